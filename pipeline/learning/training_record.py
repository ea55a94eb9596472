"""What a training leaves beside its weights: its learning curve and final measures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from pipeline import store

Row = Mapping[str, float]  # step, and measures by name


def curve_text(curve: Sequence[Row]) -> str:
    """A learning curve as CSV with six digits, empty where a row lacks a measure.

    The step first, then all other names sorted: a resumed run reads its rows from a file with sorted names.
    """
    import pandas as pd

    names = {name for row in curve for name in row} - {"step"}
    table = pd.DataFrame(curve, columns=["step", *sorted(names)])
    return table.to_csv(index=False, float_format="%.6g", lineterminator="\n")


def write_measures(path: str | Path, measures: Row) -> None:
    """Write measures as JSON with six digits."""
    store.write_json(path, {key: float(f"{value:.6g}") for key, value in measures.items()})


def write(outputs: Path, name: str, curve: Sequence[Row], measures: Row) -> None:
    """Write the learning curve beside the weights, and the final measures.

    Args:
        outputs: folder that the project's paths are relative to.
        name: of the weight file, e.g. ``"mtf_spectral"``.
        curve: rows.
        measures: of the released weights.
    """
    store.write_text(outputs / f"data/weights/{name}.csv", curve_text(curve))
    write_measures(outputs / f"reports/metrics/train/{name}.json", measures)
