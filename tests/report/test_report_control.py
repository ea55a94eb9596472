"""The report's section on control: tables, film strips, examples, surface, order study and the verdict's sentences."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import control_report_makers as made
import numpy as np
import pandas as pd
import pytest

from pipeline import store
from pipeline.control.simulation.tables import PAIRS, STEPS, SUMMARY
from pipeline.errors import InputError
from pipeline.report import style
from pipeline.report.build import build
from pipeline.report.inputs import ReportInputs
from pipeline.report.scenario_results import scenario_results
from pipeline.report.sections import closed_loop, control, control_examples, order_study
from pipeline.report.sections.closed_loop import decision_ms
from pipeline.report.spec import Figure, NotRun, Section
from pipeline.report.tables import Estimate, Table

SCENARIOS = ("dusk_drive", "standing")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> ReportInputs:
    root = made.make_all(tmp_path_factory.mktemp("control"))
    return ReportInputs(paper=made.PAPER, data=root, members={"closed_loop": SCENARIOS})


@pytest.fixture(scope="module")
def section(inputs: ReportInputs) -> Section:
    return control.section(inputs)


def _table(section: Section, name: str) -> Table:
    (table,) = [block for block in section.blocks if isinstance(block, Table) and block.name == name]
    return table


def test_every_part_is_shown_once_and_nothing_is_missing(section: Section) -> None:
    figures = [block.name for block in section.blocks if isinstance(block, Figure)]
    assert figures == [
        "control_example_1", "control_example_2", "control_response", "control_surface", "control_dusk_drive",
        "control_standing",
    ]  # fmt: skip
    assert not [block for block in section.blocks if isinstance(block, NotRun) and "Closed loop" in block.title]
    assert [run.ran for run in section.runs[:4]] == [True] * 4


def test_without_any_stage_every_part_names_its_command() -> None:
    section = control.section(ReportInputs(paper=made.PAPER, members={"closed_loop": SCENARIOS}))
    lines = {block.line for block in section.blocks if isinstance(block, NotRun)}
    assert {"dvc repro worked_examples", "dvc repro control_surface", "dvc repro closed_loop"} <= lines
    assert "dvc repro order_study" in lines and section.findings == []


def test_a_scenario_that_did_not_run_is_named(inputs: ReportInputs) -> None:
    section = control.section(dataclasses.replace(inputs, members={"closed_loop": (*SCENARIOS, "flicker")}))
    (note,) = [block for block in section.blocks if isinstance(block, NotRun) and "Flicker" in block.title]
    assert note.line == "dvc repro closed_loop@flicker"


def test_average_precision_and_regret_have_their_intervals(section: Section) -> None:
    row = next(row for row in _table(section, "control_ap").rows if row["scenario"] == "Dusk drive")
    assert row["iopc_continuous"] == Estimate(80.0, 75.0, 85.0) and row["demanding"] == "yes"
    lines = _table(section, "control_measures").rows
    ours = next(row for row in lines if row["scenario"] == "Dusk drive" and row["policy"] == "IOPC continuous")
    assert isinstance(ours["regret_percent"], Estimate) and ours["regret_percent"].value == 2.0
    assert ours["settling_frames"] == "2"
    unsettled = next(row for row in lines if row["policy"] == "Shin 2019")
    assert unsettled["settling_frames"] == "not settled" and unsettled.get("ripple_stops") is None
    assert {row.get("settling_frames") for row in lines if row["policy"] == "Oracle"} == {None}


def test_transients_that_were_not_measured_are_empty_and_not_zero_or_unsettled(tmp_path: Path) -> None:
    """A scenario of parts that are all too short; of another the brightness settled in its last frames."""
    measured = {"tunnel": ("settling_frames", "overshoot_stops", "ripple_stops"), "ramp": ("ripple_stops",)}
    for name, unknown in measured.items():
        made.make_scenario(tmp_path, name, 1000.0, 5.0, light_factor=0.1)
        path = tmp_path / f"closed_loop/{name}/summary.parquet"
        table = pd.read_parquet(path).assign(**dict.fromkeys(unknown, np.nan))
        store.write_table(path, table, SUMMARY)
    results = scenario_results(ReportInputs(paper=made.PAPER, data=tmp_path))
    rows = [row for row in closed_loop.measures(results, {}).rows if row["policy"] == "IOPC continuous"]
    cells = {row["scenario"]: [row.get(name) for name in measured["tunnel"]] for row in rows}
    assert cells == {"Tunnel": [None, None, None], "Ramp": ["2", 0.1, None]}
    (text,) = [text for text in closed_loop.findings(results) if text.startswith("Settling")]
    assert text.endswith(": 2 in ramp.")


def test_the_course_of_drives_has_intervals_over_scenarios(section: Section) -> None:
    """Exposure times fall, the gain makes up for them: settings change in every frame and never turn."""
    rows = {row["policy"]: row for row in _table(section, "control_course").rows}
    ours, fixed = rows["IOPC continuous"], rows["Fixed"]
    assert ours["scenarios"] == len(SCENARIOS)
    assert ours["writes_per_s"].value == 30.0 and ours["reversals_per_s"] == Estimate(0.0, 0.0, 0.0)
    expected = np.mean([4.0 + step for step in range(made.N_STEPS)])
    assert ours["sigma_dn"].value == expected and ours["sigma_dn"].has_interval
    assert ours["motion_px"].low < ours["motion_px"].value < ours["motion_px"].high
    assert ours["unestimated_percent"].value == 0.0 and not np.isfinite(fixed["unestimated_percent"].value)
    by_scenario = _table(section, "control_course_scenarios").rows
    assert {(row["scenario"], row["policy"]) for row in by_scenario} >= {("Dusk drive", "Oracle"), ("Standing", "Shim")}
    standing = next(row for row in by_scenario if row["scenario"] == "Standing" and row["policy"] == "Shim")
    assert standing["motion_px"] == 0.0 and not np.isfinite(standing["unestimated_percent"])


def test_paired_differences_say_which_policies_are_beaten(section: Section) -> None:
    rows = {(row["scenario"], row["policy"]): row for row in _table(section, "control_pairs").rows}
    row = rows["Dusk drive", "IOPC continuous"]
    assert row["shin2019"] == Estimate(30.0, 25.0, 35.0) and row["better"] == (
        "than Mean intensity, Fixed, Shim and Shin 2019"
    )


def test_an_interval_that_includes_zero_does_not_count_as_better(tmp_path: Path) -> None:
    made.make_scenario(tmp_path, "dusk_drive", 1000.0, 25.0)
    results = scenario_results(ReportInputs(paper=made.PAPER, data=tmp_path))
    assert not results[0].beats_all("iopc_continuous")
    (row,) = [row for row in closed_loop.pairs(results).rows if row["policy"] == "IOPC continuous"]
    assert row["better"] == "than Fixed and Shin 2019"
    assert "in 0 of 1 scenarios" in closed_loop.findings(results)[0]
    cause = "(not above Mean intensity and Shim, nor is the oracle above Mean intensity)"
    assert f"Not in: dusk drive {cause}." in closed_loop.findings(results)[0]
    rows = {row["other"]: row for row in closed_loop.losses(results).rows}
    assert set(rows) == {"Mean intensity", "Shim"}
    assert rows["Shim"]["where"] == "behind in no frame" and rows["Shim"]["oracle"].low > 0


def _without(folder: Path, *policies: str) -> None:
    """Take the rows of policies out of a scenario's tables."""
    for name, schema in (("steps", STEPS), ("summary", SUMMARY), ("pairs", PAIRS)):
        table = pd.read_parquet(folder / f"{name}.parquet")
        absent = table["policy"].isin(policies) | table.get("other", table["policy"]).isin(policies)
        store.write_table(folder / f"{name}.parquet", table[~absent].reset_index(drop=True), schema)


def test_policies_that_did_not_run_are_not_compared_but_named(tmp_path: Path) -> None:
    made.make_scenario(tmp_path, "dusk_drive", 1000.0, 5.0)
    _without(tmp_path / "closed_loop/dusk_drive", "shim", "shin2019", "oracle")
    made.make_scenario(tmp_path, "tunnel", 1000.0, 25.0)
    _without(tmp_path / "closed_loop/tunnel", "iopc_optimal", "shim", "oracle")
    results = scenario_results(ReportInputs(paper=made.PAPER, data=tmp_path))
    assert results[0].beats_all("iopc_continuous") and not results[1].beats_all("iopc_continuous")
    assert not results[1].beats_all("iopc_optimal")  # did not run
    text = closed_loop.findings(results)[0]
    assert "in 1 of 2 scenarios" in text and "Not in: tunnel (not above Mean intensity)." in text
    absent = "Shim and Shin 2019 in dusk drive; IOPC optimal and Shim in tunnel"
    assert text.endswith(f"Did not run in the closed loop, and not compared: {absent}.")


def test_without_any_rival_no_scenario_counts_as_won_or_lost(tmp_path: Path) -> None:
    made.make_scenario(tmp_path, "dusk_drive", 1000.0, 5.0)
    _without(tmp_path / "closed_loop/dusk_drive", "mean_intensity", "fixed", "shim", "shin2019")
    results = scenario_results(ReportInputs(paper=made.PAPER, data=tmp_path))
    assert not results[0].beats_all("iopc_continuous") and results[0].largest_loss_percent("iopc_optimal") is None
    absent = "Mean intensity, Fixed, Shim and Shin 2019 in dusk drive"
    assert closed_loop.findings(results)[0] == f"Did not run in the closed loop, and not compared: {absent}."


def test_where_a_rival_is_not_beaten_the_costliest_frame_and_its_settings_are_named(tmp_path: Path) -> None:
    made.make_scenario(tmp_path, "tunnel", 500.0, 25.0, light_factor=1 / 16)
    path = tmp_path / "closed_loop/tunnel/steps.parquet"
    steps = pd.read_parquet(path)
    lost = steps["policy"].isin(["iopc_optimal", "iopc_continuous"]) & (steps["step"] == 3)
    steps.loc[lost, "ap_percent"] -= 60.0
    store.write_table(path, steps, STEPS)
    results = scenario_results(ReportInputs(paper=made.PAPER, data=tmp_path))
    (row,) = [row for row in closed_loop.losses(results).rows if row["other"] == "Shim"]
    points = 60 - (made.AP["iopc_continuous"] - made.AP["shim"])
    settings = "2.0 ms, ISO 400 against 2.0 ms, ISO 400"
    assert row["where"] == f"{points:.1f} points in frame 3, at the fall of light: {settings}"
    section = control.section(ReportInputs(paper=made.PAPER, data=tmp_path))
    assert _table(section, "control_losses").rows


def test_the_verdict_counts_scenarios_and_states_the_regret(section: Section) -> None:
    text = " ".join(section.findings)
    assert "in 1 of 1 scenarios with motion in poor light" in text
    assert "IOPC continuous: median regret to the oracle 2.0 AP points; where nothing moves, at most 0.0" in text


def test_settling_is_stated_for_drives_with_a_step_of_light(tmp_path: Path, inputs: ReportInputs) -> None:
    made.make_scenario(tmp_path, "tunnel", 500.0, 5.0, light_factor=1 / 16)
    results = scenario_results(ReportInputs(paper=made.PAPER, data=tmp_path))
    assert results[0].has_light_step and not any(one.has_light_step for one in scenario_results(inputs))
    text = closed_loop.findings(results)[-1]
    assert text.startswith("Settling of IOPC continuous in drives with a step of light (frames after a disturbance")
    assert text.endswith(": 2 in tunnel.")
    made.make_scenario(tmp_path, "ramp", 500.0, 5.0, light_factor=1 / 16)
    _without(tmp_path / "closed_loop/ramp", "iopc_continuous")
    results = scenario_results(ReportInputs(paper=made.PAPER, data=tmp_path))
    assert closed_loop.findings(results)[-1].endswith(": 2 in tunnel.")
    assert not [text for text in closed_loop.findings(results[:1]) if "Settling" in text]  # ramp, which comes first


def test_decision_times_come_from_the_record(tmp_path: Path, inputs: ReportInputs) -> None:
    path = tmp_path / "control.json"
    store.write_json(path, {"machine": {}, "decision": {"shim": {"processor_median_ms": 1.25}}})
    times = decision_ms(dataclasses.replace(inputs, benchmarks={"control": path}))
    assert times == {"shim": 1.25}
    rows = closed_loop.measures(scenario_results(inputs), times).rows
    assert {row["decision_ms"] for row in rows if row["policy"] == "Shim"} == {1.25}
    store.write_json(path, {"decision": {}})
    with pytest.raises(InputError, match=r"benchmarks/control\.py"):
        decision_ms(dataclasses.replace(inputs, benchmarks={"control": path}))


def test_a_film_strip_shows_state_estimates_and_pictures(inputs: ReportInputs, tmp_path: Path) -> None:
    result = scenario_results(inputs)[0]
    drawing = closed_loop.strip(result)
    values = drawing.values
    assert values is not None and set(values["policy"]) == {"mean_intensity", "iopc_continuous", "oracle"}
    ours = values[values["policy"] == "iopc_continuous"]
    assert len(ours) == made.N_STEPS and (ours["ap_percent"] == made.AP["iopc_continuous"] + 0.5).all()
    assert ours["estimated_sigma_dn"].tolist() == [4.5 + step for step in range(made.N_STEPS)]
    assert "8 ms at ISO 100 to 1.3 ms at ISO 600" in drawing.alt.replace("8.0", "8")
    svg = style.save(drawing.figure, tmp_path / "film", values)[0].read_text(encoding="utf-8")
    assert svg.count("<image") == 4


@pytest.mark.parametrize("light", [(0.095, 0.115), (0.2, 0.2), (0.03, 0.0301)])  # of a lamp that flickers; constant
def test_an_axis_of_light_that_hardly_varies_has_a_scale(inputs: ReportInputs, light: tuple[float, float]) -> None:
    result = scenario_results(inputs)[0]
    steps = result.steps.assign(light=np.where(result.steps["step"] % 2, *light))
    axes = closed_loop.strip(dataclasses.replace(result, steps=steps)).figure.axes[0]
    low, high = axes.get_ylim()
    assert axes.get_title() == "light [daylight = 1]" and low < min(light) and max(light) < high
    assert sum(low <= tick <= high for tick in axes.get_yticks()) >= 2


def test_notes_point_to_tables_where_they_stand(section: Section) -> None:
    names = [block.name for block in section.blocks if isinstance(block, Table)]
    notes = " ".join(_table(section, "control_pairs").footnotes)
    assert "measures below" in notes and names.index("control_pairs") < names.index("control_measures")


def test_example_pictures_carry_scores_and_settings(inputs: ReportInputs) -> None:
    blocks, findings = control_examples.blocks(inputs)
    one, two = (block for block in blocks if isinstance(block, Figure) and "example" in block.name)
    assert "ISO 200) missed" in one.drawing.alt and "score 0.50" in one.drawing.alt
    assert "nothing moves (as bright as taken)" in one.drawing.alt  # not at the settings of a frame a quarter as bright
    assert two.drawing.values is not None
    assert list(two.drawing.values["step"]) == [
        "initial",
        "final",
        "built_in_18",
    ]  # one picture of the built-in control
    assert "30.0 < 50.0 < 70.0 %" in findings[0] and "the means are in" in findings[0]


def test_the_published_order_of_the_controllers_may_fail(tmp_path: Path) -> None:
    made.make_examples(tmp_path, (70.0, 50.0, 30.0))
    _, findings = control_examples.blocks(ReportInputs(paper=made.PAPER, data=tmp_path))
    assert "70.0, 50.0, 30.0 %" in findings[0] and "the means are not in" in findings[0]


def test_the_replay_is_compared_with_the_published_curve(inputs: ReportInputs) -> None:
    blocks, findings = control_examples.blocks(inputs)
    assert "within 0.030 ms (root mean square until 4.7 s" in findings[1]
    assert "after that, which do not lie on the law's steps, are up to 0.20 ms off" in findings[1]
    (response,) = [block for block in blocks if isinstance(block, Figure) and block.name == "control_response"]
    assert "0.030 ms until 4.7 s, at most 0.20 ms after" in response.drawing.alt
    assert "30.0 % (paper 26.08 %)" in response.drawing.alt


def test_the_paper_stands_beside_the_steps(section: Section) -> None:
    row = next(row for row in _table(section, "control_examples").rows if row["step"] == "as taken")
    sigma, iso = row["sigma_dn"], row["iso"]
    assert isinstance(sigma, Estimate) and sigma.reference == 20.0
    assert isinstance(iso, Estimate) and iso.value == 200.0 and iso.reference == 400.0
    reference = next(row for row in _table(section, "control_examples").rows if row["step"].startswith("reference"))
    assert isinstance(reference["iso"], Estimate) and np.isnan(reference["iso"].value)


def test_the_surface_names_knots_that_rise(tmp_path: Path, section: Section) -> None:
    assert _table(section, "control_surface").footnotes[0].startswith("AP falls with noise and with motion")
    made.make_surface(tmp_path, raised=True)
    blocks = control.surface_blocks(ReportInputs(paper=made.PAPER, data=tmp_path))
    (table,) = [block for block in blocks if isinstance(block, Table)]
    assert "at 10 DN and 15 px" in table.footnotes[0]


def test_the_surface_has_one_panel_for_each_brightness(section: Section) -> None:
    (figure,) = [block for block in section.blocks if isinstance(block, Figure) and block.name == "control_surface"]
    assert len(figure.drawing.figure.axes) == 3  # two panels and the colour bar
    assert "at a mean level of 0.5 90 %" in figure.drawing.alt and "at a mean level of 0.25 90 %" in figure.drawing.alt
    assert {row["level"] for row in _table(section, "control_surface").rows} == {0.5, 0.25}


def _study(kept_detector: float = 1.0, noise_hurts: bool = True) -> order_study.StudyTables:
    return order_study.StudyTables(made.study(kept_detector), made.effects(noise_hurts))


def test_the_order_study_decides_by_intervals() -> None:
    softened, disturbs, noise, motion = order_study.CONCLUSIONS
    study = _study()
    assert study.survival(softened) == "holds in the paper's order only"
    assert study.survival(disturbs) == study.survival(noise) == study.survival(motion) == "survives"
    assert _study(kept_detector=0.3).survival(softened) == "survives"
    assert _study(noise_hurts=False).survival(disturbs) == "not decided"


def test_a_change_against_the_claim_does_not_survive() -> None:
    effects = made.effects().assign(low=5.0, high=9.0)
    study = order_study.StudyTables(made.study(), effects)
    assert study.survival(order_study.CONCLUSIONS[2]) == "does not survive"


def test_a_fall_whose_interval_holds_zero_is_not_decided() -> None:
    """Of a claim that precision falls, whose sign is turned for the comparison."""
    effects = made.effects().assign(low=-12.0, high=3.0)
    study = order_study.StudyTables(made.study(), effects)
    assert study.survival(order_study.CONCLUSIONS[2]) == "not decided"


def test_one_noise_level_decides_nothing_about_noise() -> None:
    effects = made.effects()
    study = order_study.StudyTables(made.study(), effects[effects["cause"] == "motion"])
    assert study.survival(order_study.CONCLUSIONS[1]) == "not decided"
    assert study.survival(order_study.CONCLUSIONS[3]) == "survives"


def test_the_sentence_on_the_order_is_built_from_numbers() -> None:
    text = order_study.finding(_study())
    assert "holds in the paper's order only: “Blur softens photon noise”" in text
    assert "100 % is left behind the blur, in the paper's order 30 %" in text
    rows = order_study.study_table(made.study()).rows
    assert len(rows) == 8 and {row["present_detector"] for row in rows if row["motion_px"] == 21.0} == {5.0, 15.0}
    (row,) = [row for row in order_study.conclusion_table(_study()).rows if row["claim"] == "AP falls with motion blur"]
    assert row["detector_linear"] == "yes: 50.0 to 29.0 %, change −31.0 to −11.0 points"
    (note,) = order_study.conclusion_table(_study()).footnotes
    assert "5 to 15 DN, mean over motions of 21 px; of motion: 0 to 21 px" in note  # not over the sharp frames


def test_opposite_verdicts_never_stand_beside_the_same_interval() -> None:
    """Changes of AMAE of 0.04 to 1.0 and of -0.04 to 1.0 points, both of which round to 0.0 to 1.0."""
    effects = made.effects()
    of_noise = (effects["cause"] == "noise") & (effects["measure"] == "amae_percent")
    effects.loc[of_noise, "high"] = 1.0
    effects.loc[of_noise, "low"] = np.where(effects[of_noise]["light"] == "linear", -0.04, 0.04)
    row = order_study.conclusion_table(order_study.StudyTables(made.study(), effects)).rows[1]
    assert row["paper_encoded"].startswith("yes") and row["paper_encoded"].endswith("change 0.04 to 1.0 points")
    assert row["paper_linear"].startswith("not decided")
    assert row["paper_linear"].endswith("change −0.04 to 1.0 points")


def test_paired_differences_show_the_sign_of_their_ends(section: Section) -> None:
    columns = [column for column in _table(section, "control_pairs").columns if column.unit == "points"]
    columns += [column for column in closed_loop.losses([]).columns if column.unit == "points"]
    assert len(columns) > 3 and all(column.signed for column in columns)


@pytest.mark.full("a page takes 6 s")
def test_the_verdict_of_the_page_holds_the_findings(
    inputs: ReportInputs, report_inputs: ReportInputs, tmp_path: Path
) -> None:
    build(dataclasses.replace(report_inputs, data=inputs.data), tmp_path)
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    verdict = page[page.index('id="verdict"') : page.index("</section>")]
    assert "median regret to the oracle 2.0 AP points" in verdict and "“Blur softens photon noise”" in verdict
    assert {path.name for path in (tmp_path / "tables").iterdir()} >= {"control_pairs.csv", "order_study.tex"}
    values = pd.read_csv(tmp_path / "figures/control_dusk_drive.csv")
    assert re.search(r"motion_px,estimated_motion_px", ",".join(values.columns))
