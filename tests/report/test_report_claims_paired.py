"""Claims that compare cells of the same frames or scenes: by paired differences, each measurement once."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from report_makers import ABSENT, REPO

from pipeline.camera import mtf
from pipeline.cluster_intervals import bias_corrected
from pipeline.experiments.condition import SHARP
from pipeline.experiments.intervals import robust_median
from pipeline.report.claims import of_blur, of_detection, paired_blur, paired_precision
from pipeline.report.claims.claim import CONTRADICTED, PARTLY, SUPPORTED, UNDECIDED, Evidence, Measurement
from pipeline.report.detection_results import Results
from pipeline.report.inputs import ReportInputs
from pipeline.streams import stream

NOTHING = ReportInputs(paper=REPO / "data/paper", absent=ABSENT)
RECORDED = dataclasses.replace(NOTHING, recorded=REPO / "reports/recorded")
FRAMES = 8


def estimates(
    errors: dict[tuple[str, str, float], float], frames: int = FRAMES, dataset: str = "kitti"
) -> pd.DataFrame:
    """Estimates that err by how hard a frame is, from 0 to 0.35, plus an error of estimator, blur and size."""
    rows = [
        (dataset, *key, 0.0, f"f{frame}", 0, axis, frequency, 0.5, 0.5 + 0.05 * frame + error)
        for key, error in errors.items()
        for frame in range(frames)
        for axis in "HV"
        for frequency in mtf.FREQUENCIES
    ]
    columns = ["measured_on", "estimator", "blur_kind", "kernel_size_px", "angle_deg", "frame", "patch", "axis"]
    return pd.DataFrame(rows, columns=[*columns, "frequency", "true_mtf", "mtf"])


def blur_evidence(table: pd.DataFrame, amae_percent: float = 20.0) -> Evidence:
    """Evidence of these estimates; what tables say beside them does not decide."""
    evidence = Evidence(NOTHING)
    evidence.blur = paired_blur.cells(table)
    keys = table[["measured_on", "estimator", "blur_kind", "kernel_size_px"]].drop_duplicates()
    evidence.amae = keys.assign(dataset="kitti", paper=1.0, amae_percent=amae_percent)
    return evidence


def measure(name: str, evidence: Evidence, **options: object) -> Measurement:
    functions = of_blur.MEASURES | of_detection.MEASURES
    measured = functions[name](evidence, **options)
    assert measured is not None
    return measured


def test_frames_that_are_hard_for_every_estimator_do_not_hide_which_is_better() -> None:
    """Two points less on every frame: the intervals of both AMAE overlap widely, that of the difference excludes 0."""
    errors = {("cnn", "defocus", 3.0): 0.02, ("pmp", "defocus", 3.0): 0.04, ("gbb", "defocus", 3.0): 0.05}
    errors |= {("cnn", "defocus", 7.0): 0.04, ("pmp", "defocus", 7.0): 0.02, ("gbb", "defocus", 7.0): 0.09}
    measured = measure("network_is_best", blur_evidence(estimates(errors)))
    assert measured.text.startswith("1 for, 1 against, of 2 cells.") and measured.verdict == PARTLY


def test_estimators_are_compared_on_the_frames_that_both_have() -> None:
    """The network errs less, but ran on four more frames that are harder."""
    network = estimates({("cnn", "defocus", 3.0): 0.02}, frames=2 * FRAMES)
    rest = estimates({("pmp", "defocus", 3.0): 0.04, ("gbb", "defocus", 3.0): 0.04})
    assert measure("network_is_best", blur_evidence(pd.concat([network, rest]))).verdict == SUPPORTED


def test_a_difference_is_that_of_the_amae_with_frames_resampled_together() -> None:
    generator = stream(0, "paired blur")
    table = estimates({("pmp", "linear_motion", 3.0): 0.1, ("pmp", "linear_motion", 11.0): 0.0}, frames=5)
    table["mtf"] += generator.normal(scale=0.02, size=len(table))
    first, second = paired_blur.cells(table).values()
    low, high = paired_blur.difference(first, second, 0, ("test",))
    every = np.indices((5,) * 5).reshape(5, -1).T  # five frames: all resamples
    drawn = [
        float(mtf.amae(robust_median(first.estimates[pick]), first.truth).mean())
        - float(mtf.amae(robust_median(second.estimates[pick]), second.truth).mean())
        for pick in every
    ]
    value = float(mtf.amae(robust_median(first.estimates), first.truth).mean())
    value -= float(mtf.amae(robust_median(second.estimates), second.truth).mean())
    np.testing.assert_allclose((low, high), bias_corrected(np.array(drawn), value, 5), rtol=1e-9)


@pytest.mark.parametrize(("small", "large", "verdict"), [(0.05, 0.02, SUPPORTED), (0.02, 0.05, CONTRADICTED)])
def test_amae_over_size(small: float, large: float, verdict: str) -> None:
    evidence = blur_evidence(estimates({("pmp", "linear_motion", 3.0): small, ("pmp", "linear_motion", 11.0): large}))
    options = {"blur": "linear_motion", "estimators": ["pmp"], "first_px": 3.0, "then_px": 11.0, "rises": False}
    measured = measure("amae_over_size", evidence, **options)
    assert measured.verdict == verdict and "20.0 % at 3 px and 20.0 % at 11 px" in measured.text


def test_defocus_is_easiest_where_it_is_easier_than_each_motion() -> None:
    errors = {
        ("cnn", "defocus", 3.0): 0.02,
        ("cnn", "linear_motion", 3.0): 0.04,
        ("cnn", "nonlinear_motion", 3.0): 0.05,
    }
    errors |= {
        ("cnn", "defocus", 7.0): 0.04,
        ("cnn", "linear_motion", 7.0): 0.06,
        ("cnn", "nonlinear_motion", 7.0): 0.01,
    }
    measured = measure("defocus_is_easiest", blur_evidence(estimates(errors)))
    assert measured.text.startswith("1 for, 1 against, of 2 dataset-size pairs.")


def test_sharp_frames_by_the_difference_of_medians_at_one_frequency() -> None:
    evidence = blur_evidence(
        estimates({("cnn", SHARP, 0.0): 0.03, ("pmp", SHARP, 0.0): -0.03, ("gbb", SHARP, 0.0): 0.03})
    )
    rows = [(name, 0.3, 0.9) for name in ("cnn", "pmp", "gbb")]
    evidence.sharp = pd.DataFrame(rows, columns=["estimator", "frequency", "mtf"]).assign(measured_on="kitti")
    assert measure("sharp_frames", evidence).text.startswith("1 for, 0 against, of 2 dataset-estimator pairs.")


def test_records_give_the_paired_differences_of_table_one() -> None:
    evidence = Evidence(RECORDED)
    options = {"blur": "linear_motion", "estimators": ["pmp", "gbb"], "first_px": 3, "then_px": 11, "rises": False}
    measured = measure("amae_over_size", evidence, **options)
    assert measured.text.startswith("6 for, 0 against, of 6 dataset-estimator pairs.") and measured.verdict == SUPPORTED


def results(
    detector: str = "yolox", *, draws: bool = True, scatter: float = 0.0, blur: str = "linear_motion"
) -> Results:
    """Sharp, noisy, blurred and both; scenes make all conditions good or bad together."""
    ap = {(0.0, 0.0): 80.0, (0.0, 25.0): 75.0, (21.0, 0.0): 60.0, (21.0, 25.0): 58.0}
    rows = [
        {"label": "car", "blur_kind": blur if size else SHARP, "kernel_size_px": size, "angle_deg": 0.0,
         "target_sigma_dn": level, "sigma_dn": level, "mtf": 1 - size / 30, "ap_percent": value, "scenes": 30,
         "objects": 50}
        for (size, level), value in ap.items()
    ]  # fmt: skip
    shared = stream(0, "scenes").normal(scale=10.0, size=400)
    single = stream(0, "conditions").normal(scale=scatter, size=(4, 400))
    drawn = np.clip(np.array(list(ap.values()))[:, None] + shared - shared.mean() + single, 0, 100)
    nothing = pd.DataFrame({"label": [], "count": []})
    return Results("kitti", detector, pd.DataFrame(rows), nothing, nothing, draws={"car": drawn} if draws else {})


def sweep_evidence(*each: Results) -> Evidence:
    evidence = Evidence(NOTHING)
    evidence.detection = list(each)
    return evidence


def test_ap_falls_by_the_difference_on_the_same_scenes() -> None:
    """AP scatters by 10 points over scenes, its difference by less than 1."""
    for cause in ("noise", "blur"):
        measured = measure("falls", sweep_evidence(results(scatter=0.5)), cause=cause)
        assert measured.verdict == SUPPORTED and measured.text.startswith("1 for, 0 against, of 1 comparison.")
    assert measure("both_cost_more", sweep_evidence(results(scatter=0.5))).verdict == SUPPORTED
    assert measure("falls", sweep_evidence(results(scatter=20.0)), cause="noise").verdict == UNDECIDED
    assert measure("falls", sweep_evidence(results(draws=False)), cause="noise").verdict == UNDECIDED


def test_points_that_two_sweeps_share_count_once() -> None:
    """The same sharp frames belong to the sweep over motion and to that over defocus."""
    both = sweep_evidence(results(), results(blur="defocus"), results("compact"))
    assert "of 2 comparisons. Mean AP 80 to 75 %." in measure("falls", both, cause="noise").text
    assert "of 3 comparisons. Mean AP 80 to 60 %." in measure("falls", both, cause="blur").text


def test_recorded_surfaces_give_the_paired_differences_of_ap() -> None:
    """Every point of the records is alone in its bin; persons lose 39.9 points under 25 DN."""
    evidence = Evidence(RECORDED)
    assert all(np.isfinite(sweep.draws).any(axis=1).all() for sweep in evidence.sweeps)
    persons = next(sweep for sweep in evidence.sweeps if sweep.label == "person")
    value, low, high = persons.difference((0.0, 25.0), (0.0, 0.0))
    assert (round(value, 1), round(low, 1), round(high, 1)) == (-39.9, -59.3, -17.9)
    assert all(map(math.isnan, persons.difference((0.0, 25.0), (0.0, 3.0))))
    measured = measure("falls", evidence, cause="noise")
    assert measured.text.startswith("2 for, 0 against, of 2 comparisons. Mean AP 76 to 42 %.")


def test_bins_that_two_surfaces_share_count_once() -> None:
    measured = measure("not_monotonic", Evidence(RECORDED))
    assert measured.text.startswith("0 for, 0 against, of 4 surfaces. 1 of 42 bins")  # of 48, 6 of them twice


def test_equal_rows_of_other_classes_are_other_measurements() -> None:
    rows = [
        dict(zip(paired_precision.WHO, ("sim", "compact", label), strict=True)) for label in ("car", "car", "person")
    ]
    assert list(paired_precision.distinct(rows)["label"]) == ["car", "person"] and paired_precision.distinct([]).empty


def test_policies_that_drive_alike_count_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the first scenario both policies have the same differences, in the second they differ."""

    def scenario(name: str, points: dict[str, float]) -> SimpleNamespace:
        def difference(policy: str, other: str) -> tuple[float, float, float]:
            return points[policy], points[policy] - 1, points[policy] + 1

        return SimpleNamespace(name=name, is_demanding=True, difference=difference)

    alike = scenario("ramp", {"iopc_optimal": 3.0, "iopc_continuous": 3.0})
    apart = scenario("flicker", {"iopc_optimal": 0.5, "iopc_continuous": 4.0})
    monkeypatch.setattr(of_detection, "scenario_results", lambda inputs: [alike, apart])
    measured = measure("framework_wins_elsewhere", Evidence(NOTHING))
    assert measured.text.startswith("4 for, 0 against, of 6 comparisons.")
    assert measured.text.endswith("Both policies drive alike in 1 scenario, which count once.")
