"""Kept work of control: its key changes with the source of a third party's detector, other modules of it too."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import composed
import pytest
from plug_in_makers import SPOTS, plug_in

from pipeline.control import cache
from pipeline.control.simulation import measured_surface, views
from pipeline.stages import closed_loop, control_surface

ROOT = Path(__file__).resolve().parents[2]


class KeyReached(Exception):
    """The stage has come to the key of its kept work."""


STAGES = [(closed_loop, {"scenario": "tunnel_in"}), (control_surface, {})]


@pytest.mark.parametrize(("stage", "job"), STAGES)
def test_other_weights_change_the_key_though_the_stage_detector_has_not_seen_them(
    stage: Any, job: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    weights, keys = tmp_path / "weights.onnx", []
    config = composed.config("profile=smoke")
    name = config.control.detector
    config.detection.detectors[name] = config.detection.detectors[name].model_copy(update={"weights": str(weights)})
    monkeypatch.setattr(views, "views", lambda *given, **options: [])
    monkeypatch.setattr(views, "folds", lambda *given: [[]])
    monkeypatch.setattr(measured_surface, "exposures", lambda *given: None)

    def fingerprint(module: str, settings: Mapping[str, Any]) -> str:
        keys.append(settings["detector"])
        raise KeyReached

    monkeypatch.setattr(cache, "fingerprint", fingerprint)
    for content in (b"first", b"first", b"other"):
        weights.write_bytes(content)
        with pytest.raises(KeyReached):
            stage.run.run(config, job, tmp_path, tmp_path)
    assert keys[0] == keys[1] != keys[2]


@pytest.mark.parametrize(("stage", "job"), STAGES)
def test_an_edit_of_a_third_partys_detector_changes_the_key_though_its_hashed_file_is_the_same(
    stage: Any, job: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = f"kept_spots_{stage.__name__.rpartition('.')[2]}"
    helper = tmp_path / package / "helper.py"
    helper.parent.mkdir()
    helper.write_text("SIDE = 30\n")
    (helper.parent / "__init__.py").write_text(SPOTS)
    plug_in(tmp_path, monkeypatch, f"{package}_module", "", detection=f"spots = {package}:Spots")
    settings = ["profile=smoke", "+detection.detectors.mine={kind: spots}", "control.detector=mine"]
    config = composed.config(*settings)
    monkeypatch.setattr(views, "views", lambda *given, **options: [])
    monkeypatch.setattr(views, "folds", lambda *given: [[]])
    monkeypatch.setattr(measured_surface, "exposures", lambda *given: None)
    keys = []

    def fingerprint(module: str, settings: Mapping[str, Any]) -> str:
        keys.append(settings["detector"])
        raise KeyReached

    monkeypatch.setattr(cache, "fingerprint", fingerprint)
    for side_px in (30, 30, 50):
        helper.write_text(f"SIDE = {side_px}\n")
        with pytest.raises(KeyReached):
            stage.run.run(config, job, tmp_path, tmp_path)
    assert keys[0] == keys[1] != keys[2]
