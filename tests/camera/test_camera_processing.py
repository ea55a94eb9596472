"""The processing inside a camera: moments of the raw noise, what each step does to contrast and noise, codecs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.camera import tone_curve
from pipeline.camera.processing import colour, demosaic, mosaic, presets, scale, temporal_noise
from pipeline.camera.processing.codec import CODECS, VIDEO, Codec, store, video
from pipeline.camera.processing.denoise import METHODS, Denoising, denoise_luma
from pipeline.camera.processing.develop import CameraPipeline, grey
from pipeline.camera.processing.raw_noise import RawNoise
from pipeline.camera.processing.sharpen import Sharpening, gain, sharpen
from pipeline.errors import InputError
from pipeline.streams import stream

GREY = np.full((128, 128, 3), 0.2, np.float32)


def shots(camera: CameraPipeline, scene=GREY, count=4, key="shots"):
    generator = stream(1, key)
    return np.stack([grey(camera.shoot(scene, generator)) for _ in range(count)])


def test_raw_noise_has_the_variance_of_its_model():
    noise = RawNoise(shot=1e-4, read=0.02)
    for level in (0.0, 0.1, 0.8):
        raw = np.full((400, 400), level, np.float32)
        variance = noise.add(raw, stream(1, "raw", level)).var()
        assert variance == pytest.approx(1e-4 * (level + 0.02), rel=0.02)  # five standard errors


def test_iso_doubles_shot_variance_and_keeps_read_noise_in_electrons():
    low, high = (RawNoise.at_iso(iso, full_well_e=10_000, read_e=5) for iso in (100, 200))
    assert high.shot == pytest.approx(2 * low.shot)
    assert np.sqrt(low.shot * low.read) * 10_000 == pytest.approx(5)  # electrons at unit gain
    assert np.sqrt(high.shot * high.read) * 10_000 / 2 == pytest.approx(5)
    with pytest.raises(InputError, match="iso=50"):
        RawNoise.at_iso(50, full_well_e=10_000, read_e=5)


def test_row_noise_is_common_to_a_row():
    noise = RawNoise(shot=1e-4, read=0.5, row=2.0)
    rows = noise.add(np.zeros((300, 300), np.float32), stream(1, "rows")).mean(axis=1)
    assert rows.std() == pytest.approx(2.0 * np.sqrt(1e-4 * 0.5), rel=0.15)


@pytest.mark.parametrize("method", demosaic.METHODS)
def test_demosaicing_keeps_flat_colours_and_sampled_pixels(method):
    flat = np.broadcast_to(np.float32([0.6, 0.3, 0.1]), (32, 32, 3)).copy()
    inside = demosaic.demosaic(mosaic.mosaic(flat), method)[6:-6, 6:-6]
    assert np.abs(inside - flat[6:-6, 6:-6]).max() < 1e-4
    response = demosaic.transfer(method, (0.0, 0.1, 0.3))
    assert response[0] == pytest.approx(1, abs=0.02) and 0.4 < response[2] < 1.1


def test_bilinear_demosaicing_has_the_contrast_of_its_closed_form():
    # On an axis green keeps 3/4 + cos(2 pi f)/4, red and blue 1/2 + cos(2 pi f)/2; the mean over colours is measured.
    frequencies = (0.05, 0.15, 0.25, 0.35)
    cosine = np.cos(2 * np.pi * np.array(frequencies))
    expected = ((3 + cosine) / 4 + 2 * (1 + cosine) / 2) / 3
    assert demosaic.transfer("bilinear", frequencies) == pytest.approx(expected, abs=0.03)


def test_the_colour_matrix_keeps_grey():
    matrix = colour.matrix((1.7, 1.3, 1.5), (0.3, 0.6, 0.5))
    assert matrix.sum(axis=1) == pytest.approx(1, abs=1e-6)


def test_the_tone_curve_is_monotonic_and_inverts():
    x = np.linspace(0, 1, 101, dtype=np.float32)
    assert (np.diff(tone_curve.render(x, 2.2, 0.5)) > 0).all()
    assert tone_curve.linearise(tone_curve.render(x, 2.2), 2.2) == pytest.approx(x, abs=1e-4)


@pytest.mark.parametrize("strength", [0.35, 1.0])
def test_the_s_curve_is_steeper_by_its_strength_in_the_middle_and_flatter_at_the_ends(strength):
    x = np.linspace(0, 1, 1001, dtype=np.float32)
    y = tone_curve.render(x, 1.0, strength).astype(float)
    steepness = np.gradient(y, 0.001)
    assert steepness[[1, 250, 500, 750, -2]] == pytest.approx(
        [1 - strength, 1, 1 + strength, 1, 1 - strength], abs=0.01
    )
    assert y[[0, 500, 1000]] == pytest.approx([0, 0.5, 1], abs=1e-6)
    assert y[250] == pytest.approx(0.25 - strength / 6.2832, abs=1e-4)


@pytest.mark.parametrize("method", [name for name in METHODS if name != "none"])
def test_denoising_lowers_noise_and_keeps_the_mean(method):
    noisy = np.float32(0.5) + np.float32(0.03) * stream(1, "d").standard_normal((96, 96), dtype=np.float32)
    smooth = denoise_luma(noisy, Denoising(method, strength=2.0), 0.03)
    assert smooth.std() < 0.85 * noisy.std()
    assert smooth.mean() == pytest.approx(0.5, abs=0.003)


def test_sharpening_lifts_contrast_as_its_formula():
    settings = Sharpening(0.8, 1.2)
    columns = np.arange(240)
    for frequency in (0.05, 0.15, 0.3):
        wave = np.broadcast_to(np.float32(0.5 + 0.1 * np.sin(2 * np.pi * frequency * columns)), (8, 240)).copy()
        lifted = sharpen(wave, settings, 0.0)[:, 40:200]
        assert np.ptp(lifted) / np.ptp(wave[:, 40:200]) == pytest.approx(
            gain(settings, np.array([frequency]))[0], rel=0.02
        )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Denoising("bilateral", strength=-2), "denoising: strength=-2, expected a finite number, 0 or more"),
        (lambda: Denoising(blend=1.5), "denoising: blend=1.5, expected 0 to 1"),
        (lambda: Denoising("gaussian", radius_px=float("nan")), "denoising: radius_px=nan"),
        (lambda: Sharpening(amount=float("inf")), "sharpening: amount=inf"),
        (lambda: Codec("jpeg", 80, corner=(40, 0)), r"codec jpeg: corner=\(40, 0\), expected 0 to 7 each"),
    ],
)
def test_settings_out_of_range_are_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_a_gaussian_narrower_than_a_pixel_sharpens_nothing():
    luma = stream(1, "narrow").random((32, 32), dtype=np.float32)
    narrow = Sharpening(amount=1.0, radius_px=0.14)
    np.testing.assert_array_equal(sharpen(luma, narrow, 0.0), luma)
    np.testing.assert_array_equal(gain(narrow, np.array([0.1, 0.5])), 1)


def test_coring_spares_noise_and_sharpens_edges():
    noise = np.float32(0.01) * stream(1, "coring").standard_normal((128, 128), dtype=np.float32)
    flat, edge = np.full((128, 128), 0.4, np.float32), np.zeros((128, 128), np.float32)
    edge[:, 64:] = 0.2
    open_, cored = Sharpening(1.0, 1.2), Sharpening(1.0, 1.2, coring=8.0)  # the threshold is 4 sigma
    assert sharpen(flat + noise, open_, 0.01).std() > 1.5 * noise.std()
    assert sharpen(flat + noise, cored, 0.01).std() == pytest.approx(noise.std(), rel=0.01)
    # of an edge, detail is lifted less by the threshold: an overshoot of a (d - 0.04)
    full, less = (np.ptp(sharpen(flat + edge, settings, 0.01)) for settings in (open_, cored))
    assert full - less == pytest.approx(2 * 0.04, abs=1e-5) and less > 0.24


def test_shrinkage_acts_on_coarse_scales_as_set():
    """A faint wave of 8 px lies in all three bands; what is left is what no threshold took."""
    f = 1 / 8
    finest, middle = (np.exp(-2 * (np.pi * f * sigma_px) ** 2) for sigma_px in (0.7, 2.8))
    wave = np.float32(0.5 + 1e-4 * np.sin(2 * np.pi * f * np.arange(256)))
    luma = np.broadcast_to(wave, (64, 256)).copy()
    for coarse, kept in ((0.0, finest), (1.0, middle)):
        settings = Denoising("shrinkage", strength=3.0, coarse=coarse)
        smooth = denoise_luma(luma, settings, 0.01)[32, 64:192]
        assert np.ptp(smooth) / np.ptp(wave) == pytest.approx(kept, abs=0.03)


def test_shrinkage_takes_most_from_the_finest_band():
    """A strong wave of 8 px lies in all three bands: its peaks lose what the thresholds of all of them take."""
    wave = np.float32(0.5 + 0.2 * np.cos(2 * np.pi / 8 * np.arange(256)))
    luma = np.broadcast_to(wave, (64, 256)).copy()
    for coarse in (0.0, 1.0, 2.0):
        smooth = denoise_luma(luma, Denoising("shrinkage", strength=2.0, coarse=coarse), 0.01)
        lost = 0.6 * 2.0 * 0.01 * (0.7 + 0.45 * coarse + 0.25 * 0.5 * coarse**2)
        assert luma[32, 128] - smooth[32, 128] == pytest.approx(lost, abs=1e-5)


def test_non_local_means_are_those_of_opencv_at_the_stated_strength():
    import cv2

    grey = np.rint(128 + 8 * stream(1, "nlm").standard_normal((64, 64))).clip(0, 255).astype(np.uint8)
    smooth = denoise_luma(grey.astype(np.float32) / 255, Denoising("nlm", strength=2.0), 8 / 255)
    np.testing.assert_array_equal(np.rint(255 * smooth), cv2.fastNlMeansDenoising(grey, None, 0.6 * 2 * 8, 3, 9))


def test_h264_gives_the_same_bytes_whatever_memory_held_before():
    """x264's AVX-512 analysis gave other bytes in 2 % of the runs: of 200, hardly ever in none."""
    picture = np.repeat(np.broadcast_to(np.linspace(0, 255, 92), (60, 92))[..., None], 3, axis=2).astype(np.uint8)
    generator, answers, freed = stream(1, "memory"), set(), []
    for _ in range(200):
        freed = [*freed[-19:], generator.integers(0, 256, generator.integers(1, 200_000), np.uint8)]
        answers.add(video([picture, picture], "h264", 20)[-1].tobytes())
    assert len(answers) == 1


@pytest.mark.parametrize("name", CODECS)
def test_codecs_return_the_picture_at_their_quality(name):
    columns = np.linspace(0, 255, 96)
    picture = np.repeat(np.broadcast_to(columns, (64, 96))[..., None], 3, axis=2).astype(np.uint8)
    codec = Codec(name, {"jpeg": 90, "mpeg4": 3, "mjpeg": 3}.get(name, 20), corner=(3, 5))
    before = [picture] if name in VIDEO and name != "mjpeg" else []
    back = store(picture, codec, before)
    assert back.shape == picture.shape
    assert np.abs(back.astype(int) - picture).mean() < 4
    assert np.array_equal(back, store(picture, codec, before))


@pytest.mark.parametrize("name", VIDEO)
def test_the_coarsest_quality_of_a_video_loses_most(name):
    scene = np.clip(128 + 40 * stream(1, "scene").standard_normal((64, 96, 1)), 0, 255).astype(np.uint8)
    picture = np.repeat(scene, 3, axis=2)
    fine, coarse = (store(picture, Codec(name, quality), [picture]) for quality in (2, VIDEO[name].worst))
    lost = [np.abs(back.astype(float) - picture).mean() for back in (fine, coarse)]
    assert lost[0] < 0.5 * lost[1]


def test_a_codec_out_of_range_is_refused():
    with pytest.raises(InputError, match="quality=101"):
        Codec("jpeg", 101)
    with pytest.raises(InputError, match="quality=0, expected 1 to 31"):
        Codec("mpeg4", 0)
    with pytest.raises(InputError, match="quality=52, expected 0 to 51"):
        Codec("hevc", 52)
    with pytest.raises(InputError, match="jpeg"):
        Codec("jpg")


def test_scaling_changes_the_number_of_pixels():
    assert scale.resize(np.zeros((40, 60, 3), np.float32), 0.5).shape == (20, 30, 3)


def test_temporal_noise_measures_white_and_correlated_noise():
    import cv2

    generator = stream(1, "temporal")
    white = 100 + 6 * generator.standard_normal((8, 128, 128)).astype(np.float32)
    result = temporal_noise.measure(white)
    assert result.sigma_dn == pytest.approx(6, rel=0.02) and abs(result.correlation) < 0.02
    assert result.white_sigma_dn == pytest.approx(6, rel=0.05)
    assert result.map_dn.shape == (16, 16) and result.spectrum_dn2 == pytest.approx(36, rel=0.1)
    soft = np.stack([cv2.GaussianBlur(shot, (0, 0), 1.0) for shot in white])
    result = temporal_noise.measure(soft)
    assert result.correlation == pytest.approx(np.exp(-0.25), abs=0.03)  # of a Gaussian of 1 px
    assert result.white_sigma_dn < 0.2 * result.sigma_dn


def test_temporal_noise_does_not_count_flicker_of_the_whole_frame():
    shots_dn = 100 + 3 * stream(1, "flicker").standard_normal((8, 64, 64)).astype(np.float32)
    shots_dn += np.linspace(-10, 10, 8, dtype=np.float32)[:, None, None]
    result = temporal_noise.measure(shots_dn)
    assert result.sigma_dn == pytest.approx(3, rel=0.03) and abs(result.correlation) < 0.05


@pytest.mark.parametrize("shape", [(2, 16, 16), (2, 8, 128), (2, 128, 16), (1, 32, 32), (2, 32, 36), (32, 32)])
def test_temporal_noise_refuses_shots_that_it_cannot_measure(shape):
    with pytest.raises(InputError, match="at least 24 px"):
        temporal_noise.measure(np.zeros(shape, np.uint8))


def test_temporal_noise_of_the_smallest_patch_is_complete():
    white = 100 + 6 * stream(1, "least").standard_normal((64, 24, 24)).astype(np.float32)
    result = temporal_noise.measure(white)
    assert np.isfinite(result.spectrum_dn2).all()
    assert 4 < result.white_sigma_dn <= result.sigma_dn == pytest.approx(6, rel=0.05)


def test_a_camera_without_noise_repeats_itself():
    for preset in presets.PRESETS.values():
        pair = shots(preset.at_iso(0), count=2)
        assert np.array_equal(pair[0], pair[1])


def test_processing_correlates_noise_and_linear_cameras_leave_it_nearly_white():
    processed = temporal_noise.measure(shots(presets.named("phone").at_iso(1600)))
    assert processed.sigma_dn > 1 and processed.correlation > 0.25
    bare = CameraPipeline(noise=RawNoise(1e-4, 0.02), demosaicing=None, gamma=1.0)
    measured = temporal_noise.measure(shots(bare))
    assert abs(measured.correlation) < 0.03
    assert measured.sigma_dn == pytest.approx(255 * np.sqrt(1e-4 * 0.22 + 1 / 12 / 255**2), rel=0.03)


@pytest.mark.parametrize("method", demosaic.METHODS)
def test_encoded_sigma_is_the_noise_behind_the_tone_curve_within_a_factor_of_two(method):
    # It neglects the correlation between colours that demosaicing makes; thresholds of denoisers need no more.
    camera = CameraPipeline(noise=RawNoise(4e-4, 0.02), balance=(1.8, 1.6), demosaicing=method)
    picture = shots(camera)
    ratio = 255 * camera.encoded_sigma(float(picture.mean()) / 255) / temporal_noise.measure(picture).sigma_dn
    assert 0.5 < ratio < 2
    quiet = camera.with_noise(RawNoise(1e-4, 0.02))
    assert camera.encoded_sigma(0.4) == pytest.approx(2 * quiet.encoded_sigma(0.4))


def test_encoded_sigma_without_colour_filters_is_exact():
    camera = CameraPipeline(noise=RawNoise(1e-4, 0.02), demosaicing=None)
    picture = shots(camera)
    expected = temporal_noise.measure(picture).sigma_dn
    assert 255 * camera.encoded_sigma(float(picture.mean()) / 255) == pytest.approx(expected, rel=0.05)


def test_encoded_sigma_knows_that_colour_correction_amplifies_noise():
    noise = RawNoise(2e-4, 0.05)
    plain = CameraPipeline(noise=noise, demosaicing="bilinear")
    corrected = replace(plain, colour_diagonal=(1.9, 1.9, 1.9), colour_split=(0.2, 0.5, 0.8))
    first, second = (
        (temporal_noise.measure(picture).sigma_dn, camera.encoded_sigma(float(picture.mean()) / 255))
        for camera in (plain, corrected)
        for picture in [shots(camera)]
    )
    assert second[0] > 1.15 * first[0]
    assert second[1] / first[1] == pytest.approx(second[0] / first[0], rel=0.1)


def test_encoded_sigma_knows_that_white_balance_amplifies_noise_of_less_light():
    """At four times the gain a colour had a quarter of the light: its shot noise is doubled, not quadrupled."""
    plain = CameraPipeline(noise=RawNoise(2e-4, 0.0), demosaicing="bilinear")
    ratios = []
    for camera in (plain, replace(plain, balance=(4.0, 4.0))):
        picture = shots(camera)
        measured = temporal_noise.measure(picture).sigma_dn
        ratios.append(255 * camera.encoded_sigma(float(picture.mean()) / 255) / measured)
    assert ratios[1] / ratios[0] == pytest.approx(1, abs=0.1)


def test_encoded_sigma_of_black_is_finite_and_near_the_noise():
    camera = CameraPipeline(noise=RawNoise(1e-5, 0.02), demosaicing=None)
    dark = np.full((128, 128, 3), 0.004, np.float32)
    picture = shots(camera, dark)
    ratio = 255 * camera.encoded_sigma(float(picture.mean()) / 255) / temporal_noise.measure(picture).sigma_dn
    assert 0.4 < ratio < 0.8  # the slope of a somewhat brighter shadow stands for that of black
    assert camera.encoded_sigma(0.0) == camera.encoded_sigma(0.1) > 0


def test_transfer_is_the_contrast_of_a_soft_camera():
    camera = CameraPipeline(demosaicing=None, gamma=1.0, denoising=Denoising(softness_px=0.9))
    columns = np.arange(192)
    for frequency in (0.1, 0.25):
        wave = np.float32(0.5 + 0.2 * np.sin(2 * np.pi * frequency * columns))
        scene = np.repeat(np.broadcast_to(wave, (32, 192))[..., None], 3, axis=2).astype(np.float32)
        delivered = grey(camera.shoot(scene, stream(1, "t")))[16, 20:170].astype(float)
        ratio = np.ptp(delivered) / 255 / np.ptp(wave[20:170])
        assert ratio == pytest.approx(camera.transfer(np.array([frequency]))[0], abs=0.02)


def test_shots_depend_on_their_stream_alone():
    camera = presets.named("reflex").at_iso(3200)
    assert np.array_equal(shots(camera, key="a"), shots(camera, key="a"))
    assert not np.array_equal(shots(camera, key="a"), shots(camera, key="b"))


def test_bad_scenes_and_names_are_refused():
    with pytest.raises(InputError, match="even sides"):
        CameraPipeline().expose(np.zeros((5, 6, 3), np.float32))
    with pytest.raises(InputError, match="phone"):
        presets.named("phon")
    with pytest.raises(InputError, match="scaling"):
        replace(CameraPipeline(), scaling=0.5).transfer(np.array([0.1]))
