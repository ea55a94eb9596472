"""`camera-monitor download`: listed, downloaded, what to do next."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from download_server import BYTES, SHA256, serving

from pipeline.cli import main
from pipeline.datasets import published
from pipeline.datasets.published import TABLE, PublishedData
from pipeline.downloads import PublishedFile


def test_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run, folder = CliRunner().invoke, tmp_path / "real noise"
    monkeypatch.chdir(tmp_path)
    with serving() as server:
        file = PublishedFile(file="net.onnx", urls=(server.url,), size_bytes=len(BYTES), sha256=SHA256)
        data = PublishedData(holds="one file", licence="MIT", next_step="use FOLDER", bases=(server.base,))
        monkeypatch.setitem(TABLE, "cc", data)
        monkeypatch.setattr(published, "single_files", lambda name: [file])
        got = run(main, ["download", "cc", "--to", str(folder)])
        assert got.exit_code == 0, got.output
        assert (folder / "net.onnx").read_bytes() == BYTES
        assert "cc: one file; licence: MIT" in got.output
        assert "1 file, 1 downloaded, SHA-256 as expected" in got.output
        assert f"next: use '{folder}'" in got.output
        assert "1 file, 0 downloaded" in run(main, ["download", "cc", "--to", str(folder)]).output
        assert run(main, ["download", "cc"]).exit_code == 0
    assert (tmp_path / "data" / "raw" / "cc" / "net.onnx").is_file()
    listed = run(main, ["download"]).output.splitlines()
    assert len(listed) == 1 + len(TABLE)
    assert [line.split()[2] for line in listed[1:] if line.startswith(("cc", "kitti"))] == ["no", "yes"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["ktti"], "did you mean 'kitti'?"),
        (["--to", "somewhere"], "need the NAME"),
        (["--keep-archives"], "need the NAME"),
    ],
)
def test_mistakes_are_one_line(arguments: list[str], words: str) -> None:
    wrong = CliRunner().invoke(main, ["download", *arguments])
    assert wrong.exit_code == 2 and words in wrong.stderr and "Traceback" not in wrong.output
