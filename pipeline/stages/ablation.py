"""Stage `ablation`: one short training of the spectral network with one thing changed, judged like the others."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = ["train.mtf.spectral", "ablation.steps", "ablation.images", "ablation.kernels"]


@stage("ablation", reads=[*READS, "ablation.variants.{variant}"], job=["variant"])
def run(run: Run) -> None:
    """Train, judge and write the measures."""
    from pipeline import processor
    from pipeline.blur import ablation
    from pipeline.learning import training_record
    from pipeline.learning.run_options import RunOptions
    from pipeline.learning.settings import Training

    name, section = run.job["variant"], run.params.ablation
    released: Training = run.params.train.mtf["spectral"]
    base = ablation.variant(
        ablation.shortened(released, section.steps), {"images": section.images, "kernels": section.kernels}
    )
    changed = ablation.variant(base, section.variants[name].model_dump())

    if changed.half_precision:
        processor.release_torch()
    result = ablation.evaluate(released, changed, RunOptions.reporting(name, section.steps, run.executor.workers))
    training_record.write_measures(run.outputs / f"reports/metrics/ablation/{name}.json", result)


if __name__ == "__main__":
    run()
