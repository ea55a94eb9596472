"""Stage `train_sigma`: trains one noise network on procedural pictures; released weights, learning curve."""

from __future__ import annotations

from pipeline.config.entry import Run, stage


@stage("train_sigma", reads=["seed", "train.sigma.{network}"], job=["network"])
def run(run: Run) -> None:
    """Train, write weights, learning curve and metrics; goes on from its checkpoint if it was interrupted."""
    import os
    import sys
    from pathlib import Path

    import pandas as pd

    from pipeline import store
    from pipeline.learning.training import final_measures
    from pipeline.noise import training

    name = run.job["network"]
    settings = training.Settings.from_section(name, run.params.train.sigma[name], run.params.seed)

    def report(row: dict[str, float]) -> None:
        measures = "  ".join(f"{key} {value:.4g}" for key, value in row.items() if key != "step")
        print(f"{name} step {row['step']:.0f} of {settings.schedule.steps}: {measures}", file=sys.stderr)

    workers = run.executor.workers or len(os.sched_getaffinity(0))
    trained = training.train(
        settings,
        Path(".cache/training"),
        producers=1 if workers > 1 else 0,
        executor={"workers": workers},
        report=report,
    )
    training.save(run.outputs / f"data/weights/sigma_{name}.safetensors", trained, settings)
    curve = pd.DataFrame(trained.curve).to_csv(index=False, float_format="%.6g", lineterminator="\n")
    store.write_text(run.outputs / f"data/weights/sigma_{name}.csv", curve)
    measures = {key: float(f"{value:.6g}") for key, value in final_measures(trained).items()}
    store.write_json(run.outputs / f"reports/metrics/train/sigma_{name}.json", measures)


if __name__ == "__main__":
    run()
