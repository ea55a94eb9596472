"""How a training runs: processes as there are workers, one line of progress for each row of the curve."""

from pipeline.learning.run_options import RunOptions

ROW = {"step": 100.0, "loss": 1.23456789, "error_percent": 20.0}


def test_samples_are_made_beside_the_training_where_there_are_two_workers(monkeypatch):
    alone, two = (RunOptions.reporting("mine", 500, workers) for workers in (1, 2))
    assert (alone.producers, two.producers) == (0, 1)
    assert alone.executor == {"workers": 1} and two.executor == {"workers": 2}
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1, 2})
    assert RunOptions.reporting("mine", 500, 0).executor == {"workers": 3}


def test_progress_names_the_network_the_step_and_every_measure(capsys):
    RunOptions.reporting("mine", 500, 1).report(ROW)
    printed = capsys.readouterr()
    assert printed.err == "mine step 100 of 500: loss 1.235  error_percent 20\n" and not printed.out
