"""Where the ledger's own numbers come from: each function reads one stage's files; None where it has not run.

Each returns a table with the key and value columns of one ledger item (`pipeline.report.ledger_items`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline import tables
from pipeline.errors import InputError
from pipeline.report.inputs import (
    ReportInputs,
    blur_estimates,
    blur_summary,
    existing,
    noise_tables,
    optional_json,
    optional_table,
    records,
)
from pipeline.store import read_json

if TYPE_CHECKING:
    import pandas as pd

PAPER_EFFECTS = ("photon", "dcsn", "readout", "combined")
NOMINAL_FREQUENCIES = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6)
"""What the paper's figures call its eight frequencies (`pipeline.camera.mtf.FREQUENCIES`, 0.054 to 0.595)."""


def formation(inputs: ReportInputs) -> pd.DataFrame | None:
    """Constants and moments of our sensor, from the JSON that names them: columns quantity, value."""
    import pandas as pd

    path = existing(inputs.sensor / "formation.json" if inputs.sensor is not None else None)
    if path is None:
        return None
    numbers = read_json(path)
    if not isinstance(numbers, dict) or not all(isinstance(value, (int, float)) for value in numbers.values()):
        raise InputError(f"{path}: expected one JSON object that maps quantities to numbers; run the stage again")
    return pd.DataFrame({"quantity": list(numbers), "value": [float(value) for value in numbers.values()]})


def levels(inputs: ReportInputs) -> pd.DataFrame | None:
    """By how much, at most, the noise added misses the level asked for: dataset, effect, miss_percent.

    The standard deviation is taken over a frame before the 8-bit range clips it; level 0 must be exact.
    """
    import pandas as pd

    parts = [optional_table(folder, "corruption.parquet", tables.CORRUPTION) for folder in inputs.corrupt.values()]
    found = [part for part in parts if part is not None]
    if not found:
        return None
    together = pd.concat(found, ignore_index=True)
    miss = 100.0 * (together["sigma_dn"] - together["level_dn"]).abs() / together["level_dn"].clip(lower=1.0)
    keys = ["dataset", "effect"]
    return together.assign(miss_percent=miss)[[*keys, "miss_percent"]].groupby(keys, as_index=False).max()


def expected_levels(inputs: ReportInputs) -> pd.DataFrame:
    """What the paper's scaling of the noise promises, no miss at all: the published side of `levels`.

    Datasets that have not run are listed with the paper's effects.
    """
    import pandas as pd

    own = levels(inputs)
    rows = [] if own is None else records(own[["dataset", "effect"]])
    ran = {row["dataset"] for row in rows}
    absent = [dataset for dataset in inputs.datasets if dataset not in ran]
    rows += [{"dataset": dataset, "effect": effect} for dataset in absent for effect in PAPER_EFFECTS]
    place = {dataset: number for number, dataset in enumerate(inputs.datasets)}
    rows.sort(key=lambda row: place.get(row["dataset"], len(place)))  # stable: effects keep their order
    return pd.DataFrame(rows, columns=["dataset", "effect"]).assign(miss_percent=0.0)


def sizes(inputs: ReportInputs) -> pd.DataFrame | None:
    """Frames and patches of each dataset: dataset, quantity, value."""
    import pandas as pd

    rows = []
    for dataset, folder in inputs.index.items():
        frames = optional_table(folder, "frames.parquet", tables.FRAMES)
        patches = optional_table(folder, "patches.parquet", tables.PATCHES)
        if frames is not None and len(frames):
            found = {
                "frames_noise": len(frames),
                "width_px": frames["width_px"].median(),
                "height_px": frames["height_px"].median(),
            }
            rows += [{"dataset": dataset, "quantity": name, "value": value} for name, value in found.items()]
        if patches is not None:
            blur = patches[patches["purpose"] == "blur"]
            noise = patches[patches["purpose"] == "noise"].groupby("frame").size()
            rows.append({"dataset": dataset, "quantity": "frames_blur", "value": blur["frame"].nunique()})
            if len(noise):
                rows.append({"dataset": dataset, "quantity": "noise_patches_per_frame", "value": noise.median()})
    return pd.DataFrame(rows) if rows else None


def noise_medians(inputs: ReportInputs) -> pd.DataFrame | None:
    """Robust medians of every noise estimator: dataset, effect, level_dn, estimator, sigma_dn."""
    summary, _ = noise_tables(inputs)
    if summary.empty:
        return None
    return summary[["dataset", "effect", "level_dn", "estimator", "median_dn"]].rename(
        columns={"median_dn": "sigma_dn"}
    )


def star_curve(inputs: ReportInputs) -> dict[str, np.ndarray] | None:
    """Sim's star: ``frequency`` as fraction of Nyquist, ``measured`` and ``formula``, each (K,).

    Raises:
        InputError: a curve is missing or of another length.
    """
    content = optional_json(inputs.star, "star.json")
    if content is None:
        return None
    names = ("frequency", "measured", "formula")
    curves = {name: np.asarray(content.get(name, []), dtype=float) for name in names}
    if len({values.shape for values in curves.values()}) != 1 or not curves["frequency"].size:
        raise InputError(
            f"{inputs.star}/star.json: expected equally long lists {', '.join(names)}; run the stage again"
        )
    return curves


def sharp_mtf(inputs: ReportInputs) -> pd.DataFrame | None:
    """Our Sim's ground truth at the paper's frequencies: dataset, estimator, statistic, frequency, mtf.

    The measured curve is interpolated linearly, from one at frequency zero on; frequencies beyond it are left out.
    """
    import pandas as pd

    curves = star_curve(inputs)
    if curves is None:
        return None
    wanted = np.array(NOMINAL_FREQUENCIES)
    order = np.argsort(curves["frequency"])
    frequency = np.concatenate([[0.0], curves["frequency"][order]])
    measured = np.concatenate([[1.0], curves["measured"][order]])
    wanted = wanted[wanted <= frequency[-1] + 1e-9]
    return pd.DataFrame(
        {
            "dataset": "sim",
            "estimator": "ground_truth",
            "statistic": "value",
            "frequency": wanted,
            "mtf": np.interp(wanted, frequency, measured),
        }
    )


def sharp_curves(estimates: pd.DataFrame) -> pd.DataFrame:
    """What each estimator reads from sharp frames, the outliers among patches rejected.

    Args:
        estimates: `pipeline.blur.evaluation.ESTIMATES`; rows of other kernels are passed over.

    Returns:
        dataset, estimator, axis (H, V), frequency (one of `NOMINAL_FREQUENCIES`), place (its number, from 0), median,
        min, max, count (patches with an answer), rejected and abstained (patches).
    """
    import pandas as pd

    from pipeline.blur.evaluation import SHARP
    from pipeline.statistics import inliers

    columns = ["dataset", "estimator", "axis", "frequency", "place", "median", "min", "max"]
    rows = []
    sharp = estimates[estimates["kernel"] == SHARP]
    for (dataset, estimator, axis), curve in sharp.groupby(["dataset", "estimator", "axis"], sort=True):
        for place, (_, point) in enumerate(curve.groupby("frequency", sort=True)):
            given = point["mtf"].to_numpy(float)
            answers = given[np.isfinite(given)]
            kept = answers[inliers(answers)] if answers.size else np.array([np.nan])
            rows.append(
                {
                    "dataset": dataset,
                    "estimator": estimator,
                    "axis": axis,
                    "frequency": NOMINAL_FREQUENCIES[place],
                    "place": place,
                    "median": float(np.median(kept)),
                    "min": float(kept.min()),
                    "max": float(kept.max()),
                    "count": answers.size,
                    "rejected": answers.size - (kept.size if answers.size else 0),
                    "abstained": int(point["abstained"].sum()),
                }
            )
    return pd.DataFrame(rows, columns=[*columns, "count", "rejected", "abstained"])


def uncorrupted(inputs: ReportInputs) -> pd.DataFrame | None:
    """MTF of uncorrupted frames, horizontal, as the paper publishes it: the star's, and what each estimator reads.

    Returns:
        dataset, estimator, statistic, frequency, mtf.
    """
    import pandas as pd

    found = (sharp_mtf(inputs), horizontal(sharp_curves(blur_estimates(inputs))))
    parts = [part for part in found if part is not None and len(part)]
    return pd.concat(parts, ignore_index=True) if parts else None


def horizontal(curves: pd.DataFrame) -> pd.DataFrame:
    """The horizontal ones of `sharp_curves` in long form: dataset, estimator, statistic, frequency, mtf."""
    keys = ["dataset", "estimator", "frequency"]
    return curves[curves["axis"] == "H"].melt(keys, ["median", "min", "max"], "statistic", "mtf")


def blur_amae(inputs: ReportInputs) -> pd.DataFrame | None:
    """AMAE of every blur estimator, uncalibrated as the paper's: dataset, estimator, blur, size_px, amae_percent."""
    from pipeline.blur.evaluation import SHARP

    summary = blur_summary(inputs)
    own = summary[~summary["calibrated"] & (summary["kind"] != SHARP)]
    if own.empty:
        return None
    return own.rename(columns={"kind": "blur"})[["dataset", "estimator", "blur", "size_px", "amae_percent"]]


def run_times(inputs: ReportInputs) -> pd.DataFrame | None:
    """Run times as the paper's table counts them: estimator, unit, seconds (of the processor, least disturbed)."""
    import pandas as pd

    from pipeline.report.run_times import patch_times

    times = patch_times(inputs.runtime)
    rows = []
    for task, name, published in (
        ("blur", "cnn", "cnn_mtf"), ("blur", "pmp", "pmp"), ("blur", "gbb", "gbb"), ("noise", "cnn", "cnn_sigma"),
        ("noise", "pca", "pca"), ("noise", "bf", "bf"),
    ):  # fmt: skip
        own = [time for time in times if (time.task, time.estimator) == (task, name)]
        if own:
            of_four = published == "cnn_mtf"  # the paper's network averages four frames of one place
            seconds = 4e-3 * own[0].batched_ms if of_four else 1e-3 * own[0].one_ms
            unit = "batch of 4 patches" if of_four else "patch"
            rows.append({"estimator": published, "unit": unit, "seconds": seconds})
    return pd.DataFrame(rows) if rows else None
