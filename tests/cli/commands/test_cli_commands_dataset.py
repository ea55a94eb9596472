"""``camera-monitor dataset``: what is usable, what is set aside and why, and what is passed over."""

import pytest
from cli_makers import call
from data_makers import make_folder, make_kitti, make_sim, make_udacity


def test_dataset_says_what_it_found(tmp_path):
    done = call("dataset", "kitti", make_kitti(tmp_path / "kitti", frames=3))
    assert done.exit_code == 0, done.output
    assert "3 usable frames" in done.output
    table = [line.split() for line in done.output.splitlines()[1:5]]
    assert table[0][:3] == ["class", "objects", "ignored"]
    assert table[1] == ["Car", "3", "3", "40.0", "75.0", "110.0", "20.0", "45.0", "70.0", "object:", "car"]
    assert table[0][-2:] == ["to", "detectors"] and table[2][-1] == "ignored"
    make_folder(tmp_path / "folder", frames=4)
    next((tmp_path / "folder").rglob("*.png")).write_bytes(b"")
    done = call("dataset", "folder", tmp_path / "folder")
    assert done.exit_code == 2
    assert "set aside" in done.output


def test_dataset_says_what_each_word_is_to_detectors(tmp_path):
    root = make_folder(tmp_path / "folder", frames=2)
    (root / "labels/frame-0.txt").write_text("Car 10 10 90 90\ncar 20 20 60 90\npersons 30 20 60 90\nbus 1 1 9 9\n")
    done = call("dataset", "folder", root)
    assert done.exit_code == 0, done.output
    roles = {line.split()[0]: line.split("  ")[-1] for line in done.output.splitlines()[2:7]}
    assert roles == {"car": "object: car", "Car": "left out", "persons": "left out", "bus": "left out"} | {
        "traffic": "ignored"
    }
    mistaken = [line.strip() for line in done.output.splitlines() if "to detectors: write" in line]
    assert [line.partition(" to detectors")[0] for line in mistaken] == [
        "1  boxes of 'Car' are no 'car'",
        "1  boxes of 'persons' are no 'person'",
    ]


def test_dataset_counts_the_pictures_of_other_formats_that_it_passes_over(tmp_path):
    make_folder(tmp_path / "folder", frames=2)
    for name in ("a.heic", "b.HEIC", "c.dng", ".d.dng"):
        (tmp_path / "folder" / name).write_bytes(b"x")
    done = call("dataset", "folder", tmp_path / "folder")
    assert done.exit_code == 0, done.output
    counts = [line.split()[:2] for line in done.output.splitlines() if "are no frames" in line]
    assert counts == [["1", ".dng"], ["2", ".heic"]]


def test_dataset_counts_the_pictures_of_sub_folders_that_it_passes_over(tmp_path):
    frames = make_folder(tmp_path / "folder", frames=2) / "images"
    content = (frames / "frame-0.png").read_bytes()
    for name in (
        "day/a.png",
        "night/late/b.PNG",
        "night/late/.c.png",
        ".thumbnails/d.png",
        "night/e.txt",
        "../f/g.png",
    ):
        (frames / name).parent.mkdir(parents=True, exist_ok=True)
        (frames / name).write_bytes(content)
    done = call("dataset", "folder", tmp_path / "folder")
    assert done.exit_code == 0, done.output
    lines = [line.split() for line in done.output.splitlines() if "are no frames" in line]
    assert [(line[0], line[6]) for line in lines] == [("2", "images/day"), ("1", "such")]
    assert "1  pictures beside the folder images such as f/g.png are no frames" in done.output


@pytest.mark.parametrize(
    ("moved", "searched", "there"),
    [
        ("images/train", "images", "which holds no file; pictures lie in {}/images/train (2), where none is read"),
        ("Images", ".", "which holds no file; pictures lie in {}/Images (2), where none is read: move"),
        ("images/.thumbnails", "images", "which holds no file. Any folder of"),
    ],
)
def test_dataset_without_a_picture_says_where_it_looked_and_what_is_there(moved, searched, there, tmp_path):
    root = make_folder(tmp_path / "folder", frames=2)
    (root / "images").rename(root / "old")
    (root / moved).parent.mkdir(exist_ok=True)
    (root / "old").rename(root / moved)
    done = call("dataset", "folder", root)
    assert done.exit_code == 2 and len(done.stderr.splitlines()) == 1
    assert f"no pictures in {root / searched}, {there.format(root)}" in done.stderr


def test_dataset_of_formats_that_it_does_not_read_names_them(tmp_path):
    root = make_folder(tmp_path / "folder", frames=2)
    for path in (root / "images").iterdir():
        path.rename(path.with_suffix(".AVIF"))
    (root / "images/list.csv").write_text("x")
    done = call("dataset", "folder", root)
    assert f"no pictures in {root / 'images'}, which holds 2 .avif files, 1 .csv file. Any folder of PNG" in done.stderr


@pytest.mark.parametrize(("kind", "make"), [("kitti", make_kitti), ("sim", make_sim), ("udacity", make_udacity)])
def test_dataset_does_not_point_out_sub_folders_of_the_layout(kind, make, tmp_path):
    done = call("dataset", kind, make(tmp_path))
    assert done.exit_code == 0, done.output
    assert "are no frames" not in done.output
