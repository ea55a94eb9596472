"""A stage's command line, checked before Hydra sees it: its own messages span many lines."""

from __future__ import annotations

import itertools
import math
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from pipeline.config.schema import Config

MOST_COMBINATIONS = 64  # of a sweep, that are checked one by one
LAUNCHER_EXTRAS = {"joblib": "sweep", "submitit_local": "cluster", "submitit_slurm": "cluster"}
"""Hydra's launchers -> the extra of this package that installs them."""

FLAGS = (
    "--help", "-h", "--hydra-help", "--version", "--resolve", "--run", "-r", "--multirun", "-m", "--shell-completion",
    "-sc",
)  # fmt: skip
WITH_VALUE = ("--cfg", "-c", "--package", "-p", "--info", "-i", "--experimental-rerun")
OTHER_CONF = ("--config-path", "-cp", "--config-name", "-cn", "--config-dir", "-cd")
"""Options of Hydra; the last replace ``conf/``, which every stage is configured by."""


def split(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Options of Hydra with their values, and overrides, of a command line that may mix them.

    Args:
        arguments: of the command line.

    Returns:
        options; overrides, not yet read.

    Raises:
        InputError: an option that Hydra does not have, or that replaces ``conf/``.
    """
    options: list[str] = []
    overrides: list[str] = []
    waiting = list(arguments)
    while waiting:
        word = waiting.pop(0)
        name, equals, _ = word.partition("=")
        if not word.startswith("-"):
            overrides.append(word)
            continue
        if name in OTHER_CONF:
            raise InputError(f"{name}: a stage is configured by conf/config.yaml; give other values as KEY=VALUE")
        if name not in FLAGS + WITH_VALUE:
            raise InputError(f"{word}: no option of a stage; {did_you_mean(name, FLAGS + WITH_VALUE)}")
        options.append(word)
        if name in WITH_VALUE and not equals and waiting and "=" not in waiting[0]:
            options.append(waiting.pop(0))
    return options, overrides


def parsed(words: Sequence[str]) -> list[Any]:
    """Overrides as Hydra's parser gives them.

    Args:
        words: ``KEY=VALUE`` and Hydra's other forms.

    Raises:
        InputError: a word that is none.
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    parser = OverridesParser.create()
    result = []
    for word in words:
        try:
            result += parser.parse_overrides([word])
        except HydraException:
            key, equals, value = word.partition("=")
            quoted = f"; quote a value with letters beyond a to z or signs: '{key}=\"{value}\"'" if equals else ""
            raise InputError(f"{word}: not an override KEY=VALUE{quoted}") from None
    return result


def is_multirun(arguments: Sequence[str]) -> bool:
    """Whether Hydra is to run a sweep: ``--multirun`` or ``hydra.mode=MULTIRUN``.

    Args:
        arguments: of the command line.
    """
    options, words = split(arguments)
    modes = [str(override.value()) for override in parsed(words) if override.key_or_group == "hydra.mode"]
    return bool({"--multirun", "-m"} & set(options)) or any(mode != "RUN" for mode in modes)


def check_sweep(arguments: Sequence[str]) -> None:
    """Refuse several values of a key where one job is to run.

    Args:
        arguments: of the command line.

    Raises:
        InputError: an override sweeps, but ``--multirun`` is not given.
    """
    if is_multirun(arguments):
        return
    for override in parsed(split(arguments)[1]):
        if override.is_sweep_override():
            raise InputError(
                f"{override.input_line}: several values need --multirun; a list that is one value goes in brackets"
            )


def check_overrides(
    arguments: Sequence[str],
    conf: Path,
    further: Callable[[Config], None] = lambda config: None,
    check_job: Callable[[Config, Mapping[str, str]], None] = lambda config, job: None,
) -> None:
    """Compose every combination of a stage's overrides once; of more than 64 the first ones, and each value.

    Args:
        arguments: of the command line: overrides, of which some may sweep, and Hydra's options.
        conf: the folder of groups.
        further: a check of every combination beyond the schema, e.g. `pipeline.config.references.check_references`.
        check_job: a check of every job of a sweep with every combination.

    Raises:
        InputError: an override cannot be read, names a key, option or value that does not exist, or a launcher that is
            not installed; in one line.
    """
    from pipeline.config.compose import compose, parse

    choices: list[list[str]] = []
    jobs: list[dict[str, str]] = [{}]
    keys = set[str]()
    for override in parsed(split(arguments)[1]):
        word = override.input_line
        if override.key_or_group == "hydra/launcher":
            _check_launcher(override.value())
            continue
        head = override.key_or_group.partition(".")[0]
        if head == "hydra":
            continue
        key = f"{override.key_or_group}@{override.package}" if override.package else override.key_or_group
        if key in keys and not override.is_delete():
            raise InputError(f"{word}: {key} is given twice; sweep over several as KEY=VALUE,VALUE")
        keys.add(key)
        if override.is_sweep_override() and not override.is_discrete_sweep():
            raise InputError(f"{word}: a sweep is over listed values, e.g. {override.key_or_group}=1,2")
        if head == "job":
            _check_job(override)
            jobs = [{**job, **part} for job in jobs for part in _jobs_of(override)]
        else:
            choices.append(values_of(override))
    for chosen in _checked(choices):
        config = parse(compose(chosen, conf), "conf/")
        further(config)
        for job in jobs:
            check_job(config, job)


def _checked(choices: Sequence[Sequence[str]]) -> Iterator[tuple[str, ...]]:
    """Combinations of overrides that are composed before a sweep begins; see `check_overrides`."""
    yield from itertools.islice(itertools.product(*choices), MOST_COMBINATIONS)
    if math.prod(map(len, choices)) > MOST_COMBINATIONS:
        firsts = [values[0] for values in choices]
        for position, values in enumerate(choices):
            yield from ((*firsts[:position], value, *firsts[position + 1 :]) for value in values[1:])


def _jobs_of(override: Any) -> list[dict[str, str]]:
    """What each value of an override adds to the job."""
    _, _, key = override.key_or_group.partition(".")
    values = [parsed([line])[0].value() for line in values_of(override)]
    return [{key: str(value)} if key else {name: str(part) for name, part in value.items()} for value in values]


def _check_job(override: Any) -> None:
    """Refuse an override of the job that adds no key to it."""
    path, _, value = override.input_line.lstrip("+~").partition("=")
    if path == "job" and not isinstance(override.value(), dict):
        raise InputError(f"{override.input_line}: expected +job.KEY=NAME, e.g. +job.dataset={value or 'sim'}")
    if not (override.is_add() or override.is_force_add()):
        raise InputError(f"{override.input_line}: conf/ has no job; expected +{path}={value}")


def check_scheduler(arguments: Sequence[str]) -> None:
    """Check that what starts the jobs of a sweep is on this machine.

    Args:
        arguments: as of `check_overrides`.

    Raises:
        InputError: jobs are to be started by Slurm, which is not here.
    """
    if "hydra/launcher=submitit_slurm" in arguments and shutil.which("srun") is None:
        raise InputError("hydra/launcher=submitit_slurm: no Slurm here (no srun); submitit_local runs jobs without")


def _check_launcher(name: object) -> None:
    """Refuse a launcher of Hydra that is not installed, with the extra that brings it."""
    from hydra.core.config_store import ConfigStore
    from hydra.core.plugins import Plugins

    Plugins.instance()  # installed launchers declare themselves
    installed = [file.removesuffix(".yaml") for file in ConfigStore.instance().list("hydra/launcher")]
    if name in installed:
        return
    extra = LAUNCHER_EXTRAS.get(str(name))
    if extra is not None:
        raise InputError(f"hydra/launcher={name}: not installed; pip install -e '.[{extra}]'")
    raise InputError(f"hydra/launcher={name}: {did_you_mean(str(name), {*installed, *LAUNCHER_EXTRAS})}")


def values_of(override: Any) -> list[str]:
    """The overrides that a sweep over one key stands for; itself where it is none.

    Args:
        override: as Hydra's parser gives it.

    Returns:
        lines ``KEY=VALUE``; none for a range that is not a list of values.

    Raises:
        InputError: a pattern of names, which Hydra expands only where it runs.
    """
    from hydra.core.override_parser.types import ValueType

    line: str = override.input_line
    if override.value_type == ValueType.GLOB_CHOICE_SWEEP:
        raise InputError(f"{line}: list the values, e.g. {line.partition('=')[0]}=FIRST,SECOND")
    if not override.is_sweep_override() or not override.is_discrete_sweep():
        return [line] if not override.is_sweep_override() else []
    key = line.partition("=")[0]
    return [f"{key}={value}" for value in override.sweep_string_iterator()]
