"""Whether a detector calls objects by the classes' words: one that does not would have an average precision of 0 %.

Detectors of this package state all their words, as their attribute ``labels``; of those of third parties what they have
called their detections tells, and such an attribute, if there is one, what they might.
"""

from __future__ import annotations

import sys
from collections.abc import Collection

import numpy as np

from pipeline.detection import REGISTRY, opened
from pipeline.detection.classes import bare
from pipeline.errors import InputError

MOST_WORDS = 8
"""Of a detector, in a message."""


def check_words(kind: str, options: str, classes: Collection[str], seen: Collection[str], dataset: str) -> list[str]:
    """Check that classes can be among a detector's detections.

    Args:
        kind: the detector's registry name.
        options: its options, as JSON.
        classes: that are judged.
        seen: words of its detections so far; none before the first.
        dataset: that is looked at, as messages shall name it.

    Returns:
        warnings: of classes that a detector of this package does not know or, of a third party's, that no detection has
        although there are some of other words.

    Raises:
        InputError: this holds for all classes, or a detection has a class's word in another case or number, as `Car`
            beside `car`: it would be left out.
    """
    labels = getattr(opened(kind, options), "labels", None)
    stated = {str(word) for word in labels} if isinstance(labels, (list, tuple, np.ndarray)) else set()
    known = {*stated, *seen}
    unknown = sorted(set(classes) - known)
    if len(unknown) < len(set(classes)):
        _refuse_mistaken(kind, classes, seen, dataset)
    if not unknown or not (REGISTRY.is_builtin(kind) or set(seen) - set(classes)):
        return []
    words = ", ".join(f"'{word}'" for word in sorted(known)[:MOST_WORDS]) + (", ..." if len(known) > MOST_WORDS else "")
    message = (
        f"detector '{kind}' on '{dataset}': it calls no detection {_either(unknown)}; its words are {words}. "
        "Classes, the values of the dataset's detector_classes, must be words of the detector (docs/extend.md)"
    )
    if len(unknown) == len(set(classes)):
        raise InputError(message)
    return [f"{message}; the average precision of {_either(unknown)} is 0 %"]


def warn_of_words(kind: str, options: str, classes: Collection[str], seen: Collection[str], dataset: str) -> bool:
    """Check as `check_words`, and print its warnings to stderr.

    Args:
        kind: see `check_words`.
        options: see there.
        classes: see there.
        seen: see there.
        dataset: see there.

    Returns:
        whether there were any.

    Raises:
        InputError: see `check_words`.
    """
    warnings = check_words(kind, options, classes, seen, dataset)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    return bool(warnings)


def _refuse_mistaken(kind: str, classes: Collection[str], seen: Collection[str], dataset: str) -> None:
    """Refuses detections of a class that would be left out for their case or plural; words of other things are not."""
    alike = {bare(label): label for label in sorted(classes)}
    mistaken = {word: alike[bare(word)] for word in sorted(set(seen) - set(classes)) if bare(word) in alike}
    if mistaken:
        pairs = ", ".join(f"'{word}' for '{label}'" for word, label in mistaken.items())
        raise InputError(
            f"detector '{kind}' on '{dataset}': it calls detections {pairs}, which would be left out; let it call"
            " all objects of a class by one word, written exactly so (docs/extend.md)"
        )


def _either(words: Collection[str]) -> str:
    return " or ".join(f"'{word}'" for word in words)
