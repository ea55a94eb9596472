"""Frames chosen: evenly spread, more moments than the index holds, and which of them are independent."""

from data_makers import make_sim

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
