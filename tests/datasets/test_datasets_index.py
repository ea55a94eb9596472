"""Quarantine and index: broken files are counted and named, tables follow their schemas and depend on nothing else."""

from __future__ import annotations

import os
import signal
from functools import partial

import cv2
import numpy as np
import pytest
from data_makers import make_folder, make_kitti, make_sim, make_udacity, picture, write

from pipeline import datasets
from pipeline.datasets.index import index, indexed_patches, usable_frames
from pipeline.datasets.labels import CLIPPED, UNKNOWN
from pipeline.datasets.patches import Patch, object_patches, tiles
from pipeline.datasets.quarantine import ALPHA, COLOUR, DEEP, ODD_SIZE, PREVIOUS, scan
from pipeline.errors import InputError
from pipeline.executor import run_map
from pipeline.store import write_table
from pipeline.tables import FRAMES, PATCHES, QUARANTINE


def test_clean_dataset(tmp_path):
    scanned = scan(datasets.open_dataset("sim", "sim", make_sim(tmp_path)))
    assert [f.name for f in scanned.usable] == ["evaluation-0000-3", "evaluation-0001-3"]
    assert (scanned.quarantined, scanned.notes) == ([], {})


def broken_kitti(tmp_path):
    """Twenty frames, seven of them broken in seven ways, six worth a note."""
    root = make_kitti(tmp_path, frames=20, previous=1)
    images, labels = root / "training" / "image_2", root / "training" / "label_2"
    whole = (images / "000000.png").read_bytes()
    (images / "000000.png").write_bytes(whole[: len(whole) // 2])
    (images / "000001.png").write_bytes(b"")
    (images / "000002.png").write_text("not a picture")
    write(images / "000003.png", picture("small", 448, 191))
    (labels / "000004.txt").unlink()
    (labels / "000005.txt").write_text("Car 0 0 0 one 2 3 4 5 6 7 8 9 10 11\n")
    first = picture("a")
    (images / "000006.png").write_bytes(cv2.imencode(".tiff", first.astype(np.float32))[1].tobytes())
    write(images / "000007.png", first.astype(np.uint16) * 257)
    write(images / "000008.png", picture("odd", 447, 321))
    cv2.imwrite(str(images / "000009.png"), np.dstack([first, first, first, first]))
    rest = "1.5 1.6 3.9 1.0 1.7 20.0 0.1"
    (labels / "000010.txt").write_text(f"Car 0 0 0 400 10 500 90 {rest}\nPlane 0 0 0 10 10 80 90 {rest}\n")
    (root / "training" / "prev_2" / "000011_01.png").write_bytes(whole[:200])
    write(root / "training" / "prev_2" / "000012_01.png", picture("small", 400, 320))
    return root


def test_every_case_is_handled_and_counted(tmp_path):
    root = broken_kitti(tmp_path)
    dataset = datasets.open_dataset("kitti", "kitti", root)
    scanned = scan(dataset, max_rejected_fraction=0.35)
    reasons = {row.file: row.reason for row in scanned.quarantined}
    expected = {
        "training/image_2/000000.png": "truncated",
        "training/image_2/000001.png": "empty file",
        "training/image_2/000002.png": "not a picture",
        "training/image_2/000003.png": "too small: 448x191",
        "training/image_2/000004.png": "training/label_2/000004.txt: missing label file",
        "training/image_2/000005.png": "training/label_2/000005.txt, line 1: 'one' is not a number",
        "training/image_2/000006.png": "float values from",
    }
    assert reasons.keys() == expected.keys()
    for file, reason in expected.items():
        assert reasons[file].startswith(reason), (file, reasons[file])
    assert str(root) not in " ".join(reasons.values())
    assert len(scanned.usable) == 13
    grey = {"000007", "000008"}  # written in one channel
    assert scanned.notes == {
        COLOUR: 13 - len(grey),
        DEEP.format(bits=16, white=65535): 1,
        ODD_SIZE: 1,
        ALPHA: 1,
        CLIPPED: 1,
        UNKNOWN: 1,
        PREVIOUS: 3,  # two that were broken, and one that is smaller than the odd-sized frame
    }
    without = {f.name for f in scanned.usable if not f.previous}
    assert without == {"000008", "000011", "000012"}


def test_the_note_of_deep_values_names_the_value_they_are_divided_by(tmp_path):
    values = (picture("deep") * np.uint16(16)).astype(">u2")
    for white in (65535, 4095):
        (tmp_path / f"{white}.pgm").write_bytes(f"P5\n448 320\n{white}\n".encode() + values.tobytes())
    notes = scan(datasets.open_dataset("folder", "mine", tmp_path)).notes
    assert notes == {f"{bits} bits a channel: divided by {2**bits - 1}": 1 for bits in (12, 16)}


def test_named_pipes_are_set_aside_and_not_waited_for(tmp_path):
    root = make_folder(tmp_path, frames=2)
    (root / "images/frame-1.png").unlink()
    os.mkfifo(root / "images/frame-1.png")

    def waited(*_):
        raise AssertionError("waited for the pipe")

    before = signal.signal(signal.SIGALRM, waited)
    signal.alarm(2)
    try:
        scanned = scan(datasets.open_dataset("folder", "mine", root), 1.0)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    assert [frame.name for frame in scanned.usable] == ["frame-0"]
    (row,) = scanned.quarantined
    assert (row.file, row.reason) == ("images/frame-1.png", "cannot be read (a folder, pipe or device, and no file)")


def test_too_many_bad_frames_stop_the_run(tmp_path):
    dataset = datasets.open_dataset("kitti", "kitti", broken_kitti(tmp_path))
    with pytest.raises(InputError) as caught:
        scan(dataset)
    message = str(caught.value)
    assert "7 of 20 frames cannot be used" in message
    assert "5% allowed by datasets.kitti.max_rejected_fraction (of camera-monitor dataset: --max-rejected-" in message
    assert message.count(".png (") == 3  # the first three files
    with pytest.raises(InputError, match=r"^datasets\.kitti\.max_rejected_fraction=1\.5: expected a share"):
        scan(dataset, max_rejected_fraction=1.5)


def test_index_tables(tmp_path):
    dataset = datasets.open_dataset("kitti", "kitti", make_kitti(tmp_path))
    indexed = index(dataset)
    assert indexed.frames.equals(FRAMES.conform(indexed.frames))
    assert indexed.patches.equals(PATCHES.conform(indexed.patches))
    assert indexed.quarantine.equals(QUARANTINE.conform(indexed.quarantine))
    assert list(indexed.frames["frame"]) == ["000000", "000001", "000002"]
    row = indexed.frames.iloc[0]
    assert (row["objects"], row["objects_ignored"], row["previous_frames"], row["split"]) == (2, 2, 3, "training")
    assert row["mean_dn"] == pytest.approx(indexed.usable[0].image().mean() * 255, rel=1e-6)
    counts = indexed.patches.groupby("purpose").size()
    assert counts["noise"] == 3 * len(tiles((320, 448)))
    assert counts["blur"] == sum(len(object_patches((320, 448), f.boxes)) for f in dataset.frames())
    assert set(indexed.patches.loc[indexed.patches["purpose"] == "blur", "label"]) == {"Car", "Pedestrian"}
    for (_, _), group in indexed.patches.groupby(["frame", "purpose"]):
        assert list(group["patch"]) == list(range(len(group)))


def test_index_of_unlabelled_frames_takes_the_whole_frame(tmp_path):
    dataset = datasets.open_dataset("folder", "mine", make_folder(tmp_path, labels=False))
    blur = index(dataset).patches.query("purpose == 'blur'")
    assert len(blur) == 3 * len(tiles((320, 448), 192))
    assert set(blur["label"]) == {""}
    assert index(dataset, patches_from="objects").patches.query("purpose == 'blur'").empty
    with pytest.raises(InputError, match="patches_from='boxes'"):
        index(dataset, patches_from="boxes")


def test_index_options(tmp_path):
    dataset = datasets.open_dataset("sim", "sim", make_sim(tmp_path, viewpoints=1))
    indexed = index(dataset, patch_px=96, tile_px=64, patches_from="frame")
    assert set(indexed.patches["size_px"]) == {96, 64}
    counts = indexed.patches.groupby("purpose").size()
    assert (counts["noise"], counts["blur"]) == (7 * 5, 4 * 3)


def test_index_without_bad_frames_has_an_empty_quarantine_of_the_right_shape(tmp_path):
    indexed = index(datasets.open_dataset("udacity", "u", make_udacity(tmp_path)))
    assert list(indexed.quarantine.columns) == list(QUARANTINE.columns)
    assert indexed.quarantine.empty


@pytest.mark.slow
def test_index_does_not_depend_on_workers(tmp_path):
    dataset = datasets.open_dataset("kitti", "kitti", broken_kitti(tmp_path))
    one = index(dataset, max_rejected_fraction=0.4)
    two = index(dataset, max_rejected_fraction=0.4, run_map=partial(run_map, workers=2))
    for left, right in zip(one[:3], two[:3], strict=True):
        assert left.equals(right)
    assert [f.name for f in one.usable] == [f.name for f in two.usable]
    assert one.notes == two.notes


def test_index_of_a_subset_has_the_same_rows(tmp_path):
    root = make_folder(tmp_path / "data", frames=4)
    (tmp_path / "list.txt").write_text("frame-1\nframe-3\n")
    every = index(datasets.open_dataset("folder", "m", root))
    some = index(datasets.open_dataset("folder", "m", root, whitelist=tmp_path / "list.txt"))
    for whole, part in ((every.frames, some.frames), (every.patches, some.patches)):
        expected = whole[whole["frame"].isin(["frame-1", "frame-3"])].reset_index(drop=True)
        assert expected.equals(part)


def test_usable_frames_come_back_from_the_table(tmp_path):
    dataset = datasets.open_dataset("kitti", "kitti", broken_kitti(tmp_path))
    indexed = index(dataset, max_rejected_fraction=0.4)
    assert usable_frames(dataset, indexed.frames) == indexed.usable
    with pytest.raises(InputError, match="no frame '000019' any more"):
        (dataset.root / "training" / "image_2" / "000019.png").unlink()
        usable_frames(dataset, indexed.frames)


def test_of_previous_frames_the_latest_without_a_gap_are_used(tmp_path):
    """The oldest of three is broken: two are left. The middle one is: the one after it."""
    root = make_kitti(tmp_path, frames=2, previous=3)
    for stem in ("000000_03", "000001_02"):
        (root / "training" / "prev_2" / f"{stem}.png").write_bytes(b"")
    dataset = datasets.open_dataset("kitti", "kitti", root)
    indexed = index(dataset)
    assert indexed.frames["previous_frames"].tolist() == [2, 1] and indexed.notes[PREVIOUS] == 2
    for frames in (indexed.usable, usable_frames(dataset, indexed.frames)):
        names = [[path.stem for path in frame.previous] for frame in frames]
        assert names == [["000000_02", "000000_01"], ["000001_01"]]


def test_indexed_patches(tmp_path):
    indexed = index(datasets.open_dataset("sim", "sim", make_sim(tmp_path / "sim")))
    write_table(tmp_path / "patches.parquet", indexed.patches, PATCHES)
    noise = indexed_patches(tmp_path, "noise")
    assert list(noise) == ["evaluation-0000-3", "evaluation-0001-3"]
    assert noise["evaluation-0000-3"] == tiles((320, 448))
    few = indexed_patches(tmp_path, "noise", per_frame=3)
    assert few["evaluation-0001-3"] == [noise["evaluation-0001-3"][number] for number in (0, 2, 4)]
    blur = indexed_patches(tmp_path, "blur")["evaluation-0000-3"]
    assert blur[0] == Patch(98, 128, 192, "car")
