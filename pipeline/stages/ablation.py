"""Stage `ablation`: one short training of the spectral network with one thing changed, judged like the others."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = ["seed", "train.mtf.spectral", "ablation.steps", "ablation.images", "ablation.kernels"]


@stage("ablation", reads=[*READS, "ablation.variants.{variant}"], job=["variant"])
def run(run: Run) -> None:
    """Train, judge and write the measures."""
    import os
    import sys
    from pathlib import Path

    from pipeline import store
    from pipeline.blur import ablation
    from pipeline.learning.training import Training

    name, section = run.job["variant"], run.params.ablation
    released = Training.from_section(run.params.train.mtf["spectral"], run.params.seed)
    base = ablation.variant(
        ablation.shortened(released, section.steps), {"images": section.images, "kernels": section.kernels}
    )
    changed = ablation.variant(base, section.variants[name].model_dump())

    def report(row: dict[str, float]) -> None:
        print(f"{name} step {row['step']:.0f} of {section.steps}: {row['mtf_error_percent']:.3g} %", file=sys.stderr)

    workers = run.executor.workers or len(os.sched_getaffinity(0))
    found = ablation.judge(
        released,
        changed,
        Path(".cache/training"),
        producers=1 if workers > 1 else 0,
        executor={"workers": workers},
        report=report,
    )
    measures = {key: float(f"{value:.6g}") for key, value in found.items()}
    store.write_json(run.outputs / f"reports/metrics/ablation/{name}.json", measures)


if __name__ == "__main__":
    run()
