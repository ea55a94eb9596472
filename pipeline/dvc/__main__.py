"""Runs DVC; returns its exit status."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from pipeline.dvc import at_once, experiment, lock_file, read_once
from pipeline.errors import InputError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run DVC; returns its exit status."""
    from dvc.cli import main as run_dvc

    arguments = list(sys.argv[1:] if arguments is None else arguments)
    is_experiment = experiment.is_experiment(arguments)
    if is_experiment:
        try:
            experiment.check(arguments)
        except InputError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    read_once.install()
    writer = lock_file.install()
    if arguments[:1] == ["repro"] or is_experiment:
        at_once.install(writer)
    return int(run_dvc(arguments))


if __name__ == "__main__":
    raise SystemExit(main())
