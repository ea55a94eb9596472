"""Codecs that hide weak noise: no answer and a bound that allows for it; strong noise and other codecs as before."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from data_makers import picture

from benchmarks.video_codecs import shots
from pipeline.camera.processing.codec import Codec
from pipeline.condition import ConditionMonitor, noise_of_frame
from pipeline.condition.estimate import withheld
from pipeline.condition.video_codecs import HIDDEN, READ_FROM_DN, ffmpeg_name, hidden_noise_dn, is_doubtful
from pipeline.datasets.decoding.video_coding import CODECS, Coding
from pipeline.errors import InputError
from pipeline.noise.base import COMPRESSED, NoiseEstimate


def tiles(*sigmas_dn: float) -> NoiseEstimate:
    """Answers; the last tile is uncertain and has no bound, the one before is compressed."""
    nan, count = np.nan, len(sigmas_dn)
    sigma = np.array([*sigmas_dn, nan, nan])
    reason = np.array(["", *[""] * (count - 1), COMPRESSED, "uncertain"], object)
    most = np.array([*(1.2 * np.array(sigmas_dn)), 8.0, nan])
    return NoiseEstimate(sigma, 0.8 * sigma, 1.2 * sigma, reason != "", reason, sigma.copy(), sigma * 0, most)


def may_hide(codec: str, frame_dn: float, quantiser: int | None = None) -> bool:
    return is_doubtful(frame_dn, hidden_noise_dn(codec, quantiser))


NAMED = sorted(codec for codec, hidden in HIDDEN.items() if not hidden.shows)


@pytest.mark.parametrize("codec", NAMED)
def test_weak_and_unknown_noise_may_be_hidden(codec):
    assert may_hide(codec, 2.0) and may_hide(codec, np.nan)
    assert not may_hide(codec, READ_FROM_DN)


@pytest.mark.parametrize(
    ("codec", "quantiser", "words"),
    [("hevc", np.nan, "quantiser=nan"), ("hevc", "30", "quantiser='30'"), (None, None, "codec=None"), (5, 9, "codec=")],
)
def test_what_is_no_codec_or_quantiser_is_refused(codec, quantiser, words):
    """A quantiser of NaN, as tables state an unknown one, hid nothing."""
    with pytest.raises(InputError, match=words):
        hidden_noise_dn(codec, quantiser)
    assert hidden_noise_dn("hevc", np.float64(30)) == hidden_noise_dn("hevc", 30) > 0


def test_quantisers_are_read_of_every_codec_that_hides_noise():
    assert set(HIDDEN) <= set(CODECS)


@pytest.mark.parametrize("codec", sorted(HIDDEN))
def test_what_is_hidden_grows_with_the_quantiser(codec):
    hidden = HIDDEN[codec]
    levels = [hidden.at(quantiser) for quantiser in range(256)]
    assert levels == sorted(levels) and levels[0] == 0 and levels[-1] == hidden.most_dn
    assert hidden.at(None) == (0 if hidden.shows else hidden.most_dn)
    assert hidden.at((hidden.first + hidden.last) // 2) == pytest.approx(hidden.most_dn / 2)
    assert not may_hide(codec, 0.0, hidden.first) and not may_hide(codec, np.nan, hidden.first)
    assert may_hide(codec, 2.0, hidden.last) and not may_hide(codec, READ_FROM_DN, hidden.last)


@pytest.mark.parametrize("codec", ["HEVC", "H.265", "hvc1", "HEV1", "AV01", "vp90", " vp9", "VP80"])
def test_codecs_are_known_by_their_other_names(codec):
    assert may_hide(codec, 2.0)
    assert withheld(tiles(1.0), hidden_noise_dn(codec)).at_most_dn[0] >= min(HIDDEN[name].most_dn for name in NAMED)


@pytest.mark.parametrize(
    ("encoder", "codec"),
    [
        ("hevc_nvenc", "hevc"), ("libx265", "hevc"), ("libvpx", "vp8"), ("libvpx-vp9", "vp9"), ("libsvtav1", "av1"),
        ("h264_vaapi", "h264"), ("LIBX264", "h264"),
    ],
)  # fmt: skip
def test_encoders_are_known_by_their_codec(encoder, codec):
    assert ffmpeg_name(encoder) == codec and hidden_noise_dn(encoder, 50) == hidden_noise_dn(codec, 50)


def test_a_name_that_nobody_knows_is_warned_of_once():
    with pytest.warns(UserWarning, match="codec 'hvec' is not known: .*did you mean 'hevc'?"):
        assert hidden_noise_dn("hvec") == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for known in ("hvec", "", "ffv1", "mjpeg", "prores", "rawvideo", "MJPG", "XVID"):
            assert hidden_noise_dn(known) == 0


@pytest.mark.parametrize("codec", ["", "h264", "mjpeg", "mpeg4", "avc1", "MJPG"])
def test_other_codecs_are_known_by_their_traces(codec):
    assert not may_hide(codec, 0.0)


@pytest.mark.parametrize("codec", NAMED)
def test_withheld_answers_have_a_bound_with_what_may_be_hidden(codec):
    before = tiles(0.5, 2.0, 7.0)
    after = withheld(before, hidden_noise_dn(codec))
    assert after.abstained.all() and after.reason.tolist() == [COMPRESSED] * 4 + ["uncertain"]
    for values in (after.sigma_dn, after.low_dn, after.high_dn, after.white_sigma_dn, after.correlation):
        assert np.isnan(values).all()
    assert np.allclose(after.at_most_dn, np.sqrt(before.at_most_dn**2 + HIDDEN[codec].most_dn ** 2), equal_nan=True)
    assert before.sigma_dn[0] == 0.5


def test_an_estimator_without_bounds_and_parts_has_none_behind_a_codec():
    bare = tiles(1.0)
    after = withheld(NoiseEstimate(bare.sigma_dn, bare.low_dn, bare.high_dn, bare.abstained, bare.reason), 11.0)
    assert after.at_most_dn is None and after.white_sigma_dn is None and after.correlation is None


def coded(name: str, quality: int, sigma_dn: float) -> tuple[np.ndarray, float, Coding]:
    """The last frame of a video, in [0, 1], what differs from one of another noise, DN, and its coding."""
    taken, coding = shots(picture("hevc", 384, 256), Codec(name, quality), sigma_dn, "test")
    shot, other = taken.astype(np.float32)
    return shot / np.float32(255), float((shot - other).std() / 2**0.5), coding


def test_behind_hevc_noise_of_8_dn_is_read_too_low_unless_the_codec_is_known():
    monitor, (frame, left, _) = ConditionMonitor(), coded("hevc", 33, 8.0)
    assert left > 4
    unknown, known = monitor.frame(frame).noise, monitor.frame(frame, "hevc").noise
    assert unknown.summary.high < 0.5 * left
    assert np.isnan(known.summary.value) and known.at_most_dn > left and np.isnan(known.map_dn).all()
    again = noise_of_frame(monitor.noise_estimator, frame, codec="hevc")
    assert again.at_most_dn == known.at_most_dn


def test_behind_hevc_noise_of_25_dn_is_read():
    monitor, (frame, left, _) = ConditionMonitor(), coded("hevc", 33, 25.0)
    known = monitor.frame(frame, "hevc").noise
    assert known.summary.value == monitor.frame(frame).noise.summary.value > READ_FROM_DN
    assert known.summary.value == pytest.approx(left, rel=0.2)


@pytest.mark.parametrize(("name", "quality"), [("hevc", 43), ("vp8", 63), ("vp9", 50), ("av1", 55), ("h264", 48)])
def test_bounds_hold_behind_coarse_quantisers(name, quality):
    frame, left, coding = coded(name, quality, 15.0)
    monitor = ConditionMonitor()
    for quantiser in (coding.quantiser, *([] if HIDDEN[name].shows else [None])):
        known = monitor.frame(frame, name, quantiser).noise
        assert left > 3 and np.isnan(known.summary.value)
        assert not known.at_most_dn < left  # no bound is right too


def test_a_fine_quantiser_of_hevc_hides_little():
    monitor, (frame, left, coding) = ConditionMonitor(), coded("hevc", 12, 5.0)
    named, stored = monitor.frame(frame, "hevc").noise, monitor.frame(frame, "hevc", coding.quantiser).noise
    assert np.isnan(named.summary.value) and named.at_most_dn >= HIDDEN["hevc"].most_dn
    assert stored.summary.value == monitor.frame(frame).noise.summary.value == pytest.approx(left, rel=0.2)


def test_a_finer_quantiser_has_a_lower_bound():
    monitor, (frame, left, coding) = ConditionMonitor(), coded("hevc", 28, 2.0)
    named, stored = monitor.frame(frame, "hevc").noise, monitor.frame(frame, "hevc", coding.quantiser).noise
    assert np.isnan(named.summary.value) and np.isnan(stored.summary.value)
    assert left < stored.at_most_dn < 0.8 * named.at_most_dn
