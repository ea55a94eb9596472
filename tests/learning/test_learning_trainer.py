"""The loop: it learns, resumes to the bit, keeps the best, refuses checkpoints of another training."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from pydantic import ValidationError

from pipeline.errors import InputError
from pipeline.learning import weights
from pipeline.learning.chunk_loader import ChunkLoader
from pipeline.learning.initial import initialise
from pipeline.learning.settings import Schedule
from pipeline.learning.trainer import CHECKPOINT, train
from pipeline.streams import stream

SCHEDULE = Schedule(60, learning_rate=0.02, warm_up=5, checkpoint_every=20, report_every=10)
TRUTH = np.array([1.0, -2.0, 0.5, 3.0], np.float32)


def lines(number):
    """Points of a linear law."""
    x = stream(1, "points", number).standard_normal((16, 4)).astype(np.float32)
    return {"x": x, "y": x @ TRUTH}


def network(seed=1):
    made = torch.nn.Sequential(torch.nn.Linear(4, 8), torch.nn.Tanh(), torch.nn.Linear(8, 1))
    initialise(made, seed, "test")
    return made


def loss(model, batch):
    error = model(batch["x"])[:, 0] - batch["y"]
    return error.square().mean(), {"error": float(error.detach().abs().mean())}


def loader():
    return ChunkLoader(lines, 1, replays=2, replay_window=8, producers=0)


def run(schedule=SCHEDULE, seed=1, **options):
    return train(network(seed), loss, loader(), schedule, **options)


def weights_of(trained):
    return torch.cat([value.flatten() for value in trained.model.state_dict().values()])


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU that torch sees")
def test_on_a_gpu_it_ends_near_the_same_weights_and_resumes(tmp_path):
    options = {"validate": lambda model: {"first": float(next(model.parameters()).detach().sum())}, "score": "first"}
    here, there = run(**options), run(device="cuda", **options)
    run(device="cuda", folder=tmp_path, stop_after=33, **options)
    resumed = run(device="cuda", folder=tmp_path, **options)
    assert {value.device.type for value in there.model.state_dict().values()} == {"cpu"}
    assert torch.allclose(weights_of(here), weights_of(there), atol=1e-3)
    assert torch.allclose(weights_of(resumed), weights_of(there), atol=1e-3)
    assert (here.device, there.device) == ("cpu", "cuda")


def test_it_learns_and_records():
    trained = run(replace(SCHEDULE, steps=150))
    assert trained.curve[-1]["error"] < 0.3 * trained.curve[0]["error"]
    assert [row["step"] for row in trained.curve] == list(range(10, 151, 10))
    assert trained.best_step == 150


def test_rows_of_a_prolonged_training_are_means_over_their_steps(tmp_path):
    """A row ends the first length, 25 steps, between those of every tenth step; 33 is a stop, which adds none."""

    def steady(model, batch):
        value, _ = loss(model, batch)
        return value * 0 + 3.0, {"constant": 1.0}

    schedule = replace(SCHEDULE, steps=25, final_lr_ratio=1.0)
    for longer, stop in ((schedule, None), (replace(schedule, steps=50), 33), (replace(schedule, steps=50), None)):
        trained = train(network(), steady, loader(), longer, folder=tmp_path, stop_after=stop)
    assert [row["step"] for row in trained.curve] == [10, 20, 25, 30, 40, 50]
    assert {(row["loss"], row["constant"]) for row in trained.curve} == {(3.0, 1.0)}


def test_measures_may_stay_where_they_were_computed(tmp_path):
    """A loss that gives tensors has the curve and the checkpoint of one that gives numbers."""

    def unread(model, batch):
        error = model(batch["x"])[:, 0] - batch["y"]
        return error.square().mean(), {"error": error.detach().abs().mean()}

    numbers = run(folder=tmp_path / "numbers")
    tensors = train(network(), unread, loader(), SCHEDULE, folder=tmp_path / "tensors", stop_after=33)
    tensors = train(network(), unread, loader(), SCHEDULE, folder=tmp_path / "tensors")
    assert tensors.curve == numbers.curve and torch.equal(weights_of(tensors), weights_of(numbers))
    kept = [(tmp_path / name / CHECKPOINT).read_bytes() for name in ("numbers", "tensors")]
    assert kept[0] == kept[1]


@pytest.mark.parametrize("stop_after", [None, 33])
def test_without_an_average_the_weights_are_the_networks_own(stop_after):
    schedule, validated = replace(SCHEDULE, ema_decay=0.0), []
    model = network()

    def validate(averaged):
        validated.append(torch.cat([value.flatten().clone() for value in averaged.parameters()]))
        return {}

    trained = train(model, loss, loader(), schedule, validate=validate, stop_after=stop_after)
    assert len(validated) == (3 if stop_after is None else 1) and not torch.equal(validated[0], weights_of(trained))
    stopped_early = train(network(), loss, loader(), schedule, stop_after=20)
    assert torch.equal(validated[0], weights_of(stopped_early))
    if stop_after is None:
        assert torch.equal(validated[-1], weights_of(trained))


@pytest.mark.parametrize("optimiser", ["adamw", "adam"])
def test_an_interrupted_run_ends_the_same_to_the_bit(tmp_path, optimiser):
    schedule = replace(SCHEDULE, optimiser=optimiser)
    options = {"validate": lambda model: {"first": float(next(model.parameters()).detach().sum())}, "score": "first"}
    whole = run(schedule, **options)
    for stop in (13, 40, 47):
        run(schedule, folder=tmp_path, stop_after=stop, **options)
    resumed = run(schedule, folder=tmp_path, **options)
    assert torch.equal(weights_of(whole), weights_of(resumed))
    assert whole.curve == resumed.curve and whole.best_step == resumed.best_step


@pytest.mark.parametrize("optimiser", ["adamw", "adam"])
def test_moments_stay_with_their_weights_where_those_are_channels_last(tmp_path, optimiser):
    """Files hold tensors row by row: read back as they are, a fused optimiser gives weights the moments of others."""

    def trained(**options):
        model = torch.nn.Sequential(torch.nn.Conv2d(4, 6, 3), torch.nn.Tanh(), torch.nn.Conv2d(6, 2, 2))
        initialise(model, 1, "test")
        batches = ChunkLoader(pictures, 1, replays=1, replay_window=8, producers=0)
        schedule = Schedule(8, 0.02, optimiser=optimiser, checkpoint_every=4, report_every=4)
        return train(model.to(memory_format=torch.channels_last), error, batches, schedule, **options)

    def pictures(number):
        return {"x": stream(1, "pictures", number).standard_normal((3, 4, 6, 6)).astype(np.float32)}

    def error(model, batch):
        return (model(batch["x"]) - 1).square().mean(), {}

    trained(folder=tmp_path, stop_after=3)
    assert torch.equal(weights_of(trained(folder=tmp_path)), weights_of(trained()))


def test_a_run_killed_between_checkpoints_ends_the_same(tmp_path):
    def dying(model, batch):
        dying.calls += 1
        if dying.calls == 35:
            raise KeyboardInterrupt
        return loss(model, batch)

    dying.calls = 0
    with pytest.raises(KeyboardInterrupt):
        train(network(), dying, loader(), SCHEDULE, folder=tmp_path)
    assert torch.equal(weights_of(run(folder=tmp_path)), weights_of(run()))


def test_a_finished_run_is_not_repeated(tmp_path):
    first = run(folder=tmp_path)
    again = train(network(), None, loader(), SCHEDULE, folder=tmp_path)
    assert torch.equal(weights_of(first), weights_of(again))


def test_the_best_validated_weights_are_kept():
    scores = iter([3.0, 1.0, 2.0])
    trained = run(validate=lambda model: {"score": next(scores)}, score="score")
    assert trained.best_step == 40
    assert [row["validation_score"] for row in trained.curve if "validation_score" in row] == [3.0, 1.0, 2.0]
    stopped = run(replace(SCHEDULE, constant_lr_fraction=0.0), stop_after=40)
    assert torch.equal(weights_of(trained), weights_of(stopped))


def test_the_best_weights_of_before_a_stop_are_kept_where_none_after_it_are_better(tmp_path):
    options = {"folder": tmp_path, "score": "score"}
    run(validate=lambda model: {"score": 1.0}, stop_after=30, **options)
    trained = run(validate=lambda model: {"score": 2.0}, **options)
    assert trained.best_step == 20 and torch.equal(weights_of(trained), weights_of(run(stop_after=20)))


def test_the_average_of_the_first_step_is_nine_tenths_its_own():
    """Else a training shorter than the average would end near its initial weights."""
    initial = torch.cat([value.flatten() for value in network().state_dict().values()])
    first = weights_of(run(replace(SCHEDULE, ema_decay=0.0), stop_after=1))
    averaged = weights_of(run(replace(SCHEDULE, ema_decay=0.998), stop_after=1))
    assert torch.allclose(averaged - initial, 0.9 * (first - initial), atol=1e-6)


def test_a_gradient_is_no_longer_than_its_greatest_norm():
    """Clipped far below the optimiser's epsilon it moves next to nothing."""
    schedule = replace(SCHEDULE, weight_decay=0.0, ema_decay=0.0)
    initial = torch.cat([value.flatten() for value in network().state_dict().values()])
    moved, clipped = (
        float((weights_of(run(replace(schedule, max_grad_norm=norm), stop_after=5)) - initial).abs().max())
        for norm in (None, 1e-12)
    )
    assert clipped < 1e-3 * moved


@pytest.mark.parametrize("first_bad", [21, 25, 30])
@pytest.mark.parametrize("stop_after", [None, 35])
def test_a_training_that_diverges_is_an_error_and_keeps_the_last_good_checkpoint(tmp_path, first_bad, stop_after):
    """Ended as if it had succeeded, with weights that are NaN."""

    def diverging(model, batch):
        value, measures = loss(model, batch)
        diverging.calls += 1
        return (value * float("nan") if diverging.calls >= first_bad else value), measures

    diverging.calls = 0
    with pytest.raises(InputError, match=r"the loss is not finite at step 30; lower schedule\.learning_rate"):
        train(network(), diverging, loader(), SCHEDULE, folder=tmp_path, stop_after=stop_after)
    run(folder=tmp_path / "good", stop_after=20)
    assert (tmp_path / CHECKPOINT).read_bytes() == (tmp_path / "good" / CHECKPOINT).read_bytes()
    assert torch.equal(weights_of(run(folder=tmp_path)), weights_of(run()))


def test_a_training_stopped_as_it_diverges_keeps_no_checkpoint(tmp_path):
    def diverging(model, batch):
        return loss(model, batch)[0] * float("inf"), {}

    with pytest.raises(InputError, match="the loss is not finite at step 3;"):
        train(network(), diverging, loader(), SCHEDULE, folder=tmp_path, stop_after=3)
    assert not list(tmp_path.iterdir())


def test_a_score_that_is_not_finite_is_an_error(tmp_path):
    """No comparison finds it smaller, so that the weights of the last step were taken."""
    scores = iter([3.0, float("nan")])
    with pytest.raises(InputError, match="the validation's error is not finite at step 40; lower"):
        run(folder=tmp_path, validate=lambda model: {"error": next(scores)}, score="error")
    assert weights.details(tmp_path / CHECKPOINT)["step"] == 20


def test_weights_that_are_not_finite_are_not_kept(tmp_path):
    """The loss is of the weights before the step, which may be the last one."""

    def steep(model, batch):
        value, measures = loss(model, batch)
        steep.calls += 1
        return (value + (value - value.detach()).sqrt() if steep.calls == 20 else value), measures

    steep.calls = 0
    with pytest.raises(InputError, match=r"checkpoint\.safetensors: tensor 'model\..*' holds values that are NaN"):
        train(network(), steep, loader(), SCHEDULE, folder=tmp_path)
    assert not list(tmp_path.iterdir())


def test_length_may_change_while_the_rate_is_held(tmp_path):
    held = replace(SCHEDULE, constant_lr_fraction=0.5)
    run(replace(held, steps=200), folder=tmp_path, stop_after=30)
    assert torch.equal(weights_of(run(held, folder=tmp_path)), weights_of(run(held)))
    run(replace(held, steps=200), folder=tmp_path / "late", stop_after=40)
    with pytest.raises(InputError, match="another schedule"):
        run(held, folder=tmp_path / "late")


def test_length_may_change_where_the_rate_never_falls(tmp_path):
    even = replace(SCHEDULE, constant_lr_fraction=0.0, final_lr_ratio=1.0)
    run(replace(even, steps=200), folder=tmp_path, stop_after=40)
    assert torch.equal(
        weights_of(run(replace(even, steps=80), folder=tmp_path)), weights_of(run(replace(even, steps=80)))
    )
    with pytest.raises(InputError, match="another schedule"):  # it is past that end
        run(replace(even, steps=40), folder=tmp_path)


def test_checkpoints_of_another_training_are_refused(tmp_path):
    run(folder=tmp_path, stop_after=20)
    with pytest.raises(InputError, match="another schedule"):
        run(replace(SCHEDULE, learning_rate=0.5), folder=tmp_path)
    with pytest.raises(InputError, match="another network"):
        train(torch.nn.Linear(4, 1), loss, loader(), SCHEDULE, folder=tmp_path)
    path = tmp_path / CHECKPOINT
    whole = path.read_bytes()
    changed = whole[:-1] + bytes([whole[-1] ^ 1])
    for content in (b"", whole[:-40], changed):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"safetensors: [^;]*; delete its folder to begin anew$"):
            run(folder=tmp_path)


def test_the_rate_warms_up_holds_and_falls():
    schedule = Schedule(100, learning_rate=1.0, warm_up=10, constant_lr_fraction=0.5, final_lr_ratio=0.01)
    rates = [schedule.rate(step) for step in range(100)]
    assert rates[0] == pytest.approx(0.1) and rates[10:51] == [1.0] * 41
    assert all(a > b for a, b in itertools.pairwise(rates[50:])) and rates[-1] < 0.02
    assert Schedule(100, final_lr_ratio=1.0, warm_up=1).rate(70) == 2e-3


@pytest.mark.parametrize("wrong", [{"steps": 0}, {"constant_lr_fraction": 1.0}, {"checkpoint_every": 15}])
def test_impossible_schedules_are_refused(wrong):
    with pytest.raises(ValidationError, match=next(iter(wrong))):
        replace(SCHEDULE, **wrong)


@pytest.mark.parametrize("rule", ["torch", "glorot"])
def test_initial_weights_are_named_draws(rule):
    one, two = network(), network()
    initialise(one, 3, "a", rule)
    initialise(two, 3, "a", rule)
    assert torch.equal(one[0].weight, two[0].weight)
    initialise(two, 3, "b", rule)
    assert not torch.equal(one[0].weight, two[0].weight)
    bound = 0.5 if rule == "torch" else (6 / 12) ** 0.5
    assert 0.8 * bound < float(one[0].weight.detach().abs().max()) <= bound
