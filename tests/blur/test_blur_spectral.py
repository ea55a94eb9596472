"""The spectral estimator: features that blur shifts as theory says, an honest interface, released weights that work."""

import itertools
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pipeline import blur
from pipeline.blur.networks.spectral_features import BLOCK_PX, MAPS, VECTOR_LENGTH, features, mirrored
from pipeline.blur.networks.spectral_net import ARCHITECTURE, SpectralNet, laplace_loss
from pipeline.blur.spectral import RELEASED, Spectral
from pipeline.blur.training import spectral as spectral_training
from pipeline.camera import mtf
from pipeline.camera.blur import blur as convolve
from pipeline.camera.psf.defocus import create as defocus
from pipeline.errors import InputError
from pipeline.learning import images, kernels, samples, weights
from pipeline.learning.initial import initialise
from pipeline.learning.run_options import RunOptions
from pipeline.learning.settings import Recipe, Schedule, Training
from pipeline.streams import stream

released = pytest.mark.skipif(not RELEASED.is_file(), reason="released weights absent: run dvc repro train_mtf")


def noise(count=1, seed=0):
    """White noise of moderate contrast: (N, 192, 192), 0..255."""
    return torch.from_numpy(stream(seed, "noise").normal(120, 25, (count, 192, 192)).astype(np.float32))


@pytest.fixture(scope="module")
def untrained(tmp_path_factory):
    """A weight file of a network that was never trained."""
    network = SpectralNet()
    initialise(network, 1, "test")
    path = tmp_path_factory.mktemp("weights") / "net.safetensors"
    weights.save(path, network.state_dict(), ARCHITECTURE, interval=2.0)
    return path


@pytest.fixture(scope="module")
def pictures():
    """Sharp procedural patches: (8, 1, 192, 192)."""
    results = [images.picture(index, 5, "test image", 192) for index in range(8)]
    return np.stack(results)[:, None].astype(np.float32) / 255


@pytest.mark.parametrize("block_px", [BLOCK_PX, 96])
def test_features_have_their_shapes(block_px):
    maps, vector = features(noise(3), block_px)
    assert maps.shape == (3, MAPS, block_px, block_px // 2) and vector.shape == (3, VECTOR_LENGTH)
    assert maps.isfinite().all() and vector.isfinite().all()


def test_features_do_not_depend_on_the_batch():
    together, alone = features(noise(3)), features(noise(3)[1:2])
    assert all(torch.allclose(one[1], two[0], atol=1e-4) for one, two in zip(together, alone, strict=True))


@given(st.floats(-60, 60), st.integers(0, 50))
def test_features_ignore_brightness_but_for_its_number(offset, seed):
    image = noise(1, seed) * 0.5 + 60
    maps, vector = features(image)
    shifted_maps, shifted_vector = features(image + offset)
    assert torch.allclose(maps, shifted_maps, atol=2e-3)
    assert torch.allclose(vector[:, :-4], shifted_vector[:, :-4], atol=2e-3)
    assert float(shifted_vector[0, -4] - vector[0, -4]) == pytest.approx(offset / 255, abs=1e-4)


def test_features_are_computed_where_the_patches_are():
    """Shapes alone are computed on the device "meta", which refuses tensors of another device."""
    maps, vector = features(torch.zeros(2, 192, 192, device="meta"))
    assert maps.device.type == vector.device.type == "meta"


def test_contrast_shifts_log_power():
    """Half the contrast is a quarter of the power: log 4, in the scale of the features."""
    image = noise(2)
    change = features(120 + (image - 120) * 0.5)[0] - features(image)[0]
    # The least of nine blocks may come near the floor of power; averages do not.
    assert float((change[:, :2] + 0.25 * np.log(4)).abs().mean()) < 2e-3


def test_blur_shifts_the_axis_profiles_by_twice_its_log_mtf():
    kernel = defocus(5.0)
    image = noise(40)
    blurred = torch.from_numpy(convolve(image[:, None].numpy() / 255, kernel))[:, 0] * 255
    change = (features(blurred)[1] - features(image)[1]).mean(0)
    frequencies = np.arange(97) / 96
    for profile, axis in ((0, 0), (1, 1)):
        result = change[profile * 97 : (profile + 1) * 97].numpy()
        expected = 0.25 * 2 * np.log(mtf.curve(kernel, frequencies)[axis])
        usable = (np.abs(expected) < 0.8) & (frequencies > 0.04)
        assert usable.sum() > 25
        assert np.abs(result - expected)[usable].max() < 0.06


@pytest.mark.parametrize(("block_px", "cycles"), [(BLOCK_PX, 30), (96, 30), (96, -46)])
def test_a_wave_is_in_the_cell_of_its_frequency(block_px, cycles):
    """Vertical frequency in the rows from -1/2, horizontal in the columns from 0, of whole patch and blocks alike."""
    rows, columns = torch.meshgrid(torch.arange(192.0), torch.arange(192.0), indexing="ij")
    wave = 120 + 50 * torch.cos(2 * torch.pi * (cycles * rows + 60 * columns) / 192)
    maps = features(wave[None], block_px)[0][0]
    step = 192 // block_px
    for part in maps:
        row, column = divmod(int(part.argmax()), block_px // 2)
        assert (row, column) == (block_px // 2 + cycles // step, 60 // step)


@pytest.mark.parametrize("block_px", [BLOCK_PX, 96])
def test_mirrored_maps_are_those_of_the_mirror_image(pictures, block_px):
    image = torch.from_numpy(pictures[:, 0] * 255)
    maps, vector = features(image, block_px)
    other_maps, other_vector = features(image.flip(2), block_px)
    assert float((mirrored(maps) - other_maps).abs().mean()) < 0.3 * float((maps - other_maps).abs().mean())
    assert torch.equal(mirrored(mirrored(maps)), maps)
    assert float((vector - other_vector).abs().mean()) < 0.02


def test_horizontal_and_vertical_features_are_told_apart():
    """A patch that varies along x only has power along the horizontal axis of frequency only."""
    row = stream(0, "row").normal(120, 25, 192).astype(np.float32)
    vector = features(torch.from_numpy(np.tile(row, (192, 1)))[None])[1][0]
    assert float(vector[5:97].mean()) > float(vector[97 + 5 : 2 * 97].mean()) + 1


def test_the_network_has_the_size_that_is_documented():
    assert sum(value.numel() for value in SpectralNet().parameters()) == 1_350_882


def test_the_laplace_loss_is_least_at_the_mean_error():
    truth = torch.zeros(1000)
    mean = torch.from_numpy(stream(0, "errors").laplace(0, 0.3, 1000).astype(np.float32))
    losses = {scale: float(laplace_loss(mean, torch.full_like(mean, scale), truth)) for scale in (0.2, 0.3, 0.45)}
    assert losses[0.3] == min(losses.values())


def test_the_interface_keeps_the_contract(untrained, pictures):
    estimator = blur.create("spectral", weights=str(untrained))
    patches = np.concatenate([pictures[:3], np.full((1, 1, 192, 192), 0.5, np.float32), np.ones((1, 1, 192, 192))])
    patches[4, 0, :40] = np.linspace(0, 1, 40)[:, None]
    estimate = estimator.estimate(patches.astype(np.float32))
    assert estimate.abstained.tolist() == [False, False, False, True, True]
    assert estimate.reason.tolist() == ["", "", "", "flat", "saturated"]
    kept = ~estimate.abstained
    assert ((estimate.low <= estimate.mtf) & (estimate.mtf <= estimate.high))[kept].all() and estimate.kernel is None
    assert np.isnan(estimate.low[~kept]).all() and np.isnan(estimate.high[~kept]).all()
    assert (estimate.mtf[kept] >= 0).all() and (estimate.mtf[kept] <= 1).all()


def test_single_and_batched_answers_agree(untrained, pictures):
    whole = Spectral(untrained, batch=32).estimate(pictures)
    parts = Spectral(untrained, batch=3).estimate(pictures)
    assert np.allclose(whole.mtf, parts.mtf, atol=1e-5)
    single = np.concatenate([Spectral(untrained).estimate(one[None]).mtf for one in pictures])
    assert np.allclose(whole.mtf, single, atol=1e-5)
    assert np.array_equal(whole.mtf, Spectral(untrained).estimate(torch.from_numpy(pictures)).mtf)


def test_threads_that_share_it_do_not_mix_their_answers(untrained, pictures):
    estimator = Spectral(untrained)
    batches = [pictures[:count] for count in (1, 3, 2, 4)] * 15

    def answers(run):
        found = run(estimator.predict_members, batches)
        return [np.concatenate([one.mtf.ravel(), one.hidden.units.ravel()]) for one in found]

    with ThreadPoolExecutor(3) as pool:
        together = answers(pool.map)
    assert all(np.array_equal(one, other) for one, other in zip(answers(map), together, strict=True))


def test_mirrored_answers_hardly_change(untrained, pictures):
    estimator = Spectral(untrained, mirrored=True)
    one, two = estimator.estimate(pictures).mtf, estimator.estimate(pictures[..., ::-1].copy()).mtf
    assert np.abs(one - two).max() < 0.02


def test_wrong_options_are_refused(untrained, tmp_path):
    with pytest.raises(InputError, match="batch=0"):
        Spectral(untrained, batch=0)
    with pytest.raises(InputError, match="no such weight file"):
        Spectral(tmp_path / "none.safetensors")
    with pytest.raises(InputError, match="blur estimator 'spectral'"):
        blur.create("spectral", size=3)


def small_training(**changes):
    schedule = Schedule(24, checkpoint_every=8, report_every=4, warm_up=4)
    recipe = Recipe(views=2, kernels_per_view=4)
    sizes = {"images": 4, "validation_images": 2, "kernels": 250, "validation_chunks": 2}
    return Training(schedule=schedule, recipe=recipe, half_precision=False, **{**sizes, **changes})


@pytest.fixture
def small_images(monkeypatch):
    """A few quick pictures in place of the drawn ones."""
    draw = lambda index, seed, purpose: stream(seed, purpose, index).integers(0, 256, (260, 260)).astype(np.uint8)  # noqa: E731
    monkeypatch.setattr(images, "picture", draw)


def test_training_learns_and_resumes_to_the_bit(tmp_path, small_images):
    training = small_training()
    alone, other = (RunOptions(tmp_path / "cache", folder=tmp_path / name) for name in "ab")
    whole = spectral_training.train(training, alone)
    spectral_training.train(training, replace(other, stop_after=13))
    again = spectral_training.train(training, replace(other, producers=1))
    first, last = whole.curve[0]["mtf_error_percent"], whole.curve[-1]["mtf_error_percent"]
    assert last < 0.9 * first
    for one, two in zip(whole.model.parameters(), again.model.parameters(), strict=True):
        assert torch.equal(one, two)
    path = tmp_path / "net.safetensors"
    spectral_training.save(path, whole, training)
    header = weights.details(path)
    assert header["step"] == whole.best_step and header["settings"]["images"] == 4
    estimator = Spectral(path)
    rows = {row["step"]: row for row in whole.curve}
    assert estimator.interval == rows[whole.best_step]["validation_interval"] == header["interval"]


@released
def test_released_weights_read_known_blurs(pictures):
    """Discs between the paper's sizes, on pictures that were never trained on: the robust median is within 2 %."""
    estimator = Spectral()
    for diameter in (4.4, 9.7, 17.6):
        kernel = defocus(diameter)
        estimate = estimator.estimate(np.rint(convolve(pictures, kernel) * 255) / 255)
        assert not estimate.abstained.any()
        assert mtf.amae(np.median(estimate.mtf, axis=0), mtf.sample(kernel)) < 3.0


@released
def test_released_weights_rank_blur(pictures):
    estimator = Spectral()
    strength = [
        float(np.median(estimator.estimate(convolve(pictures, defocus(diameter))).mtf[:, :, 1]))
        for diameter in (1.0, 3.0, 7.0, 11.0, 15.0, 21.0)
    ]
    assert all(a > b for a, b in itertools.pairwise(strength))


@released
def test_released_intervals_cover(tmp_path):
    """On new procedural samples, clean and noisy, 95 % intervals hold 90 to 98 % of the truths."""
    tiles = np.stack([images.picture(index, 9, "test image") for index in range(6)])
    chunks = samples.Samples(tiles, kernels.block(0, 9, "test kernels"), Recipe(), 9)
    made = [chunks.chunk(number) for number in range(4)]
    patches = np.concatenate([one.patches_dn for one in made])[:, None].astype(np.float32) / 255
    estimate = Spectral().estimate(patches)
    truth = np.concatenate([one.mtf for one in made])[~estimate.abstained]
    inside = (estimate.low[~estimate.abstained] <= truth) & (truth <= estimate.high[~estimate.abstained])
    assert 0.88 < inside.mean() < 0.99
    assert np.abs(estimate.mtf[~estimate.abstained] - truth).mean() < 0.08
