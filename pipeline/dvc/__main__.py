"""Runs DVC; returns its exit status."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Sequence

from pipeline.dvc import at_once, experiment, lock_file, read_once
from pipeline.dvc.checked_params import check_params
from pipeline.errors import InputError
from pipeline.signals import handled


def main(arguments: Sequence[str] | None = None) -> int:
    """Run DVC; returns its exit status, 2 for settings that are refused before it starts."""
    from dvc.cli import main as run_dvc

    arguments = list(sys.argv[1:] if arguments is None else arguments)
    is_experiment, is_reproduction = experiment.is_experiment(arguments), arguments[:1] == ["repro"]
    try:
        if is_experiment:
            experiment.check(arguments)
        elif is_reproduction and not {"-h", "--help"} & set(arguments):
            check_params()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    read_once.install()
    writer = lock_file.install()
    with contextlib.ExitStack() as handlers:
        if is_reproduction or is_experiment:
            handlers.enter_context(handled([signal.SIGTERM], at_once.install(writer).end))
        return int(run_dvc(arguments))


if __name__ == "__main__":
    raise SystemExit(main())
