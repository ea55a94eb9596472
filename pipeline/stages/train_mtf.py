"""Stage `train_mtf`: trains one blur network from scratch on procedural pictures; released weights, learning curve."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

PROGRAMS = {"spectral": "pipeline.blur.spectral_training", "cnn": "pipeline.blur.cnn_training"}


@stage("train_mtf", reads=["seed", "train.mtf.{network}"], job=["network"])
def run(run: Run) -> None:
    """Train, write weights, learning curve and metrics; goes on from its checkpoint if it was interrupted."""
    import importlib
    import os
    import sys
    from pathlib import Path

    import pandas as pd

    from pipeline import store
    from pipeline.learning.training import Training, final_measures

    name = run.job["network"]
    program = importlib.import_module(PROGRAMS[name])
    training = Training.from_section(run.params.train.mtf[name], run.params.seed)

    def report(row: dict[str, float]) -> None:
        measures = "  ".join(f"{key} {value:.4g}" for key, value in row.items() if key != "step")
        print(f"{name} step {row['step']:.0f} of {training.schedule.steps}: {measures}", file=sys.stderr)

    workers = run.executor.workers or len(os.sched_getaffinity(0))
    trained = program.train(
        training,
        Path(".cache/training"),
        producers=1 if workers > 1 else 0,
        executor={"workers": workers},
        report=report,
    )
    program.save(run.outputs / f"data/weights/mtf_{name}.safetensors", trained, training)
    # Columns in a fixed order: a resumed run reads its rows from a file with sorted names.
    names = ["step", *sorted({name for row in trained.curve for name in row} - {"step"})]
    curve = pd.DataFrame(trained.curve, columns=names)
    text = curve.to_csv(index=False, float_format="%.6g", lineterminator="\n")
    store.write_text(run.outputs / f"data/weights/mtf_{name}.csv", text)
    measures = {key: float(f"{value:.6g}") for key, value in final_measures(trained).items()}
    store.write_json(run.outputs / f"reports/metrics/train/mtf_{name}.json", measures)


if __name__ == "__main__":
    run()
