"""Noise of real cameras in the report: recorded numbers, a stage's numbers in their place, and what has not run."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_makers import REPO

from pipeline import store
from pipeline.errors import InputError
from pipeline.experiments.real_noise import records as real_noise_records
from pipeline.experiments.real_noise.tables import REAL_NOISE_PATCHES, REAL_NOISE_SUMMARY
from pipeline.report.inputs import ReportInputs
from pipeline.report.sections import real_noise
from pipeline.report.spec import Figure
from pipeline.report.tables import Estimate, Table

RECORDINGS = ("cc", "polyu", "flea3")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> ReportInputs:
    """The committed records, and stages that have written that their data are absent."""
    root = tmp_path_factory.mktemp("real_noise")
    for name in RECORDINGS:
        store.write_json(root / "real_noise" / name / "recording.json", {"ran": False, "source": "nobody"})
    listed = {"real_noise": RECORDINGS}
    return ReportInputs(paper=REPO / "data/paper", recorded=REPO / "reports/recorded", data=root, members=listed)


def recordings(inputs: ReportInputs) -> dict[str, real_noise_records.Recording]:
    """Every recording by its name."""
    made = real_noise_records.recordings(inputs.folders("real_noise"), inputs.recorded)
    return {part.name: part for part in made}


def test_recorded_numbers_stand_in_for_stages_that_have_not_run(inputs: ReportInputs) -> None:
    section = real_noise.section(inputs)
    assert section is not None and [run.ran for run in section.runs] == [False] * 3
    assert all("real_noise.recordings." in run.line for run in section.runs)
    blocks = {block.name: block for block in section.blocks if isinstance(block, (Figure, Table))}
    tables = [
        "real_noise_errors",
        "real_noise_parts",
        "real_noise_picture_bounds",
        "real_noise_sources",
        "real_sensor",
        "real_sensor_constants",
    ]
    assert list(blocks) == ["real_noise_examples", "real_noise", *tables]
    table = blocks["real_noise_errors"]
    assert isinstance(table, Table)
    first = table.rows[0]
    assert first["recording"] == "CC" and first["estimator"] == "Adaptive"
    selected = recordings(inputs)["cc"].summary.set_index("estimator").loc["adaptive"]
    error = first["true_mae_dn"]
    assert isinstance(error, Estimate)
    assert error.value == selected["true_mae_dn"] and error.low == selected["true_mae_low_dn"]
    shared = {(row["recording"], row["estimator"]): row["true_shared_mae_dn"] for row in table.rows}
    values = [shared[place, "Correlated"].value for place in ("CC", "PolyU")]
    assert values == pytest.approx([0.42, 0.71], abs=0.005)  # 0.60 and 1.08 on all patches
    assert shared["CC", "Adaptive"].value == pytest.approx(error.value, rel=1e-4)
    split = blocks["real_noise_parts"]
    assert isinstance(split, Table)
    rows = {(row["recording"], row["estimator"]): row for row in split.rows}
    assert {estimator for _, estimator in rows} == {"Adaptive", "Correlated"}  # others read white noise only
    assert {recording for recording, _ in rows} == {"CC", "PolyU", "Flea3 (raw)"}
    for place in ("CC", "PolyU"):
        row = rows[place, "Adaptive"]
        assert row["white_mae_dn"].value < 0.25 * row["true_white_mean_dn"]
        assert row["correlation_mae"].low < row["correlation_mae"].value < 0.05 < 0.5 < row["true_correlation_mean"]
    assert rows["Flea3 (raw)", "Adaptive"]["true_correlation_mean"] == 0
    bounds = blocks["real_noise_picture_bounds"]
    assert isinstance(bounds, Table)
    shown = {(row["recording"], row["of"]): row for row in bounds.rows}
    assert set(shown) == {("CC", "means"), ("PolyU", "photographs"), ("PolyU", "means")}  # others have an estimate
    noisy = shown["PolyU", "photographs"]
    assert noisy["held_fraction"] == 100 and noisy["true_dn"] < noisy["bound_dn"] < 2 * noisy["true_dn"]
    figure = blocks["real_noise"]
    assert isinstance(figure, Figure) and figure.stages == () and "Adaptive on CC" in figure.drawing.alt


def test_errors_stand_above_the_points(inputs: ReportInputs) -> None:
    drawing = real_noise.scatter(list(recordings(inputs).values()), real_noise.SHOWN)
    drawing.figure.draw_without_rendering()
    for axes in drawing.figure.axes:
        (note,) = axes.texts
        extent, panel = note.get_window_extent(), axes.get_window_extent()
        assert note.get_text().startswith("error ") and note.get_text().endswith(" % estimated")
        assert extent.y0 > panel.y1 and panel.x0 <= extent.x0 and extent.x1 <= panel.x1
        assert not axes.get_title() or axes.title.get_window_extent().y0 > extent.y1


def test_estimates_above_the_panel_are_marked(inputs: ReportInputs) -> None:
    """Triangles at the upper end, as many as there are estimates beyond it; no other mark touches that end."""
    parts = recordings(inputs)
    drawing = real_noise.scatter(list(parts.values()), real_noise.SHOWN)
    panels = np.array(drawing.figure.axes).reshape(len(parts), len(real_noise.SHOWN))
    for row, part in zip(panels, parts.values(), strict=True):
        for axes, name in zip(row, real_noise.SHOWN, strict=True):
            estimates, top = part.patches.loc[part.patches["estimator"] == name, "sigma_dn"], axes.get_ylim()[1]
            points, triangles = axes.collections
            assert len(triangles.get_offsets()) == (estimates > top).sum()
            assert len(points.get_offsets()) == len(estimates) - (estimates > top).sum()
            assert len(triangles.get_paths()[0].vertices) == 4  # closed
    assert len(panels[list(parts).index("flea3"), real_noise.SHOWN.index("bf")].collections[1].get_offsets()) > 5


def test_examples_show_both_answers_and_the_reason_to_abstain(inputs: ReportInputs) -> None:
    made = real_noise_records.examples(inputs.recorded)
    assert made is not None and [crop.shape for crop in made.crops] == [(128, 128)] * 3
    drawing = real_noise.crops(made)
    now = made.table[made.table["estimator"] == "adaptive"]
    assert "no answer: codec traces (1 patch)" in drawing.alt and "compressed" not in drawing.alt
    assert "no answer in 15 of 18 patches: codec traces" in drawing.alt
    assert all(f"{sigma:.2f} DN" in drawing.alt for sigma in now["true_sigma_dn"])
    row = {"patches": 4, "answered": 1, "sigma_dn": 1.0, "low_dn": 0.5, "high_dn": 2.0, "reasons": "compressed: 3"}
    assert real_noise.answer(row) == "no answer in 3 of 4 patches: codec traces"
    most = row | {"patches": 9, "answered": 6, "reasons": "compressed: 1, flat: 2"}
    assert real_noise.answer(most) == "1.00 DN (0.50 to 2.00); no answer: codec traces (1 patch), flat (2 patches)"
    assert real_noise.answer(row | {"answered": 4, "reasons": ""}) == "1.00 DN (0.50 to 2.00)"


def test_a_stage_that_has_run_takes_the_place_of_the_record(inputs: ReportInputs, tmp_path: Path) -> None:
    recorded = recordings(inputs)["cc"]
    patches = recorded.patches[recorded.patches["picture"] == recorded.patches["picture"].iloc[0]]
    store.write_json(tmp_path / "real_noise/cc/recording.json", {"ran": True, "source": "my camera"})
    store.write_table(tmp_path / "real_noise/cc/patches.parquet", patches, REAL_NOISE_PATCHES)
    store.write_table(tmp_path / "real_noise/cc/summary.parquet", recorded.summary, REAL_NOISE_SUMMARY)
    changed = dataclasses.replace(inputs, data=tmp_path)
    parts = real_noise_records.recordings(changed.folders("real_noise"), changed.recorded)
    assert [(part.name, part.stage) for part in parts] == [("cc", "real_noise@cc"), ("polyu", ""), ("flea3", "")]
    assert parts[0].source == "my camera" and len(parts[0].patches) == len(patches)
    section = real_noise.section(changed)
    assert section is not None and [run.ran for run in section.runs] == [True, False, False]


def test_without_anything_there_is_no_section(tmp_path: Path) -> None:
    assert real_noise.section(ReportInputs(paper=REPO / "data/paper", recorded=tmp_path)) is None


CODED = REPO / "benchmarks/results/coded_noise.json"
VIDEOS = REPO / "benchmarks/results/video_codecs.json"


def last_tables(inputs: ReportInputs, record: Path) -> list[Table]:
    """The tables of answers and of bounds that the section makes of a benchmark's record."""
    section = real_noise.section(dataclasses.replace(inputs, benchmarks={record.stem: record}))
    assert section is not None
    line = f"python benchmarks/{record.stem}.py"
    assert (section.runs[-1].line, section.runs[-1].state) == (line, "recorded")
    tables = [block for block in section.blocks[-2:] if isinstance(block, Table)]
    assert [table.stage for table in tables] == [line] * 2
    return tables


def answers(about: dict[str, Any]) -> str:
    answered, wrong = about["answered"] / about["count"], about["wrong"] / about["answered"]
    return f"{100 * answered:.0f} / {100 * wrong:.0f} / {100 * about['held_fraction']:.0f}"


def bound(about: dict[str, Any]) -> str:
    return f"{about['bounded']} / {about['bound_dn']:.1f} / {100 * about['bound_held_fraction']:.0f}"


def test_noise_behind_codecs_is_counted_by_codec_and_level(inputs: ReportInputs) -> None:
    table, bounds = last_tables(inputs, CODED)
    assert (table.name, bounds.name) == ("real_noise_coded", "real_noise_bounds")
    record = json.loads(CODED.read_text())
    names = [row["codec"] for row in table.rows if row["unit"] == "whole frames"]
    assert names[:3] == ["as it is", "JPEG 60", "JPEG 80"] and len(table.rows) == 2 * len(names)
    shown = next(row for row in table.rows if (row["unit"], row["codec"]) == ("patches", "JPEG 95"))
    assert shown["added_5"] == answers(record["patches"]["by_codec"]["jpeg 95"]["5"])
    assert [row["codec"] for row in bounds.rows[:2]] == ["as it is", "JPEG 60"]
    assert bounds.rows[1]["added_0"] == bound(record["frames"]["by_codec"]["jpeg 60"]["0"])
    frames = record["frames"]["by_codec"]["jpeg 60"]["0"]["count"]
    none = 100 * (1 - 0.025 ** (1 / frames))
    assert f"of {frames} a share of 0 % has the exact 95 % interval 0 to {none:.0f} %" in table.footnotes[-2]
    assert f"one of 100 % has {100 - none:.0f} to 100 %" in table.footnotes[-2]


def test_noise_behind_codecs_that_hide_it_is_counted_with_and_without_their_name(inputs: ReportInputs) -> None:
    table, bounds = last_tables(inputs, VIDEOS)
    assert (table.name, bounds.name) == ("real_noise_video", "real_noise_video_bounds")
    record = json.loads(VIDEOS.read_text())["by_codec"]
    assert len(table.rows) == 3 * len(record)
    assert [row["known"] for row in table.rows[:4]] == ["no", "by name", "with quantiser", "no"]
    stored = [row["codec"] for row in table.rows[::3]]
    assert stored[:5] == ["H.264 28", "H.264 38", "H.264 43", "H.264 48", "HEVC (H.265) 18"]
    assert table.rows[3 * 4]["added_5"] == answers(record["hevc 18"]["5"]["unknown"])
    shown = [row for row in bounds.rows if row["codec"] == "HEVC (H.265) 18"]
    assert [row["known"] for row in shown] == ["by name", "with quantiser"]
    for row, known in zip(shown, ("named", "file"), strict=True):
        assert row["added_0"] == bound(record["hevc 18"]["0"][known])


def test_every_codec_and_filter_of_the_benchmarks_has_a_name() -> None:
    from benchmarks import coded_noise, video_codecs

    processings = (*coded_noise.PROCESSINGS, *video_codecs.CODECS)
    assert {coded_noise.described(processing).split()[0] for processing in processings} <= set(real_noise.CODECS)


LEVEL = {"count": 4, "answered": 4, "wrong": 1, "held_fraction": 1.0, "bounded": 0}


@pytest.mark.parametrize(
    "content",
    [{"jpeg 80": {"0": {"count": 3}}}, {"jpeg 80": {level: {"count": 3} for level in real_noise.ADDED}}, [1]],
)
def test_a_record_of_codecs_that_is_no_such_record_is_refused(
    inputs: ReportInputs, tmp_path: Path, content: Any
) -> None:
    broken = tmp_path / "coded_noise.json"
    parts: dict[str, Any] = {"datasets": ["sim"], "frames": {"by_codec": content}, "patches": {"by_codec": {}}}
    store.write_json(broken, parts)
    with pytest.raises(InputError, match=r"coded_noise\.json: not a record of .*benchmarks/coded_noise\.py"):
        real_noise.section(dataclasses.replace(inputs, benchmarks={"coded_noise": broken}))


def test_a_level_that_saturates_every_patch_is_an_empty_cell() -> None:
    levels = dict.fromkeys(real_noise.ADDED, LEVEL) | {"25": {**LEVEL, "count": 0, "answered": 0}}
    table = real_noise.behind_codecs(
        {"datasets": ["sim"], "frames": {"by_codec": {}}, "patches": {"by_codec": {"sharpened": levels}}}
    )
    assert (table.rows[0]["added_10"], table.rows[0]["added_25"]) == ("100 / 25 / 100", "")


def test_a_codec_that_has_no_name_here_keeps_its_own(tmp_path: Path) -> None:
    content = {"webp 80": dict.fromkeys(real_noise.ADDED, LEVEL), "none": dict.fromkeys(real_noise.ADDED, LEVEL)}
    table = real_noise.behind_codecs(
        {"datasets": ["sim", "kitti"], "frames": {"by_codec": content}, "patches": {"by_codec": {}}}
    )
    assert [row["codec"] for row in table.rows] == ["as it is", "webp 80"]
    assert table.rows[1]["added_5"] == "100 / 25 / 100"
    assert "frames of Sim and KITTI" in table.footnotes[0]


def test_codecs_without_bounds_have_no_row_and_levels_without_them_no_number() -> None:
    bounded = {"count": 4, "answered": 1, "bounded": 3, "bound_dn": 4.26, "bound_held_fraction": 1.0}
    coded = {**dict.fromkeys(real_noise.ADDED, LEVEL), "2": bounded}
    table = real_noise.bounds(
        {"frames": {"by_codec": {"none": dict.fromkeys(real_noise.ADDED, LEVEL), "h264 23": coded}}}
    )
    assert [(row["codec"], row["added_0"], row["added_2"]) for row in table.rows] == [("H.264 23", "", "3 / 4.3 / 100")]
