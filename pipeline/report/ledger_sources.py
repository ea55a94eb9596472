"""Our side of the ledger: each function reads the files of a stage and returns None where it has not run.

A table has the key and value columns of one ledger item (`pipeline.report.ledger_items`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pipeline import tables
from pipeline.camera.mtf import FREQUENCIES
from pipeline.errors import InputError
from pipeline.experiments import blur_records, frame_records
from pipeline.experiments.condition import SHARP
from pipeline.experiments.intervals import median_error_of_range
from pipeline.experiments.sharp_curves import NOMINAL_FREQUENCIES, sharp_curves
from pipeline.report import detection_results
from pipeline.report.display_names import PAPER_NAMES
from pipeline.report.inputs import (
    ReportInputs,
    blur_estimates,
    blur_summary,
    combined_tables,
    denoised_cells,
    noise_tables,
    published_table,
)
from pipeline.report.tables import Row, records
from pipeline.stage_files import optional

if TYPE_CHECKING:
    import pandas as pd

PAPER_EFFECTS = ("photon", "dcsn", "readout", "combined")
COMBINED_DATASET, NETWORK, COMBINED_ESTIMATOR = "udacity", "cnn", "spectral"
"""All that the paper prints of blur and noise at once is of its network on Udacity; without it, ours is the second."""

EXAMPLE_PX, EXAMPLE_ANGLE_DEG = 11.0, 45.0
DIRECTION_LABEL = "car"
STD_DEV_FRACTION = 0.2
PAPER_FRAMES = 150


def formation(inputs: ReportInputs) -> pd.DataFrame | None:
    """Constants and moments of our sensor: quantity, value."""
    import pandas as pd

    numbers = optional(inputs.sensor, "formation.json")
    if numbers is None:
        return None
    if not isinstance(numbers, dict) or not all(isinstance(value, (int, float)) for value in numbers.values()):
        raise InputError(
            f"{inputs.sensor}/formation.json: expected one JSON object that maps quantities to numbers; "
            "run the stage again"
        )
    return pd.DataFrame({"quantity": list(numbers), "value": [float(value) for value in numbers.values()]})


def levels(inputs: ReportInputs) -> pd.DataFrame | None:
    """Largest deviation of the noise added from its target level: dataset, noise_source, miss_percent.

    The standard deviation is taken over a frame before the 8-bit range clips it; level 0 must be exact.
    """
    import pandas as pd

    parts = [optional(folder, "corruption.parquet", tables.CORRUPTION) for folder in inputs.corrupt.values()]
    if all(part is None for part in parts):
        return None
    rows = pd.concat([part for part in parts if part is not None], ignore_index=True)
    miss = (
        100.0 * (rows["unclipped_sigma_dn"] - rows["target_sigma_dn"]).abs() / rows["target_sigma_dn"].clip(lower=1.0)
    )
    return rows.assign(miss_percent=miss).groupby(["dataset", "noise_source"], as_index=False)[["miss_percent"]].max()


def expected_levels(inputs: ReportInputs) -> pd.DataFrame:
    """No deviation, as the paper's scaling of the noise promises: the published side of `levels`.

    Datasets that have not run are listed with the paper's effects.
    """
    import pandas as pd

    selected = levels(inputs)
    ran = [] if selected is None else records(selected)
    absent = [name for name in inputs.datasets if name not in {row["dataset"] for row in ran}]
    rows = [(row["dataset"], row["noise_source"]) for row in ran]
    rows += [(dataset, noise_source) for dataset in absent for noise_source in PAPER_EFFECTS]
    order = {dataset: number for number, dataset in enumerate(inputs.datasets)}
    rows.sort(key=lambda row: order.get(row[0], len(order)))  # stable: effects keep their order
    return pd.DataFrame(rows, columns=["dataset", "noise_source"]).assign(miss_percent=0.0)


def sizes(inputs: ReportInputs) -> pd.DataFrame | None:
    """Frames and patches of each dataset: dataset, quantity, value."""
    import pandas as pd

    rows: list[tuple[str, str, float]] = []
    for dataset, folder in inputs.index.items():
        frames = optional(folder, "frames.parquet", tables.FRAMES)
        patches = optional(folder, "patches.parquet", tables.PATCHES)
        if frames is not None and len(frames):
            rows.append((dataset, "frames_noise", len(frames)))
            rows += [(dataset, name, frames[name].median()) for name in ("width_px", "height_px")]
        if patches is not None:
            per_frame = patches[patches["purpose"] == "noise"].groupby("frame").size()
            rows.append((dataset, "frames_blur", patches.loc[patches["purpose"] == "blur", "frame"].nunique()))
            rows += [(dataset, "noise_patches_per_frame", per_frame.median())] if len(per_frame) else []
    return pd.DataFrame(rows, columns=["dataset", "quantity", "value"]) if rows else None


def noise_medians(inputs: ReportInputs) -> pd.DataFrame | None:
    """Robust medians of every noise estimator: dataset, noise_source, target_sigma_dn, estimator, sigma_dn and its
    interval.
    """
    summary, recorded = noise_tables(inputs)[0], frame_records.joined(inputs.recorded, frame_records.NOISE_FILE)
    medians = [table.rename(columns={"median_dn": "sigma_dn"}) for table in (summary, recorded)]
    return _with_records(None if summary.empty else medians[0], [] if recorded.empty else medians[1:])


def star_curve(inputs: ReportInputs) -> dict[str, np.ndarray] | None:
    """Sim's star: ``frequency`` as fraction of Nyquist, ``measured`` and ``formula``, each (K,).

    Raises:
        InputError: a curve is missing or of another length.
    """
    content = optional(inputs.star, "star.json")
    if content is None:
        return None
    names = ("frequency", "measured", "formula")
    curves = {name: np.asarray(content.get(name, []), dtype=float) for name in names}
    if len({values.shape for values in curves.values()}) != 1 or not curves["frequency"].size:
        raise InputError(
            f"{inputs.star}/star.json: expected equally long lists {', '.join(names)}; run the stage again"
        )
    return curves


def lenses(inputs: ReportInputs) -> dict[str, np.ndarray]:
    """Dataset -> (8,) MTF of its lens and pixels at `pipeline.camera.mtf.FREQUENCIES`, where it is known: our Sim's."""
    curves = star_curve(inputs)
    if curves is None:
        return {}
    return {"sim": np.interp(FREQUENCIES, *_from_zero(curves))}


def _from_zero(curves: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The star's frequencies in ascending order and the MTF measured there, from one at frequency zero on."""
    order = np.argsort(curves["frequency"])
    return np.r_[0.0, curves["frequency"][order]], np.r_[1.0, curves["measured"][order]]


def sharp_mtf(inputs: ReportInputs) -> pd.DataFrame | None:
    """Our Sim's ground truth at the paper's frequencies: dataset, estimator, statistic, frequency, mtf.

    The measured curve is interpolated linearly, from one at frequency zero on; frequencies beyond it are left out.
    """
    import pandas as pd

    curves = star_curve(inputs)
    if curves is None:
        return None
    frequency, measured = _from_zero(curves)
    nominal = np.array(NOMINAL_FREQUENCIES)
    nominal = nominal[nominal <= frequency[-1] + 1e-9]
    table = pd.DataFrame({"frequency": nominal, "mtf": np.interp(nominal, frequency, measured)})
    return table.assign(dataset="sim", estimator="ground_truth", statistic="value")


def uncorrupted(inputs: ReportInputs) -> pd.DataFrame | None:
    """MTF of uncorrupted frames, horizontal, as the paper publishes it: the star's, and of each estimator.

    Returns:
        dataset, estimator, statistic, frequency, mtf.
    """
    import pandas as pd

    parts = [sharp_mtf(inputs), _horizontal(sharp_curves(blur_estimates(inputs), inputs.seed))]
    known = [part for part in parts if part is not None and len(part)]
    selected = pd.concat(known, ignore_index=True) if known else None
    return _with_records(
        selected, [_horizontal(one.as_the_paper_ran(one.sharp)) for one in blur_records.read(inputs.recorded)]
    )


def _horizontal(curves: pd.DataFrame) -> pd.DataFrame:
    """Horizontal curves, one row for each statistic; ``low`` and ``high`` are those of the medians.

    Records from before intervals were computed have their range only, from which follows a narrower interval, as if
    patches were independent.
    """
    known = curves[curves["axis"] == "H"]
    error = median_error_of_range((known["max"] - known["min"]).to_numpy(float), known["count"].to_numpy(float))
    for name, end in (("low", known["median"] - error), ("high", known["median"] + error)):
        known = known.assign(**{name: known[name].fillna(end) if name in known else end})
    ends, keys = ["low", "high"], ["dataset", "estimator", "frequency"]
    rows = known.melt([*keys, *ends], ["median", "min", "max"], "statistic", "mtf")
    rows.loc[rows["statistic"] != "median", ends] = math.nan
    return rows


def published_uncorrupted(inputs: ReportInputs) -> pd.DataFrame:
    """The published curves, each median with half its 95 % interval as ``paper_error``, from the printed range."""
    table = published_table(inputs.paper / "uncorrupted_mtf.csv")
    keys = ["dataset", "estimator", "frequency"]
    wide = table.pivot_table(index=keys, columns="statistic", values="mtf").reset_index()
    error = median_error_of_range((wide["max"] - wide["min"]).to_numpy(float), np.full(len(wide), PAPER_FRAMES))
    ends = wide[keys].assign(statistic="median", paper_error=error)
    return table.merge(ends, how="left", on=[*keys, "statistic"])


def blur_amae(inputs: ReportInputs) -> pd.DataFrame | None:
    """Uncalibrated AMAE of every blur estimator: dataset, estimator, blur, size_px, amae_percent and its interval."""
    parts = [blur_summary(inputs), *(one.as_the_paper_ran(one.summary) for one in blur_records.read(inputs.recorded))]
    columns = ["dataset", "estimator", "blur_kind", "kernel_size_px", "amae_percent", "low_percent", "high_percent"]
    raw = [part[~part["calibrated"].astype(bool) & (part["blur_kind"] != SHARP)][columns] for part in parts]
    return _with_records(raw[0] if len(raw[0]) else None, raw[1:])


def is_of_authors(dataset: str, estimator: str, inputs: ReportInputs) -> bool:
    """Whether an estimator was recorded on the very frames that the paper calls by this name, ours being others."""
    recorded = blur_records.estimators(inputs.recorded)
    return any(estimator in recorded.get(group, ()) for group, name in PAPER_NAMES.items() if name == dataset)


def is_of_other_frames(row: Row, inputs: ReportInputs) -> bool:
    """Whether a row's number of blur was measured on the authors' Sim and ours was not."""
    return (
        row["dataset"] == "sim"
        and row["estimator"] != "ground_truth"
        and not is_of_authors("sim", row["estimator"], inputs)
    )


def is_rendered(row: Row, inputs: ReportInputs) -> bool:
    """Whether a row's number of noise was measured on the authors' Sim and ours was not."""
    return row["dataset"] == "sim" and row["measured_on"] not in PAPER_NAMES


def is_chosen_by_profile(row: Row, inputs: ReportInputs) -> bool:
    """Whether a row is a number of frames, which is the paper's in the paper's profile only."""
    return str(row["quantity"]).startswith("frames_") and inputs.profile != "paper"


def _with_records(own: pd.DataFrame | None, recorded: list[pd.DataFrame]) -> pd.DataFrame | None:
    """Rows of our stages and of records under the paper's names, one of the two for each dataset and estimator.

    A run of a stage on KITTI or Udacity wins over the record. The paper's Sim is the authors' own: a record of their
    frames wins over the Sim rendered here, which cannot be compared.
    """
    import pandas as pd

    if not recorded:
        return None if own is None else own.assign(measured_on=own["dataset"])
    rows = pd.concat(recorded, ignore_index=True)
    is_authors = rows["dataset"].isin(list(PAPER_NAMES)).to_numpy()
    rows = rows.assign(dataset=rows["dataset"].replace(PAPER_NAMES), measured_on=rows["dataset"])
    if own is None:
        return rows
    ran, known = (table["dataset"].astype(str) + " " + table["estimator"].astype(str) for table in (own, rows))
    kept = is_authors | ~known.isin(ran).to_numpy()
    own = own.assign(measured_on=own["dataset"])
    return pd.concat([own[~ran.isin(known[kept]).to_numpy()], rows[kept]], ignore_index=True)


def run_times(inputs: ReportInputs) -> pd.DataFrame | None:
    """Run times as the paper's table counts them: estimator, unit, seconds (of the processor)."""
    from pipeline.report.sections.runtime import patch_times

    times = patch_times(inputs)
    times = times[times["name"] != ""]
    if times.empty:
        return None
    exact = times["estimator"].str.endswith("_exact")  # the paper's program wins over a faster variant
    times = times[exact | ~times["name"].isin(times.loc[exact, "name"])]
    of_four = times["name"] == "cnn_mtf"  # the paper's network averages four frames of one place
    seconds = (4e-3 * times["batched_ms"]).where(of_four, 1e-3 * times["one_ms"]).astype(float)
    unit = of_four.map({True: "batch of 4 patches", False: "patch"})
    return times[["name"]].rename(columns={"name": "estimator"}).assign(unit=unit, seconds=seconds)


def _of_udacity(ran: pd.DataFrame, inputs: ReportInputs, file: str) -> pd.DataFrame:
    """Raw rows of blur and noise at once that stand for the paper's, of a stage or of a record.

    They are of the paper's network where it was run on all that the other estimator was run on.
    """
    table = frame_records.with_records(ran, inputs.recorded, file)
    rows = table[(table["dataset"] == COMBINED_DATASET) & ~table["calibrated"].astype(bool)]
    network, other = (rows[rows["estimator"] == name] for name in (NETWORK, COMBINED_ESTIMATOR))
    return network if len(network) >= max(len(other), 1) else other


def photon_defocus(inputs: ReportInputs) -> pd.DataFrame | None:
    """AMAE of defocus in the presence of photon noise: sigma_dn, kernel_size_px, amae_percent and its interval."""
    cells = _of_udacity(combined_tables(inputs)[0], inputs, frame_records.COMBINED_FILES[0])
    selected = cells[(cells["experiment"] == "photon_defocus") & (cells["filter_px"] == 0)]
    return selected.rename(columns={"target_sigma_dn": "sigma_dn"}) if len(selected) else None


def photon_linear(inputs: ReportInputs) -> pd.DataFrame | None:
    """Curves of linear motion of 11 px in the presence of photon noise: series, sigma_dn, frequency, mtf.

    The paper's curves are means of horizontal and vertical of its diagonal kernel, as the ground truth shows.
    """
    import pandas as pd

    curves = _of_udacity(combined_tables(inputs)[2], inputs, frame_records.COMBINED_FILES[2])
    selected = curves[
        (curves["experiment"] == "photon_linear")
        & (curves["filter_px"] == 0)
        & (curves["axis"] == "HV")
        & (curves["kernel_size_px"] == EXAMPLE_PX)
        & (curves["angle_deg"] == EXAMPLE_ANGLE_DEG)
    ]
    if selected.empty:
        return None
    selected = selected.assign(
        frequency=[NOMINAL_FREQUENCIES[index] for index in selected["frequency_index"]],
        sigma_dn=selected["target_sigma_dn"],
    )
    truth = selected[selected["target_sigma_dn"] == selected["target_sigma_dn"].min()].assign(
        series="ground_truth", sigma_dn=float("nan")
    )
    parts = [truth.assign(mtf=truth["true_mtf"]), selected.assign(series="cnn", mtf=selected["median"])]
    return pd.concat(parts, ignore_index=True)[["series", "sigma_dn", "frequency", "mtf"]]


def combined_estimator(inputs: ReportInputs) -> str:
    """Estimator that stands for the paper's network in blur and noise at once; empty where none has run."""
    cells = _of_udacity(combined_tables(inputs)[0], inputs, frame_records.COMBINED_FILES[0])
    return "" if cells.empty else str(cells["estimator"].iloc[0])


def improved(inputs: ReportInputs) -> pd.DataFrame | None:
    """Errors after smoothing by a disc: d2_px, d1_px, sigma_dn, and the errors in percent."""
    cells = _of_udacity(denoised_cells(inputs), inputs, frame_records.DENOISED_FILE)
    selected = cells[(cells["filter_px"] > 0) & (cells["target_sigma_dn"] > 0)]
    return (
        selected.rename(columns={"filter_px": "d2_px", "kernel_size_px": "d1_px", "target_sigma_dn": "sigma_dn"})
        if len(selected)
        else None
    )


def direction_ap(inputs: ReportInputs) -> pd.DataFrame | None:
    """AP of cars by noise, direction and length: of YOLOv7 where it has run, else of the first detector that has.

    Returns:
        sigma_dn, angle_deg, size_px, ap_percent.
    """
    results = [
        one for one in detection_results.read(inputs) if one.directions is not None and DIRECTION_LABEL in one.labels
    ]
    if not results:
        return None
    chosen = next((one for one in results if one.detector == "yolov7"), results[0])
    assert chosen.directions is not None
    selected = chosen.directions[chosen.directions["label"] == DIRECTION_LABEL]
    return selected.rename(columns={"target_sigma_dn": "sigma_dn"}).assign(measured_on=chosen.dataset)


def published_coefficients(inputs: ReportInputs) -> pd.DataFrame:
    """The published coefficients, each with a fifth of its printed standard deviation as tolerance.

    They are fitted to a grid that is printed to 0.1 points, which moves them by up to an eighth of it.
    """
    coefficients = published_table(inputs.paper / "regression_coefficients.csv")
    return coefficients.assign(tolerance=(STD_DEV_FRACTION * coefficients["std_dev"]).fillna(0.0))
