"""`camera-monitor weights`: listed, downloaded, verified."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from download_server import SHA256, serving

from pipeline.cli import main
from pipeline.detection import weights_table
from pipeline.detection.weights_table import PublishedWeights


def test_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = CliRunner().invoke
    with serving() as server:
        unpinned = PublishedWeights(
            file="net.onnx", detector="yolox", urls=(server.url,), licence="MIT", note="then export it"
        )
        monkeypatch.setattr(weights_table, "TABLE", {"net": unpinned})
        got = run(main, ["weights", "get", "net", "--to", str(tmp_path)])
    assert got.exit_code == 0, got.output
    assert SHA256 in got.output and "trusted at first use" in got.output and "then export it" in got.output
    assert "recorded hash" in run(main, ["weights", "get", "net", "--to", str(tmp_path)]).output
    listed = run(main, ["weights", "list", "--to", str(tmp_path)]).output
    assert "unpublished" in listed and "yes" in listed
    wrong = run(main, ["weights", "get", "nett"])
    assert wrong.exit_code == 2 and "did you mean 'net'?" in wrong.stderr and "Traceback" not in wrong.output
