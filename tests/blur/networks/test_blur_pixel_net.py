"""The pixel network: what it may not depend on, its training, and the released weights on known blurs."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch

from pipeline.blur.networks.pixel_net import ARCHITECTURE, PixelNet
from pipeline.blur.spectral_and_pixels import RELEASED
from pipeline.blur.training import pixel as pixel_training
from pipeline.camera import mtf
from pipeline.camera.blur import blur as convolve
from pipeline.camera.psf.defocus import create as defocus
from pipeline.camera.psf.linear_motion import create as motion
from pipeline.learning import images, kernels, samples, weights
from pipeline.learning.initial import initialise
from pipeline.learning.run_options import RunOptions
from pipeline.learning.settings import Recipe, Schedule, Training
from pipeline.streams import stream

released = pytest.mark.skipif(not RELEASED.is_file(), reason="the pixel network has not been trained yet")


def noise(count, seed=0):
    return torch.from_numpy(stream(seed, "noise").normal(120, 25, (count, 192, 192)).astype(np.float32))


@pytest.fixture(scope="module")
def untrained():
    network = PixelNet()
    initialise(network, 1, "test")
    return network.eval()


@pytest.fixture(scope="module")
def trained():
    network = PixelNet()
    weights.into(network, RELEASED, ARCHITECTURE)
    return network.eval()


@pytest.fixture(scope="module")
def pictures():
    """Sharp procedural patches: (8, 1, 192, 192)."""
    results = [images.picture(index, 5, "test image", 192) for index in range(8)]
    return np.stack(results)[:, None].astype(np.float32) / 255


def mtf_of(network, patches):
    """(N, 2, 8) of patches in [0, 1], rounded to 8 bits."""
    with torch.inference_mode():
        return network(torch.from_numpy(np.rint(patches[:, 0] * 255)))[0].numpy()


def test_the_network_has_the_size_that_is_documented():
    assert sum(part.numel() for part in PixelNet().parameters()) == pytest.approx(1.41e6, rel=0.005)


def test_what_it_gives_has_the_shapes_and_ranges_that_the_spectral_network_gives(untrained):
    mean, scale, sigma_dn, sigma_scale = untrained(noise(3))
    assert mean.shape == scale.shape == (3, 2, 8) and sigma_dn.shape == sigma_scale.shape == (3,)
    assert ((mean > 0) & (mean < 1)).all() and all((part > 0).all() for part in (scale, sigma_dn, sigma_scale))
    assert untrained.hidden(noise(3)).shape == (3, 256)


def test_a_patch_is_answered_the_same_alone_and_among_others(untrained):
    patches = noise(5)
    with torch.inference_mode():
        together, alone = untrained(patches)[0], torch.cat([untrained(patch[None])[0] for patch in patches])
    assert torch.allclose(together, alone, atol=1e-5)


def test_brightness_and_contrast_enter_by_their_numbers_only(untrained):
    """What the convolutions see has mean 0 and contrast 1."""
    seen = []
    untrained.body.register_forward_pre_hook(lambda module, given: seen.append(given[0]))
    patches = noise(2)
    with torch.inference_mode():
        for scaled in (patches, 0.5 * patches + 40):
            untrained(scaled)
    assert torch.allclose(seen[0], seen[1], atol=1e-4)
    assert seen[0].shape == (2, 4, 96, 96) and abs(float(seen[0].square().mean()) - 1) < 1e-3


def test_its_loss_shows_every_second_patch_mirrored(untrained):
    patches = noise(4).round().clamp(0, 255).byte()
    truth = {"mtf": torch.full((4, 2, 8), 0.5), "sigma_dn": torch.ones(4)}
    given = []
    pixel_training.loss(
        lambda shown: (given.append(shown), untrained(shown))[1], {"patches_dn": patches, **truth}
    )  # fmt: skip
    assert torch.equal(given[0][::2], patches[::2].float())
    assert torch.equal(given[0][1::2], patches[1::2].float().flip(2))


def test_training_learns_and_resumes_to_the_bit(tmp_path, monkeypatch):
    draw = lambda index, seed, purpose: stream(seed, purpose, index).integers(0, 256, (260, 260)).astype(np.uint8)  # noqa: E731
    monkeypatch.setattr(images, "picture", draw)
    training = Training(
        schedule=Schedule(16, checkpoint_every=8, report_every=4, warm_up=4),
        recipe=Recipe(views=1, kernels_per_view=2), half_precision=False, replays=1,
        images=4, validation_images=2, kernels=250, validation_chunks=2,
    )  # fmt: skip
    alone, other = (RunOptions(tmp_path / "cache", folder=tmp_path / name) for name in "ab")
    whole = pixel_training.train(training, alone)
    pixel_training.train(training, replace(other, stop_after=9))
    again = pixel_training.train(training, other)
    assert whole.curve[-1]["mtf_error_percent"] < 0.9 * whole.curve[0]["mtf_error_percent"]
    for one, two in zip(whole.model.parameters(), again.model.parameters(), strict=True):
        assert torch.equal(one, two)
    path = tmp_path / "net.safetensors"
    pixel_training.save(path, whole, training)
    header = weights.details(path)
    rows = {row["step"]: row for row in whole.curve}
    assert header["interval"] == rows[whole.best_step]["validation_interval"] and not header["released"]
    weights.into(PixelNet(), path, ARCHITECTURE)


@released
def test_released_weights_rank_blur(trained, pictures):
    strength = [
        float(np.median(mtf_of(trained, convolve(pictures, defocus(diameter)))[:, :, 1]))
        for diameter in (1.0, 3.0, 7.0, 11.0, 15.0, 21.0)
    ]
    assert all(a > b for a, b in itertools.pairwise(strength))


@released
def test_released_weights_tell_the_direction_of_motion(trained, pictures):
    for angle_deg, along in ((0.0, 0), (90.0, 1)):
        read = np.median(mtf_of(trained, convolve(pictures, motion(9.0, angle_deg))), axis=0)
        assert read[along, 3] < 0.35 < 0.7 < read[1 - along, 3]


@released
def test_released_weights_read_samples_that_they_have_not_seen(trained):
    """New pictures, kernels and noise: mean error about that of its validation, 4.1 %."""
    tiles = np.stack([images.picture(index, 9, "test image") for index in range(6)])
    made = samples.Samples(tiles, kernels.block(0, 9, "test kernels"), Recipe(), 9)
    chunks = [made.chunk(number) for number in range(6)]
    errors = [np.abs(mtf_of(trained, chunk.patches_dn[:, None] / np.float32(255)) - chunk.mtf) for chunk in chunks]
    assert np.mean(errors) < 0.06


def test_an_upright_patch_and_its_mirror_image_have_one_truth():
    """By which the training may mirror: the MTF along rows and columns is that of the mirrored kernel."""
    kernel = motion(9.0, 30.0)
    assert np.allclose(mtf.sample(kernel), mtf.sample(kernel[:, ::-1]))
