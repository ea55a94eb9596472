"""Stage `ablation`: one short training of the spectral network with one thing changed, judged like the others."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = ["train.mtf.spectral", "ablation.judged_on", "ablation.steps", "ablation.images", "ablation.kernels"]


@stage("ablation", reads=[*READS, "ablation.variants.{variant}"], job=["variant"])
def run(run: Run) -> None:
    """Train, judge and write the measures."""
    from pipeline import processor
    from pipeline.blur.training import ablation
    from pipeline.learning import training_record
    from pipeline.learning.run_options import RunOptions
    from pipeline.learning.settings import Training

    name, section = run.job["variant"], run.params.ablation
    released: Training = run.params.train.mtf["spectral"]
    changes = section.variants[name].model_dump()
    steps = changes.pop("steps") or section.steps
    base, _ = ablation.variant(
        ablation.shortened(released, steps), {"images": section.images, "kernels": section.kernels}
    )
    changed, form = ablation.variant(base, changes)
    further = {
        word: ablation.variant(released, one.model_dump(exclude={"steps"}))[0]
        for word, one in section.judged_on.items()
    }

    if changed.half_precision:
        processor.release_torch()
    run_options = RunOptions.reporting(name, steps, run.executor.workers, run.executor.device)
    result = ablation.evaluate(released, changed, form, further, run_options)
    training_record.write_measures(run.outputs / f"reports/metrics/ablation/{name}.json", result)


if __name__ == "__main__":
    run()
