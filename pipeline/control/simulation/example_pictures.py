"""Pictures of the worked examples: one object, cut from its view at every setting, with the detector's box on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.quantise import to_8bit
from pipeline.control.simulation.views import View
from pipeline.datasets.frame import Box
from pipeline.detection.base import Detections
from pipeline.detection.matching import overlaps
from pipeline.errors import InputError

WIDTH_PX, HEIGHT_PX = 288, 216
LEAST_VISIBLE_FRACTION = 0.6
_IOU = 0.5


@dataclass(frozen=True)
class Window:
    """The part of one view that is shown.

    Attributes:
        view: name of the view.
        left_px, top_px: corner of the window in the view.
        box: of the object, in the view.
    """

    view: str
    left_px: int
    top_px: int
    box: Box


def window(views: Sequence[View], label: str, size_px: tuple[int, int] = (768, 896)) -> Window:
    """The window around the largest object that fits into it and is mostly visible.

    Args:
        views: candidates.
        label: of the object.
        size_px: height and width of the views.

    Raises:
        InputError: no view shows such an object.
    """
    candidates = [(view, box) for view in views for box in view.boxes if box.label == label and not box.ignore]
    if not candidates:
        raise InputError(f"worked examples: no view shows an object '{label}'; use more viewpoints")

    def order(candidate: tuple[View, Box]) -> tuple[bool, bool, float]:
        box = candidate[1]
        fits = box.width_px <= 0.8 * WIDTH_PX and box.height_px <= 0.8 * HEIGHT_PX
        return fits, not box.visible_fraction < LEAST_VISIBLE_FRACTION, box.height_px * box.width_px

    view, box = max(candidates, key=order)
    left, top = (
        round(min(max((low + high - extent) / 2, 0), limit - extent))
        for low, high, extent, limit in (
            (box.x1, box.x2, WIDTH_PX, size_px[1]),
            (box.y1, box.y2, HEIGHT_PX, size_px[0]),
        )
    )
    return Window(view.name, left, top, box)


def cut(image: NDArray[np.float32], detected: Detections, at: Window) -> dict[str, Any]:
    """The picture in a window, and the best detection of its object.

    Args:
        image: (H, W) in [0, 1].
        detected: in the whole image.
        at: the window.

    Returns:
        ``picture`` (h, w) uint8; ``score`` of the best detection of the object, 0 where it is missed; ``box`` (4,) of
        that detection in the picture, NaN where missed.
    """
    part = image[at.top_px : at.top_px + HEIGHT_PX, at.left_px : at.left_px + WIDTH_PX]
    picture = to_8bit(part)
    mine = detected.where(detected.label == at.box.label)
    truth = np.array([[at.box.x1, at.box.y1, at.box.x2, at.box.y2]])
    hits = overlaps(mine.boxes, truth, 0.0)[0][:, 0] >= _IOU if len(mine) else np.zeros(0, dtype=bool)
    if not hits.any():
        return {"picture": picture, "score": 0.0, "box": np.full(4, np.nan)}
    best = int(np.argmax(np.where(hits, mine.score, -1.0)))
    corner = np.array([at.left_px, at.top_px] * 2, dtype=np.float64)
    return {"picture": picture, "score": float(mine.score[best]), "box": mine.boxes[best].astype(np.float64) - corner}


def gallery(
    cuts: Mapping[tuple[str, str], Mapping[str, Any]], at: Window
) -> tuple[dict[str, NDArray[np.uint8]], dict[str, Any]]:
    """Pictures and their description as the stage writes them.

    Args:
        cuts: (example, step) -> what `cut` gave.
        at: the window.

    Returns:
        array name -> (h, w) uint8; and ``{"view", "label", "box", "steps": [{"array", "example", "step", "score",
        "box"}]}``, boxes in the picture's pixels, None where the object is missed.
    """
    left, top = at.left_px, at.top_px
    steps = [
        {
            "array": f"{example}_{step}",
            "example": example,
            "step": step,
            "score": round(float(part["score"]), 4),
            "box": [round(float(edge), 1) for edge in part["box"]] if np.isfinite(part["box"]).all() else None,
        }
        for (example, step), part in cuts.items()
    ]
    box = [at.box.x1 - left, at.box.y1 - top, at.box.x2 - left, at.box.y2 - top]
    arrays = {f"{example}_{step}": part["picture"] for (example, step), part in cuts.items()}
    description = {"view": at.view, "label": at.box.label, "box": [round(float(edge), 1) for edge in box]}
    return arrays, {**description, "steps": steps}
