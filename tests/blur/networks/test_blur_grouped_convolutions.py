"""Convolutions of two spectral networks as one: each network's answer, from its weights."""

import numpy as np
import torch

from pipeline import blur
from pipeline.blur.networks.grouped_convolutions import GroupedBodies, OneDnnConvolution
from pipeline.blur.networks.spectral_net import SpectralNet
from pipeline.learning.initial import initialise
from pipeline.streams import stream


def networks(count):
    result = [SpectralNet().eval() for _ in range(count)]
    for number, network in enumerate(result):
        initialise(network, number, "grouped")
        for block in (network.body[2], network.body[3]):
            block.weight.data += 0.1 * number
    return result


def test_each_group_is_the_body_of_its_network():
    maps = torch.from_numpy(stream(1, "maps").normal(0, 1, (3, 3, 64, 32)).astype(np.float32))
    for count in (1, 2, 3):
        each = networks(count)
        grouped = GroupedBodies(each).eval()
        with torch.inference_mode():
            results = grouped(maps)
            assert len(results) == count
            for network, result in zip(each, results, strict=True):
                assert torch.allclose(result, network.body(maps), atol=1e-5)


def test_a_convolution_without_onednn_is_pytorchs(monkeypatch):
    inputs = torch.from_numpy(stream(1, "inputs").normal(0, 1, (1, 3, 16, 8)).astype(np.float32))
    torch.manual_seed(1)
    layer = OneDnnConvolution(3, 4, 3, padding=1)
    with torch.inference_mode():
        expected = torch.nn.functional.conv2d(inputs, layer.weight, layer.bias, padding=1)
        assert torch.allclose(layer(inputs), expected, atol=1e-5)
        monkeypatch.setattr(torch.backends.mkldnn, "is_available", lambda: False)
        assert torch.equal(layer(inputs), expected)


def test_the_weights_are_copies():
    first, second = networks(2)
    grouped = GroupedBodies([first, second])
    before = grouped.body[0].weight.detach().clone()
    first.body[0].weight.data.zero_()
    assert torch.equal(grouped.body[0].weight, before)


def test_a_patch_alone_is_answered_as_among_others():
    patches = stream(2, "patches").uniform(0, 1, (3, 1, 192, 192)).astype(np.float32)
    estimator = blur.create("spectral")
    together = estimator.predict_members(patches)
    for index in range(3):
        alone = estimator.predict_members(patches[index : index + 1])
        assert np.allclose(alone.members, together.members[index : index + 1], atol=1e-5)
        assert np.allclose(alone.mtf, together.mtf[index : index + 1], atol=1e-5)
        assert np.allclose(alone.scale, together.scale[index : index + 1], atol=1e-5)
        assert np.allclose(alone.hidden.units, together.hidden.units[index : index + 1], atol=1e-3)


def test_making_it_leaves_a_callers_random_numbers_alone():
    torch.manual_seed(3)
    expected = torch.get_rng_state()
    blur.create("spectral")
    assert torch.equal(torch.get_rng_state(), expected)
