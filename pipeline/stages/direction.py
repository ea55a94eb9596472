"""Stage `direction`: average precision of one detector by the angle of the blur, its length and noise."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

USES: dict[str, list[str]] = {"pipeline.detection": [], "pipeline.blur": [], "pipeline.noise": []}


@stage("direction", reads=["detection.curves.tolerance_percent"], job=["dataset", "detector"], uses=USES)
def run(run: Run) -> None:
    """Arrange the average precisions by direction; write the table, the spread over directions and the metrics."""
    from pipeline import store
    from pipeline.curves import directions, precision

    name = f"{run.job['dataset']}-{run.job['detector']}"
    folder = run.inputs / "data/curves" / name
    table = store.read_table(folder / "precision.parquet", precision.PRECISION)
    draws = store.read_arrays(folder / "draws.npz")
    tolerance = run.params.detection.curves.tolerance_percent
    rows, spread = directions.of_labels(table, draws, tolerance)
    with store.replacing_folder(run.outputs / "data/direction" / name) as out:
        store.write_table(out / "table.parquet", rows, directions.TABLE)
        store.write_table(out / "spread.parquet", spread, directions.SPREAD)
    marked = rows["rises_with_size"] | rows["rises_with_sigma"]
    values = {
        str(label): {
            "cells": len(selected),
            "non_monotonic": int(marked[selected.index].sum()),
            "largest_spread_percent": float(spread.loc[spread["label"] == label, "spread_percent"].max()),
        }
        for label, selected in rows[rows["ap_percent"].notna()].groupby("label")
    }
    store.write_json(run.outputs / f"reports/metrics/direction/{name}.json", values)


if __name__ == "__main__":
    run()
