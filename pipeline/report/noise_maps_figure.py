"""Local noise drawn over a frame: what was added in each cell's neighbourhood, beside what an estimator finds there.

One row per noise effect. Photon noise follows the light, dark-current and readout noise do not; texture and clipped
areas must not show. All maps of a row share one scale of colours.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.errors import InputError
from pipeline.report import style
from pipeline.report.style import Drawing
from pipeline.report.wording import word

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

SHOWN_PX = 260  # longest side of a picture inside the figure
STRENGTH = 0.6  # of the colours over the frame
HIGHEST = 99.0  # percentile of the noise added that gets the last colour
EVEN = 0.1  # noise whose relative spread over the frame is less has no pattern to correlate with
MEASURES = ("added_median_dn", "found_median_dn", "mean_error_dn", "correlation")


@dataclass(frozen=True)
class NoiseMaps:
    """Maps of one frame by one estimator.

    Attributes:
        estimator: its name.
        arrays: ``<effect>_seen`` (H, W) uint8, ``<effect>_added`` and ``<effect>_found`` (h, w) DN.
        effects: in the order shown.
        level_dn: standard deviation over the frame asked for.
    """

    estimator: str
    arrays: Mapping[str, np.ndarray]
    effects: Sequence[str]
    level_dn: float

    def of(self, effect: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Frame, noise added and noise found under one effect.

        Raises:
            InputError: an array is missing.
        """
        names = [f"{effect}_{part}" for part in ("seen", "added", "found")]
        absent = [name for name in names if name not in self.arrays]
        if absent:
            raise InputError(f"noise maps by {self.estimator}: missing {', '.join(absent)}; run the stage noise again")
        seen, added, found = (self.arrays[name] for name in names)
        return seen, added, found


def _shrunk(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    import cv2

    scale = min(1.0, SHOWN_PX / max(image.shape))
    size = (max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _panel(axes: Axes, seen: NDArray[np.uint8], cells: NDArray[np.floating] | None, top: float) -> Any:
    picture = _shrunk(seen)
    axes.imshow(picture, cmap="gray", vmin=0, vmax=255)
    style.bare(axes)
    height, width = picture.shape
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    if cells is None:
        return None
    return axes.imshow(
        np.ma.masked_invalid(cells), cmap="viridis", vmin=0, vmax=top, alpha=STRENGTH,
        extent=(-0.5, width - 0.5, height - 0.5, -0.5),
    )  # fmt: skip


def _agreement(added: NDArray[np.floating], found: NDArray[np.floating]) -> dict[str, float]:
    """How the two maps of one frame agree, over cells that both know."""
    known = np.isfinite(added) & np.isfinite(found)
    one, other = added[known].astype(float), found[known].astype(float)
    numbers = {"cells": int(known.sum()), "unknown": int((~known).sum())}
    if not one.size:
        return numbers | dict.fromkeys(MEASURES, float("nan"))
    spread = one.std() * other.std() if one.std() > EVEN * np.median(one) else 0.0
    covariance = ((one - one.mean()) * (other - other.mean())).mean()
    told = (
        np.median(one), np.median(other), np.abs(one - other).mean(), covariance / spread if spread else float("nan")
    )  # fmt: skip
    return numbers | {name: float(value) for name, value in zip(MEASURES, told, strict=True)}


@style.styled
def draw(maps: Sequence[NoiseMaps]) -> Drawing:
    """Rows: effects. Columns: the frame, the noise added, the noise found by each estimator.

    Args:
        maps: of one frame, at least one; all with the same effects.

    Raises:
        InputError: an array is missing.
    """
    import pandas as pd

    effects = list(maps[0].effects)
    columns = 2 + len(maps)
    seen = maps[0].of(effects[0])[0]
    tall = style.TWO_COLUMNS_IN / (columns + 0.25) * seen.shape[0] / seen.shape[1]
    figure = style.new_figure(style.TWO_COLUMNS_IN, len(effects) * (tall + 0.14) + 0.2)
    panels = figure.subplots(len(effects), columns, squeeze=False)
    rows: list[dict[str, Any]] = []
    for down, effect in enumerate(effects):
        seen, added, _ = maps[0].of(effect)
        known = added[np.isfinite(added)]
        top = float(np.percentile(known, HIGHEST)) if known.size else 1.0
        _panel(panels[down, 0], seen, None, top)
        panels[down, 0].set_ylabel(f"{word(effect)}, {maps[0].level_dn:g} DN")
        shown = _panel(panels[down, 1], seen, added, top)
        for across, one in enumerate(maps):
            found = one.of(effect)[2]
            _panel(panels[down, 2 + across], seen, found, top)
            rows.append({"effect": effect, "estimator": one.estimator, **_agreement(added, found)})
        figure.colorbar(shown, ax=list(panels[down]), label="σ [DN]", fraction=0.03, pad=0.01)
    titles = ["Frame", "Noise added", *(f"Found by {word(one.estimator)}" for one in maps)]
    for axes, title in zip(panels[0], titles, strict=True):
        axes.set_title(title, loc="left")
    words = []
    for row in rows:
        pattern = f", correlation {row['correlation']:.2f}" if np.isfinite(row["correlation"]) else ""
        words.append(
            f"{word(row['effect'])} by {word(row['estimator'])}: mean error {row['mean_error_dn']:.2f} DN about a "
            f"median of {row['added_median_dn']:.1f} DN{pattern}"
        )
    alt = f"Local noise over one frame, added and found cell by cell. {'; '.join(words)}."
    return Drawing(figure, alt, pd.DataFrame(rows))
