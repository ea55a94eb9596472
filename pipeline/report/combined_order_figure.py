"""The order of the physics: one patch after each step of image formation, for noise before and after the optics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.report import style
from pipeline.report.style import Drawing
from pipeline.report.wording import listing, word

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STEPS = {
    "scene": "light",
    "photon": "photon noise",
    "optics": "optics (blur)",
    "dark": "dark current",
    "readout": "readout noise",
    "frame": "8-bit frame",
}
ROW_GAP_IN, LEFT_IN = 0.16, 0.5


def _passes(axes: Axes) -> None:
    """A step that does nothing: the light goes through."""
    axes.axis("off")
    axes.annotate(
        "", xy=(1.0, 0.5), xytext=(0.0, 0.5), xycoords="axes fraction",
        arrowprops={"arrowstyle": "-|>", "color": style.MUTED, "linewidth": 0.8},
    )  # fmt: skip


@style.styled
def draw(arrays: Mapping[str, np.ndarray], said: Mapping[str, Any]) -> Drawing:
    """One row for each order that occurs among the experiments.

    Args:
        arrays: ``step_<experiment>_<step>``.
        said: ``example.json`` of the stage `combined`.
    """
    rows: dict[tuple[str, ...], Mapping[str, Any]] = {}
    for entry in said["experiments"]:
        rows.setdefault(tuple(entry["steps"]), entry)
    columns = [step for step in STEPS if any(step in steps for steps in rows)]
    cell_in = style.sheet_cell_in(len(columns), margins_in=LEFT_IN + 0.02, gap_in=0.12)
    figure, axes = style.sheet(
        len(columns), [cell_in] * len(rows), left_in=LEFT_IN, top_in=0.22, gap_in=0.12,
        row_gaps_in=[ROW_GAP_IN] * (len(rows) - 1),
    )  # fmt: skip
    for down, (steps, entry) in enumerate(rows.items()):
        for across, step in enumerate(columns):
            panel = axes[down, across]
            if step in steps:
                panel.imshow(arrays[f"step_{entry['experiment']}_{step}"], cmap="gray", vmin=0, vmax=255)
                style.bare(panel)
            else:
                _passes(panel)
            if down == 0:
                panel.set_title(STEPS[step], fontsize=6.4, pad=3)
            if across == 0:
                panel.set_ylabel(word(entry["experiment"]).replace(", ", ",\n"), fontsize=6.0)
    orders = [
        f"{word(entry['experiment'])}: {', '.join(STEPS[step] for step in steps)}" for steps, entry in rows.items()
    ]
    highest = max(said["experiments"][0]["levels_dn"])
    return Drawing(
        figure,
        f"A patch of {word(said['dataset'])} after each step of image formation, blur {said['size_px']:g} px, noise "
        f"{highest:g} DN. {listing(orders)}.",
    )
