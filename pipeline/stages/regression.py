"""Stage `regression`: one detector's average precision as a function of ISO and exposure time (c1..c8)."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

USES: dict[str, list[str]] = {"pipeline.detection": [], "pipeline.blur": [], "pipeline.noise": []}


@stage("regression", reads=["detection.regression"], job=["dataset", "detector"], uses=USES)
def run(run: Run) -> None:
    """Fit each class; write coefficients, fitted cells with residuals, what each term is worth, and the calibration."""
    import pandas as pd

    from pipeline import store
    from pipeline.curves import iso_exposure, precision
    from pipeline.errors import InputError
    from pipeline.experiments.tables import CONDITIONS

    name, section = f"{run.job['dataset']}-{run.job['detector']}", run.params.detection.regression
    folder = run.inputs / "data/curves" / name
    table = store.read_table(folder / "precision.parquet", precision.PRECISION)
    conditions = store.read_table(run.inputs / f"data/measured/{run.job['dataset']}/conditions.parquet", CONDITIONS)
    coefficients, fitted, about = [], [], {}
    for label, draws in sorted(store.read_arrays(folder / "draws.npz").items()):
        data, together = iso_exposure.cells(table[table["label"] == label], draws, section)
        try:
            *parts, about[label] = iso_exposure.tables(label, data, section.terms, together)
        except InputError as error:
            about[label] = {"reason": str(error)}
            continue
        coefficients.append(parts[0])
        fitted.append(parts[1])
    with store.replacing_folder(run.outputs / "data/regression" / name) as out:
        for file, schema, result in (
            ("coefficients", iso_exposure.COEFFICIENTS, coefficients),
            ("fitted", iso_exposure.FITTED, fitted),
        ):
            empty = pd.DataFrame(columns=list(schema.columns))
            store.write_table(out / f"{file}.parquet", pd.concat(result) if result else empty, schema)
        store.write_json(out / "calibration.json", iso_exposure.calibration(conditions, section))
        store.write_json(out / "fits.json", about)
    store.write_json(run.outputs / f"reports/metrics/regression/{name}.json", iso_exposure.metrics(about))


if __name__ == "__main__":
    run()
