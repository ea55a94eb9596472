"""Stage `train_sigma_correlated`: trains the network for correlated noise; released weights, learning curve."""

from __future__ import annotations

from pipeline.config.entry import Run, stage


@stage("train_sigma_correlated", reads=["train.sigma_correlated"])
def run(run: Run) -> None:
    """Train, write weights, learning curve and metrics; goes on from its checkpoint if it was interrupted."""
    from pipeline.learning import training_record
    from pipeline.learning.fitting import final_measures
    from pipeline.learning.run_options import RunOptions
    from pipeline.noise.settings import CorrelatedTraining
    from pipeline.noise.training import correlated as correlated_training

    settings: CorrelatedTraining = run.params.train.sigma_correlated
    run_options = RunOptions.reporting("correlated", settings.schedule.steps, run.executor.workers, run.executor.device)
    trained = correlated_training.train(settings, run_options)
    path = run.outputs / "data/weights/sigma_correlated.safetensors"
    correlated_training.save(path, trained, settings, released=run.released)
    training_record.write(run.outputs, "sigma_correlated", trained.curve, final_measures(trained))


if __name__ == "__main__":
    run()
