"""Raw frames by scene and exposure; what is not a raw frame is refused by name."""

import cv2
import numpy as np
import pytest

from pipeline.datasets.decoding.raw_frames import raw_frames
from pipeline.errors import InputError


def write(folder, name, picture):
    assert cv2.imwrite(str(folder / name), picture)


def test_frames_are_sorted_by_scene_and_exposure(tmp_path):
    grey = np.full((40, 60), 7, np.uint8)
    for name in ("b_25ms_x.tif", "a_1000ms_x.tif", "a_12.5ms_y.tif"):
        write(tmp_path, name, grey)
    (tmp_path / "notes.txt").write_text("no picture")
    frames = raw_frames(tmp_path)
    assert [(frame.scene, frame.exposure_s) for frame in frames] == [("a", 0.0125), ("a", 1.0), ("b", 0.025)]
    assert (frames[0].pixels() == 7).all()


@pytest.mark.parametrize(("name", "word"), [("frame.tif", "no exposure"), ("", "no pictures"), ("absent", "no folder")])
def test_what_is_no_raw_frame_is_named(tmp_path, name, word):
    if name.endswith(".tif"):
        write(tmp_path, name, np.zeros((8, 8), np.uint8))
    with pytest.raises(InputError, match=word):
        raw_frames(tmp_path / "absent" if name == "absent" else tmp_path)


def test_a_frame_with_colours_is_refused(tmp_path):
    write(tmp_path, "a_5ms.tif", np.dstack([np.full((8, 8), value, np.uint8) for value in (1, 90, 200)]))
    with pytest.raises(InputError, match="colours"):
        raw_frames(tmp_path)[0].pixels()
