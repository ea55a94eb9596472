"""Noise that the estimate leaves out: in words, in alarms of noise, and in what `health` writes."""

from __future__ import annotations

import csv
import json

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from control_makers import performance
from data_makers import picture

from pipeline.cli import main
from pipeline.cli.analysis.flag_words import flag_words, left_out_words, line_noise_dn
from pipeline.cli.analysis.frame import Thresholds
from pipeline.cli.analysis.rows import alarms, undecided
from pipeline.cli.watching.alarms import alarm_words
from pipeline.streams import stream

CLEAR = {
    "picture": "a.png", "sigma_dn": 0.4, "sigma_low_dn": 0.2, "sigma_high_dn": 1.1, "sigma_at_most_dn": 1.1,
    "noise_patches": 30, "abstained": {}, "mtf50_horizontal": 0.5, "mtf50_vertical": 0.5,
    "flags": "", "row_noise_dn": 0.3, "column_noise_dn": 0.0, "dead_lines": 0,
    "impulse_fraction": 0.0,
}  # fmt: skip
BANDED = CLEAR | {"flags": "dark, banded", "row_noise_dn": 1.2, "column_noise_dn": 8.31}
IMPULSES = CLEAR | {"flags": "impulses", "impulse_fraction": 0.0123}


def test_flags_in_words_state_what_the_estimate_leaves_out():
    assert flag_words(CLEAR) == []
    assert flag_words(BANDED) == [
        "dark", "banded: columns differ by 8.3 DN, which the noise estimate leaves out"
    ]  # fmt: skip
    lines = [flag_words(CLEAR | {"flags": "dead_lines", "dead_lines": count})[0] for count in (1, 4)]
    assert [words.partition(",")[0] for words in lines] == [
        "dead lines: 1 row or column stands out", "dead lines: 4 rows or columns stand out",
    ]  # fmt: skip
    assert left_out_words(CLEAR | {"flags": "dead_lines", "dead_lines": 1}) == []
    assert flag_words(BANDED | {"row_noise_dn": 9.0})[1].startswith("banded: rows differ by 9.0 DN")
    assert flag_words(IMPULSES) == ["impulses: 1.2 % of the pixels, which the noise estimate leaves out"]
    assert flag_words(CLEAR | {"flags": "over_exposed, frozen"}) == ["over-exposed", "frozen"]


def test_noise_of_lines_counts_where_it_is_flagged():
    assert line_noise_dn(BANDED) == 8.31
    assert line_noise_dn(BANDED | {"row_noise_dn": np.nan}) == 8.31
    assert line_noise_dn(BANDED | {"column_noise_dn": np.nan}) == 1.2
    assert np.isnan(line_noise_dn(CLEAR))


@pytest.mark.parametrize(
    ("row", "limit_dn", "raised", "open_limits"),
    [
        (CLEAR, 5.0, [], []),
        (BANDED, 5.0, ["noise"], []),
        (BANDED, 10.0, [], []),
        (BANDED | {"sigma_dn": np.nan, "sigma_at_most_dn": np.nan}, 5.0, ["noise"], []),
        (BANDED | {"sigma_dn": np.nan, "sigma_at_most_dn": np.nan}, 10.0, [], ["noise"]),
        (IMPULSES, 5.0, [], ["noise"]),
        (IMPULSES | {"sigma_dn": 6.0}, 5.0, ["noise"], []),
        (IMPULSES, None, [], []),
    ],
)
def test_noise_that_the_estimate_leaves_out_does_not_keep_a_threshold(row, limit_dn, raised, open_limits):
    assert alarms(row, limit_dn, None) == raised
    assert undecided(row, limit_dn, None) == open_limits


def test_noise_beyond_what_estimators_know_is_above_any_threshold_of_theirs():
    strong = CLEAR | {"sigma_dn": np.nan, "sigma_low_dn": np.nan, "sigma_high_dn": np.nan, "sigma_at_most_dn": np.nan}
    assert alarms(strong | {"abstained": {"noise": {"beyond": 16}}}, 8.0, None) == ["noise"]
    half = strong | {"abstained": {"noise": {"beyond": 15, "uncertain": 15}}}
    assert alarms(half, 8.0, None) == alarms(strong | {"abstained": {"noise": {"beyond": 16}}}, 60.0, None) == []
    assert undecided(half, 8.0, None) == ["noise"]


def test_flags_are_alarms_on_request_and_have_their_words():
    assert alarms(BANDED, None, None, flagged=True) == ["dark", "banded"]
    limits = Thresholds(5.0, None, True)
    assert alarm_words("noise", BANDED, limits) == "noise of whole rows or columns 8.31 DN, above 5 DN"
    assert alarm_words("noise", BANDED | {"sigma_dn": 6.0}, limits) == "noise 6.00 DN, above 5 DN"
    assert alarm_words("noise", CLEAR | {"sigma_dn": np.nan}, limits) == "noise beyond 60 DN, above 5 DN"
    assert alarm_words("banded", BANDED, limits).startswith("frame flagged banded: columns differ by 8.3 DN")
    assert alarm_words("dark", BANDED, limits) == "frame flagged dark"


def test_health_flags_noise_of_rows_and_impulses_writes_their_measures_and_alarms(tmp_path):
    clear = picture("lines", 448, 320)
    lines = clear + stream(0, "flag words", "rows").normal(0, 10.0, (320, 1))
    drawn = stream(0, "flag words", "impulses").random(clear.shape)
    defects = {"banded": lines, "impulses": np.where(drawn < 0.005, 0, np.where(drawn > 0.995, 255, clear))}
    (tmp_path / "in").mkdir()
    for name, image in defects.items():
        assert cv2.imwrite(str(tmp_path / f"in/{name}.png"), np.clip(np.rint(image), 0, 255).astype(np.uint8))
    out = tmp_path / "out"
    call = ["health", str(tmp_path / "in"), "--out", str(out), "--alarm-sigma-dn", "5"]
    done = CliRunner().invoke(main, call)
    assert done.exit_code == 3, done.output
    assert "[banded: rows differ by " in done.stdout and "[impulses: " in done.stdout
    with (out / "health.csv").open() as file:
        banded, impulses = csv.DictReader(file)
    assert banded["flags"] == "banded" and float(banded["row_noise_dn"]) == pytest.approx(10, rel=0.2)
    assert banded["alarms"] == "noise" and float(banded["column_noise_dn"]) == 0
    assert impulses["flags"] == "impulses" and float(impulses["impulse_fraction"]) == pytest.approx(0.01, rel=0.4)
    assert impulses["alarms"] or impulses["undecided"] == "noise"
    assert "banded: rows differ by" in (out / "health.html").read_text()
    row = json.loads((out / "health.jsonl").read_text().splitlines()[0])
    assert row["row_noise_dn"] == pytest.approx(float(banded["row_noise_dn"]))


def test_the_verdict_on_a_banded_frame_names_its_lines_and_no_precision(tmp_path):
    """Detection was measured with white noise only."""
    lines = picture("verdict", 448, 320) + stream(0, "flag words", "verdict").normal(0, 10.0, (320, 1))
    assert cv2.imwrite(str(tmp_path / "rows.png"), np.clip(np.rint(lines), 0, 255).astype(np.uint8))
    performance().save(tmp_path / "surface.npz")
    requested = ["--surface", str(tmp_path / "surface.npz"), "--exposure", "4ms", "--iso", "400"]
    done = CliRunner().invoke(main, ["health", str(tmp_path / "rows.png"), *requested])
    assert done.exit_code == 0, done.output
    cause = "Expected AP unknown: none was measured with noise of rows, columns or single pixels."
    assert "banded: rows differ by" in done.output and f"which the noise estimate leaves out. {cause}" in done.output
    assert "No advice: noise of rows, columns or single pixels" in done.output
