"""Stage `train_detector`: trains one compact detector on *Sim* from scratch; released weights, learning curve."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

USES = {"pipeline.detection.compact": ["{network}"]}


@stage("train_detector", reads=["train.detector.{network}"], job=["network"], uses=USES)
def run(run: Run) -> None:
    """Render, train, write weights, learning curve and metrics; goes on from its checkpoint if it was interrupted."""
    from pipeline import processor
    from pipeline.detection.settings import DetectorTraining
    from pipeline.learning import training_record
    from pipeline.learning.fitting import final_measures
    from pipeline.learning.run_options import RunOptions

    name = run.job["network"]
    settings: DetectorTraining = run.params.train.detector[name]
    if settings.half_precision:
        processor.release_torch()
    from pipeline.detection.compact import training

    run_options = RunOptions.reporting(name, settings.schedule.steps, run.executor.workers, run.executor.device)
    trained = training.train(name, settings, run_options)
    training.save(
        run.outputs / f"data/weights/detector_{name}.safetensors", name, trained, settings, released=run.released
    )
    training_record.write(run.outputs, f"detector_{name}", trained.curve, final_measures(trained))


if __name__ == "__main__":
    run()
