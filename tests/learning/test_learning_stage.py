"""The stage that trains a blur network: same bytes when run again, weights that an estimator can use."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter

from pipeline.blur.spectral import Spectral
from pipeline.errors import InputError
from pipeline.learning import images
from pipeline.learning.settings import Training
from pipeline.stages.train_mtf import run as stage
from pipeline.streams import stream

CONF = Path(__file__).resolve().parents[2] / "conf/train/default.yaml"


def section(network="spectral", **changes):
    content = yaml.safe_load(CONF.read_text())["mtf"][network]
    content["schedule"] |= {"steps": 6, "checkpoint_every": 3, "report_every": 3}
    content["recipe"] |= {"views": 1, "kernels_per_view": 4}
    small = {"images": 2, "validation_images": 1, "kernels": 250, "validation_chunks": 1, "half_precision": False}
    return TypeAdapter(Training).validate_python(content | small | {"seed": 1} | changes)


def configuration():
    training = {"spectral": section(), "cnn": section("cnn")}
    return SimpleNamespace(train=SimpleNamespace(mtf=training), executor=SimpleNamespace(workers=1, device="cpu"))


@pytest.fixture
def quick_images(monkeypatch, tmp_path):
    draw = lambda index, seed, purpose: stream(seed, purpose, index).integers(0, 256, (260, 260)).astype(np.uint8)  # noqa: E731
    monkeypatch.setattr(images, "picture", draw)
    monkeypatch.chdir(tmp_path)


def test_it_writes_the_same_bytes_each_time(tmp_path, quick_images, monkeypatch):
    for index in ("a", "b", "b"):  # the last finds the training finished
        (tmp_path / index).mkdir(exist_ok=True)
        monkeypatch.chdir(tmp_path / index)
        stage.run(configuration(), {"network": "spectral"}, Path(), tmp_path / index)
    names = ["data/weights/mtf_spectral.safetensors", "data/weights/mtf_spectral.csv"]
    for name in [*names, "reports/metrics/train/mtf_spectral.json"]:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    rough = stream(1, "patches").random((2, 1, 192, 192)).astype(np.float32)
    assert not Spectral(tmp_path / "a" / names[0]).estimate(rough).abstained.any()


def test_a_network_that_is_not_configured_is_refused(tmp_path):
    with pytest.raises(InputError, match="spectral"):
        stage.run(configuration(), {"network": "spectrl"}, Path(), tmp_path)


def test_the_configuration_of_both_networks_is_complete():
    for network in ("spectral", "cnn"):
        content = yaml.safe_load(CONF.read_text())["mtf"][network]
        training = TypeAdapter(Training).validate_python(content | {"seed": 3})
        assert training.schedule.steps == content["schedule"]["steps"]
        assert training.recipe.intrinsic_px == tuple(content["recipe"]["intrinsic_px"])
        assert set(content) == set(training.__dataclass_fields__)
        assert set(content["schedule"]) == set(training.schedule.__dataclass_fields__)
        assert set(content["recipe"]) == set(training.recipe.__dataclass_fields__) - {"cameras"}
