"""Display names (``display_names.yaml``) and small helpers of prose."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import resources
from typing import Any

from pipeline.report.yaml_files import content

NAMES: Mapping[str, Mapping[str, str]] = content(resources.files(__package__), "display_names.yaml")
"""What names are of, e.g. ``dataset``, a column of tables -> name -> display name, in the order of listing."""

DATASETS, ESTIMATORS, EFFECTS = NAMES["dataset"], NAMES["estimator"], NAMES["noise_source"]
BLURS, EXPERIMENTS, DETECTORS, POLICIES = (NAMES[key] for key in ("blur_kind", "experiment", "detector", "policy"))
PAPER_NAMES = {"sim_authors": "sim"}
"""Our names of the paper's datasets where they differ: ``sim`` is rendered here, ``sim_authors`` are its own frames."""

_QUALIFIED: ContextVar[Mapping[str, str]] = ContextVar("qualified names")
_WORDS = {name: word for names in NAMES.values() for name, word in names.items()}


def word(name: str) -> str:
    """The word for a name; a name not listed here is shown as it is, with spaces for underscores."""
    return _QUALIFIED.get({}).get(name) or short_word(name)


def short_word(name: str) -> str:
    """The word for a name, unqualified: for a mark in a figure whose legend has the whole name."""
    return _WORDS.get(name, name.replace("_", " "))


@contextmanager
def qualified(names: Mapping[str, str]) -> Iterator[None]:
    """While a report is built, replaces the words of some names by ones that state what has to be known everywhere."""
    token = _QUALIFIED.set(names)
    try:
        yield
    finally:
        _QUALIFIED.reset(token)


def in_order(names: Iterable[Any], order: Iterable[Any] = ()) -> list[Any]:
    """Names without repeats: those of ``order`` first, in its order, then the others alphabetically."""
    present = set(names)
    known = [name for name in order if name in present]
    return known + sorted(present - set(known))


def listing(words: Iterable[str]) -> str:
    """``"a"``, ``"a and b"``, ``"a, b and c"``; ``"none"`` without words."""
    items = list(words)
    if len(items) < 2:
        return items[0] if items else "none"
    return f"{', '.join(items[:-1])} and {items[-1]}"


def counted(number: int, noun: str, plural: str = "") -> str:
    """``"1 frame"``, ``"2 frames"``, with thousands set apart."""
    return f"{number:,} {noun if number == 1 else plural or noun + 's'}"
