"""The order study: conditions, truth by closed form, one row per condition."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from plug_in_makers import Darkening

from pipeline.camera import mtf, psf
from pipeline.camera.settings import CameraSettings
from pipeline.datasets.frame import Box, Frame
from pipeline.detection.average_precision import MeanResult
from pipeline.detection.base import Detections
from pipeline.detection.classes import CLASS_MAPS, ClassMap
from pipeline.experiments import order_study
from pipeline.store import write_image
from pipeline.streams import stream

JUDGE = SimpleNamespace(
    rule="paper", iou_threshold=0.5, min_height_px=25.0, min_visible_fraction=0.3, bootstrap_draws=10
)


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


def test_order_study_motion_is_judged_beside_the_camera_s_own_blur(frame, monkeypatch):
    """An estimator that reads the whole system exactly, of which the sharp frame passes half, has no error."""
    kernel = mtf.sample(psf.create("linear_motion", 11))
    answers = [np.full((2, 8), 0.5), np.full((2, 8), 0.5), 0.5 * kernel]
    monitor = SimpleNamespace(
        frame=lambda image: SimpleNamespace(
            mtf=SimpleNamespace(value=answers.pop(0)), sigma_dn=SimpleNamespace(value=0.0)
        )
    )
    nothing = Detections.of(np.zeros((0, 4)), np.zeros(0), np.zeros(0, dtype=str))
    detector = SimpleNamespace(detect=lambda images: [nothing])
    monkeypatch.setattr(order_study, "_opened", lambda kind, options: (monitor, detector))
    chosen = [one for one in order_study.conditions([0, 11], [5]) if (one.order, one.light) == ("detector", "encoded")]
    entries = order_study.measure(frame, chosen=chosen, camera=CameraSettings(), kind="", options="{}", seed=1)
    assert [entry["amae_percent"] for entry in entries] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_order_study_a_detector_in_place_leaves_the_image_as_it_was(frame, monkeypatch):
    images = []
    condition = SimpleNamespace(mtf=SimpleNamespace(value=np.ones((2, 8))), sigma_dn=SimpleNamespace(value=0.0))
    monitor = SimpleNamespace(frame=lambda image: images.append(image) or condition)
    monkeypatch.setattr(order_study, "_opened", lambda kind, options: (monitor, Darkening()))
    chosen = order_study.conditions([0], [5])
    entries = order_study.measure(frame, chosen=chosen, camera=CameraSettings(), kind="mine", options="{}", seed=1)
    means = [image.mean() for image in images[1:]]  # the first is the sharp frame
    assert [float(entry["score"][0]) for entry in entries] == pytest.approx(means, rel=1e-6)


def test_order_study_noise_behind_the_optics_keeps_its_level(frame):
    """The paper's order blurs its own noise away: of 15 DN behind 11 px of motion about 15 / sqrt(11) are left."""
    chosen = [one for one in order_study.conditions([11], [15]) if one.light == "encoded"]
    results = [order_study.measure(frame, chosen=chosen, camera=CameraSettings(), kind="compact", options="{}", seed=1)]
    scores = order_study.precisions([frame], results, chosen, CLASS_MAPS["sim"], JUDGE, 1)
    table = order_study.Study(results, chosen, scores, 1).table().set_index("order")
    assert table.loc["detector", "clipped_sigma_dn"] == pytest.approx(15, rel=0.05)
    assert table.loc["paper", "clipped_sigma_dn"] == pytest.approx(15 / np.sqrt(11), rel=0.1)
    assert (table["frames"] == 1).all() and table["ap_percent"].between(0, 100).all()


def test_a_second_class_that_is_found_alike_leaves_the_interval_of_precision_as_it_is(tmp_path):
    """Cars and persons in the same boxes, found in the same frames: their mean is as certain as either."""
    chosen, corners = order_study.conditions([0], [5]), [(40 * left, 0, 40 * left + 30, 30) for left in range(5)]
    frames, measured = [], []
    for number in range(24):
        hit = stream(1, "alike", number).random(5) < (0.2 if number % 2 else 0.9)
        boxes, score = np.array(corners, float)[hit], np.linspace(0.9, 0.5, 5)[hit]
        words = [Box(label, *box) for label in ("car", "person") for box in corners]
        frames.append(Frame("sim", f"evaluation-{number:04}-3", tmp_path / f"{number}.png", tuple(words)))
        labels = ["car"] * hit.sum() + ["person"] * hit.sum()
        measured.append([{"boxes": np.tile(boxes, (2, 1)), "score": np.tile(score, 2), "label": labels}] * len(chosen))
    judge = SimpleNamespace(**{**vars(JUDGE), "bootstrap_draws": 300})
    both = order_study.precisions(frames, measured, chosen, CLASS_MAPS["sim"], judge, 1)
    car = order_study.precisions(frames, measured, chosen, ClassMap({"car": "car"}), judge, 1)
    for mean, alone in zip(both, car, strict=True):
        assert mean.ap_percent == pytest.approx(alone.ap_percent) and np.ptp(alone.draws) > 10
        np.testing.assert_allclose(mean.draws, alone.draws)


def _made(amae_of, ap_of, frames=6):
    """Estimates and scores from formulas of (order, motion, sigma), frames with offsets of their own."""
    chosen = order_study.conditions([0, 11, 21], [5, 15])
    offset = np.linspace(-4, 4, frames)
    results = [[{"amae_percent": amae_of(one) + shift} for one in chosen] for shift in offset]
    draws = np.linspace(-20, 20, 50)
    return results, chosen, [MeanResult(ap_of(one), ap_of(one) + draws, 8, 8) for one in chosen]


def test_effects_are_paired_so_that_differences_between_frames_do_not_widen_them():
    result, chosen, scores = _made(lambda one: one.sigma_dn / 5, lambda one: 90 - one.motion_px - one.sigma_dn)
    table = order_study.Study(result, chosen, scores, 1).effects().set_index(["order", "light", "cause", "measure"])
    assert len(table) == 16
    noise = table.loc[("detector", "linear", "noise", "amae_percent")]
    assert (noise["change"], noise["low"], noise["high"]) == pytest.approx((2.0, 2.0, 2.0))
    motion = table.loc[("paper", "encoded", "motion", "ap_percent")]
    assert (motion["before"], motion["after"]) == pytest.approx((85.0, 64.0))
    assert (motion["low"], motion["high"]) == pytest.approx((-21.0, -21.0))


def test_abstentions_do_not_make_an_effect():
    """No noise changes the AMAE; under the strongest, the hard frames and the longest motion have no estimate."""
    result, chosen, scores = _made(lambda one: one.motion_px, lambda one: 50.0)
    for entries in result[3:]:
        for entry, one in zip(entries, chosen, strict=True):
            if one.sigma_dn == 15:
                entry["amae_percent"] = np.nan
    for entry, one in zip(result[0], chosen, strict=True):
        if (one.sigma_dn, one.motion_px) == (15, 21):
            entry["amae_percent"] = np.nan
    table = order_study.Study(result, chosen, scores, 1).effects().set_index(["order", "light", "cause", "measure"])
    noise = table.loc[("paper", "linear", "noise", "amae_percent")]
    assert (noise["change"], noise["low"], noise["high"]) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    motions, offsets = np.array([[11, np.nan], [11, 21], [11, 21]]), np.array([-4, -2.4, -0.8])
    assert noise["before"] == noise["after"] == pytest.approx(np.mean(np.nanmean(motions, axis=1) + offsets))
    for entries in result:
        for entry in entries:
            entry["amae_percent"] = np.nan
    unknown = order_study.Study(result, chosen, scores, 1).effects()
    unknown = unknown[unknown["measure"] == "amae_percent"]
    assert len(unknown) and unknown[["before", "after", "change", "low", "high"]].isna().all(axis=None)


def test_the_interval_of_an_effect_on_precision_leans_as_its_resamples_do():
    """Resamples in which the loss is greater are far out, those in which it is smaller are near."""
    result, chosen, scores = _made(lambda one: 1.0, lambda one: 90 - one.motion_px)
    skewed = stream(1, "skewed").exponential(4.0, 2000)
    scores = [
        MeanResult(score.ap_percent, score.ap_percent - skewed * (one.motion_px == 21), 8, 8)
        for score, one in zip(scores, chosen, strict=True)
    ]
    table = order_study.Study(result, chosen, scores, 1).effects().set_index(["order", "light", "cause", "measure"])
    motion = table.loc[("paper", "encoded", "motion", "ap_percent")]
    assert motion["change"] == pytest.approx(-21)
    assert motion["change"] - motion["low"] > 2 * (motion["high"] - motion["change"]) > 0


def test_effects_of_one_noise_level_are_not_stated():
    chosen = order_study.conditions([0, 11], [15])
    result = [[{"amae_percent": 3.0} for _ in chosen]] * 2
    scores = [MeanResult(50.0, np.full(5, 50.0), 8, 8) for _ in chosen]
    assert set(order_study.Study(result, chosen, scores, 1).effects()["cause"]) == {"motion"}
