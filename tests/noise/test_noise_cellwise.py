"""The cell-wise estimator: known noise comes back, with its interval, where classical estimators fail as well."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from skimage import data

from pipeline import noise
from pipeline.camera.corruption import corrupt
from pipeline.errors import InputError
from pipeline.learning import weights
from pipeline.learning.textures import power_law
from pipeline.noise.cellwise import Cellwise
from pipeline.noise.networks.cellwise_features import CELL_PX, CHANNELS, POWERS, features, log_power, power
from pipeline.noise.networks.cellwise_net import ARCHITECTURE, CellwiseNet
from pipeline.noise.training.samples import noise_by_level
from pipeline.streams import stream


@pytest.fixture(scope="module")
def estimator() -> Cellwise:
    """With the released weights."""
    return Cellwise()


def scene(name: str, size_px: int = 128) -> np.ndarray:
    """Overlapping ellipses and bars of random grey, (H, W) float32 in [0, 1], 8-bit numbers."""
    draw = stream(5, "cellwise scene", name)
    image = np.full((size_px, size_px), 120, np.uint8)
    for _ in range(size_px // 4):
        centre = (int(draw.integers(size_px)), int(draw.integers(size_px)))
        axes = (int(draw.integers(3, 40)), int(draw.integers(3, 30)))
        cv2.ellipse(image, centre, axes, float(draw.uniform(0, 180)), 0, 360, int(draw.integers(40, 215)), -1)
    return cv2.GaussianBlur(image, (0, 0), 0.6).astype(np.float32) / 255


def noisy(noise_source: str, sigma_dn: float, count: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Patches (N, 1, 128, 128) with a sensor's noise, and its sigma in each before clipping."""
    made = [
        corrupt(
            scene(str(number)), noise_source, sigma_dn=sigma_dn, generator=stream(1, "cellwise", noise_source, number)
        )
        for number in range(count)
    ]
    return np.stack([one.image for one in made])[:, None], np.array([one.unclipped_sigma_dn for one in made])


# --- statistics -----------------------------------------------------------------------------------------------------


@given(sigma=st.floats(3.0, 20.0), level=st.integers(90, 160))
def test_every_filter_answers_white_noise_with_its_deviation(sigma: float, level: int) -> None:
    draw = stream(0, "white noise", sigma)
    # So large that the coarsest filters scatter by little more than 1 % from draw to draw.
    image = np.rint(level + sigma * draw.standard_normal((1, 512, 512))).clip(0, 255).astype(np.float32)
    statistics, base = features(torch.from_numpy(image))
    result = power(statistics)[0].mean((1, 2)).sqrt()
    averages = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, *range(15, POWERS)]  # but for extremes and the mean modulus
    np.testing.assert_allclose(result[averages], np.hypot(sigma, 1 / 12**0.5), rtol=0.07)
    assert float(base.mean()) == pytest.approx(sigma, rel=0.08)


def test_statistics_are_of_the_declared_shape_and_local() -> None:
    image = torch.zeros(2, 48, 64)
    image[:, 16:24, 24:32] = 200
    statistics, base = features(image)
    assert statistics.shape == (2, CHANNELS, 6, 8)
    assert base.shape == (2, 6, 8)
    assert torch.isfinite(statistics).all()
    far = torch.ones(6, 8, dtype=torch.bool)
    far[1:4, 2:5] = False
    assert (statistics[0][:, far] == statistics[0][:, :1, :1].flatten(1)).all()


@given(st.floats(0.0, 1e4))
def test_powers_come_back_from_their_logarithms(value: float) -> None:
    shown = log_power(torch.full((1, CHANNELS, 2), value, dtype=torch.float64))
    assert float(power(shown)[0, 0, 0]) == pytest.approx(value, abs=1e-9, rel=1e-9)


# --- network --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cells", [(4, 4), (16, 16), (5, 23)])
def test_the_network_takes_any_number_of_cells(cells: tuple[int, int]) -> None:
    network = CellwiseNet().eval()
    image = 10 * torch.randn(2, cells[0] * CELL_PX, cells[1] * CELL_PX, generator=torch.Generator().manual_seed(0)) + 99
    with torch.no_grad():
        sigma, scale, result = network(*features(image.round()))
    assert result.shape == (2, *cells)
    assert (result > 0).all()
    assert (scale > 0).all()
    least, most = result.flatten(1).amin(1), result.flatten(1).amax(1)
    assert ((sigma >= least * 0.999) & (sigma <= most * 1.001)).all()  # a mean of the cells


# --- what the released weights can do -------------------------------------------------------------------------------


@pytest.mark.parametrize("noise_source", ["dcsn", "readout", "combined", "photon"])
@pytest.mark.parametrize("sigma_dn", [5.0, 15.0, 25.0])
def test_known_noise_comes_back(estimator: Cellwise, noise_source: str, sigma_dn: float) -> None:
    patches, truth = noisy(noise_source, sigma_dn)
    estimate = estimator.estimate(patches)
    assert np.abs(np.median(estimate.sigma_dn - truth)) < 0.4
    assert np.abs(estimate.sigma_dn - truth).max() < 1.0 + 0.06 * sigma_dn
    assert (estimate.low_dn <= estimate.sigma_dn).all()
    assert (estimate.sigma_dn <= estimate.high_dn).all()
    assert np.mean((estimate.low_dn <= truth) & (truth <= estimate.high_dn)) >= 4 / 6


@pytest.mark.parametrize("source", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
@pytest.mark.parametrize("gamma", [1.6, 2.2])
def test_noise_behind_a_tone_curve_comes_back(
    estimator: Cellwise, source: tuple[float, float, float], gamma: float
) -> None:
    """Photographs under noise in linear light: strongest in the shadows; smooth bright cells show little of it."""
    from pipeline.camera import tone_curve

    for name in ("camera", "coins", "moon"):
        levels = getattr(data, name)()[:256, :384]
        pixels = np.bincount(levels.ravel(), minlength=256)
        before, _ = noise_by_level(pixels, 8.0, source, gamma)
        light = tone_curve.decode(levels / 255, gamma)
        light = light + before[levels] * stream(7, "curve", name).standard_normal(levels.shape)
        seen = np.rint(255 * np.clip(tone_curve.encode(light, gamma), 0, 1))
        patches = [seen[y : y + 128, x : x + 128] for y in (0, 128) for x in (0, 128, 256)]
        answer = estimator.estimate(np.stack(patches)[:, None].astype(np.float32) / 255)
        assert np.sqrt((answer.sigma_dn**2).mean()) == pytest.approx(8.0, rel=0.12), name


def test_no_noise_reads_as_none(estimator: Cellwise) -> None:
    patches = np.stack([scene(str(number)) for number in range(6)])[:, None]
    estimate = estimator.estimate(np.rint(patches * 255).astype(np.float32) / 255)
    assert estimate.sigma_dn.max() < 0.3
    assert (estimate.low_dn < 0.3).all()


def test_fine_texture_is_not_noise(estimator: Cellwise) -> None:
    """Gravel of 30 DN with a natural spectrum, seen through a lens: Immerkaer reads some DN of noise."""
    fields = [power_law(stream(2, "gravel", number), 128, 1.3) for number in range(6)]
    patches = np.stack([cv2.GaussianBlur(128 + 30 * field, (0, 0), 0.5) for field in fields])[:, None]
    patches = np.rint(np.clip(patches, 0, 255)).astype(np.float32) / 255
    ours, simple = estimator.estimate(patches), noise.create("immerkaer").estimate(patches)
    assert simple.sigma_dn.min() > 1.5
    assert np.median(ours.sigma_dn) < 0.5


@pytest.mark.parametrize("noise_source", ["dcsn", "readout"])
def test_a_white_sky_tells_the_sensors_noise(estimator: Cellwise, noise_source: str) -> None:
    """Half of the noise is cut away; what PCA reads there is not two thirds of it."""
    sky = np.ones((384, 384), np.float32)
    sky[-40:, :] = 0.4
    shown = corrupt(sky, noise_source, sigma_dn=25.0, generator=stream(3, "sky", noise_source)).image
    patches = np.stack([shown[y : y + 128, x : x + 128] for y in (0, 128) for x in (0, 128, 256)])[:, None]
    estimate = estimator.estimate(patches)
    assert not estimate.abstained.any()
    assert np.abs(estimate.sigma_dn - 25.0).max() < 2.0
    classical = noise.create("pca", saturated_fraction=1.0).estimate(patches)
    assert classical.sigma_dn.max() < 18.0


def test_noise_before_a_blur_does_not_count(estimator: Cellwise) -> None:
    from pipeline.camera import psf

    kernel = psf.create("defocus", 9.0)
    blurred = [
        corrupt(scene(str(n), 192), "photon", sigma_dn=25.0, psf=kernel, generator=stream(4, "before", n)).image
        for n in range(4)
    ]
    estimate = estimator.estimate(np.stack([image[32:160, 32:160] for image in blurred])[:, None])
    assert np.median(estimate.sigma_dn) < 0.5
    both = [
        corrupt(scene(str(n), 192), "dcsn", sigma_dn=10.0, psf=kernel, generator=stream(4, "after", n)).image
        for n in range(4)
    ]
    estimate = estimator.estimate(np.stack([image[32:160, 32:160] for image in both])[:, None])
    assert np.median(estimate.sigma_dn) == pytest.approx(10.0, abs=0.5)


def test_the_map_shows_where_photon_noise_is_strong(estimator: Cellwise) -> None:
    steps = np.repeat(np.array([0.1, 0.3, 0.5, 0.7], np.float32), 96)
    image = np.broadcast_to(steps, (250, 384)).copy()
    truth = corrupt(image, "photon", sigma_dn=12.0, generator=stream(5, "steps"))
    result = estimator.map(truth.image)
    assert result.shape == (32, 48)
    expected = 12.0 * np.sqrt(steps[::8] / steps.mean())
    inside = [column for column in range(48) if column % 12 not in (0, 11)]
    np.testing.assert_allclose(np.median(result, axis=0)[inside], expected[inside], rtol=0.15)


def test_the_map_has_holes_where_nothing_can_be_said(estimator: Cellwise) -> None:
    image = np.ones((128, 512), np.float32)
    image[:, 384:] = corrupt(scene("right"), "dcsn", sigma_dn=8.0, generator=stream(6, "right")).image
    result = estimator.map(image)
    assert np.isnan(result[:, :32]).all()
    assert np.isfinite(result[:, 48:]).all()


# --- conduct --------------------------------------------------------------------------------------------------------


def test_abstains_from_flat_and_saturated(estimator: Cellwise) -> None:
    patches = np.stack([np.full((128, 128), level, np.float32) for level in (0.5, 1.0, 0.0)])[:, None]
    estimate = estimator.estimate(patches)
    assert list(estimate.reason) == ["flat", "saturated", "saturated"]
    assert np.isnan(estimate.sigma_dn).all()


def test_patches_are_judged_alone_and_in_any_form(estimator: Cellwise) -> None:
    patches, _ = noisy("dcsn", 7.0, count=11)
    together = estimator.estimate(patches).sigma_dn
    np.testing.assert_allclose(together, [estimator.estimate(one[None]).sigma_dn[0] for one in patches], rtol=1e-4)
    np.testing.assert_allclose(together, estimator.estimate(torch.from_numpy(patches).double()).sigma_dn, rtol=1e-4)
    assert len(estimator.estimate(patches[:0])) == 0


def test_odd_sizes_are_cut_to_whole_cells(estimator: Cellwise) -> None:
    patches, truth = noisy("dcsn", 7.0)
    cut = estimator.estimate(patches[:, :, :101, :77]).sigma_dn
    np.testing.assert_allclose(cut, estimator.estimate(patches[:, :, :96, :72]).sigma_dn)
    assert np.median(np.abs(cut - truth)) < 0.7


@given(turn=st.integers(0, 3), mirror=st.booleans())
def test_turning_a_patch_changes_little(turn: int, mirror: bool) -> None:
    patches, _ = noisy("dcsn", 9.0, count=2)
    turned = np.rot90(patches, turn, (2, 3))[..., :: -1 if mirror else 1].copy()
    estimator = Cellwise()
    np.testing.assert_allclose(estimator.estimate(turned).sigma_dn, estimator.estimate(patches).sigma_dn, rtol=0.08)


def test_foreign_or_incomplete_weights_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such weight file"):
        noise.create("cellwise", weights=tmp_path / "none.safetensors")
    weights.save(tmp_path / "other.safetensors", CellwiseNet().state_dict(), "sigma-cnn-1")
    with pytest.raises(InputError, match="expected 'sigma-cellwise-2'"):
        noise.create("cellwise", weights=tmp_path / "other.safetensors")
    weights.save(tmp_path / "silent.safetensors", CellwiseNet().state_dict(), ARCHITECTURE)
    with pytest.raises(InputError, match="holds no interval"):
        noise.create("cellwise", weights=tmp_path / "silent.safetensors")


@pytest.mark.parametrize(
    ("options", "word"), [({"batch": 0}, "batch=0"), ({"saturated_fraction": 0.0}, "share"), ({"bach": 1}, "bach")]
)
def test_options_out_of_range(options: dict[str, float], word: str) -> None:
    with pytest.raises(InputError, match=word):
        noise.create("cellwise", **options)


def test_wrong_input_is_named(estimator: Cellwise) -> None:
    with pytest.raises(InputError, match="at least 32 x 32"):
        estimator.estimate(np.zeros((1, 1, 16, 64), np.float32))
    with pytest.raises(InputError, match=r"image: expected \(H, W\)"):
        estimator.map(np.zeros((1, 64, 64), np.float32))


@pytest.mark.shared
@pytest.mark.parametrize("name", ["kitti", "udacity", "sim_authors"])
def test_recorded_and_rendered_frames(shared: Path, estimator: Cellwise, name: str) -> None:
    """Median over tiles of four frames: sensor noise of 15 DN, and nothing where nothing was added.

    Measured over all tiles of these frames: 14.7 (KITTI), 14.9 (Udacity) and 15.0 DN, and 0.00 on all three.
    """
    from pipeline.datasets import open_dataset
    from pipeline.datasets.patches import cut, tiles

    root = shared / "realdata" / name
    dataset = open_dataset("folder" if name == "sim_authors" else name, name, root)
    clean, noised = [], []
    for frame in list(dataset.frames())[:4]:
        image = frame.image()
        places = tiles(image.shape)[:: 6 if name == "udacity" else 2]
        shown = corrupt(image, "dcsn", sigma_dn=15.0, generator=stream(7, name, frame.name)).image
        clean.append(estimator.estimate(cut(image, places)).sigma_dn)
        noised.append(estimator.estimate(cut(shown, places)).sigma_dn)
    assert np.nanmedian(np.concatenate(clean)) < 0.3
    assert np.nanmedian(np.concatenate(noised)) == pytest.approx(15.0, abs=0.6)
