"""Display names of datasets, estimators, noise sources, kinds of blur and detectors, and small helpers of prose."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

DATASETS = {
    "sim": "Sim",
    "photos": "Photos",
    "kitti": "KITTI",
    "udacity": "Udacity",
    "sim_authors": "Sim (authors’)",
}
PAPER_NAMES = {"sim_authors": "sim"}
"""Our names of the paper's datasets where they differ: ``sim`` is rendered here, ``sim_authors`` are its own frames."""

ESTIMATORS = {
    "pca": "PCA",
    "bf": "B+F",
    "cnn": "CNN",
    "cellwise": "Cell-wise",
    "wavelet": "Wavelet",
    "immerkaer": "Immerkær",
    "correlated": "Correlated",
    "adaptive": "Adaptive",
    "pca_stride_2": "PCA, every 2nd pixel",
    "pmp": "PMP",
    "gbb": "GBB",
    "pmp_exact": "PMP, exact",
    "gbb_exact": "GBB, exact",
    "spectral": "Spectral",
    "generic_lens": "Spectral, generic lens",
    "camera_calibrated": "Spectral, camera-calibrated",
    "fused": "Fused, camera-calibrated",
    "ground_truth": "Ground truth",
}
EFFECTS = {
    "photon": "Photon",
    "dcsn": "DCSN",
    "readout": "Readout",
    "combined": "Combined",
    "sensor": "Dark current + readout",
}
BLURS = {"defocus": "Defocus", "linear_motion": "Linear motion", "nonlinear_motion": "Non-linear motion"}
EXPERIMENTS = {
    "defocus_dcsn": "Defocus, then DCSN",
    "linear_dcsn": "Linear motion, then DCSN",
    "photon_linear": "Photon noise, then linear motion",
    "photon_defocus": "Photon noise, then defocus",
}
DETECTORS = {
    "compact": "Compact",
    "compact_two_stage": "Compact, two stages",
    "yolox": "YOLOX",
    "yolov4": "YOLOv4",
    "yolov7": "YOLOv7",
    "faster_rcnn": "Faster R-CNN",
}
CLASSES = {"car": "Car", "person": "Person", "bicycle": "Bicycle", "pedestrian": "Pedestrian"}
ORDERS: Mapping[str, Iterable[str]] = {
    "dataset": DATASETS,
    "estimator": ESTIMATORS,
    "noise_source": EFFECTS,
    "blur_kind": BLURS,
    "experiment": EXPERIMENTS,
    "detector": DETECTORS,
}
"""Column of a table -> the order of its values wherever they are listed."""

_QUALIFIED: ContextVar[Mapping[str, str]] = ContextVar("qualified names")
_WORDS = {**EXPERIMENTS, **DETECTORS, **CLASSES, **DATASETS, **ESTIMATORS, **EFFECTS, **BLURS}


def word(name: str) -> str:
    """The word for a name; a name not listed here is shown as it is, with spaces for underscores."""
    return _QUALIFIED.get({}).get(name) or short_word(name)


def short_word(name: str) -> str:
    """The word for a name, unqualified: for a mark in a figure whose legend has the whole name."""
    return _WORDS.get(name, name.replace("_", " "))


@contextmanager
def qualified(names: Mapping[str, str]) -> Iterator[None]:
    """Replaces the words for some names while a report is built.

    Args:
        names: name -> its word with what has to be known at every place where it stands.
    """
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
