"""Stage `train_mtf`: trains one blur network from scratch on procedural pictures; released weights, learning curve."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

PROGRAMS = {"spectral": "pipeline.blur.spectral_training", "cnn": "pipeline.blur.cnn_training"}


@stage("train_mtf", reads=["seed", "train.mtf.{network}"], job=["network"])
def run(run: Run) -> None:
    """Train, write weights, learning curve and metrics; goes on from its checkpoint if it was interrupted."""
    import importlib

    from pipeline import training_record
    from pipeline.learning.conduct import Conduct
    from pipeline.learning.fitting import final_measures
    from pipeline.learning.training import Training

    name = run.job["network"]
    program = importlib.import_module(PROGRAMS[name])
    training = Training.from_section(run.params.train.mtf[name], run.params.seed)

    trained = program.train(training, Conduct.reported(name, training.schedule.steps, run.executor.workers))
    program.save(run.outputs / f"data/weights/mtf_{name}.safetensors", trained, training)
    training_record.write(run.outputs, f"mtf_{name}", trained.curve, final_measures(trained))


if __name__ == "__main__":
    run()
