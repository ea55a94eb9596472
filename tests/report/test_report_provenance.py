"""Provenance read from dvc.lock."""

from __future__ import annotations

import html
import re
from pathlib import Path

import pytest
from report_makers import LOCK, REPO

from pipeline.errors import InputError
from pipeline.report.inputs import ReportInputs
from pipeline.report.provenance import origin, read_lock, shown_path


def test_hashes_parameters_and_lines(tmp_path: Path) -> None:
    (tmp_path / "dvc.lock").write_text(LOCK)
    inputs = ReportInputs(paper=tmp_path, runs={"star": "dvc repro -s star"})
    stages = read_lock(tmp_path / "dvc.lock")
    result = origin(["noise"], "noise@sim-pca", stages, inputs)
    assert result.inputs == {"data/index/sim": "0123456789", "…/kitti": "ffffffffff"}
    assert result.parameters == ["noise.tile_px = 128", "seed = 1"]
    assert result.items == ("noise",)
    assert result.line == "dvc repro noise@sim-pca"
    unknown = origin(["sim_star"], "star", stages, inputs)
    assert (unknown.inputs, unknown.parameters, unknown.line) == ({}, [], "dvc repro -s star")
    assert result.recorded and not unknown.recorded


def test_no_lock_file_means_no_record(tmp_path: Path) -> None:
    assert read_lock(None) == {} and read_lock(tmp_path / "dvc.lock") == {}
    (tmp_path / "dvc.lock").write_text("")
    assert read_lock(tmp_path / "dvc.lock") == {}


@pytest.mark.parametrize("content", ["- a list", "stages: [1]", "a: b: c"])
def test_a_broken_lock_file_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "dvc.lock").write_text(content)
    with pytest.raises(InputError, match=r"dvc\.lock"):
        read_lock(tmp_path / "dvc.lock")


@pytest.mark.parametrize(
    ("path", "shown"),
    [("data/index/sim", "data/index/sim"), ("/home/me/kitti", "…/kitti"), ("C:\\data\\kitti", "…/kitti")],
)
def test_absolute_paths_lose_the_machines_part(path: str, shown: str) -> None:
    assert shown_path(path) == shown


def test_every_command_of_the_committed_page_names_a_stage_of_dvc_lock() -> None:
    page = (REPO / "reports/index.html").read_text(encoding="utf-8")
    commands = {html.unescape(line) for line in re.findall(r"<code>(dvc repro [^<]+)</code>", page)}
    named = {command.split()[-1] for command in commands if "--" not in command}
    stages = set(read_lock(REPO / "dvc.lock"))
    assert len(named) > 40
    assert not {name for name in named if name not in stages}
    assert "No record of this stage" not in page
