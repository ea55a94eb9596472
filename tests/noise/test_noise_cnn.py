"""The paper's noise network: its size, its loss, what comes of a trained one, and a plain word where none is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from pipeline import noise
from pipeline.errors import InputError
from pipeline.learning import weights
from pipeline.noise.maps import NoiseMapper
from pipeline.noise.networks.cnn_net import ARCHITECTURE, PixelNet, loss
from pipeline.streams import stream


@pytest.fixture(scope="module")
def constant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A weight file whose network answers 7.5 DN wherever it looks, or 0 where the image is black."""
    network = PixelNet()
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.zero_()
        network.leave.bias.fill_(7.5 / 255)
    path = tmp_path_factory.mktemp("cnn") / "constant.safetensors"
    weights.save(path, network.state_dict(), ARCHITECTURE)
    return path


def test_has_the_papers_number_of_parameters() -> None:
    assert sum(parameter.numel() for parameter in PixelNet().parameters()) == 519_361


def test_a_block_adds_to_its_input_without_rectifying_the_sum() -> None:
    """With silent blocks the network is three convolutions and the last one."""
    network = PixelNet()
    with torch.no_grad():
        for parameter in network.blocks.parameters():
            parameter.zero_()
        image = torch.rand(2, 1, 20, 24, generator=torch.Generator().manual_seed(1))
        x = image.expand(-1, 3, -1, -1)
        for layer in network.enter:
            x = layer(x).relu()
        torch.testing.assert_close(network(image), network.leave(x).relu()[:, 0])


def test_loss_is_the_papers() -> None:
    result = torch.tensor([[[0.1, 0.2], [0.3, 0.4]]])
    pixels = 0.1**2 + 0 + 0.1**2 + 0.2**2
    expected = 0.25 * pixels + 0.75 * (0.25 - 0.2) ** 2
    assert float(loss(result, torch.tensor([0.2]))) == pytest.approx(expected, rel=1e-5)


def test_sees_only_its_surroundings() -> None:
    """Sixteen 3 x 3 layers: a pixel further than 16 px away changes nothing."""
    network = PixelNet().eval()
    image = torch.full((1, 1, 48, 48), 0.5)
    changed = image.clone()
    changed[..., 0, 0] = 1.0
    with torch.no_grad():
        difference = (network(image) - network(changed))[0]
    assert not difference[17:].any()
    assert not difference[:, 17:].any()


def test_estimate_is_the_median_of_the_map(constant: Path) -> None:
    patches = stream(1, "cnn").uniform(0.2, 0.8, (3, 1, 32, 32)).astype(np.float32)
    patches[2] = 1.0
    estimator = noise.create("cnn", weights=constant, batch=2)
    estimate = estimator.estimate(patches)
    np.testing.assert_allclose(estimate.sigma_dn[:2], 7.5, rtol=1e-5)
    assert list(estimate.reason) == ["", "", "saturated"]
    assert np.isnan(estimate.low_dn).all()
    np.testing.assert_allclose(estimator.pixel_map(patches[0, 0]), 7.5, rtol=1e-5)
    assert not isinstance(estimator, NoiseMapper)  # a sigma of every pixel is no map of cells
    published = noise.create("cnn", weights=constant, quantise_like_paper=True).estimate(patches)
    np.testing.assert_array_equal(published.sigma_dn, 7.0)
    assert not published.abstained.any()


def test_learns_the_noise_of_a_few_patches() -> None:
    """The network and its loss can tell 4 from 20 DN after some steps, which untrained weights cannot."""
    from pipeline.learning.initial import initialise

    draw = stream(2, "cnn patches")
    truth = torch.tensor([4.0, 20.0, 4.0, 20.0]) / 255
    image = 0.5 + truth[:, None, None, None] * torch.from_numpy(draw.standard_normal((4, 1, 16, 16), np.float32))
    network = PixelNet()
    initialise(network, 1, "test", "glorot")
    optimiser = torch.optim.Adam(network.parameters(), 1e-4)
    for _ in range(50):
        optimiser.zero_grad()
        loss(network(image), truth).backward()
        optimiser.step()
    with torch.no_grad():
        result = 255 * network(image).flatten(1).median(1).values
    assert result[[0, 2]].max() < 10 < result[[1, 3]].min()


def test_absent_weights_are_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"absent; train it with .*train_sigma.*cellwise") as reported:
        noise.create("cnn", weights=tmp_path / "none.safetensors")
    assert "\n" not in str(reported.value)


def test_foreign_weights_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.safetensors"
    weights.save(path, {"x": torch.zeros(2)}, "sigma-cellwise-1")
    with pytest.raises(InputError, match="expected 'sigma-cnn-1'"):
        noise.create("cnn", weights=path)
    path.write_bytes(path.read_bytes()[:20])
    with pytest.raises(InputError, match="not a readable safetensors file"):
        noise.create("cnn", weights=path)


@pytest.mark.parametrize(("options", "word"), [({"batch": 0}, "batch=0"), ({"saturated_fraction": 2}, "share")])
def test_options_out_of_range(constant: Path, options: dict[str, float], word: str) -> None:
    with pytest.raises(InputError, match=word):
        noise.create("cnn", weights=constant, **options)


@pytest.mark.filterwarnings("error")
def test_patches_that_may_not_be_written_are_read_without_a_warning(constant: Path) -> None:
    patches = np.full((1, 1, 32, 32), 0.5, np.float32)
    patches[..., ::2] = 0.4
    patches.flags.writeable = False
    assert len(noise.create("cnn", weights=str(constant)).estimate(patches)) == 1
