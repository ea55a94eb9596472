"""Maps of local noise: the truth about each cell, and what the report is given to draw."""

from pathlib import Path

import cv2
import numpy as np
from data_makers import picture

from pipeline import noise
from pipeline.camera.settings import CameraSettings
from pipeline.datasets.frame import Frame
from pipeline.experiments.pictures.noise_maps import local_truth, noise_maps
from pipeline.streams import stream


def test_local_truth_follows_the_noise_of_each_place():
    draw = stream(0, "local truth").standard_normal((200, 300)).astype(np.float32)
    draw[:, :150] *= 4
    draw[:, 150:] *= 12
    result = local_truth(draw)
    assert result.shape == (25, 38)
    assert np.allclose(result[:, :15], 4, rtol=0.12)
    assert np.allclose(result[:, 23:], 12, rtol=0.12)


def test_local_truth_is_zero_beside_strong_noise():
    """A running sum must not turn the rounding of what it passed into noise, or into a root of less than nothing."""
    noise_dn = np.zeros((160, 320), np.float32)
    noise_dn[:, :80] = stream(0, "beside").normal(0, 90, (160, 80))
    noise_dn[:40] = stream(0, "above").normal(0, 90, (40, 320))
    assert (local_truth(noise_dn)[12:, 16:] < 1e-3).all()


def test_maps_hold_frame_truth_and_answer(tmp_path):
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), cv2.GaussianBlur(picture("a"), (0, 0), 1))
    frame, camera = Frame("made_up", "a", Path(path)), CameraSettings()
    arrays, metadata = noise_maps(frame, noise.create("cellwise"), ["readout", "dcsn", "photon"], 10.0, camera, 1)
    assert metadata["effects"] == ["photon", "dcsn"]
    for noise_source in metadata["effects"]:
        seen, added, result = (arrays[f"{noise_source}_{part}"] for part in ("seen", "added", "found"))
        assert seen.shape == (320, 448)
        assert seen.dtype == np.uint8
        assert added.shape == result.shape == (40, 56)
        assert abs(np.median(result) - np.median(added)) < 1.5
    light = cv2.resize(arrays["dcsn_seen"].astype(float), (56, 40), interpolation=cv2.INTER_AREA)
    assert np.corrcoef(light.ravel(), arrays["photon_added"].ravel())[0, 1] > 0.7
    assert abs(np.corrcoef(light.ravel(), arrays["dcsn_added"].ravel())[0, 1]) < 0.2
    again = noise_maps(frame, noise.create("cellwise"), ["readout", "dcsn", "photon"], 10.0, camera, 1)
    assert all(np.array_equal(arrays[name], again[0][name]) for name in arrays)
    assert noise_maps(frame, noise.create("pca"), ["dcsn"], 10.0, camera, 1) is None
    assert noise_maps(frame, noise.create("cellwise"), ["readout"], 10.0, camera, 1)[1]["effects"] == ["readout"]
