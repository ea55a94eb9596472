"""What matters in the training of the spectral network: one thing changed at a time, judged on the same samples.

A variant is the released network's training, shortened, with other banks, another recipe or a network of another form.
All variants are judged on the held-out samples of the released training (its pictures, kernels and noise), so a variant
that never saw noise is judged on noise too, and on further held-out samples that differ from them in one thing each.
Differences smaller than those between seeds are no differences.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from functools import partial
from typing import Any

from pipeline.blur.training.spectral import Form
from pipeline.learning.run_options import RunOptions
from pipeline.learning.settings import Recipe, Training

JUDGED = ("mtf_error_percent", "mtf_error_clean_percent", "mtf_error_noisy_percent", "sigma_error_dn")


def shortened(training: Training, steps: int) -> Training:
    """The same training in fewer steps, validated only at its end.

    Args:
        training: of the released network.
        steps: how many.
    """
    rhythm = max(steps // 10, 1)
    schedule = replace(
        training.schedule,
        steps=steps,
        warm_up=min(training.schedule.warm_up, max(steps // 8, 1)),
        ema_decay=min(training.schedule.ema_decay, 1 - 10 / max(steps, 20)),
        checkpoint_every=rhythm * max(steps // rhythm, 1),
        report_every=rhythm,
    )
    return replace(training, schedule=schedule)


def variant(training: Training, changes: Mapping[str, Any]) -> tuple[Training, Form]:
    """A training with some things changed, and the form of its network.

    Args:
        training: to start from.
        changes: fields of `Training`, of its recipe or of `Form`, by name; None leaves a field.
    """
    given = {name: value for name, value in changes.items() if value is not None}
    form = Form(**{field.name: given.pop(field.name) for field in fields(Form) if field.name in given})
    of_recipe = {field.name for field in fields(Recipe)}
    recipe = replace(training.recipe, **{name: given.pop(name) for name in sorted(of_recipe & given.keys())})
    return replace(training, recipe=recipe, **given), form


def evaluate(
    released: Training, changed: Training, form: Form, further: Mapping[str, Training], run_options: RunOptions
) -> dict[str, float]:
    """Train a variant and judge it on the held-out samples of the released training, and on others.

    Args:
        released: training whose held-out samples are used.
        changed: the variant.
        form: of its network.
        further: by name, trainings whose held-out samples are used beside them.
        run_options: how the variant's training runs.

    Returns:
        measures of `pipeline.blur.training.spectral.measure`, and ``mtf_error_NAME_percent`` of the further samples.
    """
    import torch

    from pipeline.blur.training.spectral import feature_arrays, measure, train
    from pipeline.learning.training import validation_samples

    trained = train(changed, run_options, form)
    here = replace(run_options, device="cpu")  # where the trained network is

    def judged(training: Training) -> dict[str, float]:
        with torch.no_grad():
            transform = partial(feature_arrays, block_px=form.block_px)
            return measure(trained.model, validation_samples(training, here, transform))

    result = judged(released)
    others = {f"mtf_error_{name}_percent": judged(training)["mtf_error_percent"] for name, training in further.items()}
    return {name: result[name] for name in JUDGED} | others
