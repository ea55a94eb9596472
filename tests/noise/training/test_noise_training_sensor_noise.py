"""Training of the noise networks: labels that are what the noise was, samples by name, resume to the bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.learning.bank import bank_file
from pipeline.learning.fitting import fingerprint
from pipeline.learning.run_options import RunOptions
from pipeline.learning.settings import Schedule
from pipeline.noise.settings import Recipe, SigmaTraining
from pipeline.noise.training import samples
from pipeline.noise.training import sensor_noise as training
from pipeline.stages.train_sigma import run as stage
from pipeline.streams import stream

SMALL = Recipe(size_px=64, views=2, noises=2)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Banks of pictures that are quick to make: overlapping rectangles of random grey."""
    folder = tmp_path_factory.mktemp("cache")
    (folder / "images").mkdir()
    for purpose in ("training-image", "validation-image"):
        draw = stream(0, "test pictures", purpose)
        tiles = np.full((4, 384, 384), 120, np.uint8)
        for tile in tiles:
            for x, y, width, height, grey in draw.integers((0, 0, 8, 8, 20), (380, 380, 120, 120, 230), (120, 5)):
                tile[y : y + height, x : x + width] = grey
        np.save(bank_file(folder / "images", purpose.replace("-", " "), 1, 4, "pipeline.learning.images"), tiles)
    return folder


def settings(kind: str = "cellwise", **changes: object) -> SigmaTraining:
    """A training of a dozen steps."""
    schedule = Schedule(12, learning_rate=3e-3, warm_up=2, checkpoint_every=6, report_every=3)
    chosen = SigmaTraining(
        kind="cnn" if kind == "cnn" else "cellwise",
        schedule=schedule,
        recipe=SMALL,
        images=4,
        validation_images=4,
        replay_window=4,
        validation_chunks=2,
    )
    return replace(chosen, **changes)


def test_a_chunk_is_a_function_of_its_name(cache: Path) -> None:
    tiles = np.load(next((cache / "images").glob("training-image-1-4-*.npy")))
    one, two = (samples.chunk(tiles, SMALL, 1, "training", 5) for _ in range(2))
    np.testing.assert_array_equal(one.patches_dn, two.patches_dn)
    np.testing.assert_array_equal(one.map_dn, two.map_dn)
    other = samples.chunk(tiles, SMALL, 1, "training", 6)
    assert not np.array_equal(one.patches_dn, other.patches_dn)
    assert one.patches_dn.shape == (4, 64, 64)
    assert one.map_dn.shape == (4, 8, 8)


@pytest.mark.parametrize("number", range(12))
def test_the_label_is_the_noise_that_was_added(number: int) -> None:
    """On mid grey, where nothing clips: the deviation of patch and cells within what sampling allows."""
    recipe = Recipe(clean_fraction=0.0, low_fraction=0.0, sigma_dn=(4.0, 16.0))
    clean = np.full((256, 256), 128, np.float32)
    noisy, sigma, cells = samples.noisy(clean, recipe, stream(3, "label", number))
    present = noisy.astype(float) - clean
    assert present.std() == pytest.approx(np.hypot(sigma, 1 / 12**0.5), rel=0.02)
    assert np.sqrt(np.mean(np.square(cells, dtype=float))) == pytest.approx(sigma, rel=1e-5)


def test_photon_noise_grows_with_the_square_root_of_light() -> None:
    clean = np.full((128, 128), 40, np.float32)
    clean[:, 64:] = 160
    recipe = Recipe(clean_fraction=0.0, low_fraction=0.0, sigma_dn=(8.0, 9.0))
    ratios = []
    for number in range(40):
        _, _, cells = samples.noisy(clean, recipe, stream(3, "ratio", number))
        ratios.append(round(float(cells[:, 8:].mean() / cells[:, :8].mean()), 3))
    assert max(ratios) == pytest.approx(2.0, abs=1e-3)  # photons alone
    assert min(ratios) == pytest.approx(1.0, abs=1e-3)  # dark current or readout alone
    assert len({ratio for ratio in ratios if 1.01 < ratio < 1.99}) >= 3  # mixed


def test_white_keeps_its_label_though_half_of_the_noise_is_cut() -> None:
    clean = np.full((128, 128), 255, np.float32)
    recipe = Recipe(clean_fraction=0.0, low_fraction=0.0, sigma_dn=(20.0, 20.001))
    for number in range(12):
        noisy, sigma, _ = samples.noisy(clean, recipe, stream(3, "white", number))
        assert sigma == pytest.approx(20.0, rel=1e-3)
        present = noisy.astype(float) - 255
        assert present.max() <= 0
        assert 0.5 * 20 < np.sqrt(np.mean(present**2)) < 0.95 * 20


@pytest.mark.parametrize("number", range(8))
@pytest.mark.parametrize("grey", [60, 128, 180])
def test_the_label_behind_a_tone_curve_is_the_noise_that_was_added(grey: int, number: int) -> None:
    """Where nothing clips: the deviation of the patch within what sampling allows."""
    recipe = Recipe(clean_fraction=0.0, low_fraction=0.0, sigma_dn=(3.0, 9.0), tone_curve_fraction=1.0)
    clean = np.full((256, 256), grey, np.float32)
    noisy, sigma, cells = samples.noisy(clean, recipe, stream(4, "label", grey, number))
    assert 2.8 < sigma < 9.2
    assert noisy.std() == pytest.approx(np.hypot(sigma, 1 / 12**0.5), rel=0.03)
    np.testing.assert_allclose(cells, sigma, rtol=1e-5)


def test_noise_behind_a_tone_curve_lies_in_the_shadows() -> None:
    """Of dark current or readout: with the slope of the curve. Photon noise behind a square root is even."""
    clean = np.full((128, 128), 40, np.float32)
    clean[:, 64:] = 160
    recipe = Recipe(
        clean_fraction=0.0, low_fraction=0.0, sigma_dn=(3.0, 3.5), tone_curve_fraction=1.0, gamma=(2.0, 2.000001)
    )
    ratios = []
    for number in range(40):
        noisy, _, cells = samples.noisy(clean, recipe, stream(4, "ratio", number))
        ratios.append(float(cells[:, :8].mean() / cells[:, 8:].mean()))
        shown = noisy.astype(float)
        assert shown[:, :64].std() / shown[:, 64:].std() == pytest.approx(ratios[-1], rel=0.12)
    assert max(ratios) == pytest.approx(4.0, rel=0.05)
    assert min(ratios) == pytest.approx(1.0, rel=0.05)


def test_a_dark_patch_has_no_more_noise_behind_a_tone_curve_than_a_camera_can_have() -> None:
    recipe = Recipe(clean_fraction=0.0, low_fraction=0.0, sigma_dn=(40.0, 42.0), tone_curve_fraction=1.0)
    for number in range(20):
        noisy, sigma, cells = samples.noisy(np.full((64, 64), 1, np.float32), recipe, stream(4, "dark", number))
        assert np.isfinite(cells).all() and 0 < sigma < 43
        assert noisy.dtype == np.uint8


def test_without_a_tone_curve_nothing_is_drawn_for_it() -> None:
    """Trainings of before keep their samples."""
    clean = np.full((64, 64), 90, np.float32)
    recipe = Recipe(clean_fraction=0.0)
    plain, _, _ = samples.noisy(clean, recipe, stream(5, "none"))
    other, _, _ = samples.noisy(clean, replace(recipe, gamma=(1.1, 1.2)), stream(5, "none"))
    np.testing.assert_array_equal(plain, other)


def test_clean_samples_are_clean() -> None:
    clean = np.rint(stream(0, "clean").uniform(0, 255, (64, 64))).astype(np.float32)
    noisy, sigma, cells = samples.noisy(clean, Recipe(clean_fraction=1.0), stream(0, "clean noise"))
    np.testing.assert_array_equal(noisy, clean)
    assert sigma == 0.0
    assert not cells.any()


@pytest.mark.parametrize("kind", ["cellwise", "cnn"])
def test_training_goes_on_to_the_bit(cache: Path, tmp_path: Path, kind: str) -> None:
    recipe = SMALL if kind == "cellwise" else replace(SMALL, size_px=16)
    chosen = settings(kind, recipe=recipe)
    whole = training.train(chosen, RunOptions(cache, tmp_path / "whole"))
    training.train(chosen, RunOptions(cache, tmp_path / "parts", stop_after=7))
    parts = training.train(chosen, RunOptions(cache, tmp_path / "parts"))
    assert whole.curve == parts.curve
    for name, tensor in whole.model.state_dict().items():
        assert tensor.equal(parts.model.state_dict()[name]), name


def test_training_learns(cache: Path, tmp_path: Path) -> None:
    """Sixty steps halve the loss; fresh weights answer near Immerkaer's estimate, which is no bad start."""
    schedule = Schedule(60, learning_rate=5e-3, warm_up=5, checkpoint_every=60, report_every=10, ema_decay=0.9)
    chosen = settings(schedule=schedule, recipe=replace(SMALL, views=4))
    trained = training.train(chosen, RunOptions(cache, tmp_path))
    losses = [row["loss"] for row in trained.curve]
    assert len(losses) == 6
    assert losses[-1] < 0.5 * losses[0], losses
    path = tmp_path / "weights.safetensors"
    training.save(path, trained, chosen)
    from pipeline import noise

    estimate = noise.create("cellwise", weights=path).estimate(np.full((1, 1, 64, 64), 0.5, np.float32))
    assert estimate.reason[0] == "flat"


def test_the_interval_factor_holds_95_percent_of_the_held_out(cache: Path) -> None:
    import torch

    chosen = settings(validation_chunks=10)
    model = training.PROGRAMS.get("cellwise").network(1).eval()
    factor = training.validation(chosen, cache)(model)["interval"]
    make = training.Maker(chosen, cache, validation=True)
    inside = []
    for number in range(10):
        made = {name: torch.from_numpy(values) for name, values in make(number).items()}
        sigma, scale, _ = model(made["statistics"].float(), made["base_dn"])
        inside.append((torch.log1p(sigma) - torch.log1p(made["sigma_dn"])).abs() <= factor * scale * (1 + 1e-5))
    assert float(torch.cat(inside).float().mean()) == pytest.approx(0.95, abs=0.03)


def test_unknown_network_is_named() -> None:
    configuration = SimpleNamespace(train=SimpleNamespace(sigma={"cellwise": settings()}))
    with pytest.raises(InputError, match=r"'celwise' is not among the configured train\.sigma.*cellwise"):
        stage.run(configuration, {"network": "celwise"}, Path(), Path())


def test_fingerprint_follows_the_settings_and_the_networks_own_code() -> None:
    cellwise, cnn = (training.PROGRAMS.get(kind).module for kind in ("cellwise", "cnn"))
    assert fingerprint(settings(), cellwise) == fingerprint(settings(), cellwise)
    assert fingerprint(settings(), cellwise) != fingerprint(settings(seed=2), cellwise)
    assert fingerprint(settings(), cellwise) != fingerprint(settings(), cnn)
