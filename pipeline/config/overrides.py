"""Overrides of a sweep, checked before Hydra sees them: its own messages span many lines."""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from pipeline.config.schema import Config

MOST_COMBINATIONS = 64  # of a sweep, that are checked one by one
LAUNCHER_EXTRAS = {"joblib": "sweep", "submitit_local": "cluster", "submitit_slurm": "cluster"}
"""Hydra's launchers -> the extra of this package that installs them."""


def check_overrides(
    arguments: Sequence[str], conf: Path, further: Callable[[Config], None] = lambda config: None
) -> None:
    """Compose every combination of a stage's overrides once.

    Args:
        arguments: of the command line: overrides, of which some may sweep, and Hydra's options.
        conf: the folder of groups.
        further: a check of every combination beyond the schema, e.g. `pipeline.config.references.check_references`.

    Raises:
        InputError: an override cannot be read, names a key, option or value that does not exist, or a launcher that is
            not installed; in one line.
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.core.override_parser.types import Override
    from hydra.errors import HydraException

    from pipeline.config.compose import compose, parse

    words = [word for word in arguments if not word.startswith("-")]
    parser = OverridesParser.create()
    choices: list[list[str]] = []
    jobs = set[str]()
    for word in words:
        try:
            (override,) = parser.parse_overrides([word])
        except HydraException as error:
            raise InputError(f"{word}: not an override KEY=VALUE ({str(error).splitlines()[0]})") from None
        if override.key_or_group == "hydra/launcher":
            _check_launcher(override.value())
            continue
        head = override.key_or_group.partition(".")[0]
        if head == "job" and override.key_or_group in jobs:
            raise InputError(f"{word}: {override.key_or_group} is given twice; sweep over several as KEY=VALUE,VALUE")
        if head == "job":
            jobs.add(override.key_or_group)
        if head in ("hydra", "job"):
            continue
        choices.append(values_of(override) if isinstance(override, Override) else [word])
    for chosen in itertools.islice(itertools.product(*choices), MOST_COMBINATIONS):
        further(parse(compose(chosen, conf), "conf/"))


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


def values_of(override: object) -> list[str]:
    """The overrides that a sweep over one key stands for; itself where it is none.

    Args:
        override: as Hydra's parser gives it.

    Returns:
        lines ``KEY=VALUE``; none for a range that is not a list of values.
    """
    line: str = override.input_line  # type: ignore[attr-defined]
    if not override.is_sweep_override() or not override.is_discrete_sweep():  # type: ignore[attr-defined]
        return [line] if not override.is_sweep_override() else []  # type: ignore[attr-defined]
    key = line.partition("=")[0]
    return [f"{key}={value}" for value in override.sweep_string_iterator()]  # type: ignore[attr-defined]
