"""Spectral and pixel networks as one estimator: what each answers, in which order, and what a calibration is given."""

import numpy as np
import pytest
import torch

from pipeline.blur.camera_calibration import fit_map
from pipeline.blur.networks.pixel_net import ARCHITECTURE, PixelNet
from pipeline.blur.spectral import Spectral
from pipeline.blur.spectral_and_pixels import RELEASED, SpectralAndPixels
from pipeline.errors import InputError
from pipeline.learning import images, weights
from pipeline.learning.initial import initialise


@pytest.fixture(scope="module")
def patches():
    pictures = [images.picture(index, 5, "test image", 192) for index in range(4)]
    return np.stack(pictures)[:, None].astype(np.float32) / 255


@pytest.fixture(scope="module")
def estimator():
    return SpectralAndPixels(Spectral(batch=3))


def test_uncalibrated_it_answers_as_the_spectral_networks_do(estimator, patches):
    both, spectral = estimator.estimate(patches), Spectral(batch=3).estimate(patches)
    assert np.array_equal(both.mtf, spectral.mtf) and np.array_equal(both.low, spectral.low)


def test_the_pixel_network_stands_between_the_spectral_ones(estimator, patches):
    every, spectral = estimator.estimate(patches), Spectral(batch=3).predict_members(patches)
    assert every.members.shape == (4, 3, 2, 8) and every.hidden.units.shape == (4, 3, 256)
    assert np.array_equal(every.members[:, ::2], spectral.members)
    assert np.array_equal(every.hidden.units[:, ::2], spectral.hidden.units)
    network = PixelNet()
    weights.into(network, RELEASED, ARCHITECTURE)
    with torch.inference_mode():
        read = network.eval()(torch.from_numpy(np.rint(patches[:, 0] * 255)))[0].numpy()
    assert np.allclose(every.members[:, 1], read, atol=1e-4)


def test_output_layers_give_the_networks_answers(estimator, patches):
    every, layers = estimator.estimate(patches), estimator.output_layers()
    seen = np.maximum(np.einsum("nef,ekf->nek", every.hidden.units, layers.first) + layers.first_offset, 0)
    logits = np.einsum("nek,evk->nev", seen, layers.second) + layers.second_offset
    read = (1 / (1 + np.exp(-logits))).reshape(every.members.shape)
    alone = every.hidden.second_share == 0  # else the first is the joint answer
    assert alone.any() and np.allclose(read[alone], every.members[alone], atol=1e-4)


@pytest.mark.full("a calibration of three networks takes 7 s")
def test_a_calibration_joins_all_three(estimator, patches):
    made = fit_map(estimator, patches[:3], samples=100)
    assert made.members == 3
    read = estimator.estimate(patches)
    moved = read.members.copy()
    moved[:, 1] = np.clip(moved[:, 1] + 0.1, 0, 0.99)
    assert not np.allclose(made(read.members, read.hidden), made(moved, read.hidden), atol=1e-3)


def test_weights_that_are_not_released_are_known_for_it(tmp_path):
    network = PixelNet()
    initialise(network, 1, "test")
    path = tmp_path / "net.safetensors"
    weights.save(path, network.state_dict(), ARCHITECTURE, released=False)
    assert not SpectralAndPixels(Spectral(), path).released
    with pytest.raises(InputError, match="no such weight file"):
        SpectralAndPixels(Spectral(), tmp_path / "absent.safetensors")
