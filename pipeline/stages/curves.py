"""Stage `curves`: average precision of one detector over estimated noise and MTF (the paper's IOPC), with intervals."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

USES: dict[str, list[str]] = {"pipeline.detection": [], "pipeline.blur": [], "pipeline.noise": []}


@stage("curves", reads=["seed", "detection.evaluation", "detection.curves"], job=["dataset", "detector"], uses=USES)
def run(run: Run) -> None:
    """Judge every condition; write average precisions, surfaces that can be queried, isolated curves and metrics."""
    import pandas as pd

    from pipeline import store
    from pipeline.curves import precision
    from pipeline.errors import InputError
    from pipeline.experiments import detect, tables

    name, params = f"{run.job['dataset']}-{run.job['detector']}", run.params
    folder, settings = run.inputs / "data/detect" / name, params.detection.curves
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
    surfaces, heats, isolated, refused = {}, [], [], {}
    for label, drawn in draws.items():
        rows = table[table["label"] == label].reset_index(drop=True)
        isolated.append(precision.curves(label, rows, drawn, settings, params.seed))
        try:
            surfaces[label] = precision.surface(rows, drawn, settings, params.seed)
        except InputError as error:
            refused[label] = str(error)
        else:
            heats.append(precision.heat(label, surfaces[label], settings.tolerance_percent, rows["objects"].max()))
    empty = pd.DataFrame(columns=list(precision.HEAT.columns))
    with store.replacing_folder(run.outputs / "data/curves" / name) as out:
        store.write_table(out / "precision.parquet", table, precision.PRECISION)
        store.write_arrays(out / "draws.npz", **draws)
        store.write_table(out / "heat.parquet", pd.concat(heats) if heats else empty, precision.HEAT)
        store.write_table(out / "isolated.parquet", pd.concat(isolated), precision.ISOLATED)
        store.write_json(out / "refused.json", refused)
        for label, surface in surfaces.items():
            surface.save(out / f"surface-{label.replace(' ', '_')}.npz")
    store.write_json(run.outputs / f"reports/metrics/curves/{name}.json", precision.metrics(table, surfaces))


if __name__ == "__main__":
    run()
