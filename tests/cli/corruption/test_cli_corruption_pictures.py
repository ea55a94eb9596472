"""Corrupted pictures are written with their truth, under names that do not collide; what fails is set aside."""

import numpy as np

from pipeline.cli.corruption.pictures import CorruptedPicture, write_each
from pipeline.errors import InputError
from pipeline.store import read_json

GREY = np.full((16, 16), 0.5, np.float32)


def make(name, stem, image):
    if stem == "refused":
        raise InputError("too dark")
    return CorruptedPicture(image, {"stem": stem}, "1.00")


def test_frames_become_pictures_with_truth_and_a_line_each(tmp_path, capsys):
    names = ["b/a.jpg", "a.png", "drive.mp4#7", "refused.png", "broken.png"]
    frames = [(name, None if name == "broken.png" else GREY, "not a picture") for name in names]
    files = [tmp_path / name for name in ("b/a.jpg", "a.png")]
    written, set_aside = write_each(frames, files, tmp_path / "out", "sigma", make, note="a note")
    assert written and set_aside.names == ["refused.png", "broken.png"]
    results = {path.stem: read_json(path) for path in (tmp_path / "out").glob("*.json")}
    assert results == {
        "a": {"source": "a.png", "stem": "a"},
        "a-2": {"source": "b/a.jpg", "stem": "a"},
        "drive.mp4-000007": {"source": "drive.mp4#7", "stem": "drive.mp4-000007"},
    }
    shown = capsys.readouterr()
    assert shown.out.splitlines() == [
        "sigma  picture -> file",
        "1.00  b/a.jpg -> a-2.png",
        "1.00  a.png -> a.png",
        "1.00  drive.mp4#7 -> drive.mp4-000007.png",
        "a note",
        f"written to {tmp_path / 'out'}",
    ]
    assert "refused.png: too dark" in shown.err and "broken.png: not a picture" in shown.err


def test_nothing_usable_writes_nothing(tmp_path, capsys):
    written, set_aside = write_each([("a.png", None, "not a picture")], [], tmp_path / "out", "sigma", make)
    assert not written and set_aside.names == ["a.png"] and "written to" not in capsys.readouterr().out
