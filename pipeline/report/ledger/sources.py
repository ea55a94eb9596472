"""Our side of the ledger: tables with the key and value columns of its items (``ledger.yaml``).

Each function gives a table, empty or None where its stage has not run and nothing was recorded; ``measured_on`` names
the dataset where that is not the column ``dataset``.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from pipeline import tables
from pipeline.camera.mtf import FREQUENCIES
from pipeline.errors import InputError
from pipeline.experiments.condition import SHARP
from pipeline.experiments.intervals import median_error_of_range
from pipeline.experiments.recorded import blur as blur_records
from pipeline.experiments.recorded.frames import folders_with
from pipeline.experiments.sharp_curves import NOMINAL_FREQUENCIES, sharp_curves
from pipeline.report import detection_results
from pipeline.report.display_names import PAPER_NAMES
from pipeline.report.inputs import ReportInputs, published_table
from pipeline.report.tables import ordered, records, where

PAPER_EFFECTS = ("photon", "dcsn", "readout", "combined")
COMBINED_DATASET, NETWORK, COMBINED_ESTIMATOR = "udacity", "cnn", "spectral"
"""All that the paper prints of blur and noise at once is of its network on Udacity; without it, ours is the second."""

PAPER_FRAMES = 150


def formation(inputs: ReportInputs) -> pd.DataFrame | None:
    """Constants and moments of our sensor: quantity, value."""
    numbers = inputs.read("sensor/formation.json")
    if numbers is None:
        return None
    if not isinstance(numbers, dict) or not all(isinstance(value, (int, float)) for value in numbers.values()):
        expected = "expected one JSON object that maps quantities to numbers; run the stage again"
        raise InputError(f"{inputs.data}/sensor/formation.json: {expected}")
    return pd.DataFrame({"quantity": list(numbers), "value": [float(value) for value in numbers.values()]})


def levels(inputs: ReportInputs) -> pd.DataFrame | None:
    """Largest deviation of the noise added from its target level: dataset, noise_source, miss_percent.

    The standard deviation is taken over a frame before the 8-bit range clips it; level 0 must be exact.
    """
    parts = list(inputs.each("corrupt", "corruption.parquet", tables.CORRUPTION).values())
    if not parts:
        return None
    rows = pd.concat(parts, ignore_index=True)
    miss = (rows["unclipped_sigma_dn"] - rows["target_sigma_dn"]).abs() / rows["target_sigma_dn"].clip(lower=1.0)
    groups = rows.assign(miss_percent=100.0 * miss).groupby(["dataset", "noise_source"], as_index=False)
    return groups[["miss_percent"]].max()


def expected_levels(inputs: ReportInputs) -> pd.DataFrame:
    """No deviation, as the paper's scaling of the noise promises: the published side of `levels`.

    Datasets that have not run are listed with the paper's effects.
    """
    selected = levels(inputs)
    ran = [] if selected is None else records(selected)
    absent = [name for name in inputs.datasets if name not in {row["dataset"] for row in ran}]
    rows = [(row["dataset"], row["noise_source"]) for row in ran]
    rows += [(dataset, noise_source) for dataset in absent for noise_source in PAPER_EFFECTS]
    pairs = pd.DataFrame(rows, columns=["dataset", "noise_source"])
    return ordered(pairs, dataset=inputs.datasets).assign(miss_percent=0.0)  # stable: effects keep their order


def sizes(inputs: ReportInputs) -> pd.DataFrame | None:
    """Frames and patches of each dataset: dataset, quantity, value."""
    rows: list[tuple[str, str, float]] = []
    for dataset, frames in inputs.each("index", "frames.parquet", tables.FRAMES).items():
        if len(frames):
            rows.append((dataset, "frames_noise", len(frames)))
            rows += [(dataset, name, frames[name].median()) for name in ("width_px", "height_px")]
    for dataset, patches in inputs.each("index", "patches.parquet", tables.PATCHES).items():
        per_frame = where(patches, purpose="noise").groupby("frame").size()
        rows.append((dataset, "frames_blur", where(patches, purpose="blur")["frame"].nunique()))
        rows += [(dataset, "noise_patches_per_frame", per_frame.median())] if len(per_frame) else []
    return pd.DataFrame(rows, columns=["dataset", "quantity", "value"])


def noise_summary(inputs: ReportInputs) -> pd.DataFrame | None:
    """`pipeline.tables.NOISE_SUMMARY` of every noise estimator, records among them."""
    return _with_records(inputs.result("noise_summary"), [inputs.recorded_result("noise_summary")])


def star_curve(inputs: ReportInputs) -> dict[str, np.ndarray] | None:
    """Sim's star: ``frequency`` as fraction of Nyquist, ``measured`` and ``formula``, each (K,).

    Raises:
        InputError: a curve is missing or of another length.
    """
    content = inputs.read("star/star.json")
    if content is None:
        return None
    names = ("frequency", "measured", "formula")
    curves = {name: np.asarray(content.get(name, []), dtype=float) for name in names}
    if len({values.shape for values in curves.values()}) != 1 or not curves["frequency"].size:
        expected = f"expected equally long lists {', '.join(names)}; run the stage again"
        raise InputError(f"{inputs.data}/star/star.json: {expected}")
    return curves


def lenses(inputs: ReportInputs) -> dict[str, np.ndarray]:
    """Dataset -> (8,) MTF of its lens and pixels at `pipeline.camera.mtf.FREQUENCIES`, where it is known: our Sim's."""
    curves = star_curve(inputs)
    return {} if curves is None else {"sim": np.interp(FREQUENCIES, *_from_zero(curves))}


def _from_zero(curves: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The star's frequencies in ascending order and the MTF measured there, from one at frequency zero on."""
    order = np.argsort(curves["frequency"])
    return np.r_[0.0, curves["frequency"][order]], np.r_[1.0, curves["measured"][order]]


def sharp_mtf(curves: dict[str, np.ndarray]) -> pd.DataFrame:
    """Our Sim's ground truth at the paper's frequencies: dataset, estimator, statistic, frequency, mtf.

    The measured curve is interpolated linearly, from one at frequency zero on; frequencies beyond it are left out.
    """
    frequency, measured = _from_zero(curves)
    nominal = np.array(NOMINAL_FREQUENCIES)
    nominal = nominal[nominal <= frequency[-1] + 1e-9]
    table = pd.DataFrame({"frequency": nominal, "mtf": np.interp(nominal, frequency, measured)})
    return table.assign(dataset="sim", estimator="ground_truth", statistic="value")


def uncorrupted(inputs: ReportInputs) -> pd.DataFrame | None:
    """Horizontal MTF of uncorrupted frames, the star's and each estimator's: the columns of `sharp_mtf`."""
    ours = _horizontal(sharp_curves(inputs.noiseless("blur_estimates"), inputs.seed))
    star = star_curve(inputs)
    known = [part for part in (None if star is None else sharp_mtf(star), ours) if part is not None and len(part)]
    recorded = [_horizontal(one.as_the_paper_ran(one.sharp)) for one in blur_records.read(inputs.recorded)]
    return _with_records(pd.concat(known, ignore_index=True) if known else None, recorded)


def _horizontal(curves: pd.DataFrame) -> pd.DataFrame:
    """Horizontal curves, one row for each statistic; ``low`` and ``high`` are those of the medians."""
    ends, keys = ["low", "high"], ["dataset", "estimator", "frequency"]
    rows = where(curves, axis="H").melt([*keys, *ends], ["median", "min", "max"], "statistic", "mtf")
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
    """Table I, `pipeline.experiments.tables.BLUR_SUMMARY` of every blur estimator, raw, records among them."""
    parts = [
        inputs.noiseless("blur_summary"),
        *(one.as_the_paper_ran(one.summary) for one in blur_records.read(inputs.recorded)),
    ]
    raw = [where(part[part["blur_kind"] != SHARP], calibrated=False) for part in parts]
    return _with_records(raw[0], raw[1:])


def blur_estimates(inputs: ReportInputs) -> pd.DataFrame | None:
    """`pipeline.experiments.tables.BLUR_ESTIMATES` without noise behind the numbers of `blur_amae`, records among them.

    Records from before estimates were kept have none.
    """
    recorded = [
        blur_records.read_folder(folder).as_the_paper_ran(blur_records.estimates_of(folder))
        for folder in folders_with(inputs.recorded, blur_records.SUMMARY_FILE, blur_records.KEYS).values()
    ]
    return _with_records(inputs.noiseless("blur_estimates"), recorded)


def _with_records(ran: pd.DataFrame | None, recorded: list[pd.DataFrame]) -> pd.DataFrame | None:
    """Rows of our stages and of records under the paper's names, one of the two for each dataset and estimator.

    A run of a stage on KITTI or Udacity wins over the record. The paper's Sim is the authors' own: a record of their
    frames wins over the Sim rendered here, which cannot be compared.
    """
    parts = [part.assign(measured_on=part["dataset"]) for part in (ran, *recorded) if part is not None and len(part)]
    if not parts:
        return None
    rows = pd.concat(parts, ignore_index=True)
    is_record = np.arange(len(rows)) >= (0 if ran is None else len(ran))
    is_authors = is_record & rows["dataset"].isin(list(PAPER_NAMES)).to_numpy()
    rows = rows.assign(dataset=rows["dataset"].replace(PAPER_NAMES))
    pairs = rows["dataset"].astype(str) + " " + rows["estimator"].astype(str)
    dropped = np.where(is_record, ~is_authors & pairs.isin(pairs[~is_record]), pairs.isin(pairs[is_authors]))
    return rows[~dropped].reset_index(drop=True)


def run_times(inputs: ReportInputs) -> pd.DataFrame | None:
    """Run times as the paper's table counts them: estimator, unit, seconds (of the processor)."""
    from pipeline.report.patch_times import patch_times

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


def on_udacity(inputs: ReportInputs, name: str) -> pd.DataFrame:
    """Raw rows of blur and noise at once that stand for the paper's, of a stage or of a record.

    They are of the paper's network where it was run on all that the other estimator was run on.
    """
    rows = where(inputs.result_with_records(name), dataset=COMBINED_DATASET, calibrated=False)
    network, other = (where(rows, estimator=estimator) for estimator in (NETWORK, COMBINED_ESTIMATOR))
    return network if len(network) >= max(len(other), 1) else other


def photon_linear(inputs: ReportInputs) -> pd.DataFrame | None:
    """Curves of linear motion of 11 px in the presence of photon noise: series, sigma_dn, frequency, mtf.

    The paper's curves are means of horizontal and vertical of its diagonal kernel, as the ground truth shows.
    """
    curves = where(on_udacity(inputs, "combined_curves"), experiment="photon_linear", filter_px=0, axis="HV")
    selected = where(curves, kernel_size_px=11, angle_deg=45)
    if selected.empty:
        return None
    nominal = [NOMINAL_FREQUENCIES[index] for index in selected["frequency_index"]]
    selected = selected.assign(frequency=nominal, sigma_dn=selected["target_sigma_dn"])
    truth = where(selected, target_sigma_dn=selected["target_sigma_dn"].min())
    truth = truth.assign(series="ground_truth", sigma_dn=math.nan, mtf=truth["true_mtf"])
    ours = selected.assign(series="cnn", mtf=selected["median"])
    return pd.concat([truth, ours], ignore_index=True)[["series", "sigma_dn", "frequency", "mtf"]]


def combined_estimator(inputs: ReportInputs) -> str:
    """Estimator that stands for the paper's network in blur and noise at once; empty where none has run."""
    cells = on_udacity(inputs, "combined_blur")
    return "" if cells.empty else str(cells["estimator"].iloc[0])


def directions(inputs: ReportInputs) -> pd.DataFrame | None:
    """`pipeline.curves.directions.TABLE` of YOLOv7 where it has run, else of the first detector that has."""
    tables = [
        (one.detector != "yolov7", one.directions.assign(measured_on=one.dataset))
        for one in detection_results.read(inputs)
        if one.directions is not None and "car" in one.labels
    ]
    return min(tables, key=lambda pair: pair[0])[1] if tables else None
