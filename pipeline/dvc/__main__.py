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

WRONG_ARGUMENTS = 254
"""DVC's exit status for arguments that it cannot parse."""


def check_git() -> None:
    """Refuse a project outside of git, as an archive of it is: DVC would end without saying what to do.

    Raises:
        InputError: there is no repository, and DVC is not set to do without one.
    """
    from dvc.exceptions import NotDvcRepoError
    from dvc.repo import Repo
    from dvc.scm import SCMError

    try:
        Repo()
    except NotDvcRepoError:  # DVC says so
        return
    except SCMError as error:
        remedy = "git init && git add . && git commit -m start"  # experiments begin from a commit
        raise InputError(f"{error}, in which DVC works; run '{remedy}' there") from None


def main(arguments: Sequence[str] | None = None) -> int:
    """Run DVC; returns its exit status, 2 for settings that are refused before it starts."""
    from dvc.cli import DvcParserError, parse_args
    from dvc.cli import main as run_dvc
    from dvc.commands.experiments.run import CmdExperimentsRun
    from dvc.commands.repro import CmdRepro

    arguments = list(sys.argv[1:] if arguments is None else arguments)
    try:
        given = parse_args(arguments)
    except DvcParserError:  # it has said why
        return WRONG_ARGUMENTS
    is_experiment, is_reproduction = given.func is CmdExperimentsRun, given.func is CmdRepro
    try:
        if is_experiment or is_reproduction:
            with contextlib.chdir(given.cd):
                check_git()
                if is_experiment:
                    experiment.check(given)
                else:
                    check_params()
    except (InputError, OSError) as error:
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
