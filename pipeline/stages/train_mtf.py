"""Stage `train_mtf`: trains one blur network from scratch on procedural pictures; released weights, learning curve."""

from __future__ import annotations

from pipeline.config.entry import Run, stage
from pipeline.registry import Registry

PROGRAMS = Registry(
    "trained blur network",
    "pipeline.blur.training",
    {
        "spectral": "pipeline.blur.training.spectral:train",
        "spectral_processed": "pipeline.blur.training.spectral:train",
        "pixels": "pipeline.blur.training.pixel:train",
        "cnn": "pipeline.blur.training.cnn:train",
    },
)
SAVERS = Registry(
    "trained blur network",
    "pipeline.blur.training",
    {
        "spectral": "pipeline.blur.training.spectral:save",
        "spectral_processed": "pipeline.blur.training.spectral:save",
        "pixels": "pipeline.blur.training.pixel:save",
        "cnn": "pipeline.blur.training.cnn:save",
    },
)

USES = {"pipeline.blur.training": ["{network}"]}


@stage("train_mtf", reads=["train.mtf.{network}"], job=["network"], uses=USES)
def run(run: Run) -> None:
    """Train, write weights, learning curve and metrics; goes on from its checkpoint if it was interrupted."""
    from pipeline import processor
    from pipeline.learning import training_record
    from pipeline.learning.fitting import final_measures
    from pipeline.learning.run_options import RunOptions
    from pipeline.learning.settings import Training

    name = run.job["network"]
    training: Training = run.params.train.mtf[name]
    if training.half_precision:
        processor.release_torch()

    run_options = RunOptions.reporting(name, training.schedule.steps, run.executor.workers, run.executor.device)
    trained = PROGRAMS.get(name)(training, run_options)
    SAVERS.get(name)(run.outputs / f"data/weights/mtf_{name}.safetensors", trained, training, released=run.released)
    training_record.write(run.outputs, f"mtf_{name}", trained.curve, final_measures(trained))


if __name__ == "__main__":
    run()
