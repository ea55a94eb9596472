"""Exported networks equal the originals, for batches of any size; what cannot be exported is one clear line."""

import hashlib

import numpy as np
import pytest
from click.testing import CliRunner

from pipeline.cli import main, onnx_networks
from pipeline.cli.onnx_networks import NETWORKS, example_patches, largest_difference, original_outputs, run
from pipeline.errors import InputError
from pipeline.project_files import located

pytest.importorskip("onnxruntime", reason="ONNX Runtime is not installed, which runs the exported networks")
pytest.importorskip("onnx", reason="the extra onnx is not installed, which writes the exported networks")


@pytest.mark.parametrize("name", NETWORKS)
def test_an_exported_network_equals_the_original(name, tmp_path):
    done = CliRunner().invoke(main, ["export", name, "--out", str(tmp_path / "network.onnx")])
    assert done.exit_code == 0, done.output
    weights = located(f"data/weights/{name}.safetensors").read_bytes()
    assert f"weights {name}.safetensors, SHA-256 {hashlib.sha256(weights).hexdigest()}\n" in done.output
    network = NETWORKS[name]
    for count in (1, 3):
        inputs = network.features(example_patches(count, network.side_px))
        expected = original_outputs(network.load().eval(), inputs)
        result = run(tmp_path / "network.onnx", inputs)
        assert [part.shape for part in result] == [part.shape for part in expected]
        assert largest_difference(expected, result) < 1e-5
        assert all(f"output {output}" in done.output for output in network.outputs)


def test_a_network_that_differs_is_not_written(tmp_path, monkeypatch):
    monkeypatch.setattr(onnx_networks, "run", lambda path, inputs: [np.full((3, 128, 128), 0.5, np.float32)])
    with pytest.raises(InputError, match="differ"):
        onnx_networks.export("sigma_cnn", tmp_path / "network.onnx")
    assert not list(tmp_path.iterdir())
    assert largest_difference([np.ones(2, np.float32)], [np.array([1, np.nan], np.float32)]) == np.inf


def test_unknown_networks_and_places_are_refused(tmp_path):
    done = CliRunner().invoke(main, ["export", "mtf_spectrall", "--out", str(tmp_path / "a.onnx")])
    assert done.exit_code == 2 and "did you mean 'mtf_spectral'" in done.output
    (tmp_path / "file").write_text("x")
    done = CliRunner().invoke(main, ["export", "mtf_cnn", "--out", str(tmp_path / "file")])
    assert done.exit_code == 2 and "is there already" in done.output and (tmp_path / "file").read_text() == "x"
    done = CliRunner().invoke(main, ["export", "mtf_cnn", "--out", str(tmp_path / "file/a.onnx")])
    assert done.exit_code == 2 and "--out" in done.output and len(done.output.splitlines()) == 1
