"""A stage's way in under DVC: sections from ``params.yaml``, written to the paths that DVC tracks."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import processor, yaml_text
from pipeline.config import sections
from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.config.entry import Stage

PARAMS = Path("params.yaml")


def start(stage: Stage, arguments: Sequence[str]) -> None:
    """Run a stage on ``params.yaml``.

    Args:
        stage: to run.
        arguments: ``+job.KEY=VALUE`` only, since ``params.yaml`` is already resolved.

    Raises:
        InputError: another argument, or sections that are not what the schema allows.
    """
    job = {}
    for argument in arguments:
        key, equals, value = argument.partition("=")
        if not equals or not key.startswith("+job."):
            raise InputError(
                f"{argument}: with --params only +job.KEY=VALUE may be given (params.yaml is already resolved); "
                "leave --params away to override other keys"
            )
        job[key.removeprefix("+job.")] = value
    content = read(PARAMS)
    if not processor.status().startswith(processor.PINNED):
        print(f"note: {processor.status()}; last digits may differ from committed results", file=sys.stderr)
    config = sections.read(content, stage.sections(), str(PARAMS))
    root = Path(config.root)
    stage.run(config, job, root, root, released=not config.root, weights=root / "data/weights" if config.root else None)


def read(path: Path) -> dict[str, Any]:
    """What a ``params.yaml`` holds, unchecked.

    Raises:
        InputError: missing, empty, or not YAML.
    """
    import yaml

    compiled = "run 'make params' to compile it from conf/"
    if not path.is_file():
        raise InputError(f"{path}: no such file; {compiled}")
    try:
        content: Any = yaml_text.parse(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not valid YAML ({' '.join(str(error).split())}); {compiled}") from None
    if not isinstance(content, dict):
        raise InputError(f"{path}: expected a mapping of sections, got {type(content).__name__}; {compiled}")
    return content
