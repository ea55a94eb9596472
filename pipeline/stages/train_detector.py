"""Stage `train_detector`: trains one compact detector on *Sim* from scratch; released weights, learning curve."""

from __future__ import annotations

from pipeline.config.entry import Run, stage


@stage("train_detector", reads=["seed", "train.detector.{network}"], job=["network"])
def run(run: Run) -> None:
    """Render, train, write weights, learning curve and metrics; goes on from its checkpoint if it was interrupted."""
    import os
    import sys
    from pathlib import Path

    import pandas as pd

    from pipeline import store
    from pipeline.detection.compact import training
    from pipeline.learning.training import final_measures

    name = run.job["network"]
    settings = training.DetectorTraining.from_section(run.params.train.detector[name], run.params.seed)

    def report(row: dict[str, float]) -> None:
        measures = "  ".join(f"{key} {value:.4g}" for key, value in row.items() if key != "step")
        print(f"{name} step {row['step']:.0f} of {settings.schedule.steps}: {measures}", file=sys.stderr)

    workers = run.executor.workers or len(os.sched_getaffinity(0))
    trained = training.train(
        name,
        settings,
        Path(".cache/training"),
        producers=1 if workers > 1 else 0,
        executor={"workers": workers},
        report=report,
    )
    training.save(run.outputs / f"data/weights/detector_{name}.safetensors", name, trained, settings)
    # Columns in a fixed order: a resumed run reads its rows from a file with sorted names.
    names = ["step", *sorted({name for row in trained.curve for name in row} - {"step"})]
    text = pd.DataFrame(trained.curve, columns=names).to_csv(index=False, float_format="%.6g", lineterminator="\n")
    store.write_text(run.outputs / f"data/weights/detector_{name}.csv", text)
    measures = {key: float(f"{value:.6g}") for key, value in final_measures(trained).items()}
    store.write_json(run.outputs / f"reports/metrics/train/detector_{name}.json", measures)


if __name__ == "__main__":
    run()
