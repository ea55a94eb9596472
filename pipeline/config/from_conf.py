"""A stage's way in for sweeps: ``conf/`` composed with Hydra overrides, written below Hydra's output folder."""

from __future__ import annotations

import itertools
import multiprocessing
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.config.entry import Stage


def start(stage: Stage, arguments: Sequence[str]) -> None:
    """Run a stage on ``conf/``.

    Args:
        stage: to run.
        arguments: Hydra's, e.g. ``["seed=1,2", "--multirun", "+job.dataset=sim"]``.

    Raises:
        InputError: no ``conf/`` here, an override that cannot be composed, or one that names what does not exist.
    """
    import hydra
    from omegaconf import DictConfig, OmegaConf

    from pipeline.config.compose import CONF
    from pipeline.config.entry import plain_errors
    from pipeline.config.hydra_plugins import kinds  # noqa: F401  (registers the resolvers of conf/)
    from pipeline.config.overrides import check_overrides, check_scheduler, check_sweep, is_multirun, parsed, split
    from pipeline.config.references import check_references
    from pipeline.config.schema import validate
    from pipeline.config.unread import warnings

    def entry(composed: DictConfig) -> None:
        from hydra.core.hydra_config import HydraConfig

        hydra_settings = HydraConfig.get()
        outputs = Path(hydra_settings.runtime.output_dir)
        content: Any = OmegaConf.to_container(composed, resolve=True)
        job = {key: str(value) for key, value in (content.pop("job", None) or {}).items()}
        with plain_errors():
            refuse_chdir(hydra_settings.job.chdir)
            config = validate(content, "conf/")
            root = Path(config.root)
            check_outputs(outputs)
            start_processes_without_joblib()
            stage.run(config, job, root, outputs, weights=root / "data/weights" if config.root else None)

    if not (CONF / "config.yaml").is_file():
        raise InputError(f"{CONF}/config.yaml: no such file; run from the project's top folder")
    check_overrides(arguments, CONF, check_references, lambda config, job: check_job(stage, config, job))
    check_sweep(arguments)
    check_scheduler(arguments)
    options, words = split(arguments)
    overrides = parsed(words)
    for override in overrides:
        if override.key_or_group == "hydra.job.chdir" and not override.is_sweep_override():
            refuse_chdir(override.value())
        if override.key_or_group == "hydra.run.dir" and not override.is_sweep_override():
            check_outputs(Path(str(override.value())))  # before Hydra writes its records there
    if all(override.key_or_group != "hydra.run.dir" for override in overrides):
        refuse_file(Path("outputs") / stage.name)
    for sentence in warnings(stage, arguments, CONF):
        print(f"warning: {sentence}", file=sys.stderr)
    folders = [f"hydra.run.dir=outputs/{stage.name}"]
    sweep = None
    if is_multirun(arguments) and all(override.key_or_group != "hydra.sweep.dir" for override in overrides):
        sweep = fresh_folder(Path("multirun") / stage.name)
        folders.append(f"hydra.sweep.dir={sweep.as_posix()}")
    # Overrides of the user come last and win; Hydra takes them only without an option between them.
    sys.argv[1:] = [f"hydra.job.name={stage.name}", *folders, *words, *options]
    try:
        hydra.main(version_base=None, config_path=str(CONF.resolve()), config_name="config")(entry)()
    finally:
        if sweep is not None:
            with suppress(OSError):  # it holds the sweep; empty where Hydra refused to start
                sweep.rmdir()


def start_processes_without_joblib() -> None:
    """Have processes begin by a method that Python knows.

    Hydra's joblib launcher makes joblib's own the default of its jobs; the processes that a job starts, which are told
    of it, would end at once.
    """
    if multiprocessing.get_start_method(allow_none=True) not in (None, *multiprocessing.get_all_start_methods()):
        multiprocessing.set_start_method("spawn", force=True)


def check_job(stage: Stage, config: Any, job: Mapping[str, str]) -> None:
    """Check that what a job names is configured, before the first job of a sweep runs.

    Args:
        stage: that runs it.
        config: composed.
        job: its keys; where one is missing or too many, the stage says so itself.

    Raises:
        InputError: a name that is not configured.
    """
    if set(job) == set(stage.job):
        for path in stage.declared(job):
            stage._find(config, path)


def refuse_file(folder: Path) -> None:
    """Refuse a folder for results that is a file, or lies below one.

    Args:
        folder: it need not exist.

    Raises:
        InputError: a file is in its way.
    """
    for path in (folder, *folder.parents):
        if path.exists() and not path.is_dir():
            raise InputError(f"{path}: a file, where results need a folder; move it, or give another folder")


def refuse_chdir(chdir: object) -> None:
    """Refuse that Hydra changes into a stage's output folder, where it would look for its inputs.

    Args:
        chdir: value of ``hydra.job.chdir``.

    Raises:
        InputError: it is on.
    """
    if chdir:
        raise InputError(
            f"hydra.job.chdir={str(chdir).lower()}: a stage finds its inputs from the project's top folder; leave it "
            "out, hydra.run.dir=FOLDER says where results go"
        )


def check_outputs(folder: Path) -> None:
    """Refuse to write a sweep's results over those that DVC tracks.

    Args:
        folder: that Hydra was asked to write to.

    Raises:
        InputError: it is the project itself, or the folder of a profile, which links may lead to; or a file.
    """
    refuse_file(folder)
    project, runs, target = Path.cwd().resolve(), Path("runs").resolve(), folder.resolve()
    profiles = [each.resolve() for each in runs.iterdir()] if runs.is_dir() else []
    if target == project or target.parent == runs or target in profiles:
        raise InputError(
            f"hydra.run.dir={folder}: holds results of dvc repro, which a sweep must not replace; give another folder"
        )


def fresh_folder(parent: Path) -> Path:
    """Make a folder for a sweep: date and time, with a number where another sweep has that name already.

    Args:
        parent: folder of a stage's sweeps.

    Returns:
        its path; no other sweep gets it, not even one that starts at the same moment.
    """
    refuse_file(parent)
    now = time.strftime("%Y-%m-%d_%H-%M-%S")
    parent.mkdir(parents=True, exist_ok=True)
    for name in itertools.chain([now], (f"{now}_{number}" for number in itertools.count(2))):
        with suppress(FileExistsError):
            (parent / name).mkdir()
            break
    return parent / name
