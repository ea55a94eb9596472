"""``python -m pipeline.dask_worker ADDRESS``: ``dask worker`` with pinned libraries (`pipeline.processor`).

Dask loads NumPy before any module that it is told to preload, so that its processes would not be pinned; here
`pipeline` is imported before Dask, and the worker's processes inherit the pins. Every option is ``dask worker``'s.
"""

from __future__ import annotations

import sys

from pipeline.errors import InputError


def main() -> None:
    """Run a worker; ends the process.

    Raises:
        InputError: Dask is not installed.
    """
    try:
        from distributed.cli.dask_worker import main as dask_worker
    except ImportError:
        raise InputError("the package 'distributed' is not installed: pip install '.[dask]'") from None
    dask_worker(prog_name="python -m pipeline.dask_worker")


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None
