"""One answer for blur and noise: it finds what was done to a frame, where, and says where it can say nothing."""

from functools import partial

import cv2
import numpy as np
import pytest
from data_makers import picture
from scipy.ndimage import gaussian_filter1d
from test_condition_coarse_grain import enlarged, scene

from pipeline import blur, noise
from pipeline.blur.base import BlurEstimate, Estimator
from pipeline.camera import mtf
from pipeline.camera.corruption import corrupt
from pipeline.camera.processing import presets, temporal_noise
from pipeline.camera.processing.codec import Codec, store
from pipeline.camera.processing.delivered import linear_scene
from pipeline.camera.processing.develop import grey
from pipeline.camera.psf import create
from pipeline.condition import ConditionMonitor, estimate, noise_of_frame
from pipeline.condition.coarse_grain import most_coarse_noise_dn
from pipeline.condition.estimate import readable_patches
from pipeline.datasets.decoding.pictures import read_grey8
from pipeline.datasets.patches import cut, tiles
from pipeline.errors import InputError
from pipeline.noise.base import FLAT, REQUIRED, UNCERTAIN, NoiseEstimate
from pipeline.streams import stream


@pytest.fixture(scope="module")
def monitor():
    return ConditionMonitor()


def frame(name="a", width_px=576, height_px=400):
    """Edges and shapes with the finest texture taken away, float32 in [0, 1]."""
    smooth = cv2.GaussianBlur(picture(name, width_px, height_px), (0, 0), 0.7)
    return (0.1 + 0.8 * smooth.astype(np.float32) / 255).astype(np.float32)


def seen(image, sigma_dn, psf=None):
    generator = stream(0, "condition test", sigma_dn)
    return corrupt(image, "readout", sigma_dn=sigma_dn, generator=generator, psf=psf).image


@pytest.mark.parametrize("sigma_dn", [4.0, 15.0])
def test_noise_and_blur_are_found_together(monitor, sigma_dn):
    psf = create("defocus", 9)
    result = monitor.frame(seen(frame(), sigma_dn, psf))
    assert abs(float(result.sigma_dn.value) - sigma_dn) < 0.1 * sigma_dn
    assert result.sigma_dn.low < sigma_dn < result.sigma_dn.high
    assert mtf.amae(result.mtf.value, mtf.sample(psf)) < 12
    sharp = monitor.frame(seen(frame(), sigma_dn))
    assert (sharp.mtf.value[:, 3:] > result.mtf.value[:, 3:] + 0.2).all()
    assert not any(result.abstained.values())
    assert result.milliseconds > 0


def test_a_coded_frame_with_little_noise_is_unknown_and_one_with_much_is_read(monitor, shared):
    """Of a frame without noise as JPEG, MPEG-4 or Motion JPEG a few tiles of asphalt answer, by several DN."""
    path = shared / "realdata/kitti/training/image_2/000001.png"
    if not path.is_file():
        pytest.skip("frame absent: ../shared/realdata/kitti")
    grey, answering = read_grey8(path), []
    for sigma_dn, known in ((0, False), (10, True)):
        noisy = grey + stream(0, "coded frame", sigma_dn).normal(0, sigma_dn, grey.shape)
        colours = np.repeat(np.clip(np.rint(noisy), 0, 255).astype(np.uint8)[..., None], 3, 2)
        for codec in (Codec("jpeg", 75), Codec("mpeg4", 4), Codec("mjpeg", 5)):
            coded = store(colours[: grey.shape[0] // 2 * 2, : grey.shape[1] // 2 * 2], codec)[..., 1] / np.float32(255)
            result = monitor.frame(coded)
            assert result.abstained["noise"] is not known
            assert np.isfinite(result.noise.map_dn).any() == known
            if known:
                assert float(result.sigma_dn.value) == pytest.approx(10, rel=0.2)
                assert result.noise.at_most_dn == float(result.sigma_dn.high)
            else:
                assert result.reasons["noise"]["compressed"] > len(result.noise.patches) / 2
                answering.append(int(result.sigma_dn.count))
                assert 0 < result.noise.at_most_dn < np.nanmax(result.noise.estimate.at_most_dn)
    assert any(answering)  # tiles that the map does not show


def test_motion_is_told_by_direction(monitor):
    result = monitor.frame(seen(frame(), 1.0, create("linear_motion", 15, 0.0)))
    assert (result.mtf.value[1, 2:] > result.mtf.value[0, 2:] + 0.2).all()


def test_maps_lie_where_things_are(monitor):
    image = frame()
    noisy = seen(image, 12.0)
    noisy[:, :288] = image[:, :288]
    result = monitor.frame(noisy)
    assert result.noise.map_dn.shape == (50, 72)
    left, right = result.noise.map_dn[:, :16], result.noise.map_dn[:, -16:]
    assert np.nanmedian(left) < 2
    assert abs(np.nanmedian(right) - 12) < 2
    answered = np.zeros((50, 72), bool)
    for square, without in zip(result.noise.patches, result.noise.estimate.abstained, strict=True):
        rows, columns = (slice(start // 8, (start + square.size_px) // 8) for start in (square.y_px, square.x_px))
        answered[rows, columns] |= not without
    np.testing.assert_array_equal(np.isfinite(result.noise.map_dn), answered)
    assert result.blur.map_mtf.shape == (3, 3, 2, 8)
    assert np.array_equal(result.blur.map_mtf[0, 1], result.blur.estimate.mtf[1], equal_nan=True)
    assert result.blur.patches[1].y_px == 0


def test_a_part_that_tells_nothing_is_counted_and_not_a_zero(monitor):
    image = frame()
    image[:192, :192] = 1.0
    result = monitor.frame(image)
    assert result.blur.estimate.abstained[0]
    assert sum(result.reasons["blur"].values()) == 1
    assert np.isnan(result.blur.map_mtf[0, 0]).all()
    assert np.isfinite(result.mtf.value).all()
    nothing = monitor.frame(np.ones((400, 576), np.float32))
    assert nothing.abstained == {"blur": True, "noise": True}
    assert np.isnan(nothing.mtf.value).all()
    assert np.isnan(nothing.sigma_dn.value)
    assert sum(nothing.reasons["noise"].values()) == len(nothing.noise.patches)


def test_a_frame_smaller_than_a_patch_still_tells_its_noise(monitor):
    result = monitor.frame(seen(frame(), 8.0)[:120, :150])
    assert result.blur.grid == (0, 0)
    assert result.abstained == {"blur": True, "noise": False}
    assert abs(float(result.sigma_dn.value) - 8) < 1.5


def test_patches_are_answered_as_single_estimators_do(monitor):
    noisy = seen(frame(), 6.0)
    stack = np.stack([noisy[:192, x : x + 192] for x in (0, 150, 300)])[:, None]
    result = monitor.patches(stack)
    assert np.array_equal(result.blur.estimate.mtf, monitor.blur_estimator.estimate(stack).mtf)
    assert np.array_equal(result.noise.estimate.sigma_dn, monitor.noise_estimator.estimate(stack).sigma_dn)
    assert result.blur.grid == result.noise.grid == (1, 3)


def test_patches_that_are_no_floats_are_refused(monitor):
    with pytest.raises(InputError, match="uint8"):
        monitor.patches(np.ones((2, 1, 192, 192), np.uint8))


@pytest.mark.full("five calibrations take 12 s")
def test_the_cameras_own_blur_can_be_divided_out(monkeypatch):
    monitor = ConditionMonitor()
    selected = create("gaussian", 1.6)
    sharp = [seen(frame(name), 0.0, selected) for name in "abc"]
    monitor.calibrate(sharp)
    assert (monitor.frame(sharp[0]).mtf.value > 0.8).all()
    monitor = ConditionMonitor()
    soft = monitor.frame(sharp[0]).mtf.value
    monkeypatch.setattr(estimate, "calibrate", partial(estimate.calibrate, samples=300))  # sooner
    monitor.calibrate(sharp, fitted=True)
    assert monitor.frame(sharp[0]).mtf.value.mean() > soft.mean() + 0.15
    fitted = monitor.frame(sharp[0]).mtf.value
    monitor.calibrate(sharp)
    monitor.calibrate(sharp, fitted=True)  # takes the place of what was before
    assert np.array_equal(monitor.frame(sharp[0]).mtf.value, fitted)
    with pytest.raises(InputError, match="192 px"):
        monitor.calibrate([sharp[0][:100]])


@pytest.mark.parametrize("fitted", [False, True])
def test_a_monitor_that_is_relative_to_something_already_is_not_calibrated(fitted):
    sharp = seen(frame("a"), 0.0)
    typical = ConditionMonitor(blur_options={"output": "relative"})
    with pytest.raises(InputError, match="answers relative to the generic lens; expected"):
        typical.calibrate([sharp], fitted=fitted)
    assert typical.blur_estimator.relative_to == "generic lens"
    mine = ConditionMonitor()
    mine.calibrate([sharp])
    mine.blur_estimator = blur.create("spectral").divided(readable_patches([sharp])[0])  # by the caller
    with pytest.raises(InputError, match="answers relative to the camera; expected"):
        mine.calibrate([sharp], fitted=fitted)


def test_frames_that_are_given_as_sharp_and_are_not_give_a_warning(recwarn):
    sharp, soft = seen(frame("a"), 0.0), seen(frame("b"), 0.0, create("defocus", 7.0))
    ConditionMonitor().calibrate([sharp])
    assert not [each for each in recwarn if each.category is UserWarning]
    with pytest.warns(UserWarning, match=r"^sharp frame 2 of 2 does not look sharp: contrast falls to half at 0\.[01]"):
        ConditionMonitor().calibrate([sharp, soft])
    with pytest.warns(UserWarning, match=r"^night\.png does not look sharp"):
        ConditionMonitor().calibrate([soft], names=(name for name in ["night.png"]))
    with pytest.raises(InputError, match="1 names of 2 frames"):
        ConditionMonitor().calibrate([sharp, soft], names=["night.png"])


def test_any_two_estimators_of_the_registries_serve():
    result = ConditionMonitor("spectral", "pca").frame(seen(frame(), 10.0))
    assert abs(float(result.sigma_dn.value) - 10) < 2
    assert result.noise.map_dn.shape == result.noise.grid == (4, 5)
    with pytest.raises(InputError, match="did you mean 'cellwise'"):
        ConditionMonitor(noise_name="cellwize")


@pytest.mark.parametrize(
    "wrong", [np.zeros((300, 300), np.uint8), np.zeros((300, 300, 3), np.float32), np.full((300, 300), 2.0)]
)
def test_what_is_no_frame_is_refused(monitor, wrong):
    with pytest.raises(InputError, match=r"\[0, 1\]"):
        monitor.frame(wrong)


@pytest.mark.parametrize("size", [(0, 0), (0, 300)])
def test_a_frame_without_pixels_is_refused(monitor, size):
    with pytest.raises(InputError, match=r"expected \(H, W\) floats"):
        monitor.frame(np.zeros(size, np.float32))


def test_masked_pixels_are_refused_and_a_mask_of_none_is_not(monitor):
    masked = np.ma.masked_array(seen(frame(), 5.0), mask=False)
    assert monitor.frame(masked).sigma_dn.value == monitor.frame(masked.data).sigma_dn.value
    masked[3, 3] = np.ma.masked
    with pytest.raises(InputError, match="masked pixels"):
        monitor.frame(masked)


def test_rounding_of_white_is_no_other_range(monitor):
    """One more than white by the last digit of single precision, as a filter leaves it."""
    white = np.clip(seen(frame(), 5.0), 0, 1)
    white[:4, :4] = 1.0
    slightly = white.copy()
    slightly[0, 0] = np.nextafter(np.float32(1), np.float32(2))
    assert monitor.frame(slightly).sigma_dn.value == monitor.frame(white).sigma_dn.value


def test_a_picture_too_small_inside_its_bars_is_refused_as_such(monitor):
    barred = np.full((128, 128), 16 / 255, np.float32)
    barred[40:80] = seen(frame(), 5.0)[:40, :128]
    with pytest.raises(InputError, match="inside the bars beside it has 128 x 40 px; noise needs at least 48 px"):
        monitor.frame(barred)
    with pytest.raises(InputError, match="the picture has 40 x 30 px"):
        monitor.frame(np.clip(seen(frame(), 5.0), 0, 1)[100:130, 100:140])


@pytest.mark.parametrize(
    ("options", "message"),
    [({"tile_px": 128.5}, "tile_px=128.5, expected a whole number"), ({"most_tiles": 0}, "most_tiles=0"),
     ({"tile_px": 40}, "at least 48 for noise by adaptive")],
)  # fmt: skip
def test_options_out_of_range_are_refused_at_once(options, message):
    with pytest.raises(InputError, match=message):
        ConditionMonitor(**options)


@pytest.mark.parametrize("axis", [0, 1])
def test_noise_smoothed_along_lines_is_within_the_interval(monitor, axis):
    """As of band-limited analogue video: estimators read next to none of 12 DN."""
    drawn = stream(0, "smoothed along lines", axis).standard_normal((400, 576))
    smooth = gaussian_filter1d(drawn, 1.5, axis=axis)
    noisy = frame() + (12 / 255 * smooth / smooth.std()).astype(np.float32)
    result = monitor.frame(np.clip(np.rint(255 * noisy), 0, 255).astype(np.float32) / np.float32(255))
    assert result.noise.at_most_dn > 12 or np.isnan(result.noise.at_most_dn)
    assert not result.sigma_dn.high < 12


@pytest.mark.parametrize("value", [np.nan, 77.0, -0.1])
def test_pixels_between_the_tiles_count_too(monitor, value):
    wrong = seen(frame(), 5.0)
    wrong[-1, -1] = value
    with pytest.raises(InputError, match="frame: spans"):
        ConditionMonitor(noise_name="pca", most_tiles=1, most_patches=1).frame(wrong)


def test_a_tensor_is_a_frame(monitor):
    import torch

    noisy = seen(frame(), 5.0)
    one, other = monitor.frame(noisy), monitor.frame(torch.from_numpy(noisy))
    assert np.array_equal(one.mtf.value, other.mtf.value) and one.sigma_dn.value == other.sigma_dn.value
    assert not monitor.frame(torch.from_numpy(noisy).bfloat16()).abstained["noise"]


def test_the_answer_is_the_same_each_time(monitor):
    noisy = seen(frame(), 5.0)
    one, other = monitor.frame(noisy), monitor.frame(noisy.copy())
    assert np.array_equal(one.mtf.value, other.mtf.value)
    assert np.array_equal(one.noise.map_dn, other.noise.map_dn)
    assert (one.sigma_dn.low, one.sigma_dn.high) == (other.sigma_dn.low, other.sigma_dn.high)


class FewAnswer:
    """Noise of 30 DN in one square of six; the others are too uncertain to tell."""

    min_size_px = 32

    def estimate_cells(self, patches):
        sigma_dn = np.where(np.arange(len(patches)) == 0, 30.0, np.nan)
        reason = np.where(np.isnan(sigma_dn), UNCERTAIN, "").astype(object)
        cells = np.repeat(sigma_dn.astype(np.float32), 256).reshape(-1, 16, 16)
        return NoiseEstimate(sigma_dn, sigma_dn, sigma_dn, np.isnan(sigma_dn), reason), cells

    def estimate(self, patches):
        return self.estimate_cells(patches)[0]


def test_a_frame_whose_noise_is_unknown_has_no_map_of_it():
    """Few squares that answer are no sample of the frame."""
    state = noise_of_frame(FewAnswer(), frame(width_px=384, height_px=256))
    assert len(state.patches) == 6 and np.isnan(state.summary.value)
    assert state.map_dn.shape == (32, 48) and np.isnan(state.map_dn).all()


def test_noise_that_a_camera_has_processed_is_taken_apart():
    """Against the noise between shots of a simulated camera, and against white noise as it was added."""
    camera, light = presets.named("reflex").at_iso(6400), linear_scene(np.repeat(frame()[..., None], 3, axis=2))
    shots = np.stack([grey(camera.shoot(light, stream(0, "noise parts", shot))) for shot in range(4)])
    present = temporal_noise.measure(shots)
    state = noise_of_frame(noise.create("adaptive"), shots[0].astype(np.float32) / np.float32(255))
    assert present.correlation > 0.3 and state.correlation == pytest.approx(present.correlation, abs=0.15)
    assert state.white_sigma_dn == pytest.approx(present.white_sigma_dn, rel=0.35)
    assert state.white_sigma_dn < 0.6 * state.summary.value
    white = noise_of_frame(noise.create("adaptive"), seen(frame(), 8.0))
    assert white.white_sigma_dn == pytest.approx(8.0, rel=0.1) and abs(white.correlation) < 0.05
    white_only = noise_of_frame(noise.create("pca"), seen(frame(), 8.0))
    assert np.isnan([white_only.white_sigma_dn, white_only.correlation]).all() and white_only.summary.value > 7


class ThreeDn:
    """Noise of 3 DN, 2 to 4, in every square that is not uniform."""

    min_size_px = 32

    def estimate(self, patches):
        flat = patches.std(axis=(1, 2, 3)) == 0
        sigma_dn = np.where(flat, np.nan, 3.0)
        return NoiseEstimate(sigma_dn, sigma_dn - 1, sigma_dn + 1, flat, np.where(flat, FLAT, "").astype(object))


def test_the_interval_of_an_answer_reaches_as_far_as_coarse_noise_may_flat_squares_aside():
    coarse, part = enlarged(scene(10.0, 128), 4), (slice(128, 256), slice(128, 384))
    state = noise_of_frame(ThreeDn(), coarse)
    assert state.summary.value == 3 and state.at_most_dn == state.summary.high > 8
    coarse[part] = 0.5  # 2 of 16 squares
    others = np.stack([coarse[square.y_px :, square.x_px :][:128, :128] for square in state.patches])[:, None]
    flat = noise_of_frame(ThreeDn(), coarse)
    assert flat.summary.value == 3 and list(flat.estimate.reason).count(FLAT) == 2
    assert flat.summary.high == most_coarse_noise_dn(others[others.std(axis=(1, 2, 3)) > 0]) > 8


def test_patches_of_a_calibration_lie_inside_the_bars_beside_a_picture():
    sharp = frame()
    barred = np.full((560, 576), 16 / 255, np.float32)
    barred[80:-80] = sharp
    (inside,), (alone,) = readable_patches([barred]), readable_patches([sharp])
    assert len(alone) and np.array_equal(inside, alone)


class Doubled(Estimator):
    """MTF of .6; spoils the pixels that it is given, and may answer for the first patch only."""

    def __init__(self, few=False):
        self.few = few

    def measure(self, patches, reason):
        patches[:] = 0.5
        count = 1 if self.few else len(patches)
        return BlurEstimate(np.full((count, 2, 8), 0.6), np.zeros(count, bool), np.full(count, ""))


class InPlace:
    """The default noise estimate of pixels that are flat afterwards; may answer for the first patch only."""

    def __init__(self, few=False):
        self.few = few

    def estimate(self, patches):
        answer = noise.create(noise.DEFAULT).estimate(patches)
        patches[:] = 0.5
        if not self.few:
            return answer
        first = slice(0, 1)
        return NoiseEstimate(*(getattr(answer, part)[first] for part in REQUIRED))


def test_estimators_that_work_in_place_change_nothing_else_of_a_frame():
    noisy = seen(frame(), 8.0)
    kept = noisy.copy()
    untouched, both = ConditionMonitor(), ConditionMonitor()
    both.blur_estimator, both.noise_estimator = Doubled(), InPlace()
    expected, answered = untouched.frame(noisy).noise, both.frame(noisy)
    assert answered.sigma_dn.value == expected.summary.value
    assert answered.noise.at_most_dn == expected.at_most_dn
    assert answered.blur.estimate.abstained.sum() < len(answered.blur.estimate)  # of structure that is still there
    patches = cut(noisy, tiles(noisy.shape, 192, "cover"))
    both.patches(patches)
    assert np.array_equal(patches, cut(noisy, tiles(noisy.shape, 192, "cover"))) and np.array_equal(noisy, kept)


def test_an_answer_for_one_patch_of_several_is_refused_by_the_estimators_name():
    noisy = seen(frame(), 8.0)
    monitor = ConditionMonitor()
    monitor.noise_estimator = InPlace(few=True)
    with pytest.raises(InputError, match="^noise estimator 'adaptive': answered for 1 of 20 patches"):
        monitor.frame(noisy)
    monitor.blur_estimator = Doubled(few=True)
    with pytest.raises(InputError, match="^blur estimator 'spectral': answered for 1 of"):
        monitor.frame(noisy)
    with pytest.raises(InputError, match="^blur estimator 'spectral': answered for 1 of"):
        monitor.calibrate([noisy])
    with pytest.raises(InputError, match="^noise estimator 'InPlace': answered for 1 of"):
        noise_of_frame(InPlace(few=True), noisy)


@pytest.mark.parametrize(
    ("cells", "words"),
    [(None, "estimate_cells returned NoiseEstimate, expected a tuple"),
     (np.zeros((6, 4, 4), np.float32), r"cells has shape \(6, 4, 4\), expected \(6, 16, 16\)")],
)  # fmt: skip
def test_cells_that_are_none_of_the_patches_are_refused(cells, words):
    class OtherCells(FewAnswer):
        def estimate_cells(self, patches):
            answer = super().estimate_cells(patches)[0]
            return answer if cells is None else (answer, cells)

    with pytest.raises(InputError, match=f"noise estimator 'OtherCells': {words}"):
        noise_of_frame(OtherCells(), frame(width_px=384, height_px=256))
