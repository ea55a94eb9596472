"""Runs DVC; returns its exit status."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from pipeline.dvc import at_once, lock_file, read_once


def main(arguments: Sequence[str] | None = None) -> int:
    """Run DVC; returns its exit status."""
    from dvc.cli import main as run_dvc

    arguments = list(sys.argv[1:] if arguments is None else arguments)
    read_once.install()
    writer = lock_file.install()
    if arguments[:1] == ["repro"] or arguments[:2] in (["exp", "run"], ["experiments", "run"]):
        at_once.install(writer)
    return int(run_dvc(arguments))


if __name__ == "__main__":
    raise SystemExit(main())
