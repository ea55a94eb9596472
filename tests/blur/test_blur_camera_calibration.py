"""Fitting an estimator to a camera: known distortions are undone, files and bad input are honest."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch

from pipeline import blur
from pipeline.blur import camera_calibration, spectral
from pipeline.blur.base import BlurEstimate
from pipeline.blur.calibration import fit as camera_fit
from pipeline.blur.calibration import output_layers
from pipeline.blur.calibration import samples as camera_samples
from pipeline.blur.calibration.affine_logits import logit, sigmoid
from pipeline.blur.calibration.samples import Samples
from pipeline.blur.camera_calibration import CalibratedEstimator, Calibration
from pipeline.camera import mtf
from pipeline.camera.blur import blur as convolve
from pipeline.camera.psf.defocus import create as defocus
from pipeline.camera.psf.gaussian import gaussian
from pipeline.camera.psf.linear_motion import create as motion
from pipeline.errors import InputError
from pipeline.learning import images, kernels
from pipeline.streams import stream

SAMPLES = 500


@pytest.fixture(scope="module")
def sharp():
    """Sharp procedural patches: (6, 1, 192, 192)."""
    results = [images.picture(index, 5, "test image", 192) for index in range(6)]
    return np.stack(results)[:, None].astype(np.float32) / 255


@pytest.fixture(scope="module")
def truth():
    """The MTFs that `fit` blurs by, in its order: (500, 2, 8)."""
    return mtf.sample(camera_samples._kernels(SAMPLES, seed=1))  # rendered lenses take seconds: kept for calibrations


class Bent:
    """Knows what blur comes next and answers it distorted."""

    def __init__(self, truth, bend, spread=0.0, unable=0):
        self.truth, self.bend, self.spread, self.unable, self.asked = truth, bend, spread, unable, 0

    def estimate(self, patches):
        count = len(patches)
        position = np.arange(self.asked, self.asked + count)
        read = self.bend(self.truth[position % len(self.truth)])
        read = np.clip(read + self.spread * stream(0, "error", self.asked).standard_normal(read.shape), 0.001, 0.999)
        abstained = position < self.unable
        read[abstained] = np.nan
        self.asked += count
        half = np.where(np.isnan(read), np.nan, 0.02)
        reason = np.where(abstained, "flat", "")
        return BlurEstimate(read, abstained, reason, low=read - half, high=read + half)


def odds(values, factor, power):
    """A distortion that is affine in logits."""
    inside = np.clip(values, 0.004, 0.996)
    ratio = factor * (inside / (1 - inside)) ** power
    return ratio / (1 + ratio)


@pytest.mark.full("a calibration of a network takes 11 s")
def test_an_estimator_that_is_right_stays_as_it_is(sharp, truth):
    result = camera_calibration.calibrate(Bent(truth, np.array), sharp, samples=SAMPLES)
    assert np.abs(result(truth) - truth).mean() < 0.003
    assert result.samples == SAMPLES and result.error_percent[0] < 0.2


@pytest.mark.parametrize(("factor", "power"), [(0.5, 1.0), (1.0, 1.4), (2.0, 0.7)])
def test_distortions_affine_in_logits_are_undone(sharp, truth, factor, power):
    result = camera_calibration.calibrate(
        Bent(truth, lambda values: odds(values, factor, power)), sharp, samples=SAMPLES
    )
    before, after = result.error_percent
    assert after < 0.25 * before
    unseen = mtf.sample(kernels.block(7, 3))
    assert np.abs(result(odds(unseen, factor, power)) - unseen).mean() < 0.02


def test_a_calibration_uses_one_thread_and_leaves_a_callers_threads_alone(sharp, truth):
    import torch

    class Counting(Bent):
        def estimate(self, patches):
            assert torch.get_num_threads() == 1
            return super().estimate(patches)

    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        camera_calibration.calibrate(Counting(truth, np.array), sharp, samples=SAMPLES)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)


def test_what_a_calibration_is_fitted_on_is_stored_in_8_bits(sharp, truth):
    """As the frames are that it will be asked about; rounding has a spectrum of its own."""

    class Looking(Bent):
        def estimate(self, patches):
            levels = 255 * np.asarray(patches, float)
            assert np.abs(levels - np.rint(levels)).max() < 1e-3 and levels.min() >= 0 and levels.max() <= 255
            return super().estimate(patches)

    looking = Looking(truth, np.array)
    camera_calibration.calibrate(looking, sharp, samples=100)
    assert looking.asked >= 100


def test_mixed_frequencies_are_told_apart(sharp, truth):
    """An estimator that reads each frequency half from its neighbour."""
    result = camera_calibration.calibrate(
        Bent(truth, lambda values: (values + np.roll(values, 1, axis=2)) / 2), sharp, samples=SAMPLES
    )
    assert result.error_percent[1] < 0.5 * result.error_percent[0]


def test_intervals_hold_the_truth_they_were_fitted_to(sharp, truth):
    result = camera_calibration.calibrate(Bent(truth, np.array, spread=0.05), sharp, samples=SAMPLES)
    answer = camera_calibration.corrected(Bent(truth, np.array, spread=0.05).estimate(sharp[[0] * SAMPLES]), result)
    inside = (answer.low <= truth) & (truth <= answer.high)
    assert 0.93 < inside.mean() < 0.97


def test_patches_that_cannot_be_measured_are_left_out_and_stay_abstained(sharp, truth):
    result = camera_calibration.calibrate(Bent(truth, np.array, unable=150), sharp, samples=SAMPLES)
    assert result.samples == SAMPLES - 150
    answer = CalibratedEstimator(Bent(truth, np.array, unable=2), result).estimate(sharp)
    assert answer.abstained.tolist() == [True, True, False, False, False, False]
    assert np.isnan(answer.mtf[:2]).all() and np.isfinite(answer.mtf[2:]).all()
    with pytest.raises(InputError, match="only 50 of 500"):
        camera_calibration.calibrate(Bent(truth, np.array, unable=450), sharp, samples=SAMPLES)


def test_a_fit_is_repeatable_and_survives_its_file(sharp, truth, tmp_path):
    first, second = (
        camera_calibration.calibrate(Bent(truth, lambda values: odds(values, 0.6, 1.2)), sharp, samples=SAMPLES)
        for _ in range(2)
    )
    assert np.array_equal(first.matrix, second.matrix) and np.array_equal(first.offset, second.offset)
    first.save(tmp_path / "camera.json")
    kept = Calibration.load(tmp_path / "camera.json")
    assert np.array_equal(kept(truth), first(truth))
    assert (kept.widening, kept.samples, kept.error_percent) == (first.widening, first.samples, first.error_percent)


def test_an_estimator_without_intervals_gets_none(sharp, truth):
    class Plain(Bent):
        def estimate(self, patches):
            result = super().estimate(patches)
            return BlurEstimate(result.mtf, result.abstained, result.reason)

    result = camera_calibration.calibrate(Plain(truth, np.array), sharp, samples=SAMPLES)
    assert np.isnan(result.widening)
    assert camera_calibration.corrected(Plain(truth, np.array).estimate(sharp), result).low is None


@pytest.mark.parametrize("content", ["", "{}", '{"matrix": [[1]], "offset": [0], "widening": null}'])
def test_a_foreign_file_is_refused(tmp_path, content):
    path = tmp_path / "camera.json"
    path.write_text(content)
    with pytest.raises(InputError, match="not the calibration of a camera"):
        Calibration.load(path)


def test_bad_patches_are_refused(sharp, truth):
    with pytest.raises(InputError, match="none given"):
        camera_calibration.calibrate(Bent(truth, np.array), sharp[:0])
    with pytest.raises(InputError, match="at least 100"):
        camera_calibration.calibrate(Bent(truth, np.array), sharp, samples=20)
    with pytest.raises(InputError, match="sharp_patches"):
        camera_calibration.calibrate(Bent(truth, np.array), sharp[:, :, :100])


@pytest.mark.full("a calibration of a network takes 17 s")
def test_the_spectral_network_learns_a_camera_that_is_not_sharp_by_itself(sharp):
    """Blur added to pictures that are blurred and sharpened already, on scenes it was not fitted to."""
    selected = convolve(sharp, defocus(2.5))
    seen = _rounded(np.stack([_sharpened(one) for one in selected[:, 0]])[:, None])
    network = blur.create("spectral")
    fitted = CalibratedEstimator(network, camera_calibration.calibrate(network, seen[:4], samples=300))
    error = {"plain": [], "fitted": []}
    for psf in (defocus(3), motion(5, 0), motion(9, 90)):
        patches = _rounded(convolve(seen[4:], psf))
        for name, estimator in (("plain", network), ("fitted", fitted)):
            error[name].append(np.abs(estimator.estimate(patches).mtf - mtf.sample(psf)).mean())
    assert np.mean(error["fitted"]) < 0.6 * np.mean(error["plain"])


def _rounded(patches):
    return (np.rint(np.clip(patches, 0, 1) * 255) / 255).astype(np.float32)


def _sharpened(image):
    from scipy.ndimage import convolve

    return convolve(image, np.array([[0, -0.05, 0], [-0.05, 1.2, -0.05], [0, -0.05, 0]]), mode="mirror")


def test_a_map_that_does_not_carry_over_to_other_scenes_is_drawn_back(sharp, truth):
    """An estimator that is right, but errs by another factor on every scene: what one scene teaches harms the next."""

    class ByScene(Bent):
        def estimate(self, patches):
            position = np.arange(self.asked, self.asked + len(patches))
            result = super().estimate(patches)
            factor = np.where(position % 2, 4.0, 0.25)[:, None, None]
            return BlurEstimate(odds(result.mtf, factor, 1.0), result.abstained, result.reason)

    made = camera_calibration.calibrate(ByScene(truth, np.array), sharp[:2], samples=SAMPLES)
    before, after = made.error_percent
    assert after <= before
    assert np.abs(made(truth) - truth).mean() < 0.05


class Pair(Bent):
    """An ensemble: the joint output is wrong by a constant factor, its second network is right."""

    def estimate(self, patches):
        position = np.arange(self.asked, self.asked + len(patches)) % len(self.truth)
        result = super().estimate(patches)
        members = np.stack([result.mtf, self.truth[position]], axis=1)
        return BlurEstimate(result.mtf, result.abstained, result.reason, members=members)


def test_the_networks_of_an_ensemble_are_weighted_anew(sharp, truth, tmp_path):
    noisy = Pair(truth, lambda values: np.clip(values + 0.2 * np.sin(40 * values), 0.01, 0.99))
    made = camera_calibration.calibrate(noisy, sharp, samples=SAMPLES)
    before, after = made.error_percent
    assert made.members == 2 and after < 0.35 * before
    made.save(tmp_path / "camera.json")
    noisy.asked = 0
    answer = CalibratedEstimator(noisy, Calibration.load(tmp_path / "camera.json")).estimate(sharp[[0] * 100])
    assert np.abs(answer.mtf - truth[:100]).mean() < 0.35 * np.abs(noisy.bend(truth[:100]) - truth[:100]).mean()
    assert answer.members is None
    with pytest.raises(InputError, match="ensemble of 2 networks"):
        CalibratedEstimator(Bent(truth, np.array), replace(made, made_for=None)).estimate(sharp)


@pytest.mark.full("a calibration of a network takes 15 s")
def test_calibration_does_no_harm_under_halos_and_irises():
    """Kernels of other draws, scenes of other draws: at most a tenth worse than without calibration."""
    views = [images.view(images.picture(i, 9, "test optics"), stream(9, "test optics", i), 192) for i in range(8)]
    lens = gaussian(0.5)
    seen = _rounded(convolve(np.stack(views)[:, None].clip(0, 1), lens))
    generator, estimator = stream(9, "test optics kernels"), blur.create("spectral")
    calibrated = CalibratedEstimator(estimator, camera_calibration.calibrate(estimator, seen[:5], samples=SAMPLES))
    makers = (kernels._with_halo, lambda source: kernels._iris(source, source.uniform(4, 20)))
    for make in makers:
        psfs = [make(generator) for _ in range(8)]
        pairs = [(_rounded(convolve(seen[5:], psf / psf.sum())), mtf.sample(psf / psf.sum())) for psf in psfs]
        raw, relative = (
            np.mean([np.abs(way.estimate(patches).mtf - known).mean() for patches, known in pairs])
            for way in (estimator, calibrated)
        )
        assert relative <= 1.1 * raw


def test_of_maps_that_hold_out_as_well_the_strongest_draw_is_taken():
    """Held-out logits: a right map drawn strongly, one that is no better, and one that is much worse."""
    generator = stream(11, "test choice")
    truth = generator.uniform(0.2, 0.8, (240, 16))
    plain, right = logit(truth) + 2.0, logit(truth) + generator.normal(0, 0.1, truth.shape)
    alike = right + generator.normal(0, 0.02, truth.shape)
    scene = np.arange(240) % 24
    chosen = camera_fit._chosen(np.stack([right, alike]), plain, truth, scene)
    assert (chosen.index, chosen.weight) == (0, 1.0)
    assert camera_fit._chosen(np.stack([right + 1.0, right]), plain, truth, scene).index == 1
    assert camera_fit._chosen(np.stack([right + 4.0, right - 4.0]), right, truth, scene).weight == 0.0


@pytest.mark.parametrize(("scenes", "count"), [(2, 240), (3, 240), (4, 4), (24, 24)])
def test_few_scenes_do_not_say_how_much_errors_differ_between_scenes(monkeypatch, scenes, count):
    """The standard error is then over samples."""
    read, number, groups = np.zeros((240, 16)), np.arange(240), []
    monkeypatch.setattr(camera_fit, "_held_out", lambda maps, logits, folds: logits[None])
    monkeypatch.setattr(camera_fit, "_chosen", lambda held_out, plain, truth, scene: groups.append(scene))
    samples = Samples(read, sigmoid(read), number % scenes, kernel=number, fold=number % 2)
    camera_fit._strength(samples, [])
    assert len(np.unique(groups[0])) == count


def test_windows_of_one_picture_are_trusted_less_than_other_scenes(truth):
    """An estimator that one map mends: of two windows that overlap the map keeps a fixed weight, of two scenes all."""
    pictures = [images.picture(index, 5, "test image", 255).astype(np.float32) / 255 for index in range(2)]
    windows = np.stack([pictures[0][:192, :192], pictures[0][63:, 63:]])[:, None]
    scenes = np.stack([picture[:192, :192] for picture in pictures])[:, None]

    def wrong(values):
        return odds(values, 0.5, 1.0)

    one, two = (
        camera_calibration.calibrate(Bent(truth, wrong), patches, samples=SAMPLES) for patches in (windows, scenes)
    )
    _, weight = camera_fit.ONE_SCENE
    assert one.offset.mean() == pytest.approx(weight * np.log(2), rel=0.15)
    assert two.offset.mean() == pytest.approx(np.log(2), rel=0.15)


def test_scenes_that_cannot_be_measured_do_not_count(sharp, truth):
    """Of three patches only one gives estimates: a single scene."""

    class OneOfThree(Bent):
        def estimate(self, patches):
            position = np.arange(self.asked, self.asked + len(patches)) % 3
            result = super().estimate(patches)
            result.mtf[position != 2] = np.nan
            abstained = position != 2
            return BlurEstimate(result.mtf, abstained, np.where(abstained, "flat", ""))

    made = camera_calibration.calibrate(
        OneOfThree(truth, lambda values: odds(values, 0.5, 1.0)), sharp[:3], samples=SAMPLES
    )
    assert made.samples == SAMPLES // 3 and made.error_percent[1] < made.error_percent[0]


def fitted(truth, first, second):
    """A calibration to 25 scenes of an ensemble of two networks, from their logits (500, 16), and what they read."""
    logits, known = np.concatenate([first, second], axis=1), truth.reshape(SAMPLES, -1)
    number = np.arange(SAMPLES)
    maps = camera_fit.fit(Samples(logits, known, number % 25, kernel=number, fold=number % 4))
    members = sigmoid(np.stack([first, second], axis=1)).reshape(SAMPLES, 2, 2, 8)
    return Calibration(maps.matrix, maps.offset, 1.0, SAMPLES, (0.0, 0.0), maps.alone), members


def test_the_network_that_knows_halos_leads_where_it_sees_one(truth, tmp_path):
    """Two networks with errors of their own; after calibration the first reads spread light far too sharp."""
    known = truth.reshape(SAMPLES, 16)
    first, second = (logit(known) + stream(3, "test halo", i).normal(0, 0.2, known.shape) for i in range(2))
    made, members = fitted(known, first, second)
    assert made.alone is not None
    plain = replace(made, alone=None)
    assert np.abs(made(members) - truth).mean() < 1.02 * np.abs(plain(members) - truth).mean()
    spread = (truth[..., :3].mean(axis=2) < 0.9).all(axis=1) & (truth.mean(axis=(1, 2)) > 0.2)
    members[:, 0] = odds(members[:, 0], 8.0, 1.0)
    followed, ignored = (np.abs(one(members) - truth)[spread].mean() for one in (made, plain))
    assert spread.sum() > 30 and followed < 0.7 * ignored
    made.save(tmp_path / "camera.json")
    assert np.array_equal(Calibration.load(tmp_path / "camera.json")(members), made(members))


def test_a_second_network_that_is_wrong_on_a_camera_gets_no_map_to_itself(truth):
    """It takes every other kernel for a halo."""
    known = truth.reshape(SAMPLES, 16)
    wrong = np.where(stream(3, "test halo", 2).random(SAMPLES) < 0.5, -2.0, 0.0)
    made, _ = fitted(known, logit(known), logit(known) + wrong[:, None])
    assert made.alone is None and made.members == 2


@pytest.mark.parametrize(("field", "value"), [("alone", [[1.0] * 17]), ("alone", [[float("nan")] * 17] * 16)])
def test_a_file_with_a_broken_second_map_is_refused(sharp, truth, tmp_path, field, value):
    made = camera_calibration.calibrate(Bent(truth, np.array), sharp, samples=SAMPLES)
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(made.content() | {field: value}))
    with pytest.raises(InputError, match="not the calibration of a camera"):
        Calibration.load(path)


@pytest.mark.parametrize("widening", [-0.5, float("inf"), float("-inf")])
def test_intervals_are_never_reversed_by_a_file(sharp, truth, widening):
    """They would end below where they begin."""
    made = camera_calibration.calibrate(Bent(truth, np.array), sharp, samples=SAMPLES)
    with pytest.raises(ValueError, match="widening .*expected a finite number, 0 or more"):
        Calibration.from_content(made.content() | {"widening": widening})
    assert Calibration.from_content(made.content() | {"widening": 0}).widening == 0
    assert np.isnan(Calibration.from_content(made.content() | {"widening": None}).widening)


def test_a_patch_of_which_a_frequency_is_unknown_is_abstained_from():
    mtf_read = np.full((2, 2, 8), 0.5)
    mtf_read[0, 0, 7] = np.nan
    read = BlurEstimate(mtf_read, np.zeros(2, bool), np.full(2, ""), low=mtf_read - 0.1, high=mtf_read + 0.1)
    answer = camera_calibration.corrected(read, Calibration(np.eye(16), np.zeros(16), 1.0, 100, (1.0, 1.0)))
    assert answer.abstained.tolist() == [True, False] and answer.reason.tolist() == ["incomplete", ""]
    assert np.isnan(answer.mtf[0]).all() and np.isnan(answer.low[0]).all() and np.isnan(answer.high[0]).all()
    assert answer.mtf[1] == pytest.approx(0.5)


def test_what_an_estimator_does_not_know_a_calibration_does_not_know_either():
    """A map that takes .8 to .3: an interval of 0 to 1 stays one, though half of it, .5, would end at .8."""
    read = np.full((1, 2, 8), 0.8)
    unknown = BlurEstimate(read, np.zeros(1, bool), np.full(1, ""), low=np.zeros_like(read), high=np.ones_like(read))
    assert unknown.half_width() == pytest.approx(np.full((1, 2, 8), 0.8))
    assert BlurEstimate(read, np.zeros(1, bool), np.full(1, "")).half_width() is None
    lower = Calibration(np.eye(16), np.full(16, float(logit(0.3) - logit(0.8))), 1.0, 100, (1.0, 1.0))
    answer = camera_calibration.corrected(unknown, lower)
    assert answer.mtf == pytest.approx(np.full((1, 2, 8), 0.3))
    assert (answer.low == 0).all() and (answer.high == 1).all()


def test_an_interval_that_was_cut_on_both_sides_keeps_its_width():
    """A patch that tells nothing: uncalibrated 0 to 1 around .8, calibrated 0 to 1 wherever the answer lies."""
    read, every = np.full((1, 2, 8), 0.8), np.ones((1, 2, 8))
    unknown = BlurEstimate(read, np.zeros(1, bool), np.full(1, ""), low=0 * every, high=every, half=1.5 * every)
    assert unknown.half_width() == pytest.approx(1.5 * every)
    lower = Calibration(np.eye(16), np.full(16, float(logit(0.1) - logit(0.8))), 1.0, 100, (1.0, 1.0))
    answer = camera_calibration.corrected(unknown, lower)
    assert answer.mtf == pytest.approx(np.full((1, 2, 8), 0.1)) and answer.half is None
    assert (answer.low == 0).all() and (answer.high == 1).all()


def test_the_width_of_spectral_s_intervals_is_known_before_they_are_cut(sharp):
    answer = blur.create("spectral").estimate(sharp)
    half = answer.half_width()
    assert np.clip(answer.mtf - half, 0, 1) == pytest.approx(answer.low, abs=1e-6)
    assert np.clip(answer.mtf + half, 0, 1) == pytest.approx(answer.high, abs=1e-6)
    assert np.isnan(half).all(axis=(1, 2)).tolist() == answer.abstained.tolist()
    assert blur.create("spectral").divided(sharp).estimate(sharp).half is None


def test_an_estimator_says_what_its_answers_are_relative_to(sharp, monkeypatch):
    monkeypatch.setattr(spectral, "fit_map", partial(spectral.fit_map, samples=100))  # sooner
    monkeypatch.setattr(output_layers, "STEPS", 10)
    plain = blur.create("spectral")
    typical = blur.create("spectral", output="relative")
    calibrated = typical.calibrated(sharp)
    kinds = [one.relative_to for one in (plain, typical, calibrated, plain.divided(sharp), calibrated._uncalibrated())]
    assert kinds == ["system", "generic lens", "camera", "camera", "system"]
    assert calibrated.divided(sharp).relative_to == "camera" and calibrated.divided(sharp).camera is None


@pytest.mark.parametrize(
    "made",
    [lambda sharp: blur.create("spectral", output="relative"), lambda sharp: blur.create("spectral").divided(sharp)],
)
def test_an_estimator_that_is_relative_already_is_not_calibrated_again(sharp, made):
    estimator = made(sharp)
    given = Calibration(np.eye(16), np.zeros(16), 1.0, 100, (1.0, 1.0))
    with pytest.raises(InputError, match=f"answers relative to the {estimator.relative_to}; expected"):
        CalibratedEstimator(estimator, given)
    with pytest.raises(InputError, match=f"answers relative to the {estimator.relative_to}; expected"):
        camera_calibration.calibrate(estimator, sharp)


def test_a_stored_calibration_is_for_the_estimator_that_it_was_made_with(sharp, tmp_path, monkeypatch):
    """One network's map fits any other's answers in shape."""
    monkeypatch.setattr(output_layers, "STEPS", 10)  # sooner
    alone, both = blur.create("spectral", processed=False), blur.create("spectral")
    path = tmp_path / "camera.json"
    camera_calibration.calibrate(alone, sharp[:3], samples=100).save(path)
    read = Calibration.load(path)
    assert read.made_for.estimator == "Spectral" and set(read.made_for.weights_sha256) == {"main"}
    expected = CalibratedEstimator(alone, read).estimate(sharp[3:]).mtf
    anew = blur.create("spectral", processed=False)  # the same weights
    np.testing.assert_array_equal(CalibratedEstimator(anew, read).estimate(sharp[3:]).mtf, expected)
    with pytest.raises(InputError, match="of the estimator Spectral, given Cnn"):
        CalibratedEstimator(blur.create("cnn"), read)
    with pytest.raises(InputError, match=r"with other weights or networks \(processed\)"):
        CalibratedEstimator(both, read)
    with torch.no_grad():
        anew.network.head[0].bias += 1e-6
    with pytest.raises(InputError, match=r"with other weights or networks \(main\)"):
        CalibratedEstimator(anew, read)


def test_a_calibration_of_an_earlier_version_does_not_say_for_which_estimator_it_is(sharp, truth, tmp_path):
    """It is taken for any of whose answers it is not known that they are another's."""
    made = camera_calibration.calibrate(Bent(truth, np.array), sharp, samples=SAMPLES)
    path = tmp_path / "camera.json"
    path.write_text(json.dumps({name: value for name, value in made.content().items() if name != "made_for"}))
    before = Calibration.load(path)
    assert before.made_for is None
    answers = [CalibratedEstimator(Bent(truth, np.array), camera).estimate(sharp).mtf for camera in (made, before)]
    np.testing.assert_array_equal(*answers)
    with pytest.raises(InputError, match="of an estimator with intervals, given one without; calibrate anew"):
        CalibratedEstimator(blur.create("cnn"), before).estimate(sharp)


@pytest.mark.parametrize("made_for", [None, {"estimator": "Bent"}, {"estimator": 3, "weights_sha256": {}}, "Bent"])
def test_a_file_with_a_broken_note_of_its_estimator_is_refused(tmp_path, made_for):
    content = Calibration(np.eye(16), np.zeros(16), 1.0, 100, (1.0, 1.0)).content()
    (tmp_path / "camera.json").write_text(json.dumps(content | {"made_for": made_for}))
    with pytest.raises(InputError, match="not the calibration of a camera"):
        Calibration.load(tmp_path / "camera.json")
