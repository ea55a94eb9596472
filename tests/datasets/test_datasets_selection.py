"""Frames chosen: evenly spread, and which of them are independent."""

import dataclasses
import shutil
from pathlib import Path

import pytest
from data_makers import make_folder, make_kitti, make_sim, make_udacity

from pipeline.datasets import open_dataset
from pipeline.datasets.folder import Folder
from pipeline.datasets.photos import PHOTOGRAPHS
from pipeline.datasets.selection import evenly_spread, scenes_of
from pipeline.datasets.udacity import Udacity
from pipeline.errors import InputError


def test_items_are_spread_evenly():
    assert evenly_spread(list(range(10)), 3) == [0, 3, 6]
    assert evenly_spread([1, 2], 5) == [1, 2] and evenly_spread([1, 2], None) == [1, 2]


def test_moments_of_one_viewpoint_are_one_scene(tmp_path):
    frames = open_dataset("sim", "sim", make_sim(tmp_path / "sim", viewpoints=2), moments="all").frames()
    assert len(frames) == 8
    assert set(scenes_of(frames).values()) == {"evaluation-0000", "evaluation-0001"}


def test_frames_are_scenes_of_their_own_where_nothing_is_known_of_them(tmp_path):
    for kind, root in (("kitti", make_kitti(tmp_path / "kitti")), ("folder", make_folder(tmp_path / "folder"))):
        frames = open_dataset(kind, kind, root).frames()
        assert scenes_of(frames) == {frame.name: frame.name for frame in frames} and len(frames) == 3
    stated = [dataclasses.replace(frame, scene="") for frame in frames]  # as of a reader that makes its frames itself
    assert scenes_of(stated) == scenes_of(frames)


def test_a_stereo_pair_is_one_scene():
    scenes = scenes_of(open_dataset("photos", "photos").frames())
    assert scenes["motorcycle_left"] == scenes["motorcycle_right"] == "motorcycle"
    assert len(set(scenes.values())) == len(scenes) - 1 == len(PHOTOGRAPHS) - 1


def test_seconds_of_one_drive_are_one_scene(tmp_path):
    """Names of Udacity are nanoseconds; four frames within 1.5 s, one 209 s earlier."""
    names = [f"{time_ns}" for time_ns in (1478019984182279255, 1478020193690486111, 1478020194190078499)]
    names += ["1478020194690266730", "1478020195196250051"]
    drive = Udacity("udacity", make_udacity(tmp_path, frames=2))
    first, *others = (drive.scene_of(name) for name in names)
    assert len(set(others)) == 1 and first not in others
    assert drive.scene_of("street_1") == "street_1"
    assert set(scenes_of(drive.frames()).values()) == set(others)


def bursts(root: Path) -> Path:
    """A folder of two bursts of two frames each, and another frame."""
    made = make_folder(root, frames=5)
    for old, new in enumerate(("yard_1", "yard_2", "gate_north_1", "gate_north_7", "last")):
        shutil.move(made / f"images/frame-{old}.png", made / f"images/{new}.png")
        shutil.move(made / f"labels/frame-{old}.txt", made / f"labels/{new}.txt")
    return made


@pytest.mark.parametrize(
    ("scene", "scenes"),
    [
        ("(.+)_|.+", ["gate_north", "gate_north", "last", "yard", "yard"]),
        ("[^_]+", ["gate", "gate", "last", "yard", "yard"]),
        (".", ["g", "g", "l", "y", "y"]),
        (None, ["gate_north_1", "gate_north_7", "last", "yard_1", "yard_2"]),
    ],
)
def test_names_of_a_folder_tell_scenes_by_an_expression(scene, scenes, tmp_path):
    frames = open_dataset("folder", "mine", bursts(tmp_path), scene=scene).frames()
    assert list(scenes_of(frames).values()) == scenes


def test_an_expression_for_scenes_that_is_none_or_matches_no_name_is_refused(tmp_path):
    root = bursts(tmp_path)
    for wrong in ("(.+_", 5):
        with pytest.raises(InputError, match=r"datasets\.mine\.options\.scene=.*expected a regular expression"):
            open_dataset("folder", "mine", root, scene=wrong)
    for scene in (".+_", "x*"):
        with pytest.raises(InputError, match=r"mine\.options\.scene=.*matches nothing .*'(last|gate_north_1)'"):
            open_dataset("folder", "mine", root, scene=scene).frames()
    (root / "labels/classes.txt").write_text("car\n")  # set aside, and asked for no scene
    frames = open_dataset("folder", "mine", root, scene="[a-z]+_|last").frames()
    assert [frame.name for frame in frames if frame.defect] == ["classes"]


def test_a_third_partys_reader_states_its_scenes(tmp_path):
    class Drives(Folder):
        def scene_of(self, frame: str) -> str:
            return frame.partition("_")[0]

    assert set(scenes_of(Drives("mine", bursts(tmp_path)).frames()).values()) == {"gate", "last", "yard"}
