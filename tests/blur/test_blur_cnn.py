"""The paper's network: its parameters, its padding, its input, its directions, its frames."""

import warnings

import cv2
import numpy as np
import pytest
import torch

from pipeline import blur
from pipeline.blur.cnn import Cnn
from pipeline.blur.networks.cnn_features import network_input
from pipeline.blur.networks.cnn_net import ARCHITECTURE, MtfCnn, SameConv
from pipeline.blur.training import cnn as cnn_training
from pipeline.errors import InputError
from pipeline.learning import images, weights
from pipeline.learning.initial import initialise
from pipeline.learning.run_options import RunOptions
from pipeline.learning.settings import Recipe, Schedule, Training
from pipeline.streams import stream


@pytest.fixture(scope="module")
def patches():
    """(4, 1, 192, 192) with structure."""
    rough = stream(1, "patches").random((4, 24, 24)).astype(np.float32)
    return np.stack([cv2.resize(one, (192, 192), interpolation=cv2.INTER_CUBIC) for one in rough])[:, None].clip(0, 1)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A weight file of a network that was never trained."""
    network = MtfCnn()
    initialise(network, 1, "test", "glorot")
    where = tmp_path_factory.mktemp("weights") / "cnn.safetensors"
    weights.save(where, network.state_dict(), ARCHITECTURE)
    return where


@pytest.fixture(scope="module")
def estimator(path):
    return Cnn(path)


def test_parameters_are_the_papers():
    counts = {name: sum(p.numel() for p in part.parameters()) for name, part in MtfCnn().named_children()}
    assert counts["stem"] == 230_528
    assert [sum(p.numel() for p in block.parameters()) for block in MtfCnn().blocks] == [
        819_456,
        295_168,
        918_272,
        1_245_952,
        1_245_952,
        1_245_952,
        590_592,
    ]
    assert sum(counts.values()) == 6_757_384


def test_the_input_is_phases_of_grey_and_of_its_gradient(patches):
    seen = network_input(torch.from_numpy(patches[:1, 0]))[0].numpy()
    centred = patches[0, 0] - patches[0, 0].mean()
    gradient = cv2.Sobel(centred.astype(np.float64), cv2.CV_64F, 1, 0, ksize=3, borderType=cv2.BORDER_REFLECT)
    for channel in range(36):
        row, column = divmod(channel, 6)
        assert np.allclose(seen[channel], centred[row::6, column::6], atol=1e-6)
        assert np.allclose(seen[36 + channel], gradient[row::6, column::6], atol=1e-5)


@pytest.mark.parametrize(
    ("kernel", "stride", "size"), [(5, 1, 32), (3, 1, 7), (3, 2, 8), (3, 2, 7), (2, 2, 2), (2, 1, 1)]
)
def test_padding_is_tensorflows(kernel, stride, size):
    """The output has ceil(size / stride) pixels; the missing pixels go half before, half and the odd one after."""
    layer = SameConv(1, 1, kernel, stride)
    x = torch.from_numpy(stream(1, "x").random((1, 1, size, size)).astype(np.float32))
    out = -(-size // stride)
    total = max((out - 1) * stride + kernel - size, 0)
    padded = np.pad(x[0, 0].numpy(), (total // 2, total - total // 2))
    weight, bias = layer.weight.detach()[0, 0].numpy(), float(layer.bias.detach())
    expected = [
        [(padded[i * stride :, j * stride :][:kernel, :kernel] * weight).sum() + bias for j in range(out)]
        for i in range(out)
    ]
    assert np.allclose(layer(x)[0, 0].detach().numpy(), expected, atol=1e-5)


def test_the_map_shrinks_to_one_vector(patches):
    assert MtfCnn().features(torch.from_numpy(patches[:1, 0])).shape == (1, 256)


def test_vertical_is_horizontal_of_the_turned_patch(estimator, patches):
    turned = np.ascontiguousarray(np.rot90(patches, -1, (2, 3)))
    assert np.allclose(estimator.estimate(patches).mtf[:, 1], estimator.estimate(turned).mtf[:, 0], atol=1e-5)


def test_four_equal_frames_answer_as_one(estimator, patches):
    repeated = np.repeat(patches[:2, None], 4, axis=1)
    assert np.allclose(estimator.estimate_sequences(repeated).mtf, estimator.estimate(patches[:2]).mtf, atol=1e-5)


def test_features_of_frames_are_averaged(estimator, patches):
    sequence = patches[None]
    with torch.no_grad():
        vector = estimator.network.features(torch.from_numpy(patches[:, 0])).mean(0, keepdim=True)
        expected = estimator.network.dense(vector)[0].numpy()
    selected = estimator.estimate_sequences(sequence).mtf[0, 0]
    assert np.allclose(selected, expected, atol=1e-5)
    assert np.allclose(selected, estimator.estimate_sequences(sequence[:, ::-1].copy()).mtf[0, 0], atol=1e-5)


def test_sequences_are_calibrated_as_single_frames(estimator, patches):
    relative = estimator.calibrated(patches)
    repeated = np.repeat(patches[:2, None], 2, axis=1)
    assert np.allclose(relative.estimate_sequences(repeated).mtf, relative.estimate(patches[:2]).mtf, atol=1e-4)


def test_a_flat_frame_makes_its_sequence_abstain(estimator, patches):
    sequence = np.stack([patches, patches])
    sequence[1, 2] = 0.5
    estimate = estimator.estimate_sequences(sequence)
    assert estimate.abstained.tolist() == [False, True] and estimate.reason.tolist() == ["", "flat"]
    assert np.isnan(estimate.mtf[1]).all() and estimate.low is None


def test_wrong_input_is_refused(path, patches):
    made = blur.create("cnn", weights=str(path), batch=2)
    with pytest.raises(InputError, match="expected \\(places, frames"):
        made.estimate_sequences(patches)
    with pytest.raises(InputError, match="batch=0"):
        Cnn(path, batch=0)


def test_its_training_turns_every_second_patch(patches):
    """The loss of a network that answers 0.5 is the mean square of both directions' truths about it, in turn."""

    class Half(torch.nn.Module):
        def forward(self, shown):
            self.shown = shown
            return torch.full((len(shown), 8), 0.5)

    network = Half()
    dn = np.rint(patches[:, 0] * 255).astype(np.uint8)
    truth = stream(1, "truth").random((4, 2, 8)).astype(np.float32)
    batch = {"patches_dn": torch.from_numpy(dn), "mtf": torch.from_numpy(truth)}
    value, measures = cnn_training.Loss(half_precision=False)(network, batch)
    expected = np.concatenate([truth[[0, 2], 0], truth[[1, 3], 1]]) - 0.5
    assert float(value) == pytest.approx(np.mean(expected**2), rel=1e-5)
    assert measures["mtf_error_percent"] == pytest.approx(100 * np.abs(expected).mean(), rel=1e-5)
    assert np.allclose(network.shown[1].numpy() * 255, np.rot90(dn[1], -1), atol=1e-3)


def test_its_training_runs_and_its_weights_load(tmp_path, monkeypatch):
    draw = lambda index, seed, purpose: stream(seed, purpose, index).integers(0, 256, (260, 260)).astype(np.uint8)  # noqa: E731
    monkeypatch.setattr(images, "picture", draw)
    schedule = Schedule(2, 1e-4, "adam", (0.9, 0.999), 1e-7, 0.0, 1, 0.0, 1.0, 0.0, None, 2, 1)
    recipe = Recipe(views=1, kernels_per_view=2, clean_fraction=1.0, pre_blur_noise_fraction=0.0)
    training = Training(
        schedule=schedule,
        recipe=recipe,
        images=2,
        validation_images=1,
        kernels=250,
        validation_chunks=1,
        half_precision=False,
    )
    trained = cnn_training.train(training, RunOptions(tmp_path))
    assert len(trained.curve) == 2 and "validation_mean_squared_error" in trained.curve[-1]
    cnn_training.save(tmp_path / "cnn.safetensors", trained, training)
    fresh = MtfCnn()
    initialise(fresh, 1, "cnn network", "glorot")
    moved = (trained.model.stem.weight - fresh.stem.weight).detach().abs()
    assert 0 < float(moved.max()) < 2.1e-4  # two Adam steps of 1e-4
    assert Cnn(tmp_path / "cnn.safetensors").sharp_mtf is None


def test_patches_that_may_not_be_written_to_are_read_without_a_warning(estimator, patches):
    locked = patches.copy()
    locked.setflags(write=False)
    before = torch.is_warn_always_enabled()
    torch.set_warn_always(True)  # else it warns once in a process
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            single, sequence = estimator.estimate(locked), estimator.estimate_sequences(locked[None])
    finally:
        torch.set_warn_always(before)
    np.testing.assert_array_equal(single.mtf, estimator.estimate(patches).mtf)
    np.testing.assert_array_equal(sequence.mtf, estimator.estimate_sequences(patches[None]).mtf)
