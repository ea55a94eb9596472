"""Frames chosen: evenly spread, more moments than the index holds, and which of them are independent."""

from pathlib import Path

from data_makers import make_sim

from pipeline.datasets.photos import PHOTOGRAPHS
from pipeline.datasets.selection import evaluation_frames, evenly_spread, scene_of
from pipeline.datasets.settings import DatasetSettings


def test_items_are_spread_evenly():
    assert evenly_spread(list(range(10)), 3) == [0, 3, 6]
    assert evenly_spread([1, 2], 5) == [1, 2] and evenly_spread([1, 2], None) == [1, 2]


def test_more_moments_can_be_judged_than_the_index_holds(tmp_path):
    root = make_sim(tmp_path / "sim", viewpoints=2)
    section = DatasetSettings(kind="sim", root=str(root), dvc_dependency="data/sim", limit=1, max_rejected_fraction=0.0)
    frames = evaluation_frames(tmp_path, "sim", section, {"moments": "all"})
    assert len(frames) == 8
    chosen = evaluation_frames(tmp_path, "sim", section, {"moments": "all"}, 4)
    assert [frame.name[-6:] for frame in chosen] == ["0000-0", "0000-2", "0001-0", "0001-2"]
    assert len({scene_of("sim", frame.name) for frame in frames}) == 2
    assert scene_of("kitti", "000012") == "000012" and scene_of("folder", "street-3") == "street-3"


def test_a_stereo_pair_is_one_scene():
    names = [Path(photograph.file).stem for photograph in PHOTOGRAPHS]
    assert scene_of("photos", "motorcycle_left") == scene_of("photos", "motorcycle_right") == "motorcycle"
    assert len({scene_of("photos", name) for name in names}) == len(names) - 1
    assert scene_of("folder", "street_left") == "street_left"


def test_seconds_of_one_drive_are_one_scene():
    """Names of Udacity are nanoseconds; four frames within 1.5 s, one 209 s earlier."""
    names = [f"{time_ns}" for time_ns in (1478019984182279255, 1478020193690486111, 1478020194190078499)]
    names += ["1478020194690266730", "1478020195196250051"]
    first, *others = (scene_of("udacity", name) for name in names)
    assert len(set(others)) == 1 and first not in others
    assert scene_of("udacity", "street_1") == "street_1" and scene_of("kitti", names[0]) == names[0]
