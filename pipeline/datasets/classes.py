"""Class maps: a dataset's words to COCO's, and which objects count neither way for a class.

| dataset | counts as | neither right nor wrong |
|---|---|---|
| kitti | Car: car; Pedestrian: person | Van, Truck, Tram for car; Cyclist, Person_sitting for person; DontCare, Misc |
| udacity | car, truck; pedestrian: person; trafficlight: traffic light | biker for person and bicycle |
| sim, folder | the word itself (a pedestrian is a person) | DontCare, Misc |

A word without a place in the map counts neither way for every class, and so does a box that its reader ignores
because it belongs to no class; an ignored box of a class counts neither way for that class. Rules as KITTI's devkit
has them for its own classes (Geiger et al. 2012).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from pipeline.datasets.frame import Box
from pipeline.errors import InputError, did_you_mean


@dataclass(frozen=True)
class ClassMap:
    """How a dataset's words are read for one experiment on COCO-trained detectors.

    Attributes:
        counts: dataset word -> the COCO word it counts as.
        beside: dataset word -> COCO words for which it is neither right nor wrong; empty for all of them.
        identity: words that are not mentioned stand for themselves.
    """

    counts: Mapping[str, str]
    beside: Mapping[str, frozenset[str]] = field(default_factory=dict)
    identity: bool = False

    def word(self, label: str) -> str | None:
        """The COCO word a label counts as, or None."""
        if label in self.counts:
            return self.counts[label]
        return label if self.identity and label not in self.beside else None

    def truth(self, boxes: Iterable[Box], coco_word: str) -> tuple[Box, ...]:
        """What a detector of one class is scored against.

        Args:
            boxes: of one frame, with the dataset's words.
            coco_word: the class, e.g. ``"car"``.

        Returns:
            the boxes that matter for the class, labelled with the COCO word: objects (``ignore=False``) and regions
            where a detection counts neither way (``ignore=True``).
        """
        chosen = []
        for box in boxes:
            word = self.word(box.label)
            if word == coco_word:
                chosen.append(dataclasses.replace(box, label=coco_word))
            elif word is None and coco_word in (self.beside.get(box.label) or (coco_word,)):
                chosen.append(dataclasses.replace(box, label=coco_word, ignore=True))
        return tuple(chosen)

    def coco_words(self, boxes: Iterable[Box]) -> tuple[str, ...]:
        """The COCO words that have at least one object that counts among the boxes, sorted."""
        return tuple(sorted({word for box in boxes if not box.ignore and (word := self.word(box.label))}))


_EVERY: frozenset[str] = frozenset()

KITTI = ClassMap(
    counts={"Car": "car", "Pedestrian": "person"},
    beside={
        "Van": frozenset({"car"}),
        "Truck": frozenset({"car"}),
        "Tram": frozenset({"car"}),
        "Cyclist": frozenset({"person"}),
        "Person_sitting": frozenset({"person"}),
        "DontCare": _EVERY,
        "Misc": _EVERY,
    },
)
UDACITY = ClassMap(
    counts={"car": "car", "truck": "truck", "pedestrian": "person", "trafficlight": "traffic light"},
    beside={"biker": frozenset({"person", "bicycle"})},
)
PLAIN = ClassMap(
    counts={"pedestrian": "person"},
    beside={"DontCare": _EVERY, "dontcare": _EVERY, "Misc": _EVERY},  # words of the authors' simplified labels
    identity=True,
)

_MAPS = {"kitti": KITTI, "udacity": UDACITY, "sim": PLAIN, "folder": PLAIN, "photos": PLAIN}


def class_map(kind: str) -> ClassMap:
    """The class map of a dataset layout.

    Raises:
        InputError: there is none for this kind.
    """
    if kind not in _MAPS:
        raise InputError(f"no class map for datasets of kind '{kind}'; {did_you_mean(kind, _MAPS)}")
    return _MAPS[kind]
