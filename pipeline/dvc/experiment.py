"""Settings of ``dvc exp run -S``, checked before DVC starts: its own message spans lines and names no key nearby."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

CONF, PARAMS = Path("conf"), "params.yaml"


def is_experiment(arguments: Sequence[str]) -> bool:
    """Whether arguments of DVC run an experiment."""
    return list(arguments[:2]) in (["exp", "run"], ["experiments", "run"])


def settings(arguments: Sequence[str]) -> list[str]:
    """Overrides of ``params.yaml`` among the arguments of ``dvc exp run``, without the name of that file."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("-S", "--set-param", action="append", default=[])
    given, _ = parser.parse_known_args(list(arguments))
    plain = (text.removeprefix(f"{PARAMS}:") for text in given.set_param)
    return [text for text in plain if ":" not in text.partition("=")[0]]  # of another file


def check(arguments: Sequence[str]) -> None:
    """Check the settings of an experiment as ``python -m pipeline.config`` would.

    Args:
        arguments: of ``dvc exp run``.

    Raises:
        InputError: a key, option, name or folder that does not exist, or a value out of range.
    """
    from pipeline.config.overrides import check_overrides
    from pipeline.config.references import check_references

    overrides = settings(arguments)
    if overrides and CONF.is_dir():
        check_overrides(overrides, CONF, check_references)
