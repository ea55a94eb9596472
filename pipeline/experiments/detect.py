"""A detector under every condition of a sweep: what it finds in one frame behind one kernel, at every level of noise.

That is the unit of work, of parallelism and of what an interrupted run keeps (`pipeline.detection.checkpoint`).
Everything is tidy: one row per detection, one row per frame and condition looked at (frames without a detection are no
gap), one row per object to be found.

All detections of the classes are kept: how many of a frame count is for the rule that judges them
(`pipeline.detection.average_precision`).
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.detection import REGISTRY, opened
from pipeline.detection.inference import detections_in
from pipeline.errors import InputError
from pipeline.experiments.condition import Condition
from pipeline.experiments.corrupt import SharpFrame
from pipeline.experiments.tables import CONDITION
from pipeline.store import Schema

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.camera.psf.kernel import Kernel
    from pipeline.camera.settings import CameraSettings
    from pipeline.datasets.frame import Frame
    from pipeline.detection.classes import ClassMap
    from pipeline.detection.settings import DetectorSettings

_CORNERS = {"x1": "float64", "y1": "float64", "x2": "float64", "y2": "float64"}
DETECTIONS = Schema(
    "detections",
    {
        "frame": "string",
        "kernel": "string",
        "target_sigma_dn": "float64",
        "label": "string",
        "score": "float64",
        **_CORNERS,
    },
    {"target_sigma_dn": "DN", "x1": "px", "y1": "px", "x2": "px", "y2": "px"},
)

LOOKED = Schema(
    "frames looked at",
    {"frame": "string", "scene": "string", **CONDITION, "detections": "int64"},
    {"kernel_size_px": "px", "angle_deg": "deg", "target_sigma_dn": "DN"},
)

OBJECTS = Schema(
    "objects",
    {
        "frame": "string",
        "label": "string",
        **_CORNERS,
        "ignore": "bool",  # by the dataset, or as a neighbour of the class
        "visible_fraction": "float64",  # NaN where the dataset does not say
    },
    {"x1": "px", "y1": "px", "x2": "px", "y2": "px"},
)


@dataclass(frozen=True)
class Sweep:
    """What one sweep has in common over its frames and kernels.

    Attributes:
        kind: the detector's registry name.
        options: its options, weights among them, as JSON.
        classes: labels that are kept.
        noise_source: noise source.
        target_sigmas_dn: of the noise.
        camera: that adds it.
        seed: root seed.
    """

    kind: str
    options: str
    classes: tuple[str, ...]
    noise_source: str
    target_sigmas_dn: tuple[float, ...]
    camera: CameraSettings
    seed: int

    def detect(self, frame: Frame, kernel: Kernel) -> dict[str, NDArray[Any]]:
        """Detections in one frame behind one kernel.

        Returns:
            ``level`` (M,) number of the level, ``boxes`` (M, 4), ``score`` (M,), ``label`` (M,); best first within a
            level. ``other`` (K,): the labels of detections that are left out, sorted.
        """
        detector = opened(self.kind, self.options)
        parts: list[tuple[NDArray[Any], ...]] = []
        other: set[str] = set()
        sharp = SharpFrame(frame, self.camera, self.seed)
        for number, level in enumerate(self.target_sigmas_dn):
            image = sharp.under(Condition(kernel, self.noise_source, float(level))).image
            result = detections_in(detector, image, self.kind)
            wanted = np.isin(result.label, self.classes)
            other.update(map(str, result.label[~wanted]))
            result = result.where(wanted).best()
            parts.append((np.full(len(result), number), result.boxes, result.score, result.label))
        numbers, boxes, score, label = (np.concatenate(column) for column in zip(*parts, strict=True))
        return {
            "level": numbers,
            "boxes": boxes.reshape(-1, 4),
            "score": score,
            "label": label.astype(np.str_),
            "other": np.array(sorted(other), dtype=np.str_),
        }


def words_of(pieces: Sequence[Mapping[str, NDArray[Any]]]) -> set[str]:
    """The labels of all detections, of the classes or not, in what `Sweep.detect` gave."""
    return {str(word) for piece in pieces for key in ("label", "other") for word in np.unique(piece[key])}


def options_of(section: DetectorSettings) -> str:
    """A detector's options with its weights, if any, as JSON, from its section of the configuration."""
    return json.dumps(section.arguments(), sort_keys=True)


def identifying_file(name: str, section: DetectorSettings) -> Path:
    """The file whose hash tells a detector from others: its weights; of one without weights, its class's source.

    Args:
        name: of the detector in the configuration.
        section: of it.

    Raises:
        InputError: the file is not there.
    """
    if section.weights is None:
        try:
            return Path(inspect.getfile(REGISTRY.get(section.kind)))
        except TypeError:
            raise InputError(f"detection.detectors.{name}: '{section.kind}' is no Python class with a file") from None
    path = Path(section.weights)
    if not path.is_file():
        getting = f"'{section.fetch_command}' gets it, or " if section.fetch_command else ""
        raise InputError(f"detection.detectors.{name}.weights: no file {path}; {getting}name another file")
    return path


def objects(frames: Sequence[Frame], words: ClassMap) -> pd.DataFrame:
    """What is to be found: schema `OBJECTS`; a frame without objects has no row."""
    import pandas as pd

    rows = []
    for frame in frames:
        for box in frame.boxes:
            truth = words.truth([box])  # one box may stand for several classes, or for none
            for corners, label, ignore in zip(truth.boxes, truth.label, truth.ignore, strict=True):
                row = dict(zip(_CORNERS, corners.tolist(), strict=True))
                named = {"frame": frame.name, "label": str(label), "ignore": bool(ignore)}
                rows.append({**named, **row, "visible_fraction": float(box.visible_fraction)})
    return OBJECTS.conform(pd.DataFrame(rows, columns=list(OBJECTS.columns)))


def tables(
    work: Sequence[tuple[Frame, Kernel]],
    found: Sequence[Mapping[str, NDArray[Any]]],
    sweep: Sweep,
    scenes: Mapping[str, str],
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """One table of detections and one of what was looked at.

    Args:
        work: frame and kernel of each piece.
        found: what `Sweep.detect` gave, in the same order.
        sweep: that looked.
        scenes: frame -> its scene.

    Returns:
        schemas `DETECTIONS` and `LOOKED`.
    """
    import pandas as pd

    parts, looked = [], []
    for (frame, kernel), piece in zip(work, found, strict=True):
        levels = np.asarray(sweep.target_sigmas_dn, dtype=float)
        columns = {
            "target_sigma_dn": levels[piece["level"].astype(int)],
            "label": piece["label"],
            "score": piece["score"],
        }
        columns |= dict(zip(_CORNERS, piece["boxes"].T, strict=True))
        parts.append(pd.DataFrame({"frame": frame.name, "kernel": kernel.name, **columns}))
        counts = np.bincount(piece["level"].astype(int), minlength=len(levels))
        for level, count in zip(levels, counts, strict=True):
            where = {"frame": frame.name, "scene": scenes[frame.name], "kernel": kernel.name, "blur_kind": kernel.kind}
            position = {
                "kernel_size_px": float(kernel.size_px),
                "angle_deg": float(kernel.angle_deg),
                "noise_source": sweep.noise_source,
            }
            looked.append({**where, **position, "target_sigma_dn": float(level), "detections": int(count)})
    return DETECTIONS.conform(pd.concat(parts, ignore_index=True)), LOOKED.conform(pd.DataFrame(looked))
