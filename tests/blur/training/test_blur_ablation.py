"""Short trainings with one thing changed: what is changed, and that all are judged on the same samples."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import pytest

from pipeline.blur.training import ablation
from pipeline.blur.training.spectral import Form
from pipeline.learning.run_options import RunOptions
from pipeline.learning.settings import Recipe, Schedule, Training

RELEASED = Training(schedule=Schedule(24000, constant_lr_fraction=0.6, checkpoint_every=500, report_every=100))
TINY = Training(
    schedule=Schedule(4, warm_up=1, checkpoint_every=2, report_every=2),
    recipe=Recipe(views=2),
    images=4,
    validation_images=4,
    kernels=64,
    validation_chunks=2,
)


@pytest.mark.parametrize("steps", [2, 20, 37, 600])
def test_a_shortened_training_is_validated_at_its_end(steps: int) -> None:
    schedule = ablation.shortened(RELEASED, steps).schedule
    assert schedule.steps == steps
    assert schedule.warm_up < steps
    assert schedule.ema_decay < RELEASED.schedule.ema_decay
    assert schedule.rate(steps - 1) < 0.1 * schedule.learning_rate or steps < 20
    assert ablation.shortened(RELEASED, steps).recipe == RELEASED.recipe


def test_only_the_named_things_change() -> None:
    changed, form = ablation.variant(RELEASED, {"seed": 2, "clean_fraction": 1.0, "images": None})
    assert form == Form()
    before, after = asdict(RELEASED), asdict(changed)
    assert after.pop("seed") == 2
    before.pop("seed")
    assert after["recipe"].pop("clean_fraction") == 1.0
    assert before["recipe"].pop("clean_fraction") == 0.45
    assert after == before


def test_the_form_of_the_network_is_no_part_of_the_training() -> None:
    changed, form = ablation.variant(RELEASED, {"width": 0.5, "block_px": 96, "seed": None})
    assert changed == RELEASED and form == Form(0.5, 96)


def test_variants_are_judged_on_the_samples_of_the_released_training(tmp_path: Path) -> None:
    """A network trained on kernels and noise of its own sees the same held-out samples: seed 1's, with noise."""
    run_options = RunOptions(tmp_path)
    further = {"isotropic": ablation.variant(TINY, {"anisotropy": 0.0})[0]}
    plain = ablation.evaluate(TINY, TINY, Form(), further, run_options)
    noise_free, _ = ablation.variant(TINY, {"clean_fraction": 1.0, "pre_blur_noise_fraction": 0.0})
    other = ablation.evaluate(TINY, noise_free, Form(), further, run_options)
    again = ablation.evaluate(TINY, TINY, Form(), further, run_options)
    assert plain == again
    assert set(plain) == {*ablation.JUDGED, "mtf_error_isotropic_percent"}
    assert plain["mtf_error_noisy_percent"] != other["mtf_error_noisy_percent"]
    assert plain["mtf_error_isotropic_percent"] != plain["mtf_error_percent"]
    assert all(0 < value < 60 for value in plain.values())


def test_a_network_of_another_form_has_a_checkpoint_of_its_own(tmp_path: Path) -> None:
    run_options = RunOptions(tmp_path)
    results = [ablation.evaluate(TINY, TINY, form, {}, run_options) for form in (Form(), Form(0.5), Form(1.0, 96))]
    assert len({result["mtf_error_percent"] for result in results}) == 3
