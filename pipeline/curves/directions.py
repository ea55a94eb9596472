"""The blur-direction table of a sweep: average precision by angle, length and noise, with its marks.

The best less the worst of a few directions exceeds 0 even where direction has no effect. What chance alone makes of it
is told by the same resampled scenes, each direction about its own mean:

    d_a = k (a_a - mean(a_a)),    chance = 97.5 % quantile of max_a d_a - min_a d_a

with the resampled average precision a_a of direction a and k of `pipeline.cluster_intervals`. A spread that does not
exceed it has an interval that begins at 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.cluster_intervals import TAIL, small_sample_factor
from pipeline.curves.cells import precision_interval
from pipeline.curves.direction import Directions, by_direction
from pipeline.store import Schema

if TYPE_CHECKING:
    import pandas as pd

TABLE = Schema(
    "average precision by direction",
    {
        "label": "string",
        "target_sigma_dn": "float64",
        "angle_deg": "float64",
        "kernel_size_px": "float64",
        "ap_percent": "float64",
        "low_percent": "float64",
        "high_percent": "float64",
        "rises_with_size": "bool",  # better than with the next shorter blur
        "rises_with_sigma": "bool",  # better than at the next lower noise
    },
    {"target_sigma_dn": "DN", "angle_deg": "deg", "kernel_size_px": "px", "ap_percent": "%"},
)
SPREAD = Schema(
    "spread over directions",
    {
        "label": "string",
        "target_sigma_dn": "float64",
        "kernel_size_px": "float64",
        "mean_percent": "float64",  # over directions
        "mean_low_percent": "float64",  # bootstrap 95 % interval of that mean
        "mean_high_percent": "float64",
        "spread_percent": "float64",  # best less worst direction
        "low_percent": "float64",  # bootstrap 95 % interval of the spread; 0 where chance alone may make it
        "high_percent": "float64",
        "worst_angle_deg": "float64",
    },
    {"target_sigma_dn": "DN", "kernel_size_px": "px", "spread_percent": "percent points", "worst_angle_deg": "deg"},
)


def of_labels(
    table: pd.DataFrame, draws: Mapping[str, NDArray[np.float64]], tolerance: float
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """`tables` of every class, one below the other by label.

    Args:
        table: `pipeline.curves.precision.PRECISION`.
        draws: label -> (rows, B) percent.
        tolerance: see `tables`.

    Raises:
        InputError: see `tables`.
    """
    import pandas as pd

    parts = [tables(table[table["label"] == label], draws[label], tolerance) for label in sorted(draws)]
    rows, spread = (pd.concat(each, ignore_index=True) for each in zip(*parts, strict=True))
    return rows, spread


def tables(rows: pd.DataFrame, draws: NDArray[np.float64], tolerance: float) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The table of one class, and what direction does at each length and noise.

    Args:
        rows: `pipeline.curves.precision.PRECISION` of one label.
        draws: (rows, B) percent.
        tolerance: rises up to this, in percent points, are not marked.

    Returns:
        schemas `TABLE` and `SPREAD`; without a row where no condition is blurred, as in a sweep of noise alone.

    Raises:
        InputError: see `pipeline.curves.direction.by_direction`.
    """
    import pandas as pd

    blurred = (rows["kernel_size_px"] > 0).to_numpy()
    if not blurred.any():
        empty, none = (schema.conform(pd.DataFrame(columns=list(schema.columns))) for schema in (TABLE, SPREAD))
        return empty, none
    selected = rows[blurred].reset_index(drop=True)
    result = by_direction(
        selected["target_sigma_dn"],
        selected["angle_deg"],
        selected["kernel_size_px"],
        selected["ap_percent"],
        tolerance,
    )
    intervals: Any = selected.set_index(["target_sigma_dn", "angle_deg", "kernel_size_px"])[
        ["low_percent", "high_percent"]
    ]
    listed: list[dict[str, Any]] = []
    for position in np.ndindex(result.ap_percent.shape):
        s, a, d = position
        key = (result.sigma_dn[s], result.angle_deg[a], result.size_px[d])
        if key not in intervals.index:
            continue
        row: dict[str, Any] = {
            "label": str(selected["label"].iloc[0]),
            **dict(zip(("target_sigma_dn", "angle_deg", "kernel_size_px"), key, strict=True)),
        }
        row |= {"ap_percent": result.ap_percent[position], **intervals.loc[key].to_dict()}
        row["rises_with_size"] = bool(result.rises_with_size[position])
        listed.append({**row, "rises_with_sigma": bool(result.rises_with_sigma[position])})
    return TABLE.conform(pd.DataFrame(listed)), _spread(selected, draws[blurred], result)


def _spread(own: pd.DataFrame, draws: NDArray[np.float64], found: Directions) -> pd.DataFrame:
    import pandas as pd

    rows = []
    scenes = int(own["scenes"].max())
    for s, level in enumerate(found.sigma_dn):
        for d, size in enumerate(found.size_px):
            chosen = ((own["target_sigma_dn"] == level) & (own["kernel_size_px"] == size)).to_numpy()
            drawn = draws[chosen]
            drawn = drawn[:, np.isfinite(drawn).all(axis=0)]
            row = {"label": str(own["label"].iloc[0]), "target_sigma_dn": level, "kernel_size_px": size}
            for name, value, values in (
                ("", found.spread_percent[s, d], drawn.max(axis=0) - drawn.min(axis=0)),
                ("mean_", found.mean_percent[s, d], drawn.mean(axis=0)),
            ):
                ends = precision_interval(values, float(value), scenes)
                if not name and value <= chance(drawn, scenes):
                    ends = 0.0 if np.isfinite(ends[0]) else ends[0], ends[1]
                row |= dict(zip((f"{name}low_percent", f"{name}high_percent"), ends, strict=True))
            row |= {"mean_percent": found.mean_percent[s, d], "spread_percent": found.spread_percent[s, d]}
            row["worst_angle_deg"] = found.worst_angle_deg[s, d]
            rows.append(row)
    return SPREAD.conform(pd.DataFrame(rows))


def chance(draws: NDArray[np.float64], scenes: int) -> float:
    """Spread over directions that chance exceeds in 2.5 % of cases where direction has no effect; see the module.

    Args:
        draws: (directions, B) resampled average precision, percent, the same scenes in each column.
        scenes: that were resampled and hold an object.

    Returns:
        percent points; infinite with fewer than two scenes or without draws.
    """
    if scenes < 2 or draws.shape[1] == 0:
        return float("inf")
    deviation = small_sample_factor(scenes) * (draws - draws.mean(axis=1, keepdims=True))
    return float(np.quantile(deviation.max(axis=0) - deviation.min(axis=0), 1 - TAIL))
