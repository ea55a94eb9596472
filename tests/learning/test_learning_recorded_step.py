"""Steps that a GPU records: same weights as step by step, goes on after a stop, every loss that says so can be."""

import numpy as np
import pytest
import torch

from pipeline.blur.networks.cnn_net import MtfCnn
from pipeline.blur.networks.pixel_net import PixelNet
from pipeline.blur.networks.spectral_features import features
from pipeline.blur.networks.spectral_net import SpectralNet
from pipeline.blur.training import cnn as cnn_training
from pipeline.blur.training import pixel as pixel_training
from pipeline.blur.training import spectral as spectral_training
from pipeline.learning.chunk_loader import ChunkLoader
from pipeline.learning.initial import initialise
from pipeline.learning.settings import Schedule
from pipeline.learning.trainer import train
from pipeline.noise.training import cnn as noise_cnn_training
from pipeline.noise.training.sensor_noise import PROGRAMS
from pipeline.streams import stream

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU that torch sees")

SCHEDULE = Schedule(60, learning_rate=0.02, warm_up=5, ema_decay=0.9, checkpoint_every=20, report_every=10)


def pictures(number):
    x = stream(1, "pictures", number).standard_normal((8, 4, 6, 6)).astype(np.float32)
    return {"x": x, "y": x.mean((1, 2, 3))}


def loss(model, batch):
    error = model(batch["x"]).mean((1, 2, 3)) - batch["y"]
    return error.square().mean(), {"error": error.detach().abs().mean()}


def run(*, recordable, schedule=SCHEDULE, **options):
    model = torch.nn.Sequential(torch.nn.Conv2d(4, 6, 3), torch.nn.Tanh(), torch.nn.Conv2d(6, 2, 2))
    initialise(model, 1, "test")
    loader = ChunkLoader(pictures, 1, replays=2, replay_window=8, producers=0)
    model = model.to(memory_format=torch.channels_last)
    options |= {"validate": lambda model: {"first": float(next(model.parameters()).detach().sum())}, "score": "first"}
    return train(model, loss, loader, schedule, device="cuda", recordable=recordable, **options)


def weights_of(trained):
    return torch.cat([value.flatten() for value in trained.model.state_dict().values()])


@pytest.mark.parametrize("optimiser", ["adamw", "adam"])
def test_a_recorded_training_ends_near_that_done_step_by_step(tmp_path, optimiser):
    """Falling rate, moving average and a limited gradient included; stopped and resumed as well."""
    schedule = SCHEDULE.__class__(**{**vars(SCHEDULE), "optimiser": optimiser})
    plain, recorded = (run(recordable=recordable, schedule=schedule) for recordable in (False, True))
    for stop in (2, 33):
        run(recordable=True, schedule=schedule, folder=tmp_path, stop_after=stop)
    resumed = run(recordable=True, schedule=schedule, folder=tmp_path)
    assert torch.allclose(weights_of(recorded), weights_of(plain), atol=1e-3)
    assert torch.allclose(weights_of(resumed), weights_of(plain), atol=1e-3)
    for row, other in zip(plain.curve, recorded.curve, strict=True):
        assert row == pytest.approx(other, rel=1e-2, abs=1e-4)
    assert recorded.curve[-1]["error"] < 0.5 * recorded.curve[0]["error"]


def patches(number, side=192):
    drawn = stream(2, "patches", number)
    return {
        "patches_dn": drawn.integers(0, 256, (4, side, side)).astype(np.uint8),
        "mtf": drawn.random((4, 2, 8)).astype(np.float32),
        "sigma_dn": drawn.random(4).astype(np.float32),
    }


def spectra(number):
    made = patches(number)
    maps, vector = features(torch.from_numpy(made["patches_dn"]).float())
    return {"maps": maps.half().numpy(), "vector": vector.half().numpy()} | made


def crops(number):
    made = patches(number, 48)
    return {"image": made["patches_dn"][:, None], "sigma_dn": made["sigma_dn"]}


CASES = {
    "cnn": (MtfCnn, cnn_training.Loss(True), patches),
    "spectral": (lambda: SpectralNet(True), spectral_training.loss, spectra),
    "pixels": (lambda: PixelNet(True), pixel_training.loss, patches),
    "noise cnn": (lambda: noise_cnn_training.network(1), noise_cnn_training.loss, crops),
}


@pytest.mark.parametrize("name", CASES)
def test_a_network_that_is_said_to_be_recordable_is(name):
    network, minimised, make = CASES[name]
    curves = []
    for recordable in (False, True):
        model = network()
        initialise(model, 1, "test")
        loader = ChunkLoader(make, 1, replays=2, replay_window=8, producers=0)
        schedule = Schedule(8, 1e-4, checkpoint_every=4, report_every=1)
        model = model.to(memory_format=torch.channels_last)
        curves.append(train(model, minimised, loader, schedule, device="cuda", recordable=recordable).curve)
    for row, other in zip(*curves, strict=True):
        assert row == pytest.approx(other, rel=0.05, abs=0.05)


def test_these_are_all_of_them():
    assert {name for name in PROGRAMS.names() if PROGRAMS.get(name).recordable} == {"cnn"}
