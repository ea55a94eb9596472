"""The example's curves: the MTF of one kernel of each experiment as read at every noise level."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline.camera import mtf
from pipeline.condition.combined_answers import CELL, answers
from pipeline.condition.combined_tables import CURVES
from pipeline.statistics import robust
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd


def example_angle(read: pd.DataFrame, kind: str, size_px: float, wanted_deg: float = 45.0) -> float:
    """The rotation, of those evaluated, that is nearest to the one wanted (the smaller of two)."""
    held = read[(read["kind"] == kind) & (read["size_px"] == size_px)]["angle_deg"].unique()
    return float(min(held, key=lambda angle: (abs(angle - wanted_deg), angle)))


def example_curves(read: pd.DataFrame, size_px: float) -> pd.DataFrame:
    """Curves of one kernel of each experiment, over levels: robust statistics over patches.

    Args:
        read: `BLUR_READ`.
        size_px: of the kernel; of motion, the rotation nearest to 45 degrees.

    Returns:
        `CURVES`; axis ``"HV"`` is the mean of both directions, which the paper draws.
    """
    import pandas as pd

    keys = [*CELL, "angle_deg"]
    rows = []
    for is_calibrated, table in answers(read):
        of_size = table[table["size_px"] == size_px]
        for cell, group in of_size.groupby(keys, sort=True):
            where = dict(zip(keys, cell, strict=True))
            if where["angle_deg"] != example_angle(of_size, str(where["kind"]), size_px):
                continue
            ordered = group.sort_values(["frame", "patch", "axis", "frequency"])
            shape = (-1, 2, len(mtf.FREQUENCIES))
            given, truth = (ordered[name].to_numpy(float).reshape(shape) for name in ("mtf", "true_mtf"))
            del where["effect"]
            for axis, curves, true in (
                ("H", given[:, 0], truth[0, 0]),
                ("V", given[:, 1], truth[0, 1]),
                ("HV", given.mean(axis=1), truth[0].mean(axis=0)),
            ):
                for place, values in enumerate(curves.T):
                    found = robust(values, stream(0, "bootstrap", "no interval"), 1)
                    rows.append(
                        {
                            **where,
                            "calibrated": is_calibrated,
                            "axis": axis,
                            "place": place,
                            "frequency": float(mtf.FREQUENCIES[place]),
                            "true_mtf": float(true[place]),
                            "median": found.median,
                            "minimum": found.minimum,
                            "maximum": found.maximum,
                            "count": found.count,
                            "abstained": found.abstained,
                        }
                    )
    return CURVES.conform(pd.DataFrame(rows, columns=list(CURVES.columns)))
