"""Pieces of a long run: their folder goes once the run is done, and no other run's with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.detection.checkpoint import clear, load_or_compute


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


def test_names_of_pieces_are_cut_to_what_a_file_system_takes_and_stay_apart(tmp_path):
    def kept(name, value):
        return load_or_compute(tmp_path, name, b"picture", frozenset({"x"}), lambda: {"x": np.array(value)})["x"].item()

    long = 200 * "\N{LATIN SMALL LETTER A WITH DIAERESIS}"  # two bytes each
    names = ["000012-sharp", long + "1", long + "2"]
    assert [kept(name, value) for value, name in enumerate(names)] == [0, 1, 2]
    assert [kept(name, 9) for name in names] == [0, 1, 2]
    assert len(list(tmp_path.glob("000012-sharp-????????????.npz"))) == 1
