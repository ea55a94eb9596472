"""The figures of AMAE over the size of the blur, raw and calibrated: of stages, and of recorded measurements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from pipeline.blur.evaluation import SHARP
from pipeline.report import amae_figure, blur_tables
from pipeline.report.sections.base import Block, ShownFigure

if TYPE_CHECKING:
    import pandas as pd

NOTES = ((True, "fitted", blur_tables.FITTED), (False, "typical", blur_tables.TYPICAL))
"""What a caption adds: of calibrated answers or not, where an estimator is among them."""


def figures(
    summary: pd.DataFrame,
    datasets: Sequence[str],
    paper: pd.DataFrame | None,
    stages: Callable[[pd.DataFrame], tuple[str, ...]],
    prefix: str = "",
) -> list[Block]:
    """A figure for raw answers and one for calibrated ones, where there are any.

    Args:
        summary: `pipeline.blur.evaluation.SUMMARY`.
        datasets: in their order.
        paper: the paper's Table I.
        stages: (rows shown) -> stages that made them.
        prefix: before names and captions, e.g. ``"recorded"``.
    """
    blocks: list[Block] = []
    blurred = summary[summary["kind"] != SHARP]
    for is_calibrated in (False, True):
        own = blurred[blurred["calibrated"] == is_calibrated]
        if own.empty:
            continue
        how = ", each answer divided by the camera's own for sharp frames" if is_calibrated else ""
        said = [
            f"AMAE over the size of the blur{how}. Line: of the median over patches; band: bootstrap 95 % interval. "
            f"Dashed: the paper's Table I{', which is not calibrated' if is_calibrated else ''}.",
            *(note for way, name, note in NOTES if way == is_calibrated and (own["estimator"] == name).any()),
        ]
        caption = f"{prefix.capitalize()}: {' '.join(said)}" if prefix else " ".join(said)
        name = "_".join(part for part in (prefix, "blur_amae", "calibrated" if is_calibrated else "") if part)
        blocks.append(ShownFigure(name, amae_figure.draw(own, list(datasets), paper), caption, stages(own)))
    return blocks
