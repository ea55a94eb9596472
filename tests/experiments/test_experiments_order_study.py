"""The order study: conditions, truth by closed form, one row per condition."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.camera.settings import CameraSettings
from pipeline.datasets.frame import Box, Frame
from pipeline.detection.classes import CLASS_MAPS
from pipeline.experiments import order_study
from pipeline.store import write_image
from pipeline.streams import stream

JUDGE = SimpleNamespace(rule="paper", overlap=0.5, lowest_px=25.0, least_visible=0.3, bootstrap_draws=10)


@pytest.fixture
def frame(tmp_path):
    picture = 0.25 + 0.5 * np.kron(stream(1, "order").random((28, 28)), np.ones((8, 8)))
    write_image(tmp_path / "evaluation-0000-3.png", picture)
    return Frame("sim", "evaluation-0000-3", tmp_path / "evaluation-0000-3.png", (Box("car", 20, 20, 90, 90),))


def test_order_study_covers_orders_lights_lengths_and_levels():
    chosen = order_study.conditions([0, 11], [5, 15])
    assert len(chosen) == len(set(chosen)) == 16
    assert {(one.order, one.light) for one in chosen} == {
        (order, light) for order in ("paper", "detector") for light in ("encoded", "linear")
    }


def test_order_study_noise_behind_the_optics_keeps_its_level(frame):
    """The paper's order blurs its own noise away: of 15 DN behind 11 px of motion about 15 / sqrt(11) are left."""
    chosen = [one for one in order_study.conditions([11], [15]) if one.light == "encoded"]
    found = [order_study.look(frame, chosen=chosen, camera=CameraSettings(), kind="compact", options="{}", seed=1)]
    table = order_study.table([frame], found, chosen, CLASS_MAPS["sim"], JUDGE, 1).set_index("order")
    assert table.loc["detector", "clipped_sigma_dn"] == pytest.approx(15, rel=0.05)
    assert table.loc["paper", "clipped_sigma_dn"] == pytest.approx(15 / np.sqrt(11), rel=0.1)
    assert (table["frames"] == 1).all() and table["ap_percent"].between(0, 100).all()
