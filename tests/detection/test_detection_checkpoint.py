"""Pieces of a long run: their folder goes once the run is done, and no other run's with it."""

from __future__ import annotations

from pathlib import Path

from pipeline.detection.checkpoint import clear


def test_pieces_go_with_their_folder(tmp_path):
    for name in ("one", "two"):
        (tmp_path / "kept" / name).mkdir(parents=True)
    clear(tmp_path / "kept/one")
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["two"]
    clear(tmp_path / "kept/two")
    assert not (tmp_path / "kept").exists()
    clear(tmp_path / "kept/two")  # another process was faster


def test_pieces_that_another_process_adds_meanwhile_stay(tmp_path, monkeypatch):
    """Its folder appears at the very moment at which the empty folder above would be removed."""
    (tmp_path / "kept/one").mkdir(parents=True)
    remove = Path.rmdir

    def late(path):
        (tmp_path / "kept/two").mkdir()
        remove(path)

    monkeypatch.setattr(Path, "rmdir", late)
    clear(tmp_path / "kept/one")
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["two"]
