"""Training samples: the label is the MTF of what was done to the image, the noise has the sigma that is said."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from pipeline.camera import mtf
from pipeline.camera.constants import PAPER_FULL_WELL_E, PAPER_HOT_DARK_E, PAPER_HOT_READOUT_E
from pipeline.camera.processing.denoise import Denoising
from pipeline.camera.processing.develop import CameraPipeline
from pipeline.camera.processing.raw_noise import RawNoise
from pipeline.camera.processing.sharpen import Sharpening
from pipeline.learning import kernels, samples
from pipeline.learning.settings import Recipe
from pipeline.streams import stream, torch_stream

RECIPE = Recipe(views=4, kernels_per_view=2)


@pytest.fixture(scope="module")
def bank():
    return kernels.block(0, 1, count=40)


def sampler(bank, recipe=RECIPE, seed=1):
    tiles = stream(0, "tiles").integers(0, 256, (3, 300, 300)).astype(np.uint8)
    return samples.Samples(tiles, bank, recipe, seed)


def test_a_chunk_is_a_function_of_seed_and_number(bank):
    made = sampler(bank)
    forward = [made.chunk(number) for number in (0, 1)]
    backward = [sampler(bank).chunk(number) for number in (1, 0)][::-1]
    for one, two in zip(forward, backward, strict=True):
        assert np.array_equal(one.patches_dn, two.patches_dn)
        assert np.array_equal(one.mtf, two.mtf) and np.array_equal(one.sigma_dn, two.sigma_dn)
    assert not np.array_equal(forward[0].patches_dn, forward[1].patches_dn)
    assert not np.array_equal(forward[0].patches_dn, sampler(bank, seed=2).chunk(0).patches_dn)


def test_shapes_and_ranges(bank):
    chunk = sampler(bank).chunk(3)
    assert chunk.patches_dn.shape == (8, 192, 192) and chunk.patches_dn.dtype == np.uint8
    assert chunk.mtf.shape == (8, 2, 8) and chunk.mtf.dtype == np.float32
    assert (chunk.mtf >= 0).all() and (chunk.mtf <= 1 + 1e-5).all()
    assert (chunk.sigma_dn >= 0).all() and (chunk.sigma_dn <= RECIPE.largest_sigma_dn).all()


def test_the_label_is_the_mtf_of_the_blur(bank):
    """A point of light, blurred, is the total kernel; its MTF by the package's own transform is the label."""
    middle = samples.FIELD_PX // 2
    scene = torch.full((4, samples.FIELD_PX, samples.FIELD_PX), 1 / 32)  # grey: nothing is cut at black
    scene[:, middle, middle] += 0.4
    image, label = sampler(bank)._blurred(scene, stream(1, "x"))
    response = (image - image.flatten(1).median(1).values[:, None, None]).double().numpy() / 0.4
    assert np.abs(response.sum((1, 2)) - 1).max() < 2e-3
    assert np.abs(mtf.sample(response) - label.numpy()).max() < 2e-3


def test_intrinsic_blur_is_part_of_the_label():
    point = np.zeros((1, kernels.CANVAS_PX, kernels.CANVAS_PX), np.float32)
    point[0, kernels.CANVAS_PX // 2, kernels.CANVAS_PX // 2] = 1
    chunk = sampler(point, replace(RECIPE, intrinsic_px=(0.6, 0.6))).chunk(0)
    assert np.abs(chunk.mtf - mtf.gaussian(0.6, mtf.FREQUENCIES)).max() < 1e-5


DELIVERED = replace(RECIPE, views=6, camera_fraction=1.0)
BARE = CameraPipeline(demosaicing=None, gamma=1.0)  # grey levels in, the same grey levels out


def delivered(monkeypatch, bank, camera, recipe=DELIVERED):
    """The chunk of which every sample is delivered by one camera."""
    monkeypatch.setattr(samples.cameras, "draw", lambda generator, cameras: camera)
    return sampler(bank, recipe).chunk(0)


def horizontal_contrast(patches_dn):
    """(8,) root mean power of patches (N, 192, 192) on the horizontal axis, in a band about each label's frequency."""
    levels = (patches_dn - patches_dn.mean((1, 2), keepdims=True)).mean(axis=1)  # vertical frequency 0
    power = (np.abs(np.fft.rfft(levels * np.hanning(192), axis=1)) ** 2).mean(0)
    cycles = np.fft.rfftfreq(192)
    return np.sqrt([power[np.abs(cycles - f) < 0.012].mean() for f in mtf.FREQUENCIES / 2])


def test_a_bare_camera_delivers_the_scene_itself(monkeypatch):
    """In linear light or not: without blur between decoding and encoding, grey levels come back to rounding."""
    point = np.zeros((1, kernels.CANVAS_PX, kernels.CANVAS_PX), np.float32)
    point[0, kernels.CANVAS_PX // 2, kernels.CANVAS_PX // 2] = 1
    recipe = replace(DELIVERED, intrinsic_px=(0.0, 0.0), clean_fraction=1.0, pre_blur_noise_fraction=0.0)
    pictures = delivered(monkeypatch, point, BARE, recipe).patches_dn
    never = replace(recipe, camera_fraction=1e-12)  # the same draws, all below
    scenes = delivered(monkeypatch, point, BARE, never).patches_dn
    assert np.abs(pictures.astype(int) - scenes).max() <= 1


@pytest.mark.parametrize(
    "steps", [{"denoising": Denoising(softness_px=0.8)}, {"sharpening": Sharpening(0.8, 1.0)}], ids=["soft", "sharp"]
)
def test_the_label_of_a_delivered_picture_is_the_mtf_of_that_picture(monkeypatch, steps):
    """The same scenes through two cameras: contrasts of the pictures differ as the labels do."""
    point = np.zeros((1, kernels.CANVAS_PX, kernels.CANVAS_PX), np.float32)
    point[0, kernels.CANVAS_PX // 2, kernels.CANVAS_PX // 2] = 1
    recipe = replace(DELIVERED, intrinsic_px=(0.9, 0.9))
    bare, processed = (delivered(monkeypatch, point, camera, recipe) for camera in (BARE, replace(BARE, **steps)))
    scene = mtf.gaussian(0.9, mtf.FREQUENCIES)
    assert np.abs(bare.mtf - scene).max() < 1e-5
    measured = horizontal_contrast(processed.patches_dn) / horizontal_contrast(bare.patches_dn)
    labelled = processed.mtf.mean((0, 1)) / scene
    strong = scene > 0.1  # below, rounding to 8 bit is seen
    assert strong.sum() >= 5 and np.abs(labelled - 1)[strong].max() > 0.2
    np.testing.assert_allclose(measured[strong], labelled[strong], rtol=0.05)


def test_labels_of_sharpened_pictures_end_at_one(monkeypatch, bank):
    chunk = delivered(monkeypatch, bank, replace(BARE, sharpening=Sharpening(1.3, 2.0)))
    assert chunk.mtf.max() == 1.0


def test_sigma_of_a_delivered_picture_is_what_its_raw_noise_causes(monkeypatch, bank):
    recipe = replace(DELIVERED, clean_fraction=0.0)  # no other noise is added
    assert (delivered(monkeypatch, bank, BARE, recipe).sigma_dn == 0).all()
    noise = RawNoise(shot=2e-5, read=20.0)  # nearly the same at all levels
    chunk = delivered(monkeypatch, bank, replace(BARE, noise=noise), recipe)
    expected = 255 * np.sqrt(2e-5 * 20.4)
    assert chunk.sigma_dn == pytest.approx(expected, rel=0.08)  # black and white cut some
    soft = replace(BARE, noise=noise, denoising=Denoising(softness_px=1.0))
    left = np.sqrt(1 / (4 * np.pi))  # of white noise behind a Gaussian of 1 px
    assert delivered(monkeypatch, bank, soft, recipe).sigma_dn == pytest.approx(left * expected, rel=0.08)


def test_a_fraction_of_the_views_is_delivered(monkeypatch, bank):
    recipe = replace(RECIPE, views=16, camera_fraction=0.4, clean_fraction=0.0, pre_blur_noise_fraction=0.0)
    chunk = delivered(monkeypatch, bank, BARE, recipe)
    clean = chunk.sigma_dn == 0  # of this camera; all others have noise
    assert 0.1 < clean.mean() < 0.7
    assert np.array_equal(clean[:16], clean[16:])  # both samples of a view, or none


def test_shares_of_clean_samples(bank):
    chunks = [sampler(bank).chunk(number) for number in range(12)]
    clean = np.concatenate([chunk.sigma_dn for chunk in chunks]) == 0
    assert clean.mean() == pytest.approx(RECIPE.clean_fraction + RECIPE.pre_blur_noise_fraction, abs=0.15)
    none = sampler(bank, replace(RECIPE, clean_fraction=1.0, pre_blur_noise_fraction=0.0)).chunk(0)
    assert (none.sigma_dn == 0).all()
    halves = sampler(bank, replace(RECIPE, clean_fraction=0.5, pre_blur_noise_fraction=0.5)).chunk(0)
    assert (halves.sigma_dn == 0).all()  # half of all samples are clean: every one without noise from before the blur


@pytest.mark.parametrize("kind", range(4))
def test_noise_has_the_variance_of_its_source(kind):
    grey = torch.full((6, 128, 128), 0.4)
    noise = samples.noise_e(grey, torch.full((6,), kind), torch_stream(1, "n", kind))
    signal, dark, readout = 0.4 * PAPER_FULL_WELL_E, PAPER_HOT_DARK_E, PAPER_HOT_READOUT_E**2
    expected = [signal, dark, readout, signal + dark + readout][kind]
    assert float(noise.var()) == pytest.approx(expected, rel=0.02)
    assert abs(float(noise.mean())) < 3 * (expected / noise.numel()) ** 0.5


def test_charge_noise_of_white_pixels_is_one_sided():
    noise = samples.noise_e(torch.ones(1, 64, 64), torch.tensor([0]), torch_stream(1, "n"))
    assert float(noise.max()) == 0 and float(noise.mean()) < -50


def test_noise_is_scaled_to_its_sigma():
    noise = samples.noise_e(torch.full((5, 64, 64), 0.5), torch.arange(5) % 4, torch_stream(2, "n"))
    wanted = torch.tensor([0.0, 1.0, 5.0, 10.0, 30.0])
    assert torch.allclose(samples.scaled(noise, wanted).std((1, 2)), wanted, rtol=0.02, atol=1e-6)
    silent = samples.scaled(torch.zeros(1, 8, 8), torch.tensor([5.0]))
    assert float(silent.abs().max()) == 0
