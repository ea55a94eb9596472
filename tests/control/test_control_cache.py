"""Keys of kept work of the control stages: another detector's or monitor's weights are other work."""

from __future__ import annotations

import shutil

from pipeline import weight_files
from pipeline.control.cache import fingerprint
from pipeline.dependencies import closure

MODULE = "pipeline.control.simulation.loop"


def test_a_key_knows_settings_and_the_weights_of_the_monitor(tmp_path):
    key = fingerprint(MODULE, {"seed": 1})
    assert key == fingerprint(MODULE, {"seed": 1}) != fingerprint(MODULE, {"seed": 2})
    weights = tmp_path / "weights"
    shutil.copytree(closure.ROOT / "data/weights", weights)
    with weight_files.active_folder(weights):
        assert fingerprint(MODULE, {"seed": 1}) == key
        for name in ("sigma_cellwise.safetensors", "mtf_spectral.safetensors"):
            (weights / name).write_bytes(b"other")
            assert fingerprint(MODULE, {"seed": 1}) != key
            shutil.copy(closure.ROOT / "data/weights" / name, weights / name)
