"""Calibrated to a generic lens: pictures blurred by lenses; the MTF relative to one without sharp frames."""

from pathlib import Path

import composed
import numpy as np
import pytest

from pipeline import blur, store
from pipeline.blur import generic_lens, spectral
from pipeline.blur.camera_calibration import Calibration
from pipeline.camera import mtf
from pipeline.camera.blur import blur as convolve
from pipeline.camera.psf.defocus import create as defocus
from pipeline.errors import InputError
from pipeline.learning import images
from pipeline.stages.generic_lens import run as stage

ROOT = Path(__file__).resolve().parents[2]
MAP = spectral.RELEASED.with_name(spectral.RELEASED.stem + spectral.TYPICAL)
released = pytest.mark.skipif(not MAP.is_file(), reason="map absent: run dvc repro generic_lens")


@pytest.fixture(scope="module")
def tiles():
    return np.stack([images.picture(index, 9, "test image", 256) for index in range(6)])


def detail(patches):
    """Mean square of the difference of neighbours: falls with blur."""
    return np.square(np.diff(patches[:, 0].astype(float), axis=2)).mean((1, 2))


def test_a_patch_depends_on_seed_place_and_tile_alone(tiles):
    many = generic_lens.sharp_patches(tiles, 8, (0.0, 0.7), 1)
    few = generic_lens.sharp_patches(tiles, 3, (0.0, 0.7), 1)
    assert many.shape == (8, 1, 192, 192) and many.dtype == np.float32
    assert many.min() >= 0 and many.max() <= 1
    assert np.array_equal(many[:3], few)
    assert not np.array_equal(generic_lens.sharp_patches(tiles, 1, (0.0, 0.7), 2), few[:1])


def test_worse_lenses_leave_less_detail(tiles):
    pinhole, good, bad = (
        detail(generic_lens.sharp_patches(tiles, 6, (spread, spread), 1)) for spread in (0.0, 0.4, 0.8)
    )
    assert (bad < good).all() and (good < pinhole).all()


def test_a_lens_has_the_mtf_of_its_gaussian(tiles):
    """The same views with and without: their spectra's ratio is exp(-2 pi^2 a^2 f^2), times that of the pixel."""
    spread = 0.6
    sharp, seen = (generic_lens.sharp_patches(tiles, 6, (a, a), 3)[:, 0].astype(float) for a in (0.0, spread))
    window = np.outer(np.hanning(192), np.hanning(192))
    power = [np.abs(np.fft.fft2((one - one.mean((1, 2), keepdims=True)) * window)[:, 0, :]) for one in (sharp, seen)]
    places = np.array([10, 20, 40])
    result = np.median(power[1][:, places] / power[0][:, places], axis=0)
    expected = np.exp(-2 * np.pi**2 * spread**2 * (places / 192) ** 2) * np.sinc(places / 192)
    assert result == pytest.approx(expected, rel=0.02)


@released
def test_added_is_nearer_to_the_kernel_than_total_for_a_camera_with_a_lens(tiles):
    kernel = defocus(4)
    truth = mtf.sample(kernel)
    errors = {}
    sharp = generic_lens.sharp_patches(tiles, 12, (0.5, 0.5), 4)
    seen = (np.rint(convolve(sharp, kernel) * 255) / 255).astype(np.float32)
    for answer in spectral.OUTPUTS:
        estimate = blur.create("spectral", output=answer).estimate(seen)
        errors[answer] = np.abs(np.nanmedian(estimate.mtf, axis=0) - truth).mean()
        assert (estimate.low <= estimate.mtf).all() and (estimate.mtf <= estimate.high).all()
    assert errors["relative"] < 0.7 * errors["system"]


@released
def test_the_relative_mtf_is_the_released_map_of_the_main_networks_system_mtf(tiles):
    seen = generic_lens.sharp_patches(tiles, 4, (0.0, 0.7), 5)
    system, relative = (blur.create("spectral", output=output).estimate(seen) for output in spectral.OUTPUTS)
    released_map = Calibration.load(MAP)
    assert released_map.members == 1 and released_map.samples > 3000
    assert np.allclose(relative.mtf, released_map(system.members[:, :1])) and relative.members is None


@pytest.mark.skipif(not spectral.RELEASED.is_file(), reason="released weights absent: run dvc repro train_mtf")
def test_an_unknown_answer_or_an_absent_map_is_an_error_that_names_it(tmp_path):
    with pytest.raises(InputError, match="output='sharp', expected one of system, relative"):
        blur.create("spectral", output="sharp")
    copy = tmp_path / "mine.safetensors"
    copy.write_bytes(spectral.RELEASED.read_bytes())
    with pytest.raises(InputError, match="mine_typical.json"):
        blur.create("spectral", weights=copy, output="relative")


@pytest.mark.full("two trainings take 8 s")
@pytest.mark.skipif(not spectral.RELEASED.is_file(), reason="released weights absent: run dvc repro train_mtf")
def test_the_stage_writes_a_map_that_depends_on_its_settings_alone(tmp_path):
    small = "{images: 4, patches: 8, samples: 120}"
    written = []
    for index, more in (("one", ["executor.workers=1"]), ("two", ["executor.workers=2"]), ("other", ["seed=8"])):
        config = composed.config(f"train.generic_lens={small}", *more)
        outputs = tmp_path / index
        stage.run(config, {}, ROOT, outputs)
        written.append((outputs / "data/weights" / MAP.name).read_bytes())
        content = store.read_json(outputs / "reports/metrics/train/generic_lens.json")
        assert 100 <= content["samples"] <= 120
        assert content["error_after_percent"] < content["error_before_percent"]
    assert written[0] == written[1] != written[2]
