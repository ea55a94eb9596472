"""Stage `train_sigma`: trains one noise network on procedural pictures; released weights, learning curve."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

USES = {"pipeline.noise.training.sensor_noise": ["{network}"]}


@stage("train_sigma", reads=["train.sigma.{network}"], job=["network"], uses=USES)
def run(run: Run) -> None:
    """Train, write weights, learning curve and metrics; goes on from its checkpoint if it was interrupted."""
    from pipeline.learning import training_record
    from pipeline.learning.fitting import final_measures
    from pipeline.learning.run_options import RunOptions
    from pipeline.noise.settings import SigmaTraining
    from pipeline.noise.training import sensor_noise as training

    name = run.job["network"]
    settings: SigmaTraining = run.params.train.sigma[name]

    run_options = RunOptions.reporting(name, settings.schedule.steps, run.executor.workers, run.executor.device)
    trained = training.train(settings, run_options)
    training.save(run.outputs / f"data/weights/sigma_{name}.safetensors", trained, settings, released=run.released)
    training_record.write(run.outputs, f"sigma_{name}", trained.curve, final_measures(trained))


if __name__ == "__main__":
    run()
