"""Options of policies: each number has a range, and what lies outside is refused in one line that names it."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from control_makers import CAMERA, performance

from pipeline import control
from pipeline.control.temporal.nelder_mead import search
from pipeline.errors import InputError

NAN, INF = float("nan"), float("inf")
IOPC = {
    "target": (0, 1, -0.1, NAN, "0.5", True),
    "tolerance": (-0.1, 1, NAN, None),
}
REFUSED = {
    "fixed": {"exposure_ms": (0, 0.04, 34, NAN, "8"), "iso": (99, 3300, INF, True)},
    "mean_intensity": {**IOPC, "damping": (0, 1.1, NAN), "exposure_max_ms": (0, 0.04, NAN, "8")},
    "prosilica": {
        "gain": (0, 1.1, NAN, "0.25"),
        "target": (0, 1, NAN),
        "cut": (0, 1, NAN),
        "hold": ((0, 31), (31, 29), (29, 64), (29.5, 31), (29,), 30),
        "levels": (31, 64.5, NAN, "64"),
    },
    "shim": {
        "gain": (0, NAN, INF, 5.0),
        "nonlinearity": (0, NAN, "0.5"),
        "anchors": (
            (0.1, 0.5, 0.8, 1.0, 1.2),
            (0.0, 0.5, 0.8, 1.0, 1.2, 1.5),
            (0.1, 0.5, 0.8, 1.0, 1.2, 2.1),
            (0.5, 0.1, 0.8, 1.0, 1.2, 1.5),
            (0.1, 0.5, 0.8, 1.0, 1.2, NAN),
            1.0,
        ),
    },
    "shin2019": {"probes": (-1, 2, 20.5, NAN, "20", True), "tolerance": (-1e-9, NAN, INF, "1e-5")},
    "iopc_target": {**IOPC, "target_px": (0, NAN, INF, "7"), "slack": (-0.1, 1, NAN, "0.1")},
    "iopc_optimal": {**IOPC, "least_gain_percent": (-1, NAN, "1"), "margin": (-0.1, 1.1, NAN, "0.2")},
    "iopc_continuous": {
        **IOPC,
        "least_gain_percent": (-1, NAN),
        "stops_per_frame": (0, NAN, "2"),
        "max_motion_px": (0, NAN, "20"),
        "lamp_hz": (-1, NAN, INF, "100"),
        "margin": (-0.1, 1.1, NAN),
    },
    "oracle": {"target": (0, 1, 3.0, NAN, "0.5")},
}


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [(kind, name, value) for kind, options in REFUSED.items() for name, values in options.items() for value in values],
)
def test_an_option_out_of_range_is_refused_in_one_line_that_names_it(kind, name, value):
    option = "policy Fixed|camera state" if kind == "fixed" else name
    if name == "exposure_max_ms":
        option += "|no exposure time of at most"
    with pytest.raises(InputError, match=option) as caught:
        control.create(kind, camera=CAMERA, performance=performance(), **{name: value})
    assert "expected" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", control.REGISTRY.names())
def test_every_option_of_every_policy_has_a_range(kind):
    options = set(inspect.signature(control.REGISTRY.get(kind)).parameters) - {"camera", "performance"}
    assert options == set(REFUSED[kind])


def test_a_search_begins_with_as_many_evaluations_as_its_simplex_has_corners():
    simplex = np.array([[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]])
    with pytest.raises(InputError, match="evaluations is 2; expected at least 3"):
        next(search(simplex, evaluations=2))
    steps, spent = search(simplex, evaluations=3), 1
    point = next(steps)
    with pytest.raises(StopIteration):
        while True:
            point, spent = steps.send(float(point.sum())), spent + 1
    assert spent == 3
