"""What the words of a dataset mean to detectors: of this package's layouts, and of those of third parties."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.datasets import REGISTRY
from pipeline.detection.classes import CLASS_MAPS, ClassMap
from pipeline.errors import InputError, did_you_mean


def class_map(kind: str) -> ClassMap:
    """What the words of a dataset mean to detectors.

    Args:
        kind: the dataset's layout; one of a third party brings ``detector_classes`` (`pipeline.datasets.dataset`).

    Raises:
        InputError: there is no map for it.
    """
    words: Mapping[str, ClassMap] = {**CLASS_MAPS, "folder": CLASS_MAPS["sim"]}
    if kind in words:
        return words[kind]
    registered = REGISTRY.get(kind) if kind in REGISTRY.names() else None
    classes = dict(getattr(registered, "detector_classes", {}))
    if not classes:
        hint = did_you_mean(kind, words)
        raise InputError(
            f"no class map defines what the labels of datasets of kind '{kind}' mean to a detector; {hint} (they are in"
            " pipeline/detection/classes.py); a class of your own defines it by its attribute detector_classes"
        )
    return ClassMap(classes, dict(getattr(registered, "detector_neighbours", {})))
