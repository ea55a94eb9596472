"""Weight files: what was saved comes back; anything else is refused in one line."""

import errno
import json
import resource
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from pipeline.errors import InputError
from pipeline.learning import weights

RELEASED = sorted((Path(__file__).resolve().parents[2] / "data/weights").glob("*.safetensors"))


@pytest.fixture
def path(tmp_path):
    where = tmp_path / "net.safetensors"
    weights.save(where, torch.nn.Linear(3, 2).state_dict(), "net-1", steps=5, interval=2.5)
    return where


def test_round_trip(tmp_path):
    layer = torch.nn.Linear(3, 2)
    weights.save(tmp_path / "a.safetensors", layer.state_dict(), "net-1", steps=5, parameters={"b": 1, "a": [2]})
    tensors, header = weights.load(tmp_path / "a.safetensors", "net-1")
    assert all(torch.equal(tensors[name], value) for name, value in layer.state_dict().items())
    digest = weights.tensors_sha256(tensors)
    expected = {"architecture": "net-1", "steps": 5, "parameters": {"b": 1, "a": [2]}, "tensors_sha256": digest}
    assert header == expected
    assert weights.details(tmp_path / "a.safetensors") == header
    other = torch.nn.Linear(3, 2)
    assert weights.into(other, tmp_path / "a.safetensors", "net-1") == {**header, "released": False}
    assert torch.equal(other.weight, layer.weight)


def test_same_content_same_bytes(tmp_path):
    layer = torch.nn.Linear(3, 2)
    for name in ("a", "b"):
        weights.save(tmp_path / name, layer.state_dict(), "net-1", z=1, a=2)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@pytest.mark.parametrize("keep", [0, 4, 100, -8])
def test_cut_short(path, keep):
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(InputError, match=r"net\.safetensors: not a readable safetensors file"):
        weights.load(path, "net-1")


def test_foreign_files(path, tmp_path):
    path.write_text(json.dumps({"hello": 1}))
    with pytest.raises(InputError, match="not a readable safetensors file"):
        weights.load(path, "net-1")
    save_file({"x": torch.zeros(2)}, tmp_path / "other.safetensors")
    with pytest.raises(InputError, match="holds no architecture"):
        weights.load(tmp_path / "other.safetensors", "net-1")
    with pytest.raises(InputError, match="no such weight file"):
        weights.load(tmp_path / "none.safetensors", "net-1")


def test_another_architecture(path):
    with pytest.raises(InputError, match="holds weights of 'net-1', expected 'net-2'"):
        weights.load(path, "net-2")
    with pytest.raises(InputError, match="does not fit the network"):
        weights.into(torch.nn.Linear(4, 2), path, "net-1")


@pytest.mark.parametrize(
    ("value", "words"), [(float("nan"), "NaN or infinite"), (float("inf"), "NaN"), (1e30, "1e\\+30")]
)
def test_absurd_values_are_refused(tmp_path, value, words):
    tensors = torch.nn.Linear(3, 2).state_dict()
    tensors["weight"][1, 2] = value
    save_file(tensors, tmp_path / "a.safetensors", {"pipeline": json.dumps({"architecture": "net-1"})})
    with pytest.raises(InputError, match=f"tensor 'weight' holds values .*{words}.*restore the file"):
        weights.load(tmp_path / "a.safetensors", "net-1")


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1e30])
def test_absurd_values_are_not_written(path, value):
    before = path.read_bytes()
    tensors = torch.nn.Linear(3, 2).state_dict()
    tensors["bias"][1] = value
    with pytest.raises(InputError, match=r"net\.safetensors: tensor 'bias' holds values .*not written"):
        weights.save(path, tensors, "net-1")
    assert path.read_bytes() == before


def test_an_error_of_a_full_disk_names_the_file_and_leaves_the_one_before(path):
    before, limits = path.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            weights.save(path, torch.nn.Linear(30, 20).state_dict(), "net-1")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (caught.value.errno, caught.value.filename) == (errno.EFBIG, str(path))
    assert path.read_bytes() == before and list(path.parent.iterdir()) == [path]


def test_squared_gradients_of_a_checkpoint_may_be_large_but_not_infinite(tmp_path):
    tensors = {"optimiser.0.exp_avg_sq": torch.tensor([1e9])}
    weights.save(tmp_path / "a.safetensors", tensors, "net-1")
    assert torch.equal(
        weights.load(tmp_path / "a.safetensors", "net-1")[0]["optimiser.0.exp_avg_sq"], torch.tensor([1e9])
    )
    with pytest.raises(InputError, match="NaN or infinite"):
        weights.save(tmp_path / "a.safetensors", {"optimiser.0.exp_avg_sq": torch.tensor([float("inf")])}, "net-1")


def test_weights_changed_after_they_were_written_are_refused(path):
    content = bytearray(path.read_bytes())
    content[-1] ^= 1  # the lowest bit of an exponent or mantissa of the last value
    path.write_bytes(content)
    with pytest.raises(InputError, match="SHA-256 differs|expected at most|NaN"):
        weights.load(path, "net-1")


def test_weights_that_are_not_released_are_announced_once(path, capsys):
    for _ in range(2):
        assert weights.into(torch.nn.Linear(3, 2), path, "net-1")["released"] is False
    assert capsys.readouterr().err == f"warning: {path}: weights that are not released (net-1)\n"
    weights.save(path, torch.nn.Linear(3, 2).state_dict(), "net-1", released=True)
    assert weights.into(torch.nn.Linear(3, 2), path, "net-1")["released"] is True
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    "file",
    sorted((Path(__file__).resolve().parents[2] / "data/weights").glob("*.safetensors")),
    ids=lambda file: file.stem,
)
def test_weights_of_the_project_are_released(file):
    assert weights.is_released(file, weights.details(file))


def test_released_weights_are_finite():
    files = sorted((Path(__file__).resolve().parents[2] / "data/weights").glob("*.safetensors"))
    assert files
    for file in files:
        weights.load(file, weights.details(file)["architecture"])


def test_a_network_is_made_without_the_callers_random_numbers():
    torch.manual_seed(5)
    before = torch.get_rng_state()
    assert isinstance(weights.untrained(lambda: torch.nn.Linear(3, 2)), torch.nn.Linear)
    assert torch.equal(torch.get_rng_state(), before)


def test_opening_the_monitor_leaves_all_random_numbers_as_they_are():
    from pipeline.condition import ConditionMonitor

    torch.manual_seed(5)
    before, numbers = torch.get_rng_state(), np.random.get_state()[1].copy()
    ConditionMonitor(blur_name="fused")
    assert torch.equal(torch.get_rng_state(), before)
    assert np.array_equal(np.random.get_state()[1], numbers)
