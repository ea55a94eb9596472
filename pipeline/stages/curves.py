"""Stage `curves`: average precision of one detector over estimated noise and MTF (the paper's IOPC), with intervals."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

USES: dict[str, list[str]] = {"pipeline.detection": [], "pipeline.blur": [], "pipeline.noise": []}


@stage("curves", reads=["seed", "detection.evaluation", "detection.curves"], job=["dataset", "detector"], uses=USES)
def run(run: Run) -> None:
    """Judge every condition; write average precisions, surfaces that can be queried, isolated curves and metrics."""
    from pipeline import store
    from pipeline.curves import precision
    from pipeline.experiments import detect, tables

    name, params = f"{run.job['dataset']}-{run.job['detector']}", run.params
    folder = run.inputs / "data/detect" / name
    conditions = store.read_table(
        run.inputs / f"data/measured/{run.job['dataset']}/conditions.parquet", tables.CONDITIONS
    )
    looked = store.read_table(folder / "looked.parquet", detect.LOOKED)
    table, draws = precision.average_precision(
        store.read_table(folder / "detections.parquet", detect.DETECTIONS),
        looked,
        store.read_table(folder / "objects.parquet", detect.OBJECTS),
        conditions,
        store.read_json(folder / "about.json")["classes"],
        params.detection.evaluation,
        params.seed,
    )
    through = precision.label_curves(table, draws, params.detection.curves, params.seed)
    with store.replacing_folder(run.outputs / "data/curves" / name) as out:
        store.write_table(out / "precision.parquet", table, precision.PRECISION)
        store.write_arrays(out / "draws.npz", **draws)
        store.write_table(out / "heat.parquet", through.heat, precision.HEAT)
        store.write_table(out / "isolated.parquet", through.isolated, precision.ISOLATED)
        store.write_json(out / "refused.json", through.refused)
        through.save_surfaces(out)
    metrics = precision.metrics(table, through.surfaces)
    store.write_json(run.outputs / f"reports/metrics/curves/{name}.json", metrics)


if __name__ == "__main__":
    run()
