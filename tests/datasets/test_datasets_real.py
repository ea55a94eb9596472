"""Readers and index on genuine frames of KITTI, Udacity and the authors' *Sim*."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline import datasets
from pipeline.datasets.decoding.pictures import read_grey8
from pipeline.datasets.folder import read_box_labels
from pipeline.datasets.index import index
from pipeline.datasets.labels import CLIPPED
from pipeline.datasets.quarantine import COLOUR, scan
from pipeline.errors import InputError

pytestmark = pytest.mark.shared


@pytest.fixture
def kitti(shared):
    return datasets.open_dataset("kitti", "kitti", shared / "realdata" / "kitti")


def udacity(shared, layout):
    images = shared / "realdata" / "udacity" / "object-dataset"
    return datasets.open_dataset("udacity", "udacity", images.parent, layout=layout, images=images)


def test_kitti_frames(kitti):
    frames = kitti.frames()
    assert len(frames) == 16
    assert [f.name for f in frames if f.previous] == [f"{number:06d}" for number in range(5)]
    assert all(len(f.previous) in (0, 3) for f in frames)
    labels = [box.label for f in frames for box in f.boxes]
    assert {word: labels.count(word) for word in ("Car", "Pedestrian", "Cyclist", "Van", "Misc")} == {
        "Car": 28,
        "Pedestrian": 10,
        "Cyclist": 1,
        "Van": 3,
        "Misc": 1,
    }
    boxes = {f.name: f.boxes for f in frames}
    # the frames the authors' labels were compared on: truncated by .8 and .98, under 25 px high, and usable ones
    assert [b.ignore for b in boxes["000010"] if b.label == "Car"] == [True, *[False] * 7]
    assert [b.ignore for b in boxes["000011"] if b.label == "Car"] == [False, True]
    assert [b.ignore for b in boxes["000001"] if b.label == "Car"] == [True]
    assert [b.ignore for b in boxes["000004"] if b.label == "Car"] == [False, True]
    assert all(b.ignore for f in frames for b in f.boxes if b.label in ("DontCare", "Misc"))


def test_kitti_boxes_lie_in_the_cropped_frames(kitti):
    for frame in kitti.frames():
        for box in frame.boxes:
            assert 0 <= box.x1 < box.x2 <= 1224
            assert 0 <= box.y1 < box.y2 <= 370


def test_kitti_last_previous_frame_is_the_nearest(kitti):
    for frame in kitti.frames()[:5]:
        now = read_grey8(frame.path).astype(float)
        alike = []
        for path in frame.previous:
            before = read_grey8(path)[: now.shape[0], : now.shape[1]]
            alike.append(np.corrcoef(before.ravel(), now.ravel())[0, 1])
        assert alike[-1] == max(alike)


def test_kitti_index(kitti):
    indexed = index(kitti)
    assert len(indexed.frames) == 16
    assert indexed.quarantine.empty
    assert indexed.notes == {CLIPPED: 9, COLOUR: 16}
    assert (indexed.patches["purpose"] == "noise").sum() == 16 * 9 * 2
    assert set(indexed.patches.query("purpose == 'blur'")["label"]) <= kitti.classes - {"DontCare", "Misc"}


def test_udacity_label_formats_agree(shared):
    autti, crowdai = (udacity(shared, layout).frames() for layout in ("autti", "crowdai"))
    assert len(autti) == 5
    assert [(f.name, f.boxes) for f in autti] == [(f.name, f.boxes) for f in crowdai]
    assert [len(f.boxes) for f in autti] == [0, 1, 3, 4, 4]
    assert [len(f.previous) for f in autti] == [0, 0, 1, 2, 3]  # half a second apart


def test_udacity_boxes_equal_the_simplified_labels(shared):
    truth = shared / "vectors" / "detection" / "GT"
    for frame in udacity(shared, "autti").frames():
        expected = [(b.label, b.x1, b.y1, b.x2, b.y2) for b in read_box_labels(truth / f"{frame.name}.txt")]
        assert sorted((b.label, b.x1, b.y1, b.x2, b.y2) for b in frame.boxes) == sorted(expected)


def test_udacity_index_has_the_papers_tiles(shared):
    indexed = index(udacity(shared, "autti"))
    assert (indexed.patches["purpose"] == "noise").sum() == 5 * 135


def test_authors_sim_is_a_folder(shared):
    dataset = datasets.open_dataset("folder", "sim_authors", shared / "realdata" / "sim_authors")
    scanned = scan(dataset)
    assert [len(f.boxes) for f in scanned.usable] == [1, 2, 2, 2, 2]
    assert (scanned.quarantined, scanned.notes) == ([], {})
    assert {box.label for f in scanned.usable for box in f.boxes} == {"car"}


def test_whitelists(shared):
    vectors = shared / "vectors"
    data = shared / "realdata"
    with pytest.raises(InputError, match=r"udacity_blur_whitelist.txt: 5 of 9 names are no frames here"):
        datasets.open_dataset(
            "udacity", "u", data / "udacity", whitelist=vectors / "udacity_blur_whitelist.txt"
        ).frames()
    with pytest.raises(InputError, match="000005, 000006"):
        datasets.open_dataset("kitti", "k", data / "kitti", whitelist=vectors / "kitti_blur_whitelist.txt").frames()
