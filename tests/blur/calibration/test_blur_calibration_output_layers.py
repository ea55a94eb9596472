"""The correction of a camera: it begins at the networks, mends what a map cannot, and is refused where it does harm."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from pipeline import blur
from pipeline.blur.base import BlurEstimate, Estimator, HiddenUnits
from pipeline.blur.calibration import output_layers
from pipeline.blur.calibration import samples as camera_samples
from pipeline.blur.calibration.affine_logits import sigmoid
from pipeline.blur.calibration.output_layers import Correction, OutputLayers, Part
from pipeline.blur.camera_calibration import CalibratedEstimator, Calibration, fit_map
from pipeline.errors import InputError
from pipeline.learning import descent, images
from pipeline.streams import stream

COUNT, VALUES, UNITS, INPUTS = 600, 16, 12, 20
KERNELS = np.arange(COUNT) // 4


@pytest.fixture(scope="module")
def sharp():
    """Sharp procedural patches of five scenes: (5, 1, 192, 192)."""
    results = [images.picture(index, 5, "test image", 192) for index in range(5)]
    return np.stack(results)[:, None].astype(np.float32) / 255


@pytest.fixture(scope="module")
def layers():
    """Output layers of two networks with random weights."""
    source = stream(1, "test layers")
    shapes = {"first": (2, UNITS, INPUTS), "first_offset": (2, UNITS)}
    shapes |= {"second": (2, VALUES, UNITS), "second_offset": (2, VALUES)}
    return OutputLayers(**{name: source.normal(0, 0.3, shape) for name, shape in shapes.items()})


@pytest.fixture(scope="module")
def camera(sharp):
    """The spectral estimator's calibration to these scenes."""
    return fit_map(blur.create("spectral"), sharp, samples=200)


def start():
    """The map of an ensemble of two networks that is their mean."""
    return np.tile(np.eye(VALUES), 2) / 2, np.zeros(VALUES)


def seen(name):
    """Hidden units of two networks, the second one of which takes no part."""
    units = np.abs(stream(1, "test units", name).normal(0, 1, (COUNT, 2, INPUTS)))
    return HiddenUnits(units.astype(np.float32), *np.zeros((2, COUNT), np.float32))


def untrained(layers):
    matrix, offset = start()
    return Correction(**{one.name: getattr(layers, one.name) for one in fields(layers)}, matrix=matrix, offset=offset,
                      weight=1.0)  # fmt: skip


def parts_of(layers, wrong):
    """Samples whose true logits are those of the networks and an error, and a map that gives those of the networks."""
    parts = []
    for name in ("clean", "noisy"):
        hidden = seen(name)
        mapped = untrained(layers).logits(hidden)
        parts.append(Part(hidden, mapped, sigmoid(mapped + wrong(hidden.units))))
    return parts


def sooner(monkeypatch):
    """These networks are small and begin at random: larger steps, and fewer."""
    monkeypatch.setattr(output_layers, "LEARNING_RATE", 1e-2)
    monkeypatch.setattr(output_layers, "STEPS", 300)


def test_it_begins_at_the_networks_own_answers(sharp):
    estimator = blur.create("spectral")
    answer = estimator.estimate(sharp)
    layers = estimator.output_layers()
    begun = untrained(layers)
    first = replace(begun, matrix=np.eye(VALUES, 2 * VALUES))
    second = replace(begun, matrix=np.eye(VALUES, 2 * VALUES, VALUES))
    assert np.allclose(sigmoid(first.logits(answer.hidden)).reshape(-1, 2, 8), answer.mtf, atol=0.005)
    assert np.allclose(sigmoid(second.logits(answer.hidden)).reshape(-1, 2, 8), answer.members[:, 1], atol=0.005)


def test_what_hidden_units_tell_is_mended_on_scenes_held_out(layers, monkeypatch):
    """An error that the estimated MTFs do not show: one hidden unit turns up every logit."""
    sooner(monkeypatch)
    parts = parts_of(layers, lambda units: 1.5 * units[:, :1, 3] - 1.2)
    groups = np.arange(COUNT) % 4
    made, held_out = output_layers.fit(layers, parts, groups, KERNELS, [start()] * 5, 1)
    before, after = (np.abs(sigmoid(logits) - parts[0].known).mean() for logits in (parts[0].mapped, held_out[0]))
    assert made is not None and made.weight == output_layers.WEIGHTS[-1]
    assert after < 0.5 * before
    assert not np.array_equal(made.matrix, start()[0])


@pytest.mark.parametrize(("count", "steps"), [(40, 100), (400, 1000), (4000, 1000)])
def test_few_kernels_are_not_passed_more_often(layers, monkeypatch, count, steps):
    taken = []
    monkeypatch.setattr(descent, "descend", lambda *_, steps, **__: taken.append(steps))
    hidden = HiddenUnits(np.zeros((count, 2, INPUTS), np.float32), *np.zeros((2, count), np.float32))
    part = Part(hidden, np.zeros((count, VALUES)), np.full((count, VALUES), 0.5))
    output_layers._trained(layers, start(), [part], np.ones(count, bool), np.arange(count), 1)
    assert taken == [steps]


def test_errors_that_are_a_scenes_own_get_no_correction(layers, monkeypatch):
    """Each of four scenes turns the logits another way; nothing of it carries over."""
    sooner(monkeypatch)
    groups = np.arange(COUNT) % 4
    turned = np.array([1.0, -1.0, 1.0, -1.0])[groups][:, None] * np.where(np.arange(VALUES) % 2, 1, -1)
    parts = []
    for name in ("clean", "noisy"):
        hidden = seen(name)
        hidden.units[:, :, :4] = (
            3 * np.eye(4, dtype=np.float32)[groups][:, None]
        )  # they tell the scene, as real ones do
        mapped = untrained(layers).logits(hidden)
        parts.append(Part(hidden, mapped, sigmoid(mapped + turned)))
    made, held_out = output_layers.fit(layers, parts, groups, KERNELS, [start()] * 5, 1)
    assert made is None and np.array_equal(held_out[0], parts[0].mapped)


@pytest.mark.full("three trainings take 4 s")
def test_the_same_samples_give_the_same_correction(layers):
    parts = parts_of(layers, lambda units: units[:, :1, 3] - 0.8)
    arguments = (layers, parts, np.arange(COUNT) % 2, KERNELS, [start()] * 3, 1)
    first, second = (output_layers.fit(*arguments)[0] for _ in range(2))
    assert all(np.array_equal(getattr(first, one.name), getattr(second, one.name)) for one in fields(first))


def test_patches_of_one_kernel_show_different_scenes_and_share_their_noise():
    sharp = np.stack([images.picture(index, 5, "test image", 192) for index in range(12)])[:, None] / np.float32(255)
    read = camera_samples.blurred(blur.create("spectral"), sharp, 120, 1, noisy=True)
    for kernel in np.unique(read.kernel):
        same = read.kernel == kernel
        assert np.ptp(read.known[same], axis=0).max() == 0
        assert len(set(read.fold[same])) == 1  # held out with its scenes
        assert len(set(read.scene[same])) == same.sum() <= camera_samples.TOGETHER
    assert np.bincount(read.scene).tolist() == [10] * 12
    spread = [np.ptp(read.noisy.hidden.sigma_dn[read.kernel == kernel]) for kernel in range(30)]
    assert np.median(spread) < 0.2 * np.ptp(read.noisy.hidden.sigma_dn)
    single = camera_samples.blurred(blur.create("spectral"), sharp, 120, 1, noisy=False)
    assert np.array_equal(single.kernel, np.arange(120))


@pytest.mark.parametrize("able", [1, 2, 8])
def test_scenes_that_cannot_be_measured_leave_no_fold_empty(able):
    """Of eight scenes the first ones alone can be measured, which would all be in the first fold of four."""
    grey = np.linspace(0.2, 0.8, 8)
    sharp = stream(1, "test unable scenes").uniform(-0.1, 0.1, (8, 1, 192, 192)) + grey[:, None, None, None]

    class Picky(Estimator):
        def measure(self, patches, reason):
            unable = patches.mean(axis=(1, 2, 3)) > (grey[able - 1] + 0.02)
            mtf = np.where(unable[:, None, None], np.nan, np.full((len(patches), 2, 8), 0.5))
            return BlurEstimate(mtf, unable, np.where(unable, "shy", ""))

    read = camera_samples.blurred(Picky(), sharp.astype(np.float32), 1000, 1, noisy=False)
    folds = [set(read.fold[read.scene == scene]) for scene in range(able)]
    assert len(set().union(*folds)) == {1: 4, 2: 2, 8: 4}[able]
    assert all(len(fold) == 1 for fold in folds) or able == 1  # a scene is held out as a whole


def test_sets_of_samples_hold_those_with_all_labels_in_common():
    sets = output_layers._together(np.array([0, 0, 1, 0, 1]), np.array([3, 3, 3, 5, 3]))
    assert sets.tolist() == [[0, 1], [3, -1], [2, 4]]
    mtf, known = np.array([[0.2], [0.6], [0.9], [0.5], [0.1]]), np.array([[0.3], [0.3], [0.7], [0.4], [0.7]])
    assert output_layers._error_of_medians(mtf, known, sets) == pytest.approx((0.1 + 0.1 + 0.2) / 3)


def test_errors_that_patches_of_a_kernel_share_are_trained_away(layers, monkeypatch):
    """Every patch shows the kernel's logits under noise of its own: by itself it keeps to what is likely, as all do."""
    sooner(monkeypatch)
    source = stream(1, "test shared errors")
    turned = np.repeat(source.normal(0, 1.5, COUNT // 4), 4)
    hidden = seen("clean")
    hidden.units[:, :, 0] = (4 + turned + source.normal(0, 2.0, COUNT))[:, None]
    mapped = untrained(layers).logits(seen("noisy"))
    part = Part(hidden, mapped, sigmoid(mapped * 0 + turned[:, None]))
    groups = KERNELS % 4

    def shared_percent(kernels):
        _, (logits,) = output_layers.fit(layers, [part], groups, kernels, [start()] * 5, 1)
        return 100 * np.abs((sigmoid(logits) - part.known).reshape(-1, 4, VALUES).mean(axis=1)).mean()

    assert shared_percent(KERNELS) < 0.97 * shared_percent(np.arange(COUNT))  # each patch of a kernel of its own


@pytest.mark.full("a calibration of a network takes 10 s")
def test_a_calibration_keeps_its_correction_in_a_file(sharp, camera, tmp_path):
    assert camera.correction is not None
    camera.save(tmp_path / "camera.json")
    answer = blur.create("spectral").estimate(sharp)
    again = Calibration.load(tmp_path / "camera.json")
    assert np.array_equal(again(answer.members, answer.hidden), camera(answer.members, answer.hidden))
    with pytest.raises(InputError, match="calibrate anew"):
        camera(answer.members)
    content = json.loads((tmp_path / "camera.json").read_text())
    for name, value in (("first", [[[1.0]]]), ("weight", [1.0]), ("offset", [float("nan")] * VALUES)):
        broken = content | {"correction": content["correction"] | {name: value}}
        (tmp_path / "broken.json").write_text(json.dumps(broken))
        with pytest.raises(InputError, match="not the calibration of a camera"):
            Calibration.load(tmp_path / "broken.json")


def test_a_single_scene_gets_none(sharp):
    picture = images.picture(7, 5, "test image", 255).astype(np.float32) / 255
    windows = np.stack([picture[:192, :192], picture[63:, 63:]])[:, None]
    made = fit_map(blur.create("spectral"), windows, samples=200)
    assert made.correction is None
    assert fit_map(blur.create("spectral"), sharp, samples=200, correction=False).correction is None


def test_samples_with_noise_show_the_same_blur(sharp):
    read = camera_samples.blurred(blur.create("spectral"), sharp, 128, 1, noisy=True)
    assert read.noisy.logits.shape == read.logits.shape == (len(read.known), 2 * VALUES)
    clean, noisy = (np.abs(sigmoid(one.logits[:, :VALUES]) - read.known).mean() for one in (read, read.noisy))
    assert clean < noisy < 0.25
    assert not np.array_equal(read.noisy.clean.units, read.noisy.hidden.units)
    assert read.noisy.clean.sigma_dn.mean() < 1 < 10 < read.noisy.hidden.sigma_dn.mean()
    assert camera_samples.blurred(blur.create("spectral"), sharp, 128, 1, noisy=False).noisy is None


@pytest.mark.full("a calibration of a network takes 10 s")
def test_noise_costs_less_with_a_correction(camera):
    """Patches of other scenes, blurred and with 20 DN of noise: the correction knows noise, the map alone does not."""
    from pipeline.camera import mtf
    from pipeline.camera.blur import blur as convolve
    from pipeline.camera.psf.linear_motion import create as motion

    estimator = blur.create("spectral")
    ways = {"with": camera, "without": replace(camera, correction=None)}
    others = np.stack([images.picture(index, 6, "test image", 192) for index in range(12)])[:, None] / np.float32(255)
    errors = {"with": [], "without": []}
    for size in (5, 9, 15):
        kernel = motion(size, 0)
        noise = stream(6, "test noise", size).normal(0, 20 / 255, others.shape)
        patches = np.rint(np.clip(convolve(others, kernel) + noise, 0, 1) * 255).astype(np.float32) / 255
        for name, calibration in ways.items():
            answer = CalibratedEstimator(estimator, calibration).estimate(patches)
            errors[name].append(np.abs(answer.mtf - mtf.sample(kernel)).mean())
    assert np.mean(errors["with"]) < np.mean(errors["without"])


def test_scenes_that_follow_each_other_are_held_out_together():
    """Neighbours may show the same surroundings."""
    assert camera_samples._folds(np.arange(8)).tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert camera_samples._folds(np.array([0, 0, 1, 2])).tolist() == [0, 0, 1, 2]
