"""What a training leaves beside its weights: its learning curve and final measures; and what it says on the way."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline import store

Row = Mapping[str, float]  # step, and measures by name


def reporter(name: str, steps: int) -> Callable[[Row], None]:
    """A function that prints each new row of a learning curve.

    Args:
        name: of what is trained.
        steps: of the whole training.
    """

    def report(row: Row) -> None:
        measures = "  ".join(f"{key} {value:.4g}" for key, value in row.items() if key != "step")
        print(f"{name} step {row['step']:.0f} of {steps}: {measures}", file=sys.stderr)

    return report


def options(name: str, steps: int, workers: int) -> dict[str, Any]:
    """Arguments that say how a training runs and reports, none of which changes its result.

    Args:
        name: of what is trained.
        steps: of the whole training.
        workers: processes; 0 takes one per core. With more than one, samples are made beside the training.

    Returns:
        ``producers``, ``executor`` and ``report``, as the training functions take them.
    """
    workers = workers or len(os.sched_getaffinity(0))
    return {
        "producers": 1 if workers > 1 else 0,
        "executor": {"workers": workers},
        "report": reporter(name, steps),
    }


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
