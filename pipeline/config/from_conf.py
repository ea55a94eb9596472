"""A stage's way in for sweeps: ``conf/`` composed with Hydra overrides, written below Hydra's output folder."""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Sequence
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
    from pipeline.config.hydra_plugins import kinds  # noqa: F401  (registers the resolvers of conf/)
    from pipeline.config.overrides import check_overrides, check_scheduler
    from pipeline.config.references import check_references
    from pipeline.config.schema import validate
    from pipeline.config.unread import warnings

    def entry(composed: DictConfig) -> None:
        from hydra.core.hydra_config import HydraConfig

        outputs = Path(HydraConfig.get().runtime.output_dir)
        content: Any = OmegaConf.to_container(composed, resolve=True)
        job = {key: str(value) for key, value in (content.pop("job", None) or {}).items()}
        try:
            config = validate(content, "conf/")
            root = Path(config.root)
            stage.run(config, job, root, outputs, weights=root / "data/weights" if config.root else None)
        except InputError as error:
            print(f"error: {error}", file=sys.stderr)
            raise SystemExit(2) from None

    if not (CONF / "config.yaml").is_file():
        raise InputError(f"{CONF}/config.yaml: no such file; run from the project's top folder")
    check_overrides(arguments, CONF, check_references)
    check_scheduler(arguments)
    for sentence in warnings(stage, arguments, CONF):
        print(f"warning: {sentence}", file=sys.stderr)
    sweep = fresh_folder(Path("multirun") / stage.name)
    folders = [f"hydra.sweep.dir={sweep.as_posix()}", f"hydra.run.dir=outputs/{stage.name}"]
    sys.argv[1:] = [f"hydra.job.name={stage.name}", *folders, *arguments]  # the user's own come last and win
    hydra.main(version_base=None, config_path=str(CONF.resolve()), config_name="config")(entry)()


def fresh_folder(parent: Path) -> Path:
    """A folder that no other sweep has written to: date and time, with a number where one is there already.

    Args:
        parent: folder of a stage's sweeps.

    Returns:
        its path; it is not made.
    """
    now = time.strftime("%Y-%m-%d_%H-%M-%S")
    names = itertools.chain([now], (f"{now}_{number}" for number in itertools.count(2)))
    return next(parent / name for name in names if not (parent / name).exists())
