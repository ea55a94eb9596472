"""Stage `refit`: the paper's regression fitted anew to its published grids, and its grids from its numbers."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

USES: dict[str, list[str]] = {"pipeline.detection": [], "pipeline.blur": [], "pipeline.noise": []}


@stage("refit", reads=["detection.regression.terms"], uses=USES)
def run(run: Run) -> None:
    """Fit each published grid; write coefficients, fitted cells and the metrics."""
    import pandas as pd

    from pipeline import store
    from pipeline.curves import iso_exposure, published

    grid = store.read_published(run.project / "data/paper/fitted_ap_grid.csv", published.GRID_COLUMNS)
    printed = store.read_published(
        run.project / "data/paper/regression_coefficients.csv", published.COEFFICIENT_COLUMNS
    )
    coefficients, fitted, about = [], [], {}
    for (detector, kind), rows in grid.groupby(["detector", "object"], sort=True):
        label = f"{detector} {kind}"
        *parts, about[label] = iso_exposure.tables(label, rows, run.params.detection.regression.terms)
        selected = printed[(printed["detector"] == detector) & (printed["object"] == kind)]
        about[label] |= published.beside(parts[0], selected, rows)
        coefficients.append(parts[0])
        fitted.append(parts[1])
    with store.replacing_folder(run.outputs / "data/refit") as out:
        store.write_table(out / "coefficients.parquet", pd.concat(coefficients), iso_exposure.COEFFICIENTS)
        store.write_table(out / "fitted.parquet", pd.concat(fitted), iso_exposure.FITTED)
        store.write_json(out / "fits.json", about)
        for item, results in published.ledger_tables(pd.concat(coefficients), pd.concat(fitted), about).items():
            store.write_text(out / f"{item}.csv", results.to_csv(index=False, lineterminator="\n"))
    store.write_json(run.outputs / "reports/metrics/refit.json", iso_exposure.metrics(about))


if __name__ == "__main__":
    run()
