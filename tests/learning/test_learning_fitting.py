"""What all trainings share: settings by name, a fingerprint of them and the code, checkpoints, the weight file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from pydantic import TypeAdapter, ValidationError

from pipeline.learning import fitting, weights
from pipeline.learning.initial import initialise
from pipeline.learning.run_options import RunOptions
from pipeline.learning.settings import LoopSettings, Schedule
from pipeline.learning.trainer import CHECKPOINT, Trained
from pipeline.streams import stream

CODE = "pipeline.learning.trainer"
TRUTH = np.array([1.0, -2.0], np.float32)


SMALL = LoopSettings(
    schedule=Schedule(12, learning_rate=0.02, warm_up=2, checkpoint_every=4, report_every=2), replay_window=4
)


def lines(number):
    """Points of a linear law."""
    x = stream(1, "points", number).standard_normal((8, 2)).astype(np.float32)
    return {"x": x, "y": x @ TRUTH}


def loss(model, batch):
    return (model(batch["x"])[:, 0] - batch["y"]).square().mean(), {}


def run(run_options, settings=SMALL, code=CODE):
    model = torch.nn.Linear(2, 1)
    initialise(model, settings.seed, "test")
    data = fitting.held_out(lines, 2)
    validate = lambda network: {"error": float(loss(network, data)[0])}  # noqa: E731
    return fitting.fit(
        model, loss, lines, settings, run_options, name="line", code=code, validate=validate, score="error"
    )


def test_settings_are_checked_wherever_they_are_made():
    read = TypeAdapter(LoopSettings).validate_python
    made = read({"schedule": {"steps": 7, "betas": [0.8, 0.9]}, "replay_window": 5, "seed": 9})
    assert made == LoopSettings(schedule=Schedule(7, betas=(0.8, 0.9)), replay_window=5, seed=9)
    assert hash(made) == hash(replace(made))
    with pytest.raises(ValidationError, match="tempo"):
        read({"schedule": {"steps": 7, "tempo": 1}})
    with pytest.raises(ValidationError, match="steps"):
        Schedule(steps=0)


def test_the_fingerprint_follows_settings_and_code():
    one = fitting.fingerprint(SMALL, CODE)
    assert one == fitting.fingerprint(replace(SMALL), CODE)
    assert one != fitting.fingerprint(replace(SMALL, replay_window=5), CODE)
    assert one != fitting.fingerprint(SMALL, "pipeline.learning.chunk_loader")


def test_the_code_of_a_training_is_what_it_executes_and_not_the_other_networks():
    from pipeline.dependencies.closure import closure
    from pipeline.detection.compact import training as compact

    codes = {
        "pipeline.blur.training.spectral": ("pipeline.blur.training.spectral", "blur/cnn_net"),
        "pipeline.blur.training.cnn": ("pipeline.blur.training.cnn", "blur/spectral_net"),
        "pipeline.noise.training.cellwise": ("pipeline.noise.training.cellwise", "noise/cnn_net"),
        "pipeline.noise.training.cnn": ("pipeline.noise.training.cnn", "noise/cellwise_net"),
        "pipeline.detection.compact.training": (compact.code("compact"), "compact/two_stage"),
    }
    for module, (code, other) in codes.items():
        files = closure(code)
        assert f"{module.replace('.', '/')}.py" in files
        assert f"pipeline/{other}.py" not in files
        assert "pipeline/learning/trainer.py" in files and "pipeline/streams.py" in files


def test_held_out_samples_are_all_chunks_in_order():
    data = fitting.held_out(lines, 3)
    expected = np.concatenate([lines(number)["x"] for number in range(3)])
    assert set(data) == {"x", "y"} and np.array_equal(data["x"].numpy(), expected)


def test_checkpoints_lie_under_the_fingerprint_or_where_they_are_wanted(tmp_path):
    run(RunOptions(tmp_path))
    assert (tmp_path / f"line-{fitting.fingerprint(SMALL, CODE)}" / CHECKPOINT).is_file()
    run(RunOptions(tmp_path, tmp_path / "mine"))
    assert (tmp_path / "mine" / CHECKPOINT).is_file()
    run(RunOptions(tmp_path), replace(SMALL, seed=2))
    assert len(list(tmp_path.iterdir())) == 3


def test_how_it_runs_makes_no_difference(tmp_path):
    rows = []
    whole = run(RunOptions(tmp_path, tmp_path / "whole", report=rows.append))
    run(RunOptions(tmp_path, tmp_path / "parts", stop_after=5))
    for other in (
        run(RunOptions(tmp_path, tmp_path / "parts")),
        run(RunOptions(tmp_path, tmp_path / "two", producers=1)),
    ):
        assert other.curve == whole.curve == rows
        assert torch.equal(other.model.weight, whole.model.weight) and torch.equal(other.model.bias, whole.model.bias)
    assert rows[-1]["validation_error"] < rows[1]["validation_error"]


def test_all_settings_of_the_feed_are_used(tmp_path):
    changes = [{}, {"new_chunks_per_step": 2}, {"replays": 3}, {"replay_window": 1}]
    ends = [run(RunOptions(tmp_path), replace(SMALL, **change)).model.weight.tolist() for change in changes]
    assert len({str(end) for end in ends}) == len(changes)


def test_a_weight_file_says_what_it_is(tmp_path):
    curve = [{"step": 2.0, "loss": 3.0}, {"step": 4.0, "loss": 1.5}, {"step": 6.0, "loss": 2.5}]
    trained = Trained(torch.nn.Linear(2, 1), curve, best_step=4)
    path = Path(tmp_path / "line.safetensors")
    fitting.save(path, trained, SMALL, architecture="line-1", code=CODE, slope=2)
    tensors, header = weights.load(path, "line-1")
    assert torch.equal(tensors["weight"], trained.model.weight)
    assert header["settings"]["schedule"]["steps"] == 12 and header["settings"]["replay_window"] == 4
    assert header["fingerprint"] == fitting.fingerprint(SMALL, CODE)
    assert header["step"] == 4 and header["measures"] == curve[1] == fitting.final_measures(trained)
    assert header["slope"] == 2
    half = {"weight": trained.model.weight.half()}
    fitting.save(path, trained, SMALL, architecture="line-1", code=CODE, tensors=half, measures={"loss": 1.0})
    tensors, header = weights.load(path, "line-1")
    assert list(tensors) == ["weight"] and tensors["weight"].dtype == torch.float16
    assert header["measures"] == {"loss": 1.0}


def test_a_curve_without_the_chosen_step_has_no_final_measures():
    assert fitting.final_measures(Trained(torch.nn.Linear(2, 1), [{"step": 2.0, "loss": 3.0}], best_step=3)) == {}
