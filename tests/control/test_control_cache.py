"""Keys of kept work of the control stages: another detector's or monitor's weights are other work."""

from __future__ import annotations

import shutil
from pathlib import Path

from pipeline import weight_files
from pipeline.control.cache import fingerprint, forget
from pipeline.dependencies import closure

MODULE = "pipeline.control.loop"


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


def test_kept_work_goes_with_its_folder(tmp_path):
    for name in ("one", "two"):
        (tmp_path / "kept" / name).mkdir(parents=True)
    forget(tmp_path / "kept/one")
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["two"]
    forget(tmp_path / "kept/two")
    assert not (tmp_path / "kept").exists()
    forget(tmp_path / "kept/two")  # another process was faster


def test_work_that_another_process_adds_meanwhile_stays(tmp_path, monkeypatch):
    """Its folder appears at the very moment at which the empty folder above would be removed."""
    (tmp_path / "kept/one").mkdir(parents=True)
    remove = Path.rmdir

    def late(path):
        (tmp_path / "kept/two").mkdir()
        remove(path)

    monkeypatch.setattr(Path, "rmdir", late)
    forget(tmp_path / "kept/one")
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["two"]
