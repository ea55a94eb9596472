"""The ledger: verdicts, scores, and that no published number is ever left out."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_makers import ABSENT, REPO

from pipeline import store
from pipeline.errors import InputError
from pipeline.report.inputs import ReportInputs, published_table
from pipeline.report.ledger import sources as ledger_sources
from pipeline.report.ledger.causes import _lens
from pipeline.report.ledger.items import ITEMS, UNEXPLAINED, Source, all_rows, rows_of
from pipeline.report.ledger.rows import (
    CONSISTENCY,
    DEFINITION,
    EXPERIMENT,
    MATCH,
    NOT_COMPARABLE,
    NOT_RUN,
    LedgerRow,
    Tolerance,
    score,
    summary_table,
    to_table,
    tolerance_of_both,
)
from pipeline.report.tables import format_number

PAPER = REPO / "data/paper"
NOTHING = ReportInputs(paper=PAPER, absent=ABSENT)
BY_NAME = {item.name: item for item in ITEMS}


def rows_from(name: str, file: Path) -> list[LedgerRow]:
    """The rows of an item, ours being a file."""
    item = dataclasses.replace(BY_NAME[name], ours=Source(file=file.name))
    return rows_of(item, dataclasses.replace(NOTHING, data=file.parent))


def row(**changes: object) -> LedgerRow:
    return LedgerRow(**{"item": "i", "quantity": "q", "unit": "", "paper": 0.3, "tolerance": 0.05, **changes})


@pytest.mark.parametrize(
    ("ours", "verdict"),
    [(0.3, "match"), (0.35, "match"), (0.25, "match"), (0.36, "close"), (0.4, "close"), (0.401, "differs")],
)
def test_verdict_at_its_borders(ours: float, verdict: str) -> None:
    assert row(ours=ours).verdict == verdict


def test_without_ours_nothing_has_run_and_comparability_comes_before_tolerance() -> None:
    assert row().verdict == "not run"
    assert row(ours=math.inf).verdict == "not run"
    assert row(ours=0.3, comparable=False).verdict == "not comparable"


def test_tiny_published_values_are_not_swamped_by_the_rounding_allowance() -> None:
    assert row(paper=3.2e-14, ours=3.2e-14, tolerance=0.0).verdict == "match"
    assert row(paper=3.2e-14, ours=3.3e-14, tolerance=0.0).verdict == "differs"


@given(st.floats(-100, 100), st.floats(-100, 100), st.floats(0, 10), st.floats(1, 5))
def test_a_wider_tolerance_never_worsens_the_verdict(paper: float, ours: float, bound: float, factor: float) -> None:
    order = ["match", "close", "differs"]
    tight, wide = (row(paper=paper, ours=ours, tolerance=bound * f).verdict for f in (1.0, factor))
    assert order.index(wide) <= order.index(tight)


def test_tolerance_takes_the_larger_bound() -> None:
    assert Tolerance(absolute=0.5, relative=0.1).around(-20.0) == 2.0
    assert Tolerance(absolute=0.5, relative=0.1).around(1.0) == 0.5


def test_score_counts_and_speaks() -> None:
    rows = [row(ours=0.3), row(ours=0.4), row(ours=9.0), row(ours=0.3, comparable=False), row()]
    rows += [row(ours=0.1, better="lower"), row(ours=0.5, better="lower")]
    evidence = score([*rows, row(ours=0.3, kind="consistency"), row(ours=9.0, kind="definition", printed=False)])
    assert evidence.sentence == (
        "Of 5 published measurements compared with ours, 1 agree within the uncertainty of both sides or, where ours "
        "has no interval, a tolerance set beforehand, in 1 the paper's method as we run it does better, on other "
        "frames, 1 are close and 2 differ."
    )
    assert evidence.rest.startswith("The ledger has 9 rows, 8 of them numbers that the paper prints.")
    assert "1 are not run and 1 cannot be compared" in evidence.rest
    assert "1 of 1 of kind consistency" in evidence.rest and "0 of 1 of kind definition" in evidence.rest
    assert evidence.metrics["not_comparable"] == 1 and evidence.metrics["total"] == 9
    assert evidence.metrics["experiment_match"] == 1 and evidence.metrics["consistency_match"] == 1
    assert score([row()]).sentence == "None of 1 published measurements has been compared yet."


def test_agreement_by_a_wide_interval_only_is_said_in_the_headline() -> None:
    near, far = row(ours=0.37, tolerance=0.2), row(ours=0.38, tolerance=0.2)
    assert (near.verdict, far.verdict) == ("match", "match") and far.far_match and not near.far_match
    evidence = score([near, far, row(ours=0.5, tolerance=0.3, kind="reference"), row(ours=9.0)])
    assert evidence.sentence.endswith(
        "Of those that agree, 1 lie more than 25 % of the published number away, within intervals that few frames make "
        "wide."
    )
    assert "Of those that agree" not in score([near]).sentence


def test_only_an_interval_shows_that_ours_is_better() -> None:
    assert row(ours=0.1, better="lower").verdict == "better" and row(ours=0.1).verdict == "differs"
    assert row(ours=0.1, better="higher").verdict == "differs"
    assert row(ours=0.31, better="lower").verdict == "match"


@given(st.floats(0, 50), st.floats(0, 2), st.floats(0, 50), st.floats(0, 10), st.floats(0, 10))
def test_within_the_tolerance_of_both_means_that_the_intervals_overlap(
    paper: float, error: float, ours: float, below: float, above: float
) -> None:
    bound = tolerance_of_both(paper, error, ours, ours - below, ours + above)
    overlap = ours - below <= paper + error + 1e-6 and paper - error <= ours + above + 1e-6
    apart = ours - below > paper + error + 1e-6 or paper - error > ours + above + 1e-6
    verdict = row(paper=paper, ours=ours, tolerance=bound).verdict
    assert overlap or verdict != "match"
    assert verdict == "match" or apart or abs(abs(ours - paper) - bound) < 1e-5


def test_the_examples_of_a_flat_tolerance_are_judged_by_intervals(tmp_path: Path) -> None:
    paper = published_table(PAPER / "blur_amae.csv")
    ours = paper[paper["dataset"] == "kitti"].copy()
    wide, narrow = ours.index[:2]
    ours["low_percent"], ours["high_percent"] = ours["amae_percent"], ours["amae_percent"]
    ours.loc[wide, ["amae_percent", "low_percent", "high_percent"]] += [5.0, 0.0, 9.0]
    ours.loc[narrow, ["amae_percent", "low_percent", "high_percent"]] += [1.9, 1.5, 2.3]
    ours.to_csv(tmp_path / "amae.csv", index=False)
    rows = rows_from("blur_amae", tmp_path / "amae.csv")
    first, second, *others = [entry for entry in rows if entry.verdict != "not run"]
    assert (first.verdict, second.verdict) == ("match", "differs")  # 5 points within, 1.9 points beyond
    assert first.tolerance == pytest.approx(5.05) and second.tolerance == pytest.approx(0.45)
    assert {entry.verdict for entry in others} == {"match"} and first.dataset == "kitti"


def test_extremes_are_not_compared_and_medians_within_what_the_printed_range_implies(tmp_path: Path) -> None:
    paper = published_table(PAPER / "uncorrupted_mtf.csv")
    ours = paper[paper["dataset"] == "kitti"].assign(low=lambda t: t["mtf"], high=lambda t: t["mtf"])
    ours.to_csv(tmp_path / "mtf.csv", index=False)
    rows = rows_from("uncorrupted_mtf", tmp_path / "mtf.csv")
    ran = [entry for entry in rows if entry.verdict != "not run"]
    assert {entry.verdict for entry in ran if ", min, " in entry.quantity} == {"not comparable"}
    medians = [entry for entry in ran if ", median, " in entry.quantity]
    assert medians and {entry.verdict for entry in medians} == {"match"}
    assert all(0.0005 < entry.tolerance < 0.05 for entry in medians)
    star = next(entry for entry in rows if "Ground truth" in entry.quantity)
    assert star.kind == "definition"


def test_numbers_that_the_paper_does_not_print_are_not_counted_as_its_numbers() -> None:
    rows = all_rows(NOTHING)
    unprinted = [entry for entry in rows if not entry.printed]
    assert {entry.item for entry in unprinted} == {"image_formation", "noise_levels", "noise_reference"}
    assert {entry.kind for entry in unprinted} == {"definition", "reference"}
    assert score(rows).printed == len(rows) - len(unprinted)


def test_every_file_of_published_numbers_is_followed_to_its_last_number() -> None:
    followed = {item.file for item in ITEMS if item.file}
    assert followed == {path.name for path in PAPER.glob("*.csv")}
    for item in ITEMS:
        if item.file:
            table = published_table(PAPER / item.file)
            numbers = int(sum(np.isfinite(pd.to_numeric(table[value])).sum() for value in item.values))
            assert len(rows_of(item, NOTHING)) == numbers
            assert not table.duplicated(list(item.keys)).any()  # keys tell the numbers apart


def test_with_nothing_run_every_row_is_there_and_says_what_would_run_it() -> None:
    rows = all_rows(NOTHING)
    assert len(rows) > 900
    assert {entry.verdict for entry in rows} == {"not run"}
    assert all(entry.line and entry.why in ("data absent", "stage absent") for entry in rows)
    kitti = next(entry for entry in rows if entry.quantity.startswith("KITTI, PMP"))
    assert (kitti.why, kitti.line) == ("data absent", ABSENT["kitti"])
    sim = next(entry for entry in rows if entry.quantity.startswith("Sim, PMP, Defocus, 3 px"))
    assert (sim.why, sim.line) == ("stage absent", "dvc repro blur@sim-pmp")


def test_a_results_table_with_the_same_keys_is_compared(tmp_path: Path) -> None:
    published = published_table(PAPER / "blur_amae.csv")
    ours = published[published["dataset"] == "kitti"].copy()
    ours["kernel_size_px"] = ours["kernel_size_px"].astype(float)  # 3.0 and 3 are the same key
    ours["amae_percent"] -= 5.0
    ours.to_parquet(tmp_path / "amae.parquet")
    rows = rows_from("blur_amae", tmp_path / "amae.parquet")
    counts = score(rows).counts
    assert (counts["match"], counts["better"], counts["not run"]) == (0, 0, 90)  # no interval shows which is better
    first = next(row for row in rows if row.quantity.startswith("KITTI"))
    assert first.difference == pytest.approx(-5.0)
    assert first.why.startswith("ours is lower, which is better; other training pictures")
    assert first.why.endswith("other frames than the paper's 150")


def test_a_difference_without_a_cause_says_that_none_is_known(tmp_path: Path) -> None:
    published = published_table(PAPER / "controller_response.csv").assign(value=-1.0)
    published.to_csv(tmp_path / "response.csv", index=False)
    rows = rows_from("controller_response", tmp_path / "response.csv")
    assert {entry.why for entry in rows} == {UNEXPLAINED}


def test_every_published_number_of_control_has_a_verdict_and_a_reason(tmp_path: Path) -> None:
    """Ours from the paper's own files, with the measured columns doubled: settings match, the rest has its cause."""
    for name in ("worked_examples", "controller_ap", "controller_response"):
        table = published_table(PAPER / f"{name}.csv")
        measured = [column for column in ("sigma_dn", "mtf_at_0.1", "detection_score") if column in table]
        table.assign(**{column: 2 * table[column] for column in measured}).to_csv(tmp_path / f"{name}.csv", index=False)
    names = ("worked_examples", "controller_ap", "controller_response")
    rows = [row for name in names for row in rows_from(name, tmp_path / f"{name}.csv")]
    assert len(rows) == 236 and NOT_RUN not in {row.verdict for row in rows}
    assert all(row.why and row.why != UNEXPLAINED for row in rows if row.verdict != MATCH)
    assert {row.verdict for row in rows if row.item == "controller_ap"} == {NOT_COMPARABLE}
    assert {row.kind for row in rows if row.item == "controller_response"} == {CONSISTENCY}
    kinds = {row.kind for row in rows if row.item == "worked_examples"}
    assert kinds == {DEFINITION, EXPERIMENT}


def test_results_without_a_key_are_refused(tmp_path: Path) -> None:
    (tmp_path / "bad.csv").write_text("estimator,seconds\npca,1\n")
    with pytest.raises(InputError, match="column 'unit' is missing"):
        rows_from("runtime", tmp_path / "bad.csv")


def test_differing_results_for_one_published_number_are_refused(tmp_path: Path) -> None:
    """Equal ones are one result; those for a number that the paper does not print are not regarded."""
    table = published_table(PAPER / "blur_amae.csv").assign(low_percent=0.0, high_percent=99.0)
    whole = rows_from("blur_amae", _written(tmp_path / "whole.csv", table))
    twice = pd.concat([table, table.iloc[:3], table.iloc[:1].assign(kernel_size_px=99)], ignore_index=True)
    other = pd.concat([twice, twice.iloc[-1:].assign(amae_percent=70.0)], ignore_index=True)
    assert rows_from("blur_amae", _written(tmp_path / "twice.csv", other)) == whole
    first = table.iloc[:1].assign(amae_percent=70.0)
    ambiguous = pd.concat([table, first], ignore_index=True)
    key = ", ".join(f"{name} {first[name].iloc[0]}" for name in BY_NAME["blur_amae"].keys)
    numbers = f"{table['amae_percent'].iloc[0]:g} ({first['dataset'].iloc[0]}) and 70 ({first['dataset'].iloc[0]})"
    with pytest.raises(InputError) as refused:
        rows_from("blur_amae", _written(tmp_path / "ambiguous.csv", ambiguous))
    words = f"results of 'blur_amae': amae_percent at {key} has 2 differing results: {numbers}; expected one"
    assert str(refused.value).startswith(words)


def _written(file: Path, table: pd.DataFrame) -> Path:
    table.to_csv(file, index=False)
    return file


def test_run_times_of_other_hardware_are_not_comparable(tmp_path: Path) -> None:
    rows = rows_from("runtime", PAPER / "runtime.csv")
    assert {entry.verdict for entry in rows} == {"not comparable"}
    assert all("hardware" in entry.why for entry in rows)


def test_sensor_constants_match_and_the_known_slip_of_the_program_differs(report_inputs: ReportInputs) -> None:
    rows = rows_of(BY_NAME["image_formation"], report_inputs)
    differing = [entry for entry in rows if entry.verdict != "match"]
    assert [entry.quantity for entry in differing] == ["source-follower noise"]
    assert "frequency step" in differing[0].why


def test_noise_levels_count_the_largest_miss(tmp_path: Path, report_inputs: ReportInputs) -> None:
    rows = rows_of(BY_NAME["noise_levels"], report_inputs)
    ran = [entry for entry in rows if entry.verdict != "not run"]
    assert len(ran) == 4 and all(entry.ours == 0 for entry in ran)
    assert len(rows) == 12  # KITTI and Udacity are listed as well
    table = pd.read_parquet(report_inputs.data / "corrupt/sim/corruption.parquet")
    table.loc[(table["noise_source"] == "photon") & (table["target_sigma_dn"] == 20), "unclipped_sigma_dn"] = 19.0
    (tmp_path / "corrupt/sim").mkdir(parents=True)
    table.to_parquet(tmp_path / "corrupt/sim/corruption.parquet")
    moved = dataclasses.replace(report_inputs, data=tmp_path)
    photon = next(entry for entry in rows_of(BY_NAME["noise_levels"], moved) if entry.quantity == "Sim, Photon")
    assert photon.ours == pytest.approx(5.0) and photon.verdict == "differs"


def test_noise_of_our_own_sim_is_not_compared_with_the_authors_frames(report_inputs: ReportInputs) -> None:
    rows = rows_of(BY_NAME["noise_reference"], report_inputs)
    sim = [entry for entry in rows if entry.quantity.startswith("Sim")]
    assert len(sim) == 10 and {entry.verdict for entry in sim} == {"not comparable"}


def test_frame_counts_are_a_choice_unless_the_paper_profile_runs(report_inputs: ReportInputs) -> None:
    def frames(inputs: ReportInputs) -> LedgerRow:
        return next(e for e in rows_of(BY_NAME["dataset_sizes"], inputs) if e.quantity.endswith("noise estimation"))

    assert frames(report_inputs).verdict == "not comparable" and frames(report_inputs).ours == 5
    assert frames(dataclasses.replace(report_inputs, profile="paper")).verdict == "differs"


def test_the_star_is_interpolated_at_the_papers_frequencies(tmp_path: Path) -> None:
    frequency = np.array([0.5, 0.1, 0.3])  # any order
    store.write_json(
        tmp_path / "star/star.json", {"frequency": frequency, "measured": 1 - frequency, "formula": 1 - frequency}
    )
    curves = ledger_sources.star_curve(dataclasses.replace(NOTHING, data=tmp_path))
    assert curves is not None
    result = ledger_sources.sharp_mtf(curves)
    assert result["mtf"].to_numpy() == pytest.approx(1 - result["frequency"].to_numpy())
    assert result["frequency"].max() == 0.5  # 0.6 lies beyond what was measured
    store.write_json(tmp_path / "star/star.json", {"frequency": [0.1], "measured": [1, 2]})
    with pytest.raises(InputError, match="equally long"):
        ledger_sources.star_curve(dataclasses.replace(NOTHING, data=tmp_path))


def test_tables_of_the_ledger_hold_every_row() -> None:
    rows = all_rows(NOTHING)
    assert len(to_table(rows).rows) == len(rows)
    assert to_table(rows).columns[0].name == "item"
    no_real_frames = {item.name: item.no_real_frames for item in ITEMS}
    summary = summary_table(rows, {item.name: item.title for item in ITEMS}, no_real_frames)
    numbers = {(line["item"], line["kind"]): int(line["numbers"]) for line in summary.rows}  # type: ignore[arg-type]
    assert sum(number for (item, _), number in numbers.items() if item == "All items") == len(rows)
    assert sum(number for (item, _), number in numbers.items() if item != "All items") == len(rows)
    assert format_number(0.0) == "0"


def test_every_measured_item_names_its_real_frames_or_why_it_has_none() -> None:
    rows = all_rows(dataclasses.replace(NOTHING, recorded=REPO / "reports/recorded"))
    titles, no_real_frames = (
        {item.name: getattr(item, part) for item in ITEMS} for part in ("title", "no_real_frames")
    )
    lines = {(line["item"], line["kind"]): line["frames"] for line in summary_table(rows, titles, no_real_frames).rows}
    measured = {key: frames for key, frames in lines.items() if key[1] == "experiment" and key[0] != "All items"}
    assert measured and all(measured.values())
    assert measured["Table I: AMAE of blur estimators", "experiment"] == "KITTI, Udacity"
    assert "no dataset has" in str(measured["Fig. built-in control and framework: AP", "experiment"])
    assert not any(frames for (item, kind), frames in lines.items() if kind == "consistency" or item == "All items")


def test_missing_published_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="image_formation.csv"):
        all_rows(ReportInputs(paper=tmp_path))


@pytest.mark.parametrize(
    ("ours", "paper", "remaining", "named"),
    [
        (12.0, 4.0, 5.0, True),  # seven of eight points are the lens's
        (12.0, 4.0, 9.0, False),  # three of eight
        (3.0, 8.0, 2.0, False),  # nothing is to be explained by a lens
    ],
)
def test_a_lens_is_a_cause_of_an_error_above_the_papers_that_it_explains(
    ours: float, paper: float, remaining: float, named: bool
) -> None:
    kernel = {"estimator": "cnn", "blur_kind": "defocus", "kernel_size_px": 7.0}
    cells = pd.DataFrame([{**kernel, "calibrated": True, "amae_percent": remaining}])
    words = _lens({**kernel, "ours": ours, "paper": paper}, SimpleNamespace(summary=cells))
    assert words.startswith(f"the camera's lens: {remaining:.1f} % remain") == named and bool(words) == named
