"""Average precision of every condition of a sweep, and the paper's curves (IOPC) through them.

Here, and nowhere else, shares become percent. The bootstrap resamples the same scenes for all conditions, so that what
is a difference between two conditions is not also one between two samples. Intervals are wider for few scenes
(`pipeline.cluster_intervals`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.curves.cells import gather, nearest_bin
from pipeline.curves.isolated import isolated
from pipeline.curves.surface import Surface
from pipeline.detection.average_precision import ClassResult, evaluate
from pipeline.detection.base import Detections
from pipeline.detection.matching import GroundTruth
from pipeline.errors import InputError
from pipeline.experiments.tables import CONDITION
from pipeline.store import Schema
from pipeline.streams import stream

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from pipeline.curves.settings import CurvesSettings
    from pipeline.detection.settings import EvaluationSettings

Floats = NDArray[np.float64]

PRECISION = Schema(
    "average precision",
    {
        "label": "string",
        **CONDITION,
        "sigma_dn": "float64",  # median estimate on objects; NaN where unknown
        "mtf": "float64",
        "ap_percent": "float64",  # NaN where there is no object
        "low_percent": "float64",  # bootstrap 95 % interval
        "high_percent": "float64",
        "images": "int64",
        "scenes": "int64",  # with an object: resampled together, so that intervals rest on them
        "objects": "int64",
        "objects_ignored": "int64",
        "detections": "int64",
        "true_positives": "int64",
        "false_positives": "int64",
        "ignored": "int64",
    },
    {
        "ap_percent": "%",
        "low_percent": "%",
        "high_percent": "%",
        "sigma_dn": "DN",
        "kernel_size_px": "px",
        "angle_deg": "deg",
    },
)

HEAT = Schema(
    "surface of average precision",
    {
        "label": "string",
        "sigma_bin_dn": "float64",
        "mtf_bin": "float64",
        "count": "int64",
        "sigma_dn": "float64",
        "mtf": "float64",
        "ap_percent": "float64",
        "low_percent": "float64",
        "high_percent": "float64",
        "non_monotonic": "bool",  # better than the next less noisy or sharper bin
        "certainly": "bool",  # significantly, corrected for the number of bins compared
        "objects_needed": "float64",  # at which a rise as large would be certain; NaN where none rises
    },
    {"sigma_bin_dn": "DN", "ap_percent": "%"},
)

ISOLATED = Schema(
    "isolated curves",
    {
        "label": "string",
        "quantity": "string",
        "quantity_value": "float64",
        "ap_percent": "float64",
        "low_percent": "float64",
        "high_percent": "float64",
        "count": "int64",
        "non_monotonic": "bool",
        "joined": "bool",  # the curve goes on to the next point
    },
    {"ap_percent": "%"},
)


def percent(share: ArrayLike) -> Floats:
    """Shares as percent; a sum that rounding has carried just beyond one is one."""
    return np.clip(100.0 * np.asarray(share, dtype=float), 0.0, 100.0)


def truths(
    objects: pd.DataFrame, frames: Sequence[str], min_height_px: float, min_visible_fraction: float
) -> list[GroundTruth]:
    """What is to be found in each frame; objects lower or less visible than stated are ignored."""
    hidden = (objects["y2"] - objects["y1"] < min_height_px) | (objects["visible_fraction"] < min_visible_fraction)
    marked = objects.assign(ignore=objects["ignore"] | hidden)
    groups = {str(name): rows for name, rows in marked.groupby("frame")}
    nothing = marked.iloc[:0]
    result = []
    for name in frames:
        rows = groups.get(name, nothing)
        corners = rows[["x1", "y1", "x2", "y2"]].to_numpy(float)
        result.append(GroundTruth(corners, rows["label"].to_numpy().astype(np.str_), rows["ignore"].to_numpy(bool)))
    return result


def average_precision(
    detections: pd.DataFrame,
    looked: pd.DataFrame,
    objects: pd.DataFrame,
    conditions: pd.DataFrame,
    labels: Sequence[str],
    criteria: EvaluationSettings,
    seed: int,
) -> tuple[pd.DataFrame, dict[str, Floats]]:
    """Judge every condition.

    Args:
        detections: `pipeline.experiments.detect.DETECTIONS`.
        looked: `pipeline.experiments.detect.LOOKED`.
        objects: `pipeline.experiments.detect.OBJECTS`.
        conditions: `pipeline.experiments.tables.CONDITIONS`, for noise and MTF.
        labels: classes.
        criteria: section ``detection.evaluation`` of the configuration.
        seed: root seed.

    Returns:
        `PRECISION`, sorted by label and in the order of the sweep; and for each label the draws (conditions, B) in
        percent, in the order of its rows.

    Raises:
        InputError: a condition was looked at in other frames than the first.
    """
    import pandas as pd

    names = list(dict.fromkeys(looked["frame"]))
    scene_of = dict(zip(looked["frame"], looked["scene"], strict=True))
    scenes = [scene_of[name] for name in names]
    wanted = truths(objects, names, criteria.min_height_px, criteria.min_visible_fraction)
    keys = ["frame", "kernel", "target_sigma_dn"]
    known = {key: _detections(rows) for key, rows in detections.groupby(keys, sort=False)}
    medians: Any = conditions.set_index(["kernel", "target_sigma_dn"])[["sigma_dn", "mtf"]]
    rows: list[dict[str, Any]] = []
    draws: dict[str, list[Floats]] = {label: [] for label in labels}
    for position, group in looked.groupby(list(CONDITION), sort=False):
        condition = dict(zip(CONDITION, position, strict=True))
        if set(group["frame"]) != set(names):
            raise InputError(
                f"{condition['kernel']} at {condition['target_sigma_dn']:g} DN: frames are missing; detect again"
            )
        cell = (condition["kernel"], condition["target_sigma_dn"])
        entries = [known.get((name, *cell), Detections.none()) for name in names]
        at = medians.loc[cell] if cell in medians.index else {"sigma_dn": np.nan, "mtf": np.nan}
        for label, result in _judged(entries, wanted, labels, criteria, seed, scenes).items():
            draws[label].append(percent(result.draws))
            rows.append({"label": label, **condition, **_numbers(result), "sigma_dn": at["sigma_dn"], "mtf": at["mtf"]})
    table = pd.DataFrame(rows, columns=list(PRECISION.columns))
    table = PRECISION.conform(table.sort_values("label", kind="stable"))
    return table, {label: np.stack(parts) for label, parts in draws.items() if parts}


def _judged(
    entries: Sequence[Detections],
    wanted: Sequence[GroundTruth],
    labels: Sequence[str],
    criteria: EvaluationSettings,
    seed: int,
    scenes: Sequence[str],
) -> dict[str, ClassResult]:
    """Results of one condition by class; every condition resamples the same scenes."""
    generator = stream(seed, "average precision")
    rule, threshold = criteria.rule, criteria.iou_threshold
    return evaluate(entries, wanted, labels, rule, threshold, generator, criteria.bootstrap_draws, scenes)


def _numbers(result: ClassResult) -> dict[str, Any]:
    """Average precision with its interval, percent, and counts: columns of `PRECISION`."""
    ap, low, high = percent((result.average_precision, result.low, result.high)).tolist()
    counts = ("images", "objects", "objects_ignored", "detections", "true_positives", "false_positives", "ignored")
    return {
        "ap_percent": ap,
        "low_percent": low,
        "high_percent": high,
        "scenes": result.clusters,
        **{name: getattr(result, name) for name in counts},
    }


def tuples(rows: pd.DataFrame, draws: Floats, average: bool) -> tuple[pd.DataFrame, Floats]:
    """The points that curves go through: noise, MTF and average precision of a condition.

    Args:
        rows: `PRECISION` of one label.
        draws: (rows, B) percent.
        average: over the directions of each size and level, as the paper does; else one point per direction.

    Returns:
        kernel_size_px, target_sigma_dn, sigma_dn, mtf, ap_percent of each point, and its draws (points, B).
    """
    import pandas as pd

    columns = ["kernel_size_px", "target_sigma_dn", "sigma_dn", "mtf", "ap_percent"]
    numbered = rows.reset_index(drop=True)
    if not average:
        return numbered[columns], draws
    groups = [(key, group) for key, group in numbered.groupby(["kernel_size_px", "target_sigma_dn"], sort=True)]
    means = [[*key, *group[columns[2:]].mean(skipna=False)] for key, group in groups]
    drawn = [draws[group.index].mean(axis=0) for _, group in groups]
    return pd.DataFrame(means, columns=columns), np.stack(drawn)


@dataclass(frozen=True)
class LabelCurves:
    """Curves through the average precisions of a sweep, of each class.

    Attributes:
        surfaces: label -> its surface.
        heat: `HEAT` of these.
        isolated: `ISOLATED` of every class.
        refused: label -> why it has no surface.
    """

    surfaces: dict[str, Surface]
    heat: pd.DataFrame
    isolated: pd.DataFrame
    refused: dict[str, str]

    def save_surfaces(self, folder: Path) -> None:
        """Write each surface into a folder, see `surface_file`."""
        for label, kept in self.surfaces.items():
            kept.save(folder / surface_file(label))


def surface_file(label: str) -> str:
    """Name of the file that holds the surface of a class."""
    return f"surface-{label.replace(' ', '_')}.npz"


def label_curves(table: pd.DataFrame, draws: Mapping[str, Floats], section: CurvesSettings, seed: int) -> LabelCurves:
    """Surface and isolated curves of every class.

    Args:
        table: `PRECISION`.
        draws: label -> (rows, B) percent, of at least one class.
        section: ``detection.curves`` of the configuration.
        seed: root seed.
    """
    import pandas as pd

    surfaces, heats, parts, refused = {}, [], [], {}
    for label, drawn in draws.items():
        rows = table[table["label"] == label].reset_index(drop=True)
        parts.append(curves(label, rows, drawn, section, seed))
        try:
            surfaces[label] = surface(rows, drawn, section, seed)
        except InputError as error:
            refused[label] = str(error)
        else:
            heats.append(heat(label, surfaces[label], section.tolerance_percent, rows["objects"].max()))
    bins = pd.concat(heats, ignore_index=True) if heats else pd.DataFrame(columns=list(HEAT.columns))
    return LabelCurves(surfaces, bins, pd.concat(parts, ignore_index=True), refused)


def surface(rows: pd.DataFrame, draws: Floats, section: CurvesSettings, seed: int) -> Surface:
    """The surface of one class.

    Args:
        rows: `PRECISION` of one label.
        draws: (rows, B) percent.
        section: ``detection.curves`` of the configuration.
        seed: root seed.

    Raises:
        InputError: no object, or too few bins for a surface.
    """
    known = rows["ap_percent"].notna().to_numpy()
    if not known.any():
        raise InputError("no object of this class to find")
    points, drawn = tuples(rows, draws, section.average_directions)
    return Surface(
        gather(
            points["sigma_dn"],
            points["mtf"],
            points["ap_percent"],
            stream(seed, "surface"),
            _without_gaps(drawn),
            sigma_bins_dn=section.sigma_bins_dn,
            mtf_bins=section.mtf_bins,
        ),
        scenes=int(rows["scenes"].max()),
    )


def heat(label: str, one: Surface, tolerance: float, objects: float) -> pd.DataFrame:
    """The bins of a surface: schema `HEAT`; empty bins have a count of 0.

    Args:
        label: of the class.
        one: its surface.
        tolerance: rises up to this are none, percent points.
        objects: of the class, on which the surface rests.
    """
    import pandas as pd

    certainty, rising = one.certainty(tolerance), one.non_monotonic(tolerance)
    with np.errstate(invalid="ignore", divide="ignore"):
        needed = np.where(rising, objects * np.maximum(certainty**-2.0, 0), np.nan)
    cells, (low, high) = one.cells, one.cells.interval(one.scenes)
    sigma_bins, mtf_bins = np.meshgrid(cells.sigma_bins_dn, cells.mtf_bins, indexing="ij")
    columns = {
        "sigma_bin_dn": sigma_bins,
        "mtf_bin": mtf_bins,
        "count": cells.count,
        "sigma_dn": cells.sigma_dn,
        "mtf": cells.mtf,
        "ap_percent": cells.ap_percent,
        "low_percent": low,
        "high_percent": high,
        "non_monotonic": rising,
        "certainly": certainty >= 1,
        "objects_needed": needed,
    }
    return HEAT.conform(pd.DataFrame({"label": label, **{name: value.ravel() for name, value in columns.items()}}))


def curves(label: str, rows: pd.DataFrame, draws: Floats, section: CurvesSettings, seed: int) -> pd.DataFrame:
    """The isolated curves of one class: noise without blur, blur without noise. Schema `ISOLATED`.

    An effect of which no point lies in the bins has no curve.
    """
    import pandas as pd

    parts = []
    bins: dict[str, Any] = {"sigma_bins_dn": section.sigma_bins_dn, "mtf_bins": section.mtf_bins}
    sigma_centres, mtf_centres = (np.asarray(centres, dtype=float) for centres in bins.values())
    points, drawn = tuples(rows, draws, section.average_directions)
    for quantity, chosen in (("sigma_dn", points["kernel_size_px"] == 0), ("mtf", points["target_sigma_dn"] == 0)):
        selected = points[chosen]
        picked = _without_gaps(drawn)[chosen.to_numpy()]
        # Only one effect is on: what the other quantity is estimated to be must not scatter the curve over bins.
        off = np.full(len(selected), section.mtf_bins[-1] if quantity == "sigma_dn" else section.sigma_bins_dn[0])
        sigma, contrast = (selected["sigma_dn"], off) if quantity == "sigma_dn" else (off, selected["mtf"])
        known = selected["ap_percent"].notna() & selected["sigma_dn"].notna() & selected["mtf"].notna()
        inside = (nearest_bin(sigma, sigma_centres) >= 0) & (nearest_bin(contrast, mtf_centres) >= 0)
        if not (known & inside).any():
            continue
        cells = gather(sigma, contrast, selected["ap_percent"], stream(seed, "curve"), picked, **bins)
        scenes = int(rows["scenes"].max())
        curve = isolated(cells, quantity, tolerance=section.tolerance_percent, scenes=scenes)
        values: dict[str, Any] = {
            "quantity_value": curve.at,
            "ap_percent": curve.ap_percent,
            "low_percent": curve.low,
            "high_percent": curve.high,
        }
        values |= {"count": curve.count, "non_monotonic": curve.non_monotonic, "joined": [*curve.joined, False]}
        parts.append(pd.DataFrame({"label": label, "quantity": quantity, **values}))
    empty = pd.DataFrame(columns=list(ISOLATED.columns))
    return ISOLATED.conform(pd.concat(parts, ignore_index=True) if parts else empty)


def _detections(rows: pd.DataFrame) -> Detections:
    return Detections.of(rows[["x1", "y1", "x2", "y2"]].to_numpy(float), rows["score"].to_numpy(), list(rows["label"]))


def _without_gaps(draws: Floats) -> Floats:
    """Draws in which every condition has a value: a resample without any object has none."""
    whole = np.isfinite(draws).all(axis=0)
    return draws[:, whole] if whole.any() else draws


def metrics(table: pd.DataFrame, made: Mapping[str, Surface]) -> dict[str, dict[str, float]]:
    """Numbers to watch, of classes with objects: average precision without blur and noise, over all; the surface.

    ``clean_ap_percent`` is left out where no sharp condition without noise was swept.
    """
    measures = {}
    for label, rows in table[table["objects"] > 0].groupby("label"):
        clean = rows[(rows["kernel_size_px"] == 0) & (rows["target_sigma_dn"] == 0)]["ap_percent"]
        item = made.get(str(label))
        measures[str(label)] = {
            "objects": float(rows["objects"].iloc[0]),
            **({"clean_ap_percent": float(clean.iloc[0])} if len(clean) else {}),
            "mean_ap_percent": float(rows["ap_percent"].mean()),
            "bins": 0.0 if item is None else float((item.cells.count > 0).sum()),
            "non_monotonic": 0.0 if item is None else float(item.non_monotonic().sum()),
            "certainly_non_monotonic": 0.0 if item is None else float(item.certainly_non_monotonic().sum()),
        }
    return measures
