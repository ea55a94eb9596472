"""The fused estimator: where it deconvolves, which patches share a kernel, calibration, abstentions."""

import numpy as np
import pytest
import torch

from pipeline import blur
from pipeline.blur.base import Estimator
from pipeline.blur.calibration import output_layers
from pipeline.blur.camera_calibration import CalibratedEstimator, Calibration
from pipeline.blur.fused import Fused, SpectralAnswer, deconvolution_pays, unsureness
from pipeline.blur.fusion import gate as fusion_gate
from pipeline.blur.fusion.camera import FusionMap
from pipeline.blur.fusion.members import Deconvolution, join_members
from pipeline.camera.blur import blur as convolve
from pipeline.camera.psf.defocus import create as defocus
from pipeline.camera.psf.linear_motion import create as motion
from pipeline.errors import InputError
from pipeline.learning import images, weights
from pipeline.streams import stream

KERNEL_PX = 13  # small kernels keep the tests short


@pytest.fixture(scope="module")
def gate_file(tmp_path_factory):
    """A gate that takes a fixed mean, as before its training."""
    gate = fusion_gate.FusionGate()
    gate.begin()
    path = tmp_path_factory.mktemp("weights") / "gate.safetensors"
    weights.save(path, gate.state_dict(), fusion_gate.ARCHITECTURE, interval=3.0)
    return path


@pytest.fixture(scope="module")
def sharp():
    tiles = [images.picture(index, 4, "test fused image") for index in range(4)]
    views = [images.view(tile, stream(4, "test fused", index), 192) for index, tile in enumerate(tiles)]
    return np.stack(views)[:, None].clip(0, 1)


@pytest.fixture(scope="module")
def blurred(sharp):
    return rounded(convolve(sharp, motion(9.0, 30.0)))


def rounded(patches):
    return np.rint(patches * 255).astype(np.float32) / 255


class Counting(Deconvolution):
    """Notes how many patches each deconvolution is given."""

    def __init__(self):
        super().__init__(KERNEL_PX)
        self.sizes = []

    def __call__(self, patches):
        self.sizes.append(len(patches))
        return super().__call__(patches)


def make(gate_file, **options):
    estimator = Fused(gate_file, **options)
    estimator.deconvolution = Counting()
    return estimator


@pytest.fixture(scope="module")
def camera(gate_file, sharp):
    """A calibration; its corrections take fewer steps: whether they converge is for tests of their own."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(output_layers, "STEPS", 100)
        return make(gate_file).fit_camera(sharp[:3], samples=100)


def test_sharp_patches_are_left_to_the_spectral_network(gate_file, sharp):
    estimator = make(gate_file)
    fused = estimator.estimate(sharp)
    spectral = estimator.spectral.estimate(sharp)
    clear = spectral.mtf.mean(axis=(1, 2)) >= 0.6
    assert clear.any() and len(estimator.deconvolution.sizes) <= (~clear).sum()
    assert np.allclose(fused.mtf[clear], spectral.mtf[clear])
    assert np.allclose(fused.low[clear], spectral.low[clear], atol=1e-6)


def test_patches_blurred_alike_share_one_deconvolution(gate_file, blurred):
    estimator = make(gate_file, deconvolved_patches=2, shared_blur="always")
    answer = estimator.estimate(blurred)
    assert estimator.deconvolution.sizes == [2]
    assert not np.allclose(answer.mtf, estimator.spectral.estimate(blurred).mtf, atol=0.005)
    assert ((answer.low <= answer.mtf) & (answer.mtf <= answer.high)).all()
    again = make(gate_file, deconvolved_patches=2, shared_blur="always").estimate(blurred)
    assert np.array_equal(again.mtf, answer.mtf)


def test_without_joint_kernels_all_patches_get_the_same_correction(gate_file, blurred):
    estimator = make(gate_file, deconvolved_patches=2, shared_blur="always", joint=False)
    answer = estimator.estimate(blurred)
    assert estimator.deconvolution.sizes == [1, 1]
    shift = answer.mtf - estimator.spectral.estimate(blurred).mtf
    unclipped = ((answer.mtf > 0) & (answer.mtf < 1)).all(axis=0)
    assert unclipped.any() and np.abs(shift).max() > 0.002
    assert np.allclose(shift[:, unclipped], shift[0, unclipped], atol=1e-6)


def test_patches_can_be_deconvolved_one_by_one(gate_file, blurred):
    estimator = make(gate_file, shared_blur="never")
    estimator.estimate(blurred[:2])
    assert estimator.deconvolution.sizes == [1, 1]


def test_by_default_a_patch_with_another_blur_is_deconvolved_alone(gate_file, sharp, blurred):
    other = rounded(convolve(sharp[:1], motion(21.0, 120.0)))
    estimator = make(gate_file)
    estimator.estimate(np.concatenate([blurred, other]))
    assert sorted(estimator.deconvolution.sizes) == [1, len(blurred)]


def test_patches_that_the_spectral_network_is_sure_of_are_left_to_it(gate_file, sharp):
    """Defocus by a disc, which it reads within half a point."""
    patches = rounded(convolve(sharp, defocus(17.0)))
    estimator = make(gate_file)
    sure = estimator.spectral.predict(patches)[1].mean(axis=(1, 2)) < 0.013
    fused, spectral = estimator.estimate(patches), estimator.spectral.estimate(patches)
    assert sure.any() and sum(estimator.deconvolution.sizes) <= (~sure).sum()
    assert np.allclose(fused.mtf[sure], spectral.mtf[sure])


def test_deconvolution_pays_where_there_is_blur_and_doubt():
    mtf = np.stack([np.full((2, 8), value) for value in (0.9, 0.5, 0.3, 0.3, 0.3)])
    scale = np.stack([np.full((2, 8), value) for value in (0.05, 0.05, 0.05, 0.0165, 0.01)])
    assert deconvolution_pays(mtf, scale) == pytest.approx([0.0, 0.5, 1.0, 0.5, 0.0])


def test_flat_patches_are_abstained_from(gate_file, blurred):
    patches = np.concatenate([blurred[:1], np.full_like(blurred[:1], 0.5)])
    estimator = make(gate_file)
    answer = estimator.estimate(patches)
    assert answer.abstained.tolist() == [False, True] and answer.reason[1] == "flat"
    assert np.isnan(answer.mtf[1]).all() and np.isfinite(answer.mtf[0]).all()
    assert len(estimator.estimate(patches[:0])) == 0


@pytest.mark.full("a calibration of three estimators takes 12 s")
def test_calibration_covers_the_members(gate_file, camera, blurred, tmp_path):
    estimator = make(gate_file, shared_blur="always", deconvolved_patches=1)
    assert camera.samples == 100 and camera.gbb_sharp_mtf.shape == (2, 8)
    calibrated = estimator.with_camera(camera)
    assert estimator.camera is None and calibrated.camera is camera
    assert [one.relative_to for one in (estimator, calibrated, calibrated.with_camera(None))] == [
        "system", "camera", "system"
    ]  # fmt: skip
    answer = calibrated.estimate(blurred)
    assert not np.allclose(answer.mtf, estimator.estimate(blurred).mtf)
    camera.save(tmp_path / "camera.json")
    read = FusionMap.load(tmp_path / "camera.json")
    assert np.array_equal(read.answer(estimator, blurred).mtf, answer.mtf)
    assert np.array_equal(CalibratedEstimator(estimator, read).estimate(blurred).mtf, answer.mtf)
    assert set(read.made_for.weights_sha256) == {"gate", "main", "pixels", "processed"}
    with pytest.raises(InputError, match="of the estimator Fused, given Spectral"):
        CalibratedEstimator(estimator.spectral, read)
    (tmp_path / "camera.json").write_text("[]")
    with pytest.raises(InputError, match="not the calibration of the fused estimator"):
        FusionMap.load(tmp_path / "camera.json")


def test_the_pixel_network_takes_part_where_the_spectral_one_is_unsure(gate_file, camera, sharp):
    """Patches with hardly any blur, and blurred ones that the spectral network is sure of: nothing is deconvolved."""
    estimator = make(gate_file)
    far = rounded(convolve(sharp, defocus(17.0)))
    sure = unsureness(estimator.spectral.predict(far)[1]) == 0
    patches = np.concatenate([sharp, far[sure]])
    before = FusionMap(camera.spectral, camera.gbb_sharp_mtf)
    answers = [estimator.with_camera(one).estimate(patches).mtf for one in (camera, before)]
    assert not estimator.deconvolution.sizes
    unsure = unsureness(estimator.spectral.predict(patches)[1])
    every = estimator.networks.estimate(patches)
    joint = camera.networks(every.members, every.hidden)
    weight = 0.5 * unsure[:, None, None]
    assert (unsure == 0).any() and (unsure > 0).any()
    assert np.array_equal(answers[0][unsure == 0], answers[1][unsure == 0])
    assert np.allclose(answers[0], (1 - weight) * answers[1] + weight * joint, atol=1e-6)


def test_of_a_single_scene_the_pixel_network_takes_no_part(gate_file, camera, sharp):
    """There is none to hold out, by which it could be judged."""
    assert camera.networks is not None
    assert make(gate_file).fit_camera(sharp[:1], samples=100).networks is None


def test_a_calibration_made_before_there_was_a_pixel_network_still_loads(gate_file, camera, sharp, tmp_path):
    before = FusionMap(camera.spectral, camera.gbb_sharp_mtf)
    before.save(tmp_path / "camera.json")
    read = FusionMap.load(tmp_path / "camera.json")
    assert read.networks is None
    estimator = make(gate_file)
    assert np.array_equal(read.answer(estimator, sharp).mtf, before.answer(estimator, sharp).mtf)


def test_gbb_is_divided_by_its_sharp_mtf_but_not_by_noise(camera):
    level = np.where(np.arange(16).reshape(2, 8) % 2, 0.8, 0.1)
    changed = FusionMap(camera.spectral, level)
    assert np.allclose(changed.relative(np.full((2, 8), 0.4)), np.where(level == 0.8, 0.5, 1.0))
    assert np.allclose(changed.relative(np.full((2, 8), 0.15)), np.where(level == 0.8, 0.15 / 0.8, 0.15 / 0.3))


def plain_map(widening=1.0):
    """A calibration that takes the joint answer of two networks as it is."""
    identity = np.eye(16, 32)
    return Calibration(identity, np.zeros(16), widening, 100, (1.0, 1.0))


def test_a_gate_is_given_gbb_over_its_sharp_mtf_and_mixes_intervals_by_what_deconvolution_pays(gate_file):
    estimator = make(gate_file).with_camera(FusionMap(plain_map(), np.full((2, 8), 0.5)))
    estimator.deconvolution = lambda patches: np.stack([np.full((2, 8), value) for value in (0.2, 0.3)])
    given = []

    def gate(members, scale, sigma_dn):
        given.append(members.numpy())
        return torch.full_like(scale, 0.1), torch.full_like(scale, 0.04)

    estimator.gate = gate
    mtf, scale = np.full((1, 2, 8), 0.6), np.full((1, 2, 8), 0.01)
    spectral = SpectralAnswer(mtf, scale, np.zeros(1), np.array([0.25]))
    answer, width = estimator._fused(np.zeros((1, 1, 192, 192), np.float32), spectral)
    assert given[0][0, :, 0, 0] == pytest.approx([0.6, 0.4, 0.3])
    assert answer == pytest.approx(0.25 * 0.1 + 0.75 * mtf)
    assert width == pytest.approx(0.25 * estimator.interval * 0.04 + 0.75 * estimator.spectral.interval * scale)


def test_where_deconvolution_pays_does_not_depend_on_how_wide_a_calibrated_interval_is(gate_file, blurred):
    pays, scales = [], []
    for widening in (1.0, 0.2):
        calibrated = make(gate_file).with_camera(FusionMap(plain_map(widening), np.ones((2, 8))))
        spectral = calibrated._of_networks(blurred, np.full(len(blurred), ""))
        pays.append(spectral.pays)
        scales.append(spectral.scale)
    assert np.array_equal(*pays) and pays[0].max() > 0 and pays[0].min() < 1
    assert np.allclose(scales[1], 0.2 * scales[0])


def test_a_camera_takes_the_place_of_a_division(gate_file):
    divided = make(gate_file)
    divided.sharp_mtf = np.full((2, 8), 0.5)
    for camera in (None, FusionMap(plain_map(), np.ones((2, 8)))):
        assert divided.with_camera(camera).sharp_mtf is None


def test_the_spectral_network_stands_in_for_what_is_not_identifiable():
    mtf = np.full((2, 2, 8), 0.3)
    others = np.stack([np.full((2, 8), np.nan), np.full((2, 8), 0.7)])
    members = join_members(mtf, others)
    assert members.shape == (2, 3, 2, 8)
    assert (members[:, :2] == 0.3).all() and (members[:, 2] == 0.7).all()
    assert np.array_equal(join_members(mtf, np.stack([others, others])), members)


def test_options_out_of_range_are_refused(gate_file, tmp_path):
    with pytest.raises(InputError, match="deconvolved_patches=0"):
        blur.create("fused", weights=gate_file, deconvolved_patches=0)
    with pytest.raises(InputError, match="shared_blur='mostly'"):
        blur.create("fused", weights=gate_file, shared_blur="mostly")
    with pytest.raises(InputError, match="no such weight file"):
        blur.create("fused", weights=tmp_path / "absent.safetensors")


def test_it_is_registered(gate_file):
    assert isinstance(blur.create("fused", weights=gate_file), Estimator)
