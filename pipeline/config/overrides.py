"""Overrides of a sweep, checked before Hydra sees them: its own messages span many lines."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

from pipeline.errors import InputError

MOST_COMBINATIONS = 64  # of a sweep, that are checked one by one


def check_overrides(arguments: Sequence[str], conf: Path) -> None:
    """Compose every combination of a stage's overrides once.

    Args:
        arguments: of the command line: overrides, of which some may sweep, and Hydra's options.
        conf: the folder of groups.

    Raises:
        InputError: an override cannot be read, or names a key, option or value that does not exist; in one line.
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.core.override_parser.types import Override
    from hydra.errors import HydraException

    from pipeline.config.compose import compose, parse

    words = [word for word in arguments if not word.startswith("-")]
    parser = OverridesParser.create()
    choices: list[list[str]] = []
    for word in words:
        try:
            (override,) = parser.parse_overrides([word])
        except HydraException as error:
            raise InputError(f"{word}: not an override KEY=VALUE ({str(error).splitlines()[0]})") from None
        if override.key_or_group.partition(".")[0] in ("hydra", "job"):
            continue
        choices.append(_values(override) if isinstance(override, Override) else [word])
    for chosen in itertools.islice(itertools.product(*choices), MOST_COMBINATIONS):
        parse(compose(chosen, conf), "conf/")


def _values(override: object) -> list[str]:
    """The overrides that a sweep over one key stands for; itself where it is none."""
    line: str = override.input_line  # type: ignore[attr-defined]
    if not override.is_sweep_override() or not override.is_discrete_sweep():  # type: ignore[attr-defined]
        return [line] if not override.is_sweep_override() else []  # type: ignore[attr-defined]
    key = line.partition("=")[0]
    return [f"{key}={value}" for value in override.sweep_string_iterator()]  # type: ignore[attr-defined]
