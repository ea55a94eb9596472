"""The condition of a sweep's frames as estimators see it: noise and MTF on patches that overlap objects.

The paper's curves are drawn over what a camera could measure of itself, not over what was put in: the median noise and
the median MTF (mean of horizontal and vertical, at the second of its frequencies) of the patches over objects.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera import mtf
from pipeline.camera.truth import local_sigma
from pipeline.datasets.conditions import conditions
from pipeline.datasets.frame import Box, Frame
from pipeline.datasets.patches import Patch, cut, object_patches, tiles
from pipeline.detection.classes import ClassMap
from pipeline.detection.sweep import CONDITION
from pipeline.statistics import bootstrap_interval
from pipeline.store import Schema
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.camera.psf.kernel import Kernel
    from pipeline.datasets.corrupted import CameraSettings

MEASURED = Schema(
    "conditions measured on objects",
    {
        "frame": "string",
        **CONDITION,
        "quantity": "string",  # "sigma_dn" or "mtf"
        "estimator": "string",
        "patch": "int64",
        "x_px": "int64",
        "y_px": "int64",
        "true": "float64",  # noise really in the tile; MTF of the kernel
        "estimate": "float64",  # NaN where abstained
        "abstained": "bool",
        "reason": "string",
    },
    {"size_px": "px", "angle_deg": "deg", "level_dn": "DN"},
)

CONDITIONS = Schema(
    "condition medians",
    {
        **CONDITION,
        "sigma_dn": "float64",  # median of the tiles' estimates; NaN where every one abstained
        "sigma_low_dn": "float64",
        "sigma_high_dn": "float64",
        "true_sigma_dn": "float64",
        "tiles": "int64",
        "tiles_abstained": "int64",
        "mtf": "float64",
        "mtf_low": "float64",
        "mtf_high": "float64",
        "true_mtf": "float64",
        "patches": "int64",
        "patches_abstained": "int64",
    },
    {"size_px": "px", "angle_deg": "deg", "level_dn": "DN", "sigma_dn": "DN"},
)
AT = 1
"""Which of the paper's eight frequencies an MTF is taken at."""


@dataclass(frozen=True)
class Measurement:
    """How a sweep's frames are measured.

    Attributes:
        mtf, sigma: registry names of the estimators.
        patch_px, tile_px: sides of what they are shown.
        per_frame: patches, and tiles, of one frame at most; None takes all.
        lowest_px, least_visible: of the objects that count.
    """

    mtf: str
    sigma: str
    patch_px: int
    tile_px: int
    per_frame: int | None
    lowest_px: float
    least_visible: float

    def places(self, frame: Frame, shape: Sequence[int], words: ClassMap) -> tuple[list[Patch], list[Patch]]:
        """Patches for the MTF and tiles for noise that overlap objects to be found; none where there are none."""
        truth = words.truth(frame.boxes, self.lowest_px, self.least_visible)
        boxes = [Box("object", x1, y1, x2, y2) for x1, y1, x2, y2 in truth.boxes[~truth.ignore].tolist()]
        patches = object_patches(shape, boxes, self.patch_px)
        over = [tile for tile in tiles(shape, self.tile_px, "cover") if any(_meet(tile, box) for box in boxes)]
        return _spread(patches, self.per_frame), _spread(over, self.per_frame)

    def look(
        self,
        work: tuple[Frame, Kernel],
        *,
        words: ClassMap,
        effect: str,
        levels_dn: Sequence[float],
        camera: CameraSettings,
        seed: int,
    ) -> list[dict[str, Any]]:
        """One frame behind one kernel at every level: rows of `MEASURED`."""
        frame, kernel = work
        sharp = frame.image()
        patches, over = self.places(frame, sharp.shape, words)
        if not patches and not over:
            return []
        blur, noise = _opened(self.mtf, self.sigma)
        true_mtf = float(mtf.sample(kernel.psf)[:, AT].mean())
        what: dict[str, Any] = {"frame": frame.name, "kernel": kernel.name, "kind": kernel.kind, "effect": effect}
        what |= {"size_px": float(kernel.size_px), "angle_deg": float(kernel.angle_deg)}
        rows = []
        for level, shown in conditions(sharp, frame, kernel, effect, levels_dn, camera, seed):
            found = []
            if patches:
                answer = blur.estimate(cut(shown.image, patches))
                truths = np.full(len(patches), true_mtf)
                found.append(("mtf", self.mtf, patches, truths, answer.mtf[:, :, AT].mean(axis=1), answer))
            if over:
                answer = noise.estimate(cut(shown.image, over))
                found.append(("sigma_dn", self.sigma, over, local_sigma(shown, over), answer.sigma_dn, answer))
            for quantity, estimator, places, truths, values, answer in found:
                for number, place in enumerate(places):
                    row = {**what, "level_dn": level, "quantity": quantity, "estimator": estimator, "patch": number}
                    row |= {"x_px": place.x_px, "y_px": place.y_px}
                    row |= {"true": float(truths[number]), "estimate": float(values[number])}
                    reason = str(answer.reason[number])
                    rows.append({**row, "abstained": bool(answer.abstained[number]), "reason": reason})
        return rows


@functools.lru_cache(maxsize=1)
def _opened(blur_name: str, noise_name: str) -> tuple[Any, Any]:
    from pipeline import blur, noise

    return blur.create(blur_name), noise.create(noise_name)


def summarise(measured: pd.DataFrame, seed: int, draws: int) -> pd.DataFrame:
    """The medians of every condition, with bootstrap 95 % intervals: schema `CONDITIONS`."""
    import pandas as pd

    rows = []
    groups: Any = measured.groupby(list(CONDITION), sort=False)
    for key, group in groups:
        row: dict[str, Any] = dict(zip(CONDITION, key, strict=True))
        for quantity, short, unit, count in (("sigma_dn", "sigma", "_dn", "tiles"), ("mtf", "mtf", "", "patches")):
            own = group[group["quantity"] == quantity]
            values = own["estimate"].to_numpy(float)
            known = values[np.isfinite(values)]
            median = float(np.median(known)) if len(known) else float("nan")
            generator = stream(seed, "condition medians", quantity, *key)
            low, high = bootstrap_interval(known, generator, draws=draws)
            row |= {f"{short}{unit}": median, f"{short}_low{unit}": low, f"{short}_high{unit}": high}
            row[f"true_{short}{unit}"] = float(own["true"].median())
            row |= {count: len(own), f"{count}_abstained": int(own["abstained"].sum())}
        rows.append(row)
    return CONDITIONS.conform(pd.DataFrame(rows, columns=list(CONDITIONS.columns)))


def _meet(tile: Patch, box: Box) -> bool:
    inside_x = box.x1 < tile.x_px + tile.size_px and box.x2 > tile.x_px
    return inside_x and box.y1 < tile.y_px + tile.size_px and box.y2 > tile.y_px


def _spread(places: list[Patch], most: int | None) -> list[Patch]:
    if most is None or len(places) <= most:
        return places
    return [places[number * len(places) // most] for number in range(most)]
