"""The surface measured by the controlled camera: gain for a noise, light for a level, knots in order."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from control_makers import judged_with
from plug_in_makers import Darkening

from pipeline.camera.exposure import Camera
from pipeline.control.simulation import measured_surface as surface
from pipeline.control.simulation.views import View
from pipeline.datasets.frame import Box
from pipeline.detection.base import Detections
from pipeline.errors import InputError
from pipeline.streams import stream

RADIANCE = (np.kron(stream(1, "surface").random((16, 16)), np.ones((8, 8))) * 2).astype(np.float32)
DESIGN = surface.SurfaceDesign((0.0, 10.0, 20.0), (0.0, 7.0, 21.0), 0.5, 0.008)


def test_surface_gain_and_light_meet_noise_and_level():
    camera = Camera()
    light = surface.light_for_level(camera, RADIANCE, 0.5, 0.008)
    level = np.clip(camera.electrons(RADIANCE, 0.008, light) / camera.sensor.full_well_e, 0, 1)
    assert float((level ** (1 / 2.2)).mean()) == pytest.approx(0.5, abs=0.005)
    for sigma in (5.0, 20.0, 40.0):
        gain = surface.gain_for_sigma(camera, RADIANCE, light, 0.008, sigma)
        electrons = camera.electrons(RADIANCE, 0.008, light / gain)
        assert camera.sigma_dn(electrons, gain, 0.008) == pytest.approx(sigma, rel=0.1)
    assert surface.gain_for_sigma(camera, RADIANCE, light, 0.008, 0.0) == 1.0


def measured(score_falls=True):
    """Detections whose scores pass for fewer objects where noise and motion are stronger."""
    boxes = tuple(Box("car", 40 * k, 10, 40 * k + 30, 60) for k in range(6))
    view = View("evaluation-0000-0", "evaluation-0000", 0, None, boxes)
    parts = {"condition": [], "boxes": [], "score": [], "label": []}
    mtf = np.full((9, 2, 8), np.nan)
    for number in range(9):
        hits = max(0, 6 - number // 3 - 2 * (number % 3)) if score_falls else 6
        for k in range(hits):
            parts["condition"].append(number)
            parts["boxes"].append([40 * k, 10, 40 * k + 30, 60])
            parts["score"].append(0.9)
            parts["label"].append("car")
        mtf[number] = 0.95
    arrays = {name: np.asarray(value) for name, value in parts.items()}
    truth = np.repeat([1.0, 10.0, 20.0], 3)
    sigma = truth + np.array([0, 0.1, np.nan, 0.2, 0, 0, 0, -12.0, 0])  # one abstains, one is far off
    return [(view, {**arrays, "true_sigma": truth, "sigma": sigma, "mtf": mtf})]


def test_surface_through_measured_knots():
    result, table = surface.performance(measured(), DESIGN, judged_with(10), 0, 1)
    assert len(table) == 9 and table["estimates_abstained"].sum() == 1
    for row in table.itertuples():
        answer = float(result.expected(row.true_sigma_dn, row.motion_px).ap_percent)
        assert answer == pytest.approx(row.ap_percent, abs=4)
    # the monitor's estimates, one of which is far off, calibrate its answers
    np.testing.assert_allclose(result.true_sigma_dn([1.0, 10.0, 20.0]), [1.0, 10.0, 20.0], atol=0.3)
    assert float(result.expected(1.0, 0.0).ap_percent) > float(result.expected(15.0, 14.0).ap_percent)


@pytest.mark.parametrize("viewpoints", [1, 2, 4, 8])
def test_surface_knows_how_many_viewpoints_it_rests_on(viewpoints):
    """Its interval at a knot is that of the knot's score, which allows for few viewpoints."""
    (view, part), parts = measured()[0], []
    for number in range(viewpoints):
        name = f"evaluation-{number:04d}"
        kept = part["boxes"][:, 0] >= 40 * (number % 3)  # views differ
        hits = {key: part[key][kept] for key in ("condition", "boxes", "score", "label")}
        parts.append((replace(view, name=f"{name}-0", viewpoint=name), {**part, **hits}))
    result, table = surface.performance(parts, DESIGN, judged_with(200), 0, 1)
    assert result.surface.scenes == viewpoints
    low, high = result.surface.cells.interval(viewpoints)
    knots = table[table["motion_px"] == 0.0]
    np.testing.assert_allclose(low[:, -1], knots["low_percent"])
    np.testing.assert_allclose(high[:, -1], knots["high_percent"])
    sharp = result.expected(1.0, 0.0)
    assert np.isnan(sharp.low) == (viewpoints == 1)
    if viewpoints > 1:
        assert float(sharp.low) == pytest.approx(knots["low_percent"].iloc[0], abs=0.1)


def test_surface_refuses_impossible_designs():
    with pytest.raises(InputError, match="sizes_px"):
        surface.SurfaceDesign((0.0, 5.0), (3.0,), 0.5, 0.008)
    with pytest.raises(InputError, match="sizes_px: begins at 3; expected 0 first"):
        surface.SurfaceDesign((0.0, 5.0), (3.0, 7.0), 0.5, 0.008)
    with pytest.raises(InputError, match="no object"):
        part = measured()
        empty = View("a-0", "a", 0, None, ())
        surface.performance([(empty, part[0][1])], DESIGN, judged_with(5), 0, 1)


def test_surface_all_views_share_light_and_gain(tmp_path):
    """A view twice as bright as the others does not change the light; its noise level is that of the median view."""
    views = []
    for number, factor in enumerate((1.0, 1.0, 2.0)):
        path = tmp_path / f"view-{number}.radiance.npz"
        np.savez(path, radiance=(factor * RADIANCE).astype(np.float16))
        views.append(View(f"view-{number}-0", f"view-{number}", 0, path, ()))
    camera = Camera()
    shared = surface.exposures(views, camera, DESIGN)
    assert shared.light == pytest.approx(surface.light_for_level(camera, RADIANCE, 0.5, 0.008), rel=0.01)
    assert shared.gains[0] == 1.0 and list(shared.gains) == sorted(shared.gains)
    electrons = camera.electrons(RADIANCE, 0.008, shared.light / shared.gains[2])
    assert camera.sigma_dn(electrons, shared.gains[2], 0.008) == pytest.approx(20.0, rel=0.1)


def test_surface_levels_of_noise_differ_in_noise_not_in_brightness(tmp_path, monkeypatch):
    """The gain that makes noise is made up for by less light."""
    np.savez(tmp_path / "view.radiance.npz", radiance=RADIANCE.astype(np.float16))
    view, images = View("view-0", "view", 0, tmp_path / "view.radiance.npz", ()), []
    nothing = Detections.of(np.zeros((0, 4)), np.zeros(0), np.zeros(0, dtype=str))
    detector = SimpleNamespace(detect=lambda seen: images.extend(seen) or [nothing])
    monkeypatch.setattr(surface, "opened", lambda kind, options: detector)
    camera = Camera()
    shared = surface.Exposures(surface.light_for_level(camera, RADIANCE, 0.5, 0.008), (1.0, 4.0, 16.0))
    result = surface.measure(
        view, camera=camera, design=DESIGN, shared=shared, kind="", options="", estimate=False, seed=1
    )  # fmt: skip
    assert [image.mean() for image in images] == pytest.approx([0.5] * 9, abs=0.04)
    noise = result["true_sigma"].reshape(3, 3)
    assert (noise[1] > 1.5 * noise[0]).all() and (noise[2] > 1.5 * noise[1]).all()


def test_surface_knots_of_noise_rise_where_measured_ones_do_not():
    rising = surface._rising(np.array([[0.0, 2.0], [3.0, 1.9], [2.5, 4.0]]))
    assert (np.diff(rising, axis=0) > 0).all() and rising[1:].max() == 4.0
    assert rising[:, 0] == pytest.approx([0.05, 3.0, 3.05]) and rising[:, 1] == pytest.approx([2.0, 2.05, 4.0])


def test_surface_a_detector_in_place_leaves_the_monitor_its_frame(tmp_path, monkeypatch):
    np.savez(tmp_path / "view.radiance.npz", radiance=RADIANCE.astype(np.float16))
    view, images = View("view-0", "view", 0, tmp_path / "view.radiance.npz", ()), []
    condition = SimpleNamespace(sigma_dn=SimpleNamespace(value=0.0), mtf=SimpleNamespace(value=np.ones((2, 8))))
    monitor = SimpleNamespace(frame=lambda image: images.append(image) or condition)
    monkeypatch.setattr(surface, "opened", lambda kind, options: Darkening())
    monkeypatch.setattr(surface, "monitor", lambda: monitor)
    camera = Camera()
    shared = surface.Exposures(surface.light_for_level(camera, RADIANCE, 0.5, 0.008), (1.0, 4.0, 16.0))
    result = surface.measure(
        view, camera=camera, design=DESIGN, shared=shared, kind="mine", options="", estimate=True, seed=1
    )  # fmt: skip
    assert result["score"] == pytest.approx([image.mean() for image in images], rel=1e-6)
