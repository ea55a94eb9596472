"""What the words of a dataset mean to detectors: of this package's layouts, and of those of third parties."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pipeline.datasets import REGISTRY
from pipeline.datasets.frame import Box, Frame
from pipeline.detection.classes import CLASS_MAPS, ClassMap, bare
from pipeline.errors import InputError, did_you_mean


def class_map(kind: str) -> ClassMap:
    """What the words of a dataset mean to detectors.

    Args:
        kind: the dataset's layout; one of a third party brings ``detector_classes`` (`pipeline.datasets.dataset`).

    Raises:
        InputError: there is no map for it, or a part of it means nothing.
    """
    words: Mapping[str, ClassMap] = {**CLASS_MAPS, "folder": CLASS_MAPS["sim"]}
    if kind in words:
        return words[kind]
    registered = REGISTRY.get(kind) if kind in REGISTRY.names() else None
    classes = getattr(registered, "detector_classes", {})
    if isinstance(classes, Mapping) and not classes:
        hint = did_you_mean(kind, words)
        raise InputError(
            f"no class map defines what the labels of datasets of kind '{kind}' mean to a detector; {hint} (they are in"
            " pipeline/detection/classes.py); a class of your own defines it by its attribute detector_classes"
        )
    _check_classes(kind, classes)
    neighbours = getattr(registered, "detector_neighbours", {})
    _check_neighbours(kind, neighbours, classes)
    return ClassMap(dict(classes), {word: tuple(ignored) for word, ignored in neighbours.items()})


def _check_classes(kind: str, classes: Any) -> None:
    key = f"datasets of kind '{kind}': detector_classes"
    if not isinstance(classes, Mapping):
        raise InputError(f"{key} is {classes!r}, expected a mapping as {{'auto': 'car'}}")
    for word, label in classes.items():
        if not (isinstance(word, str) and isinstance(label, str) and label):
            raise InputError(f"{key}[{word!r}] is {label!r}, expected the word of one class, as 'car'")


def _check_neighbours(kind: str, neighbours: Any, classes: Mapping[str, str]) -> None:
    """Each names classes of ``detector_classes`` and is none of its words: else it has no effect."""
    key = f"datasets of kind '{kind}': detector_neighbours"
    targets = sorted(set(classes.values()))
    if not isinstance(neighbours, Mapping):
        raise InputError(f"{key} is {neighbours!r}, expected a mapping as {{'van': ('{targets[0]}',)}}")
    for word, ignored in neighbours.items():
        if word in classes:
            raise InputError(f"{key}: '{word}' stands for '{classes[word]}' in detector_classes; leave it out of one")
        known = isinstance(ignored, (tuple, list)) and ignored and all(label in targets for label in ignored)
        if not known:
            raise InputError(
                f"{key}[{word!r}] is {ignored!r}, expected a tuple of classes of detector_classes "
                f"({', '.join(targets)}), as ('{targets[0]}',)"
            )


def role_of(word: str, boxes: Iterable[Box], words: ClassMap) -> str:
    """What the boxes of a word are to detectors, for people.

    Args:
        word: of the labels.
        boxes: those of it.
        words: what labels mean to detectors.

    Returns:
        ``"object: car"``, ``"ignored for car"`` (a neighbour), ``"ignored"`` (for every class, marked so by the
        dataset) or ``"left out"``.
    """
    if word in words.wanted:
        return f"object: {words.wanted[word]}"
    if word in words.neighbours:
        return f"ignored for {', '.join(words.neighbours[word])}"
    return "ignored" if all(box.ignore for box in boxes) else "left out"


def mistaken_words(labels: Iterable[str], kind: str) -> dict[str, str]:
    """Words of labels that differ from a known one in case or in an s at the end only, and so mean nothing.

    Args:
        labels: words of the boxes of a dataset.
        kind: the dataset's layout.

    Returns:
        the word as written -> the known one; none that the layout defines itself.

    Raises:
        InputError: as `class_map`.
    """
    words = class_map(kind)
    known = {*words.wanted, *words.neighbours}
    defined = known | set(getattr(REGISTRY.get(kind), "classes", None) or ())
    alike = {bare(word): word for word in sorted(known)}
    return {word: alike[bare(word)] for word in labels if word not in defined and bare(word) in alike}


def refuse_mistaken_words(frames: Sequence[Frame], name: str, kind: str) -> None:
    """Refuse labels whose objects would not count because of their case or plural; see `mistaken_words`.

    Args:
        frames: of the dataset.
        name: of the dataset.
        kind: its layout.

    Raises:
        InputError: there are such labels, or one that is no text; names words, their number and the first frame.
    """
    for frame in frames:
        for box in frame.boxes:  # a third party's reader may give class numbers
            if not isinstance(box.label, str):
                given = f"{box.label!r} of type {type(box.label).__name__}"
                raise InputError(f"dataset '{name}': frame '{frame.name}' has a box of label {given}, expected text")
    counts = Counter(box.label for frame in frames for box in frame.boxes)
    mistaken = mistaken_words(counts, kind)
    if mistaken:
        pairs = sorted(mistaken.items())
        listed = ", ".join(f"'{word}' for '{right}' (boxes: {counts[word]})" for word, right in pairs)
        first = next(frame.name for frame in frames if any(box.label in mistaken for box in frame.boxes))
        raise InputError(
            f"dataset '{name}': its labels say {listed}, first in frame '{first}'; detectors' classes do not"
            " know these words and their boxes would count for nothing: write them exactly so in the label files"
        )
