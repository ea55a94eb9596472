"""The benchmark of the camera pipeline: what is timed beside each other computes the same where it claims to."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from pipeline.store import read_json
from pipeline.streams import stream

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    specification = importlib.util.spec_from_file_location("camera_pipeline", ROOT / "benchmarks/camera_pipeline.py")
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    before = list(sys.path)
    specification.loader.exec_module(module)
    sys.path[:] = before
    return module


def test_steps_of_equal_definition_give_equal_pictures(benchmark: ModuleType) -> None:
    steps = benchmark.steps(benchmark.scene()[:128, :192])
    for step, limit_dn in (("demosaicing, bilinear", 0.1), ("unsharp mask of luma", 0.01)):
        ours, peer = (call() for call in steps[step].values())
        assert ours.shape == peer.shape and benchmark.difference_dn(ours, peer) < limit_dn


def test_both_cameras_deliver_pictures_of_like_brightness(benchmark: ModuleType) -> None:
    light = benchmark.scene()[:128, :192]
    ours = benchmark.plain_camera().shoot(light, stream(1, "test"))
    peer = benchmark.kornia_camera(light, stream(1, "test"))
    assert ours.shape == peer.shape == (128, 192, 3) and ours.dtype == peer.dtype == np.uint8
    assert (
        abs(float(ours.mean()) - float(peer.mean())) < 20
    )  # ours has the tone curve's toe and shoulder beside the gamma


def test_the_record_names_every_contestant() -> None:
    record = read_json(ROOT / "benchmarks/results/camera_pipeline.json")
    assert {"ours, plain", "kornia, plain", "ours, phone", "ours, dashcam"} <= set(record["cameras"])
    for step in record["steps"].values():
        peer = next(name for name in step if name != "ours")
        assert step[peer]["times_ours"] == pytest.approx(
            step[peer]["processor_least_ms"] / step["ours"]["processor_least_ms"], abs=0.01
        )
