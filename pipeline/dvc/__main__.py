"""Runs DVC; returns its exit status."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.dvc import at_once, lock_file, read_once


def _workers(params: Path) -> int:
    """Processes of one stage, ``executor.workers`` of a ``params.yaml``; 0 (one per core) where it is not given."""
    import yaml

    try:
        content = yaml.safe_load(params.read_text(encoding="utf-8"))
        return int(content["executor"]["workers"])
    except (OSError, ValueError, TypeError, LookupError, yaml.YAMLError):
        return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run DVC; returns its exit status."""
    from dvc.cli import main as run_dvc

    arguments = list(sys.argv[1:] if arguments is None else arguments)
    read_once.install()
    writer = lock_file.install()
    if arguments[:1] == ["repro"]:
        at_once.install(writer, _workers(Path("params.yaml")))
    return int(run_dvc(arguments))


if __name__ == "__main__":
    raise SystemExit(main())
