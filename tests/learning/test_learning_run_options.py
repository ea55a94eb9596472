"""How a training runs: processes as there are workers, one line of progress for each row of the curve."""

import pytest

from pipeline.errors import InputError
from pipeline.learning.run_options import MOST_PRODUCERS, RunOptions, available

ROW = {"step": 100.0, "loss": 1.23456789, "error_percent": 20.0}


def test_samples_are_made_beside_the_training_where_there_are_two_workers(monkeypatch):
    alone, two = (RunOptions.reporting("mine", 500, workers) for workers in (1, 2))
    assert (alone.producers, two.producers) == (0, 1)
    assert alone.executor == {"workers": 1} and two.executor == {"workers": 2}
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1, 2})
    three = RunOptions.reporting("mine", 500, 0)
    assert three.executor == {"workers": 3} and three.producers == 2
    assert RunOptions.reporting("mine", 500, 64).producers == MOST_PRODUCERS


def test_a_gpu_that_is_not_there_is_refused_with_what_to_do(monkeypatch):
    monkeypatch.setattr("torch.cuda.device_count", lambda: 1)
    assert RunOptions.reporting("mine", 500, 2, "cuda").device == "cuda"
    assert [available(device) for device in ("cpu", "cuda:0")] == ["cpu", "cuda:0"]
    with pytest.raises(InputError, match=r"executor.device is 'cuda:1', but torch .* sees 1 CUDA devices; set it to"):
        RunOptions.reporting("mine", 500, 2, "cuda:1")


def test_progress_names_the_network_the_step_and_every_measure(capsys):
    RunOptions.reporting("mine", 500, 1).report(ROW)
    printed = capsys.readouterr()
    assert printed.err == "mine step 100 of 500: loss 1.235  error_percent 20\n" and not printed.out
