"""The measured examples: the monitor sees the frame that the detector saw."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from plug_in_makers import Darkening

from pipeline.camera.exposure import Camera
from pipeline.control.simulation import worked_examples
from pipeline.control.simulation.views import View
from pipeline.streams import stream


def test_a_detector_in_place_leaves_the_monitor_its_frame(tmp_path, monkeypatch):
    radiance = np.kron(stream(1, "examples").random((16, 16)), np.ones((8, 8))) * 2
    np.savez(tmp_path / "view.radiance.npz", radiance=radiance.astype(np.float16))
    view, images = View("view-0", "view", 0, tmp_path / "view.radiance.npz", ()), []
    monkeypatch.setattr(worked_examples, "opened", lambda kind, options: Darkening())
    monkeypatch.setattr(worked_examples, "monitor", lambda: SimpleNamespace(frame=images.append))
    monkeypatch.setattr(worked_examples, "estimates", lambda condition: (None, None))
    camera = Camera()
    shots = worked_examples.shots(camera, 1e6)[:2]
    results = worked_examples.measure(view, camera=camera, chosen=shots, kind="mine", options="{}", seed=1)
    scores = [float(result["score"][0]) for result in results]
    assert scores == pytest.approx([image.mean() for image in images], rel=1e-6)
