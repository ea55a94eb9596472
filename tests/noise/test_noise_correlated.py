"""Statistics and network for correlated noise: what they separate, how answers and maps are put together."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import torch

from pipeline import noise
from pipeline.errors import InputError
from pipeline.noise.correlated import Correlated
from pipeline.noise.networks import correlated_features
from pipeline.noise.networks.correlated_net import CURVE_LEVELS_DN, CorrelatedNet, cell_map, loss
from pipeline.noise.settings import CameraSamplesRecipe
from pipeline.noise.training import camera_samples, noise_free_samples
from pipeline.noise.training import correlated as correlated_training
from pipeline.streams import stream


def flat(sigma_dn, blur_px=0.0, key="flat", level=120.0, side=128):
    field = stream(1, key, sigma_dn, blur_px).standard_normal((side + 32, side + 32), dtype=np.float32)
    if blur_px:
        field = cv2.GaussianBlur(field, (0, 0), blur_px)
        field /= field.std()
    picture = level + sigma_dn * field[16:-16, 16:-16]
    return np.clip(np.rint(picture), 0, 255).astype(np.float32)


def test_statistics_have_their_length_and_are_finite_for_any_patch():
    ramp = np.broadcast_to(np.linspace(0, 255, 128, dtype=np.float32), (128, 128)).round()
    for patch in (flat(5), flat(0), np.zeros((64, 48), np.float32), np.full((128, 96), 255, np.float32), ramp):
        values = correlated_features.statistics(patch)
        assert values.shape == (correlated_features.COUNT,) and np.isfinite(values).all()


def test_statistics_of_many_patches_are_those_of_each_wherever_their_fine_windows_come_from():
    bright = flat(9, blur_px=0.8, level=250.0)  # some windows saturated
    patches = [flat(5), flat(0), bright, bright[:96, :77].copy()]
    assert 0 < (bright >= 254).mean() < 0.5
    assert [correlated_features.fine_windows(patch).complete for patch in patches] == [True, True, False, False]
    alone = np.stack([correlated_features.statistics(patch) for patch in patches])
    measured = []
    for patch in patches:
        fine = correlated_features.fine_windows(patch)
        assert correlated_features.flat_areas(patch, fine) == correlated_features.flat_areas(patch)
        principal = correlated_features.principal_noise_dn(patch)
        assert correlated_features.principal_noise_dn(patch, fine) == principal
        measured.append(correlated_features.moments(patch.astype(np.uint8), fine))
    assert np.array_equal(correlated_features.statistics_of(measured), alone)


def test_windows_hold_the_pixels_at_their_spacing_and_leave_saturated_ones_out():
    generator = stream(1, "windows")
    picture = generator.integers(2, 250, (61, 70)).astype(np.uint8)
    picture[20:, 30:34] = 255
    for spacing, step in zip(correlated_features.SPACINGS_PX, correlated_features.STEPS_PX, strict=True):
        reach = 3 * spacing + 1
        corners = [(y, x) for y in range(0, 62 - reach, step) for x in range(0, 71 - reach, step)]
        rows = np.stack([picture[y : y + reach : spacing, x : x + reach : spacing].ravel() for y, x in corners])
        kept = rows[(rows >= 254).sum(axis=1) <= 1].astype(float)
        kept = kept if len(kept) > correlated_features.LEAST_WINDOWS else rows.astype(float)
        windows = correlated_features._windows(picture, spacing, step, saturated=True)
        assert np.array_equal(windows.means, kept.mean(axis=1))
        assert np.array_equal(windows.values, kept - kept.mean(axis=1, keepdims=True))
        assert windows.power == pytest.approx(16 * kept.var(axis=1), rel=1e-5)


def test_the_reference_statistic_is_near_white_noise():
    values = correlated_features.statistics(flat(6))
    assert np.exp(values[correlated_features.REFERENCE]) == pytest.approx(6, rel=0.25)


def test_whiteness_separates_white_noise_from_smoothed_noise():
    assert abs(correlated_features.flat_areas(flat(5)).adjacent) < 0.1
    assert correlated_features.flat_areas(flat(5, blur_px=0.8)).adjacent > 0.2


def test_sharpened_noise_is_less_correlated_between_neighbours_than_diagonally():
    sharpened = cv2.filter2D(flat(5), -1, np.array([[0, -1, 0], [-1, 5, -1], [0, -1, 0]], np.float32))
    white, sharp = (correlated_features.flat_areas(patch) for patch in (flat(5), sharpened))
    assert white == pytest.approx((0.661 * 5, -1 / 15, -1 / 15), abs=0.04)  # the mean of 16 pixels was taken off
    assert sharp.adjacent < sharp.diagonal - 0.1


def test_compression_finds_the_grid_of_jpeg():
    noisy = flat(8).astype(np.uint8)
    coded = cv2.imdecode(cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, 40])[1], 0).astype(np.float32)
    plain, jpeg = (correlated_features.compression(picture) for picture in (noisy.astype(np.float32), coded))
    assert jpeg[8] > plain[8] + 0.3  # fine coefficients have vanished
    shifted = correlated_features.compression(coded[3:, 5:])
    assert shifted[6:] == pytest.approx(jpeg[6:], abs=0.05)  # wherever the grid begins


def test_the_map_keeps_the_patch_level_and_follows_the_curve():
    curve = torch.zeros(1, len(CURVE_LEVELS_DN))
    curve[0, 2] = np.log(2)  # twice the noise at middle grey
    brightness = torch.full((1, 4, 4), CURVE_LEVELS_DN[0])
    brightness[0, :2] = CURVE_LEVELS_DN[2]
    cells = cell_map(torch.tensor([3.0]), curve, brightness)
    assert float(cells.square().mean().sqrt()) == pytest.approx(3, rel=1e-5)
    assert float(cells[0, 0, 0] / cells[0, 3, 3]) == pytest.approx(2, rel=1e-5)


def test_the_mean_answer_of_equal_members_is_theirs():
    net = CorrelatedNet(members=2)
    net.members[1].load_state_dict(net.members[0].state_dict())
    statistics = torch.from_numpy(np.stack([correlated_features.statistics(flat(level)) for level in (2, 9)]))
    with torch.no_grad():
        sigma, scale, white, correlation, curve = net(statistics)
        one = net.answers(statistics)
    assert torch.allclose(sigma, one[0][0].clamp_min(0), atol=1e-4) and torch.allclose(scale, one[1][0], atol=1e-5)
    assert white.shape == correlation.shape == (2,) and curve.shape == (2, len(CURVE_LEVELS_DN))


def test_an_interval_is_wider_by_what_the_members_differ():
    net = CorrelatedNet(members=2)
    net.members[1].load_state_dict(net.members[0].state_dict())
    statistics = torch.from_numpy(np.stack([correlated_features.statistics(flat(level)) for level in (2, 9)]))
    with torch.no_grad():
        net.members[1][-1].bias[0] += 0.5  # of the logarithm of its answer
        (sigma, scale, *_), (each, scales, *_) = net(statistics), net.answers(statistics)
    levels = torch.log1p(each.clamp_min(0))
    assert torch.allclose(torch.log1p(sigma), levels.mean(0), atol=1e-5)
    assert (levels[1] > levels[0]).all()
    assert torch.allclose(scale, scales.mean(0) + (levels[1] - levels[0]) / 2, atol=1e-5)


def test_white_noise_is_its_own_white_part():
    levels = (3.0, 10.0, 20.0)
    estimate = noise.create("correlated").estimate(
        np.stack([flat(level) for level in levels])[:, None] / np.float32(255)
    )
    assert estimate.white_sigma_dn == pytest.approx(levels, rel=0.1)


def test_samples_are_labelled_with_what_their_shots_show():
    from pipeline.learning import images

    tiles = np.stack([images.picture(index, 1, size_px=384) for index in range(2)])
    recipe = CameraSamplesRecipe(scenes=2, added_fraction=0.0)
    made = camera_samples.chunk(tiles, recipe, 1, "test", 0)
    again = camera_samples.chunk(tiles, recipe, 1, "test", 0)
    assert all(np.array_equal(getattr(made, name), getattr(again, name)) for name in vars(made))
    assert made.patches_dn.shape == (6, 128, 128) and made.map_dn.shape == (6, 16, 16)
    shots = made.patches_dn[:3].astype(float)
    assert made.sigma_dn[0] == pytest.approx(np.sqrt(shots.var(axis=0, ddof=1).mean()), abs=0.02)
    assert np.sqrt((made.map_dn**2).mean(axis=(1, 2))) == pytest.approx(made.sigma_dn, rel=1e-3)
    assert (made.white_sigma_dn <= made.sigma_dn + 1e-5).all()


def test_pictures_as_the_mean_of_many_shots_have_no_noise_and_are_denoised():
    from pipeline.learning import images

    tiles = np.stack([images.picture(index, 1, size_px=384) for index in range(2)])
    recipe = CameraSamplesRecipe(scenes=6)
    made = noise_free_samples.chunk(tiles, recipe, 1, "test", 0)
    again = noise_free_samples.chunk(tiles, recipe, 1, "test", 0)
    assert np.array_equal(made.patches_dn, again.patches_dn) and made.patches_dn.shape == (6, 128, 128)
    assert not made.sigma_dn.any() and not made.map_dn.any() and made.map_dn.shape == (6, 16, 16)
    assert (made.patches_dn.std(axis=(1, 2)) > 1).any()


def test_chunks_take_turns_by_kind_and_are_numbered_within_it(monkeypatch):
    requested = []
    monkeypatch.setattr(correlated_training, "arrays", lambda kind, *rest: requested.append((kind, rest[-1])) or {})
    make = correlated_training.Maker(None, None, _tiles=np.zeros((1, 8, 8), np.uint8))
    for number in range(2 * len(correlated_training.KINDS)):
        make(number)
    for kind in set(correlated_training.KINDS):
        assert [index for name, index in requested if name == kind] == list(
            range(2 * correlated_training.KINDS.count(kind))
        )


def test_every_second_member_is_spared_the_samples_that_are_not_for_all():
    net = CorrelatedNet(members=2)
    statistics = torch.from_numpy(np.stack([correlated_features.statistics(flat(level)) for level in (2, 9)]))
    cells = torch.full((2, 16, 16), 5.0)
    batch = {
        "statistics": statistics,
        "sigma_dn": torch.tensor([2.0, 9.0]),
        "white_sigma_dn": torch.tensor([2.0, 9.0]),
        "correlation": torch.zeros(2),
        "map_dn": cells,
        "brightness_dn": cells,
        "for_all": torch.zeros(2),
    }
    loss(net, batch)[0].backward()
    first, second = (net.members[index][0].weight.grad for index in (0, 1))
    assert first.abs().sum() > 0
    curve_only = net.members[1][-1].weight.grad[:4]  # what answers sigma, its scale, white part and correlation
    assert second is not None and not curve_only.any()


def test_the_released_network_reads_smoothed_noise_that_cellwise_does_not_see():
    levels = (3.0, 6.0, 12.0)
    patches = np.stack([flat(level, blur_px=0.8) for level in levels])[:, None] / np.float32(255)
    estimate = noise.create("correlated").estimate(patches)
    assert estimate.sigma_dn == pytest.approx(levels, rel=0.25)
    assert (estimate.correlation > 0.4).all() and (estimate.white_sigma_dn < 0.6 * estimate.sigma_dn).all()
    assert (noise.create("cellwise").estimate(patches).sigma_dn < 0.5 * np.array(levels)).all()


def test_small_and_wrong_patches_are_refused():
    with pytest.raises(InputError, match="48 x 48"):
        noise.create("correlated").estimate(np.zeros((1, 1, 40, 40), np.float32))
    with pytest.raises(InputError, match="absent"):
        Correlated("absent.safetensors")
    assert len(noise.create("correlated").estimate(np.zeros((0, 1, 128, 128), np.float32))) == 0


@pytest.mark.parametrize("sigma_dn", [2.0, 6.0, 15.0])
def test_principal_components_give_the_mean_noise_however_it_goes_with_brightness(sigma_dn):
    generator = stream(5, "principal")
    ramp = np.linspace(40, 200, 128) + np.zeros((128, 128))
    share = np.linspace(1.8, 0.2, 128)  # strongest in the dark
    noisy = ramp + sigma_dn * share * generator.standard_normal(ramp.shape)
    truth = sigma_dn * np.sqrt((share**2).mean())
    assert correlated_features.principal_noise_dn(np.clip(np.rint(noisy), 0, 255)) == pytest.approx(truth, rel=0.1)
