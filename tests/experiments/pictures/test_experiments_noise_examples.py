"""Examples of delivered pictures: the truth is the noise of the decoded picture; abstentions are counted."""

import cv2
import numpy as np
import pytest
from skimage import data

from pipeline import noise
from pipeline.camera.processing.codec import Codec
from pipeline.errors import InputError
from pipeline.experiments.pictures.noise_examples import COLUMNS, measure, patches, photograph, stored
from pipeline.streams import stream


@pytest.fixture
def frame(tmp_path):
    path = tmp_path / "frame.png"
    cv2.imwrite(str(path), data.camera()[:256, :256])
    return path


def test_the_truth_of_a_lossless_frame_is_the_noise_added(frame):
    example = stored("lossless", [frame], 6.0, Codec("none"), 1)
    assert example.true_sigma_dn.shape == (4,) and example.true_sigma_dn == pytest.approx(6, rel=0.15)
    table = measure(example, {"pca": noise.create("pca"), "adaptive": noise.create("adaptive")})
    assert list(table.columns) == list(COLUMNS) and (table["answered"] == 4).all() and (table["reasons"] == "").all()
    assert (table["sigma_dn"] - 6).abs().max() < 1


def test_a_strong_codec_removes_noise_and_abstentions_are_counted_by_reason(frame):
    example = stored("video", [frame] * 3, 3.0, Codec("h264", 35), 1)
    assert example.true_sigma_dn.min() < 2  # of the smooth patch; others keep noise of the codec itself
    row = measure(example, {"adaptive": noise.create("adaptive")}).iloc[0]
    assert row["answered"] < 4 and row["reasons"].startswith("compressed")
    assert row["unclipped_sigma_dn"] == 3.0


def test_a_photograph_is_compared_with_its_mean(tmp_path, frame):
    mean = cv2.imread(str(frame), 0)
    noisy = np.clip(np.rint(mean + stream(1, "photograph").normal(0, 4, mean.shape)), 0, 255).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "real.png"), noisy)
    example = photograph("photograph", tmp_path / "real.png", frame)
    assert example.true_sigma_dn == pytest.approx(4, rel=0.1) and np.isnan(example.unclipped_sigma_dn)
    assert (patches(example.picture)[1] == noisy[:128, 128:256]).all()


def test_pictures_of_unequal_size_are_refused(tmp_path, frame):
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((128, 128), np.uint8))
    with pytest.raises(InputError, match="expected the same"):
        photograph("p", frame, tmp_path / "small.png")
    with pytest.raises(InputError, match="one size"):
        stored("s", [frame, tmp_path / "small.png"], 1.0, Codec("none"), 1)
