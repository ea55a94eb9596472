"""Settings of ``dvc exp run -S``, checked before DVC starts: its own message spans lines and names no key nearby.

An experiment of ``--queue`` or ``--temp`` runs in a copy of what git tracks, where relative paths below ``data/raw``
lead to nothing; they are refused here. So are estimators whose code ``dvc.yaml`` does not list.
"""

from __future__ import annotations

import argparse
import os.path
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.dvc.checked_params import check_names
from pipeline.errors import InputError

CONF, PARAMS = Path("conf"), "params.yaml"
USER_FOLDER, TRACKED = Path("data/raw"), Path("data/raw/README.md")
DERIVED = ("by_kind", "option_files", "read_files")
"""Sections of paths that other keys give."""


def settings(given: argparse.Namespace) -> list[str]:
    """Overrides of ``params.yaml`` among the parsed arguments of ``dvc exp run``, without the name of that file."""
    plain = (text.removeprefix(f"{PARAMS}:") for text in given.set_param)
    return [text for text in plain if ":" not in text.partition("=")[0]]  # of another file


def check(given: argparse.Namespace) -> None:
    """Check the settings of an experiment as ``python -m pipeline.config`` would.

    Args:
        given: arguments of ``dvc exp run``, as DVC parses them.

    Raises:
        InputError: a key, option, name or folder that does not exist, a value out of range, a path that leads to
            nothing where the experiment will run, or an estimator whose code ``dvc.yaml`` does not list.
    """
    from pipeline.config.overrides import check_overrides, parsed
    from pipeline.config.references import check_references

    overrides = settings(given)
    in_copy = given.queue or given.tmp_dir

    def further(config: Any) -> None:
        check_references(config)
        swept = any(override.is_sweep_override() for override in parsed(overrides))
        words = ["KEY=VALUE"] if swept else overrides
        more = " for each value, and queue it by itself" if swept else ""
        check_names(config.model_dump(), shlex.join(["python", "-m", "pipeline.config", *words]), more)
        if in_copy:
            _check_copy(config, given.copy_paths)

    if CONF.is_dir() and not given.run_all:  # those were checked when they were queued
        check_overrides(overrides, CONF, further)


def _check_copy(config: Any, copied: Sequence[str]) -> None:
    """Refuse relative paths to files that git ignores, but for those that DVC is asked to copy."""
    content = {name: value for name, value in config.model_dump().items() if name not in DERIVED}
    lines = [
        f"{key}={path}: an experiment of --queue or --temp runs in a copy without it, since git ignores {USER_FOLDER}; "
        "give the absolute path"
        for key, path in _paths(content)
        if not any(_normal(path).is_relative_to(_normal(each)) for each in copied)
    ]
    if lines:
        raise InputError("\n".join(lines))


def _paths(content: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    """Keys of a configuration whose values are relative paths below the users' folder."""
    for name, value in content.items():
        key = f"{above}{name}"
        if isinstance(value, Mapping):
            yield from _paths(value, f"{key}.")
        elif isinstance(value, str) and name != "dvc_dependency" and _is_ignored(_normal(value)):
            yield key, value


def _is_ignored(path: Path) -> bool:
    return path.is_relative_to(USER_FOLDER) and path != TRACKED


def _normal(path: str) -> Path:
    return Path(os.path.normpath(path))
