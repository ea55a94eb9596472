"""Exact labels: what part of each object a picture shows.

The visible box bounds the samples that saw the object; the amodal box bounds all its projected corners, hidden
or outside the frame as they may be; the visible fraction compares the samples that saw it with those that would
see it if it stood alone and the frame were larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.pose import Pose
from pipeline.scenes.render import Picture
from pipeline.scenes.world import Placed, World

Array = NDArray[np.float32]

LABELS = ("car", "person", "bicycle")
_NEAREST_M = 0.3
_PROBES = 20_000


@dataclass(frozen=True)
class SimBox:
    """One labelled object of a rendered frame.

    Attributes:
        label: ``"car"``, ``"person"`` or ``"bicycle"``.
        name: which object of the scene, the same in all frames of a viewpoint (``"person-3"``).
        kind: finer kind (``"sedan"``).
        x1, y1, x2, y2: bounds of the visible part, pixels, exact to one sample (1/N pixel).
        amodal: (x1, y1, x2, y2) of the whole object, pixels; may leave the frame.
        visible_fraction: visible share of the object's area, in [0, 1]; hidden and cut-off parts both count.
        pixels: visible area.
        distance_m: along the optical axis to the nearest corner.
    """

    label: str
    name: str
    kind: str
    x1: float
    y1: float
    x2: float
    y2: float
    amodal: tuple[float, float, float, float]
    visible_fraction: float
    pixels: float
    distance_m: float

    @property
    def height_px(self) -> float:
        return self.y2 - self.y1

    def row(self) -> dict[str, object]:
        """As written to label files: numbers rounded to 1/100 pixel."""
        return {
            "label": self.label,
            "name": self.name,
            "kind": self.kind,
            "box": [round(value, 2) for value in (self.x1, self.y1, self.x2, self.y2)],
            "amodal": [round(value, 2) for value in self.amodal],
            "visible_fraction": round(self.visible_fraction, 4),
            "pixels": round(self.pixels, 2),
            "distance_m": round(self.distance_m, 2),
        }


def boxes(world: World, pose: Pose, picture: Picture, labels: Sequence[str] = LABELS) -> list[SimBox]:
    """Labels of all objects of which at least one sample is visible, in the order of the world's objects.

    Args:
        world: what was rendered.
        pose: from where.
        picture: the result.
        labels: the classes wanted.
    """
    per_pixel = picture.samples
    seen = picture.things.ravel()
    width = picture.things.shape[1]
    counts = np.bincount(seen[seen >= 0], minlength=len(world.placed))
    results: list[SimBox] = []
    for index, one in enumerate(world.placed):
        label = one.thing.label
        if label is None or label not in labels or counts[index] == 0:
            continue
        rows, columns = np.divmod(np.flatnonzero(seen == index), width)
        corners = one.corners().reshape(-1, 3)
        at, ahead = pose.project(corners)
        front = ahead > _NEAREST_M
        low, high = at[front].min(axis=0), at[front].max(axis=0)
        visible = counts[index] / per_pixel**2
        whole = _area_alone(one, pose, low, high)
        results.append(
            SimBox(
                label=label,
                name=one.name,
                kind=one.thing.kind,
                x1=float(columns.min() / per_pixel),
                y1=float(rows.min() / per_pixel),
                x2=float((columns.max() + 1) / per_pixel),
                y2=float((rows.max() + 1) / per_pixel),
                amodal=(float(low[0]), float(low[1]), float(high[0]), float(high[1])),
                visible_fraction=float(min(1.0, visible / max(whole, visible, 1e-9))),
                pixels=float(visible),
                distance_m=float(ahead[front].min()),
            )
        )
    return results


def _area_alone(one: Placed, pose: Pose, low: NDArray[np.float64], high: NDArray[np.float64]) -> float:
    """Area in pixels that the object would cover by itself, from about 20 000 rays through its amodal box.

    The box is cut one frame's size beyond the frame, since objects beside the camera project without bounds.
    """
    frame = np.array([pose.width_px, pose.height_px], np.float64)
    low, high = np.maximum(low, -frame), np.minimum(high, 2 * frame)
    size = np.maximum(high - low, 1e-6)
    step = max(np.sqrt(size[0] * size[1] / _PROBES), 1e-3)
    counts = np.maximum(1, np.ceil(size / step)).astype(int)
    cell = size / counts
    columns, rows = (low[axis] + (np.arange(counts[axis]) + 0.5) * cell[axis] for axis in (0, 1))
    alone = World([one])
    hit = alone.occluded(
        np.broadcast_to(np.asarray(pose.position_m, np.float32), (counts.prod(), 3)), pose.rays(columns, rows)
    )
    return float(hit.mean() * size[0] * size[1])
