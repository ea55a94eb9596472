"""Photon transfer and dark current: simulated sensors give back the constants they were made with."""

import numpy as np
import pytest

from pipeline.camera.characterisation import emva1288
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
    expected = (GAIN * DARK_E) ** 2 + emva1288.quantisation_dn2(1)
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
    transfer = emva1288.PhotonTransfer(0.1, 0.0, 1.0, 100, black_dn=16.0)
    assert transfer.snr(90) == pytest.approx(90 / np.sqrt(10))
    assert transfer.sigma_dn(np.array([106.0, 16.0, 0.0])) == pytest.approx([np.sqrt(10), 1, 0])
    assert transfer.dark_sigma_e == pytest.approx(np.sqrt(11 / 12) / 0.1) and transfer.dark_sigma_reason == ""


def with_pattern(fraction, exposure, key):
    """A raw frame of a ramp with an edge, each pixel off by a fixed fraction of its light."""
    level = exposure * np.tile(np.linspace(20, 160, 640), (480, 1)) * np.where(np.arange(640) > 300, 0.8, 1.0)
    electrons = level / GAIN * (1 + fraction * stream(1, "emva pattern").standard_normal(level.shape))
    drawn = stream(1, "emva pattern", key)
    return GAIN * (drawn.poisson(electrons) + drawn.normal(0, DARK_E, level.shape))


@pytest.mark.parametrize("fraction", [0.0, 0.01, 0.03])
def test_the_fixed_pattern_is_what_two_exposures_share_from_pixel_to_pixel(fraction):
    short, long = with_pattern(fraction, 0.5, "short"), with_pattern(fraction, 1.0, "long")
    points = [
        emva1288.points_of_pair(emva1288.plane(short, name), emva1288.plane(long, name), 255)
        for name in emva1288.PLANES
    ]
    assert emva1288.photon_transfer(points).pattern_fraction == pytest.approx(fraction, abs=0.003)


def test_the_finest_filter_passes_white_patterns_whole():
    """The squares of its weights add up to 1, those of its answer to a single pixel."""
    pixel = np.zeros((1, 16, 16))
    pixel[0, 8, 8] = 1.0
    assert np.square(emva1288._fine(pixel)).sum() == pytest.approx(1, abs=1e-12)


def test_a_fixed_pattern_that_was_not_measured_is_not_taken_for_none():
    without = emva1288.TransferPoints(np.linspace(10, 200, 100), np.linspace(2, 20, 100))
    transfer = emva1288.photon_transfer([without])
    assert np.isnan(transfer.pattern_fraction)
    assert np.isnan(transfer.sigma_with_pattern_dn(np.array([100.0]))).all()
    assert np.isfinite(transfer.sigma_dn(np.array([100.0]))).all()


def test_noise_and_fixed_pattern_add_as_variances_above_black():
    transfer = emva1288.PhotonTransfer(0.1, 0.0, 1.0, 100, black_dn=16.0, pattern_fraction=0.04)
    expected = np.sqrt(transfer.sigma_dn(np.array([116.0])) ** 2 + 4.0**2)
    assert transfer.sigma_with_pattern_dn(np.array([116.0])) == pytest.approx(expected)
    assert transfer.sigma_with_pattern_dn(np.array([16.0])) == pytest.approx(transfer.sigma_dn(np.array([16.0])))


def test_a_variance_below_that_of_quantisation_gives_no_dark_noise_and_the_reason():
    transfer = emva1288.PhotonTransfer(0.1, 0.001, 0.05, 100, dark_variance_error=0.01)
    assert np.isnan(transfer.dark_sigma_e) and np.isnan(transfer.dark_sigma_error)
    assert transfer.dark_sigma_reason == (
        "the variance at no light, 0.050 DN^2, is below that of quantisation, 0.083 DN^2"
    )


def converted(electrons, bits, step):
    """Grey values of a converter of some bits, black at a sixteenth, in steps of ``step`` DN."""
    top = 2**bits - 1
    return (np.clip(np.rint(electrons * top / 10_000 + top // 16), 0, top) * step).astype(np.uint16)


@pytest.mark.parametrize(("bits", "step"), [(12, 16), (10, 64), (12, 1), (8, 256)])
def test_dark_noise_does_not_depend_on_the_bits_that_hold_the_grey_values(bits, step):
    """12 bits in the high bits of 16 are measured as 12 bits are: quantisation is that of the converter's steps."""
    drawn = stream(1, "emva step", bits)
    level = np.repeat(np.exp(np.linspace(np.log(100), np.log(6000), 40)), 16)[None] * np.ones((320, 1))
    shots = [drawn.poisson(level) + drawn.normal(0, 12, level.shape) for _ in range(4)]
    fits = []
    for q in (1, step):
        frames = [converted(shot, bits, q) for shot in shots]
        assert emva1288.grey_step_dn(frames) == q
        white, black = q * (2**bits - 1), q * ((2**bits - 1) // 16)
        points = [emva1288.points_of_pair(a, b, white, black, q) for a, b in (frames[:2], frames[2:])]
        fits.append(emva1288.photon_transfer(points, black, q))
    assert fits[1].dark_sigma_e == pytest.approx(fits[0].dark_sigma_e, rel=1e-9)
    assert fits[1].points == fits[0].points
    assert bits == 8 or fits[1].dark_sigma_e == pytest.approx(12, rel=0.15)


def test_the_step_is_that_of_differences_whatever_the_black_level():
    assert emva1288.grey_step_dn([np.array([[1029, 1045]]), np.array([[1093, 1029]])]) == 16
    assert emva1288.grey_step_dn([np.array([[7, 7]])]) == 1  # a single value shows none
    assert emva1288.grey_step_dn([np.array([[0.5, 0.25]])]) == 1


def test_a_variance_below_that_of_coarse_steps_names_it():
    transfer = emva1288.PhotonTransfer(1.6, 0.01, 15.0, 100, step_dn=16.0)
    assert np.isnan(transfer.dark_sigma_e)
    assert transfer.dark_sigma_reason.endswith("is below that of quantisation, 21.333 DN^2")


def test_the_error_of_the_dark_noise_is_its_spread():
    """Lines through points with normal errors: dark noise spreads as its error says."""
    generator = stream(1, "emva error")
    mean = np.linspace(5, 150, emva1288.MEAN_BINS)
    sigma, errors = [], []
    for _ in range(300):
        variance = (1 + 1 / 12 + 0.05 * mean) * (1 + 0.02 * generator.normal(size=mean.size))
        fit = emva1288.photon_transfer([emva1288.TransferPoints(mean, variance)])
        sigma.append(fit.dark_sigma_e)
        errors.append(fit.dark_sigma_error)
    assert np.mean(errors) == pytest.approx(np.std(sigma), rel=0.12)


def test_bins_have_the_mean_of_variances_unless_some_hold_a_moving_edge():
    """The median of chi^2 is 0.26 % below its mean; a hundredth of blocks with ten times the variance changes 1 %."""
    freedom = emva1288.FREEDOM
    variance = stream(1, "emva chi2").chisquare(freedom, 240_000) / freedom
    points = emva1288.TransferPoints(np.arange(240_000, dtype=float), variance)
    assert emva1288.binned([points]).variance_dn2.mean() == pytest.approx(1, abs=7e-4)
    variance[::100] *= 10
    assert emva1288.binned([points]).variance_dn2.mean() == pytest.approx(1, abs=4e-3)


@pytest.mark.parametrize("levels", [2, 3, 5, 7, 10, 30, 240])
@pytest.mark.parametrize(("gain", "dark_dn2", "means"), [(0.25, 1.0, (10, 170)), (0.4, 64.0, (20, 2000))])
def test_any_number_of_levels_gives_gain_and_dark_noise_with_their_errors(levels, gain, dark_dn2, means):
    """Bins that hold two levels made the gain of thirty .6 % too low, and stated errors of five twice too large."""
    generator, fits = stream(1, "emva levels", levels, gain), []
    mean = np.repeat(np.linspace(*means, levels), 1280 // levels)
    for _ in range(60):
        shown = mean + generator.normal(0, np.sqrt(dark_dn2 + gain * mean) / emva1288.BLOCK_PX)
        spread = generator.chisquare(emva1288.FREEDOM, mean.size) / emva1288.FREEDOM
        variance = (dark_dn2 + 1 / 12 + gain * mean) * spread
        fits.append(emva1288.photon_transfer([emva1288.TransferPoints(shown, variance)]))
    for measured, errors, truth in (
        ([fit.gain_dn_per_e for fit in fits], [fit.gain_error for fit in fits], gain),
        ([fit.dark_sigma_e for fit in fits], [fit.dark_sigma_error for fit in fits], np.sqrt(dark_dn2) / gain),
    ):
        assert np.mean(measured) == pytest.approx(truth, abs=0.45 * np.std(measured))
        assert np.mean(errors) == pytest.approx(np.std(measured), rel=0.3)


def flat_fields(key, gain, dark_e, levels_dn, white_dn, black_dn, light=None):
    """The fit to pairs of flat fields of 64 blocks; levels in DN above black, ``light`` draws that of each shot."""
    generator, points = stream(1, "emva flat", key), []
    for level in levels_dn:
        drawn = []
        for _ in range(2):
            electrons = level / gain * (np.ones((128, 128)) if light is None else light(generator))
            signal = generator.poisson(electrons) + generator.normal(0, dark_e, electrons.shape)
            drawn.append(np.clip(np.rint(black_dn + gain * signal), 0, white_dn))
        points.append(emva1288.points_of_pair(*drawn, white_dn, black_dn))
    return emva1288.photon_transfer(points, black_dn)


def test_noise_that_rounding_hides_is_left_out():
    """Of levels at whole numbers rounding takes noise of .4 DN away: of 10 electrons of dark noise 4 to 8 were read."""
    fits = [flat_fields(f"rounding {k}", 0.02, 10.0, np.linspace(6, 170, 12), 255, 5.0) for k in range(12)]
    assert np.mean([fit.gain_dn_per_e for fit in fits]) == pytest.approx(0.02, rel=0.01)
    assert np.mean([fit.dark_sigma_e for fit in fits]) == pytest.approx(10, abs=1)
    with pytest.raises(InputError, match="rounding hides the noise"):
        flat_fields("hidden", 0.002, 10.0, [8, 12, 16], 255, 5.0)


def test_a_black_level_that_cuts_the_noise_of_dark_blocks_off_does_not_change_the_rest():
    """12 bits with black at 0 and 7 DN of dark noise: blocks of 4 to 20 DN gave 7.6 instead of 10 electrons."""
    fits = [flat_fields(f"cut {k}", 0.68, 10.0, np.geomspace(4.5, 2500, 15), 4095, 0.0) for k in range(6)]
    assert np.mean([fit.gain_dn_per_e for fit in fits]) == pytest.approx(0.68, rel=0.01)
    assert np.mean([fit.dark_sigma_e for fit in fits]) == pytest.approx(10, rel=0.02)


def test_lamps_that_flicker_do_not_change_the_noise():
    """Light that changes by 5 % within 333 rows, shifted from shot to shot, made the gain 5 to 9 % too high."""

    def flicker(generator):
        rows = 2 * np.arange(128)[:, None]  # of one colour plane
        return np.ones((128, 128)) * (1 + 0.05 * np.sin(2 * np.pi * (rows / 333 + generator.random())))

    levels = np.linspace(100, 2500, 12)
    fits = [flat_fields(f"flicker {k}", 0.4, 8.0, levels, 4095, 64.0, light=flicker) for k in range(6)]
    assert np.mean([fit.gain_dn_per_e for fit in fits]) == pytest.approx(0.4, rel=0.01)
    assert np.mean([fit.dark_sigma_e for fit in fits]) == pytest.approx(8, rel=0.05)


def test_a_gain_of_a_single_level_is_refused():
    with pytest.raises(InputError, match="which is not sure"):
        flat_fields("single", 0.4, 8.0, [800], 4095, 64.0)


def test_the_black_level_of_clipped_dark_frames_is_0():
    generator = stream(1, "emva black")
    exposures, mean = [0.1, 1.0, 4.0], {}
    for black in (-0.5, 6.0):
        dark = [np.clip(np.rint(black + generator.normal(0, 1, (100, 100))), 0, 255) for _ in exposures]
        mean[black] = emva1288.dark_current(exposures, dark)
    assert mean[-0.5].offset_dn > 0.1 and mean[-0.5].black_dn == 0
    assert mean[6.0].black_dn == mean[6.0].offset_dn == pytest.approx(6, abs=0.05)


def test_clipping_is_tested_in_raw_and_saturation_above_black():
    """Of 255 DN with black at 55 DN the line ends at 70 % of 200 DN, and pixels from 250 DN on are clipped."""
    half = np.full((16, 16), 100.0)
    counts = {}
    for grey, peak in ((194.0, 194.0), (196.0, 196.0), (100.0, 251.0)):
        block = np.full((16, 16), grey)
        block[0, 0] = peak
        counts[grey, peak] = len(emva1288.points_of_pair(half, block, 255, 55).mean_dn)
    assert counts == {(194.0, 194.0): 1, (196.0, 196.0): 0, (100.0, 251.0): 0}
    assert len(emva1288.points_of_pair(half - 42, half, 255, 55).mean_dn) == 0  # 3 DN above black


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
    with pytest.raises(InputError, match="white_dn"):
        emva1288.points_of_pair(np.zeros((64, 64)), np.zeros((64, 64)), 20, 30)
    with pytest.raises(InputError, match="all blocks of 9 DN"):
        emva1288.photon_transfer([emva1288.TransferPoints(np.full(99, 9.0), np.full(99, 2.0))])
    falling = emva1288.TransferPoints(np.linspace(10, 200, 100), np.linspace(20, 2, 100))
    with pytest.raises(InputError, match="which is not sure"):
        emva1288.photon_transfer([falling])
    with pytest.raises(InputError, match="2 exposures"):
        emva1288.dark_current([1, 2], [np.zeros((8, 8))] * 2)
