"""Rows of the ledger recomputed without the project's code, from the published files and the committed records."""

from __future__ import annotations

import csv
import math
from pathlib import Path

FOLDERS = {"KITTI": "kitti-blur", "Udacity": "udacity-blur", "Sim (authors’)": "sim_authors-blur"}
ESTIMATORS = {"CNN": "cnn", "PMP": "pmp", "GBB": "gbb"}
BLURS = {"Defocus": "defocus", "Linear motion": "linear_motion", "Non-linear motion": "nonlinear_motion"}
DETECTORS = {"YOLOv4": "yolov4", "Faster R-CNN": "faster_rcnn"}
PAPER_DATASETS = {"KITTI": "kitti", "Udacity": "udacity", "Sim": "sim"}
FRAMES, NORMAL_RANGE = 150, 5.298
"""Of the paper; expected range of as many standard normal numbers, from printed tables."""


def rows_of(path: Path) -> list[dict[str, str]]:
    """A CSV file as dictionaries."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def only(rows: list[dict[str, str]], **chosen: object) -> dict[str, str]:
    """The one row with these values; numbers are compared as numbers."""
    results = [row for row in rows if all(_equal(row[name], value) for name, value in chosen.items())]
    assert len(results) == 1, (chosen, len(results))
    return results[0]


def _equal(text: str, value: object) -> bool:
    return math.isclose(float(text), value) if isinstance(value, float) else text == value


def can_recompute(row: dict[str, str]) -> bool:
    """Whether committed files suffice for a row: Table I and sharp frames where recorded, and the fitted grid."""
    recorded = row["item"] in ("blur_amae", "uncorrupted_mtf") and row["dataset"] in FOLDERS
    return bool(row["ours"]) and (recorded or row["item"] == "fitted_ap_grid")


def recomputed(row: dict[str, str], root: Path) -> dict[str, float | str]:
    """Paper's number, ours, its interval and the verdict of a row.

    Args:
        row: of the ledger.
        root: of the repository.

    Returns:
        paper, ours, low, high (NaN without an interval) and verdict.
    """
    parts = row["quantity"].split(", ")
    if row["item"] == "fitted_ap_grid":
        return _grid(parts, root)
    folder = root / "reports/recorded" / FOLDERS[row["dataset"]]
    dataset, estimator = PAPER_DATASETS[parts[0]], ESTIMATORS[parts[1].split(" (")[0]]
    names = {each["estimator"] for each in rows_of(folder / "summary.csv")}
    measured = f"{estimator}_exact" if f"{estimator}_exact" in names else estimator  # as the paper ran it, where it was
    if row["item"] == "blur_amae":
        kernel = {"blur": BLURS[parts[2]], "size_px": float(parts[3].removesuffix(" px"))}
        paper = only(rows_of(root / "data/paper/blur_amae.csv"), dataset=dataset, estimator=estimator, **kernel)
        kernel = {"blur_kind": kernel["blur"], "kernel_size_px": kernel["size_px"]}
        ours = only(rows_of(folder / "summary.csv"), estimator=measured, calibrated="False", **kernel)
        numbers = [float(ours[name]) for name in ("amae_percent", "low_percent", "high_percent")]
        return _judged(float(paper["amae_percent"]), *numbers, error=0.05, lower_is_better=True)
    statistic, frequency = parts[2], float(parts[3].removeprefix("f "))
    published = rows_of(root / "data/paper/uncorrupted_mtf.csv")
    key = {"dataset": dataset, "estimator": estimator, "frequency": frequency}
    theirs = {name: float(only(published, statistic=name, **key)["mtf"]) for name in ("median", "min", "max")}
    ours = only(rows_of(folder / "sharp.csv"), estimator=measured, axis="H", frequency=frequency)
    value = float(ours[statistic])
    if statistic != "median":
        return {
            "paper": theirs[statistic],
            "ours": value,
            "low": math.nan,
            "high": math.nan,
            "verdict": "not comparable",
        }
    low, high = (float(ours.get(name) or "nan") for name in ("low", "high"))
    if math.isnan(low):  # recorded without an interval: from the range, as the paper's
        half = _median_error(float(ours["max"]) - float(ours["min"]), int(ours["count"]))
        low, high = value - half, value + half
    error = 0.0005 + _median_error(theirs["max"] - theirs["min"], FRAMES)
    return _judged(theirs["median"], value, low, high, error=error, lower_is_better=False)


def _grid(parts: list[str], root: Path) -> dict[str, float | str]:
    """A cell of the fitted grid, from the printed coefficients."""
    detector, kind = DETECTORS[parts[0]], parts[1].lower()
    iso, exposure_ms = float(parts[2].removeprefix("ISO ")), float(parts[3].removesuffix(" ms"))
    cells = rows_of(root / "data/paper/fitted_ap_grid.csv")
    cell = only(cells, detector=detector, object=kind, iso=iso, exposure_ms=exposure_ms)
    printed = rows_of(root / "data/paper/regression_coefficients.csv")
    c = [float(only(printed, detector=detector, object=kind, parameter=f"c{n}")["value"]) for n in range(1, 9)]
    x, y = iso, exposure_ms
    ours = c[0] * x * y + c[1] * x + c[2] * y + c[3] * math.sqrt(y) + c[4] + c[5] / (x * y) + c[6] / x + c[7] / y
    paper = float(cell["ap_percent"])
    verdict = "match" if abs(ours - paper) <= 0.1 else "close" if abs(ours - paper) <= 0.2 else "differs"
    return {"paper": paper, "ours": ours, "low": math.nan, "high": math.nan, "verdict": verdict}


def _judged(
    paper: float, ours: float, low: float, high: float, *, error: float, lower_is_better: bool
) -> dict[str, float | str]:
    """Verdict from two intervals: ours, and the paper's number with its error."""
    verdict = "match"
    reach = max(high - ours if paper > ours else ours - low, 0.0) + error
    if low > paper + error or high < paper - error:
        verdict = "close" if abs(ours - paper) <= 2 * reach else "differs"
        if lower_is_better and ours < paper:
            verdict = "better"
    return {"paper": paper, "ours": ours, "low": low, "high": high, "verdict": verdict}


def _median_error(width: float, count: int) -> float:
    """Half the 95 % interval of a median, from the range of its values."""
    expected = NORMAL_RANGE if count == FRAMES else _normal_range(count)
    return 1.959964 * math.sqrt(math.pi / 2) * width / expected / math.sqrt(count)


def _normal_range(count: int) -> float:
    """Expected range of normal numbers: twice the mean of the largest, by its density."""
    step, total = 0.002, 0.0
    for number in range(-4000, 4000):
        x = number * step
        below = 0.5 * math.erfc(-x / math.sqrt(2))
        density = math.exp(-x * x / 2) / math.sqrt(2 * math.pi)
        total += x * count * below ** (count - 1) * density * step
    return 2 * total
