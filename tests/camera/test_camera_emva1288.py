"""Photon transfer and dark current: simulated sensors give back the constants they were made with."""

import numpy as np
import pytest

from pipeline.camera import emva1288
from pipeline.errors import InputError
from pipeline.streams import stream

GAIN, DARK_E = 0.05, 20.0  # DN per electron; electrons


def frames(count, key, edge=False, exposure=1.0):
    """Raw frames of a ramp from 10 to 230 DN, 8 bit; with an edge every 40 columns."""
    generator = stream(1, "emva", key)
    level = np.tile(np.linspace(10, 230, 640), (480, 1))
    if edge:
        level = level * np.where(np.arange(640) // 40 % 2, 0.7, 1.0)
    level = exposure * level
    for _ in range(count):
        electrons = generator.poisson(level / GAIN) + generator.normal(0, DARK_E, level.shape)
        yield np.clip(np.rint(GAIN * electrons), 0, 255).astype(np.uint8)


def check(transfer):
    assert transfer.gain_dn_per_e == pytest.approx(GAIN, rel=0.04)
    assert transfer.gain_error < 0.03 * GAIN
    expected = (GAIN * DARK_E) ** 2 + emva1288.QUANTISATION_DN2
    assert transfer.dark_variance_dn2 == pytest.approx(expected, abs=0.2)
    assert transfer.dark_sigma_e == pytest.approx(DARK_E, rel=0.1)


def test_two_frames_give_gain_and_dark_noise_whatever_the_scene():
    first, second = frames(2, "pair", edge=True)
    points = [
        emva1288.points_of_pair(emva1288.plane(first, name), emva1288.plane(second, name), 255)
        for name in emva1288.PLANES
    ]
    check(emva1288.photon_transfer(points))


def test_two_exposures_of_one_scene_give_them_too():
    (short,), (long,) = frames(1, "short", edge=True, exposure=0.4), frames(1, "long", edge=True)
    points = [
        emva1288.points_of_pair(emva1288.plane(short, name), emva1288.plane(long, name), 255)
        for name in emva1288.PLANES
    ]
    check(emva1288.photon_transfer(points))


def test_signal_to_noise_follows_the_fit():
    transfer = emva1288.PhotonTransfer(0.1, 0.0, 1.0, 100)
    assert transfer.electrons(50) == pytest.approx(500)
    assert transfer.snr(90) == pytest.approx(90 / np.sqrt(10))
    assert transfer.dark_sigma_e == pytest.approx(np.sqrt(11 / 12) / 0.1)


def test_dark_current_is_the_slope_of_the_means():
    generator = stream(1, "emva dark")
    exposures = [0.1, 0.1, 1.0, 1.0, 4.0, 4.0]
    dark = [np.rint(8 + 1.5 * t + generator.normal(0, 1, (200, 200))) for t in exposures]
    fitted = emva1288.dark_current(exposures, dark)
    assert fitted.slope_dn_per_s == pytest.approx(1.5, abs=0.01)
    assert fitted.offset_dn == pytest.approx(8, abs=0.02)
    assert fitted.zero_fraction == 0 and fitted.slope_error < 0.01


def test_clipped_and_dark_blocks_are_no_points():
    bright = np.full((64, 64), 255.0)
    assert len(emva1288.points_of_pair(bright, bright, 255).mean_dn) == 0
    assert len(emva1288.points_of_pair(np.zeros((64, 64)), np.zeros((64, 64)), 255).mean_dn) == 0


def test_bad_input_is_named():
    with pytest.raises(InputError, match="02"):
        emva1288.plane(np.zeros((64, 64)), "02")
    with pytest.raises(InputError, match="32 px"):
        emva1288.plane(np.zeros((16, 64)), "00")
    with pytest.raises(InputError, match="same"):
        emva1288.points_of_pair(np.zeros((64, 64)), np.zeros((64, 32)), 255)
    with pytest.raises(InputError, match="0 usable blocks"):
        emva1288.photon_transfer([])
    falling = emva1288.TransferPoints(np.linspace(10, 200, 100), np.linspace(20, 2, 100))
    with pytest.raises(InputError, match="does not grow"):
        emva1288.photon_transfer([falling])
    with pytest.raises(InputError, match="2 exposures"):
        emva1288.dark_current([1, 2], [np.zeros((8, 8))] * 2)
