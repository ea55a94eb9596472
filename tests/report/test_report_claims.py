"""Claims: verdicts follow from intervals, every claim has a row, and what did not run names its command."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from functools import partial
from types import SimpleNamespace

import pandas as pd
import pytest
from report_makers import ABSENT, REPO

from pipeline.curves.regression import fit
from pipeline.report import training_budget
from pipeline.report.claims import of_blur, of_detection, of_noise
from pipeline.report.claims.claim import (
    CONSISTENT,
    CONTRADICTED,
    NOT_MEASURED,
    PARTLY,
    SUPPORTED,
    UNDECIDED,
    VERDICTS,
    Claim,
    Evidence,
    Measurement,
    lower,
    of_cells,
    of_number,
    verdict_of_counts,
)
from pipeline.report.detection_results import Results
from pipeline.report.inputs import ReportInputs
from pipeline.report.sections import claims

NOTHING = ReportInputs(paper=REPO / "data/paper", absent=ABSENT)


@pytest.mark.parametrize(
    ("supporting", "opposing", "verdict"),
    [
        (9, 0, SUPPORTED),
        (8, 0, PARTLY),
        (0, 9, CONTRADICTED),
        (2, 2, UNDECIDED),
        (3, 2, PARTLY),
        (0, 5, CONTRADICTED),
        (1, 5, PARTLY),
        (0, 0, UNDECIDED),
    ],
)
def test_verdict_of_ten_cells(supporting: int, opposing: int, verdict: str) -> None:
    assert verdict_of_counts(supporting, opposing, 10) == verdict


def test_a_number_decides_where_its_interval_lies_on_one_side() -> None:
    for low, high, above, below in ((6, 8, SUPPORTED, CONTRADICTED), (4, 6, UNDECIDED, UNDECIDED)):
        assert of_number(6.0, low, high, 5.0, "", ["sim"]).verdict == above
        assert of_number(6.0, low, high, 5.0, "", ["sim"], above=False).verdict == below
    assert of_number(6.0, 6.0, 6.0, 5.0, "", ["sim", "sim"]).on == "Sim"
    assert of_cells(pd.DataFrame(), "cell", []) is None


def test_with_nothing_run_every_claim_names_its_command() -> None:
    inputs = dataclasses.replace(NOTHING, stages=None)
    pairs = claims.measurements(inputs)
    assert len(pairs) >= 25
    assert {measured.verdict for _, measured in pairs} == {NOT_MEASURED}
    recorded = "Not run: camera-monitor record noise --pairs "
    assert all(measured.text.startswith(("Not run: dvc repro ", recorded)) for _, measured in pairs)
    of_real_cameras = next(measured for claim, measured in pairs if "noise of a real camera" in claim.sentence)
    assert of_real_cameras.text.startswith(recorded) and of_real_cameras.text.endswith("reports/recorded/real-noise")
    assert set(claims.MEASURES) == {claim.measure.func.__name__[1:] for claim, _ in pairs[:-4]}
    assert len({claim.sentence for claim, _ in pairs}) == len(pairs)
    assert all(claim.reservation and claim.source for claim, _ in pairs)


@pytest.mark.parametrize(
    ("pca_s", "bf_s", "verdict"),
    [
        (0.002, 0.005, SUPPORTED),
        (0.003, 0.004, CONTRADICTED),
        (0.001, 0.006, CONTRADICTED),
        (0.003, 0.006, CONTRADICTED),
    ],
)
def test_published_times_hold_where_they_do_for_both_estimators(pca_s: float, bf_s: float, verdict: str) -> None:
    evidence = Evidence(NOTHING)
    evidence.run_times = {"pca": pca_s, "bf": bf_s}
    measured = of_blur.MEASURES["published_times"](evidence)
    assert measured is not None and measured.verdict == verdict
    assert measured.text.startswith(f"PCA {1e3 * pca_s:.2f} ms, B+F {1e3 * bf_s:.2f} ms")
    del evidence.run_times["pca"]
    assert of_blur.MEASURES["published_times"](evidence) is None


def test_one_is_lower_where_the_intervals_do_not_overlap() -> None:
    first = pd.DataFrame({"low_percent": [1.0, 1.0, 5.0], "high_percent": [2.0, 4.0, 6.0]}, index=list("abc"))
    second = pd.DataFrame({"low_percent": [3.0, 3.0, 3.0], "high_percent": [4.0, 5.0, 4.0]}, index=list("abc"))
    both = lower(first, second)
    assert both["supports"].tolist() == [True, False, False] and both["opposes"].tolist() == [False, False, True]


@pytest.mark.parametrize(
    ("pmp_s", "gbb_s", "verdict"), [(9.0, 6.0, SUPPORTED), (9.0, 4.0, UNDECIDED), (3.0, 4.0, CONTRADICTED)]
)
def test_the_network_is_many_times_faster_where_both_programs_take_fifty_times_as_long(
    pmp_s: float, gbb_s: float, verdict: str
) -> None:
    evidence, least, most = Evidence(NOTHING), 10 * min(pmp_s, gbb_s), 10 * max(pmp_s, gbb_s)
    evidence.run_times = {"cnn_mtf": 0.1, "pmp": pmp_s, "gbb": gbb_s}
    measured = of_blur.MEASURES["many_times_faster"](evidence)
    assert measured is not None and (measured.verdict, measured.value) == (verdict, pytest.approx(least))
    assert measured.text.startswith(f"{least:.1f} and {most:.1f} times: 100 ms")


def test_noise_prevents_estimation_by_the_papers_estimators_not_by_ours() -> None:
    """The paper's network fails in two cells and has no interval in a third; ours, which is not counted, does not."""
    cells = [("cnn", 10.0, 20.0), ("cnn", 25.0, 40.0), ("cnn", 15.0, 30.0), ("spectral", 10.0, 2.0)]
    table = pd.DataFrame(cells, columns=["estimator", "target_sigma_dn", "amae_percent"])
    table = table.assign(low_percent=table["amae_percent"] - 1, high_percent=table["amae_percent"] + 1)
    table.loc[2, ["low_percent", "high_percent"]] = math.nan
    evidence = Evidence(NOTHING)
    evidence.combined = table.assign(
        dataset="kitti", experiment="defocus_dcsn", kernel_size_px=3.0, filter_px=0.0, calibrated=False
    )
    prevents = partial(of_noise.MEASURES["prevents"], experiment="defocus_dcsn")
    measured = prevents(evidence)
    assert measured is not None and measured.verdict == SUPPORTED
    assert measured.text.startswith("2 for, 0 against, of 2 cells. Of the paper's estimators.")
    assert measured.text.endswith("Ours, not counted (Spectral): 0 for, 1 against, of 1.")
    evidence.combined = evidence.combined.assign(low_percent=math.nan, high_percent=math.nan)
    measured = prevents(evidence)
    assert measured is not None and measured.verdict == UNDECIDED and measured.text.startswith("No cell of the paper's")


def test_mean_amae_is_stated_with_the_levels_that_it_is_of() -> None:
    """The network is known up to 25 DN, PMP up to 15 DN, GBB at 5 DN only."""
    cells = [("cnn", 0.0, 4.0), ("cnn", 15.0, 9.0), ("cnn", 25.0, 8.0), ("gbb", 5.0, 3.0)]
    cells += [("pmp", 0.0, 5.0), ("pmp", 15.0, 6.0), ("pmp", 25.0, math.nan), ("spectral", 0.0, 1.0)]
    table = pd.DataFrame([*cells, ("spectral", 25.0, 2.0)], columns=["estimator", "target_sigma_dn", "amae_percent"])
    evidence = Evidence(NOTHING)
    evidence.combined = table.assign(
        dataset="kitti", experiment="photon_defocus", kernel_size_px=3.0, filter_px=0.0, low_percent=0.0,
        high_percent=1.0,
    )  # fmt: skip
    measured = of_noise.MEASURES["prevents"](evidence, experiment="photon_defocus")
    assert measured is not None
    levels = "from 0 to 25 DN: CNN 4.0 to 8.0 %, Spectral 1.0 to 2.0 %; at 5 DN: GBB 3.0 %; from 0 to 15 DN: PMP 5.0 to"
    assert f"Mean AMAE {levels} 6.0 %." in measured.text


def test_intervals_decide_claims_on_noise_not_the_values_within_them() -> None:
    """Of 12 % [8, 16] it is not known whether it exceeds 10 %."""
    evidence = Evidence(NOTHING)
    rows = [(12.0, 8.0, 16.0), (12.0, 11.0, 13.0), (6.0, 5.0, 7.0), (90.0, 80.0, 99.0), (3.0, 2.0, 4.0)]
    evidence.combined = pd.DataFrame(rows, columns=["amae_percent", "low_percent", "high_percent"]).assign(
        dataset="kitti", experiment="photon_defocus", estimator="cnn", kernel_size_px=3.0, filter_px=0.0,
        target_sigma_dn=15.0,
    )  # fmt: skip
    prevents = of_noise.MEASURES["prevents"](evidence, experiment="photon_defocus")
    assert prevents is not None and prevents.text.startswith("2 for, 2 against, of 5 cells.")
    below = of_noise.MEASURES["defocus_under_photon_noise"](evidence)  # the paper's are at most 5.6 %
    assert below is not None and below.text.startswith("1 for, 3 against, of 5 cells.")


def test_estimates_follow_noise_where_their_interval_lies_within_two_grey_levels() -> None:
    """Too low, right, too high, right on average only."""
    ends = [(5.0, 4.0, 6.0), (10.5, 9.5, 11.5), (14.0, 13.0, 15.0), (10.0, 7.0, 11.0)]
    table = pd.DataFrame(ends, columns=["median_dn", "low_dn", "high_dn"]).assign(
        dataset="kitti", estimator="pca", unclipped_median_dn=10.0
    )
    inputs = SimpleNamespace(result_with_records=lambda name: table)
    measured = of_noise.MEASURES["follows"](SimpleNamespace(inputs=inputs))
    assert measured.text.startswith("1 for, 2 against, of 4 cells. Median less noise added: PCA -5.0 to +4.0 DN.")


def test_noise_of_real_cameras_is_followed_where_the_error_is_certainly_within_a_quarter(tmp_path) -> None:
    ends = [(1.0, 0.5, 2.0), (2.4, 2.0, 3.0), (4.0, 3.0, 5.0)]
    table = pd.DataFrame(ends, columns=["true_mae_dn", "true_mae_low_dn", "true_mae_high_dn"])
    (tmp_path / "real-noise").mkdir()
    table.assign(dataset="cc", estimator="pca", true_mean_dn=10.0).to_csv(
        tmp_path / "real-noise/noise_summary.csv", index=False
    )
    inputs = SimpleNamespace(recorded=tmp_path)
    measured = of_noise.MEASURES["real_cameras"](SimpleNamespace(inputs=inputs))
    assert measured.text.startswith("1 for, 1 against, of 3 dataset-estimator pairs.")


@pytest.mark.parametrize("column", ["median", "change_low"])
def test_a_curve_that_is_unknown_with_the_strongest_noise_is_left_out(column: str) -> None:
    """The network's curve at 25 DN is unknown: that at 15 DN must not stand for it."""
    rows = [
        (dataset, name, level, 0.1 + level / 100, 0.0, 1.0, level / 100 - 0.01, level / 100 + 0.01)
        for dataset, name in (("kitti", "cnn"), ("udacity", "cnn"))
        for level in (25.0, 0.0, 15.0)
    ]
    columns = ["dataset", "estimator", "target_sigma_dn", "median", "minimum", "maximum", "change_low", "change_high"]
    table = pd.DataFrame(rows, columns=columns).assign(
        experiment="photon_linear", calibrated=False, filter_px=0.0, axis="HV", frequency_index=4
    )
    inputs = SimpleNamespace(result_with_records=lambda name: table)
    whole = of_noise.MEASURES["overestimates"](SimpleNamespace(inputs=inputs))
    ends = "from 0 to 25 DN: CNN on KITTI 0.10 to 0.35, CNN on Udacity 0.10 to 0.35."
    assert whole.text.startswith("2 for, 0 against, of 2 curves.") and ends in whole.text
    table.loc[0, column] = math.nan
    measured = of_noise.MEASURES["overestimates"](SimpleNamespace(inputs=inputs))
    assert measured.text.startswith("1 for, 0 against, of 1 curve.") and measured.on == "Udacity"
    assert "from 0 to 25 DN: CNN on Udacity 0.10 to 0.35. Left out, no estimate with the least" in measured.text
    assert "interval of the change: CNN on KITTI." in measured.text and "KITTI 0." not in measured.text
    table.loc[3, ["change_low", "change_high"]] = -0.01, 0.5  # the interval of the change includes 0
    assert of_noise.MEASURES["overestimates"](SimpleNamespace(inputs=inputs)).verdict == UNDECIDED
    table.loc[3, column] = math.nan
    measured = of_noise.MEASURES["overestimates"](SimpleNamespace(inputs=inputs))
    assert measured.verdict == UNDECIDED and measured.text.startswith("Left out")


def test_improved_estimation_on_recorded_frames_decides_claims_on_noise_and_on_smoothing() -> None:
    evidence = Evidence(dataclasses.replace(NOTHING, recorded=REPO / "reports/recorded"))
    for measured in (
        of_noise.MEASURES["smoothing"](evidence),
        of_noise.MEASURES["prevents"](evidence, experiment="linear_dcsn"),
    ):
        assert measured is not None and "Udacity" in measured.on
        assert "Of the paper's estimators." in measured.text


def test_an_unweighted_r2_stands_beside_the_papers_and_decides_nothing() -> None:
    """Weighted the fit has another R²; one of fewer cells than terms has none."""
    fitted = pd.DataFrame({"iso": [100.0, 200.0, 300.0, 400.0] * 3, "exposure_ms": [1.0] * 4 + [2.0] * 4 + [4.0] * 4})
    fitted = fitted.assign(label="bicycle", ap_percent=fitted["iso"] / 10 + fitted["exposure_ms"] ** 2)
    terms = pd.DataFrame({"label": "bicycle", "term": ["c1", "c2", "c3"]})
    nothing, fits = pd.DataFrame(), {"car": {"r2": None}, "person": {}}
    evidence = Evidence(NOTHING)
    evidence.detection = [
        Results("sim", "compact", nothing, nothing, nothing, fitted=fitted, coefficients=terms, fits=fits)
    ]
    assert of_detection.MEASURES["regression"](evidence) is None
    evidence.detection[0].fits["bicycle"] = {"r2": 0.123}
    measured = of_detection.MEASURES["regression"](evidence)
    r2 = fit(fitted["iso"], fitted["exposure_ms"], fitted["ap_percent"], terms=["c1", "c2", "c3"]).r2
    assert measured is not None and measured.verdict == UNDECIDED
    assert measured.text.startswith(f"Unweighted R² of 1 fit: {r2:.3f} to {r2:.3f}; ") and "0.123" not in measured.text
    assert "the lower of the paper's two, 0.960" in measured.text


@pytest.mark.parametrize(("miss", "verdict"), [(0.06, CONSISTENT), (0.2, CONTRADICTED)])
def test_the_paper_s_numbers_among_themselves_are_consistent_not_supported(miss, verdict, tmp_path) -> None:
    (tmp_path / "refit").mkdir()
    (tmp_path / "refit/fits.json").write_text(json.dumps({"one": {"largest_miss_of_grid": miss}}))
    measured = of_detection.MEASURES["grid"](Evidence(dataclasses.replace(NOTHING, data=tmp_path)))
    assert measured is not None and measured.verdict == verdict and measured.value == miss


@pytest.mark.parametrize(("after", "verdict"), [(0.5, PARTLY), (0.1, CONTRADICTED)])
def test_one_view_without_an_interval_supports_a_claim_in_part_at_most(after, verdict, tmp_path) -> None:
    steps = pd.DataFrame({"step": ["corrupted", "final"], "detection_score": [0.2, after]})
    steps = steps.assign(example="sim_yolov4_car")
    (tmp_path / "worked_examples").mkdir()
    steps.to_parquet(tmp_path / "worked_examples/steps.parquet")
    measured = of_detection.MEASURES["trade"](Evidence(dataclasses.replace(NOTHING, data=tmp_path)))
    assert measured is not None and measured.verdict == verdict


RECORDS = dataclasses.replace(
    NOTHING,
    weights=REPO / "data/weights",
    recorded=REPO / "reports/recorded",
    benchmarks={"estimators": REPO / "benchmarks/results/estimators.json"},
)


@pytest.fixture(scope="module")
def pairs() -> list[tuple[Claim, Measurement]]:
    """Claims by the records of the repository, whose intervals take seconds."""
    return claims.measurements(RECORDS)


def test_the_records_of_the_repository_decide_claims_and_the_table_shows_them(
    pairs: list[tuple[Claim, Measurement]],
) -> None:
    measured = [one for _, one in pairs if one.verdict != NOT_MEASURED]
    assert len(measured) >= 8 and {one.verdict for one in measured} <= set(VERDICTS)
    for one in measured:
        assert math.isnan(one.low) or one.low <= one.value <= one.high
    table = claims.claims_table(pairs)
    assert len(table.rows) == len(pairs) and table.columns[-1].name == "reservation"
    assert [row["verdict"] for row in table.rows] == [one.verdict for _, one in pairs]
    assert claims.finding(pairs).startswith(f"Of {len(pairs)} claims")


def test_claims_on_the_papers_networks_carry_the_share(pairs: list[tuple[Claim, Measurement]]) -> None:
    texts = {claim.tasks: [] for claim, _ in claims.measurements(NOTHING)}
    for claim, measured in pairs:
        texts[claim.tasks].append(measured.text)
    for task, network in (("blur", "mtf_cnn"), ("noise", "sigma_cnn")):
        share = training_budget.rounded_up(training_budget.percents(RECORDS)[network])
        named = f"CNN (at most {share} % of the paper’s samples)"
        assert sum(named in text for text in texts[task,]) >= 1
        assert not [text for text in texts[task,] if re.search(r"(?<!R-)CNN", text.replace(named, ""))]
