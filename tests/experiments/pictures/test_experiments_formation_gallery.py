"""The gallery of the image-formation chain shows what its description lists."""

import numpy as np
import pytest
from data_makers import make_kitti

from pipeline.camera.settings import CameraSettings
from pipeline.datasets import open_dataset
from pipeline.experiments.pictures.formation_gallery import gallery


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    return open_dataset("kitti", "kitti", make_kitti(tmp_path_factory.mktemp("d") / "kitti")).frames()[0]


def test_gallery_describes_the_arrays_it_holds(frame):
    arrays, described = gallery(frame, ["photon", "dcsn"], [0, 10], CameraSettings(), 1, 15, 11, 128)
    named = [entry["array"] for entry in described["chain"] + described["effects"]]
    assert sorted(named) == sorted(arrays)
    assert {array.shape for array in arrays.values()} == {(128, 128)}
    assert {array.dtype for array in arrays.values()} == {np.dtype(np.uint8)}
    assert np.array_equal(arrays["photon_0"], arrays["dcsn_0"])
