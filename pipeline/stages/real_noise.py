"""Stage `real_noise`: every noise estimator on one recording of real cameras; without its data it writes that."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = ["seed", "real_noise.bootstrap_draws", "real_noise.estimators", "real_noise.recordings.{recording}"]
USES = {"pipeline.noise": ["real_noise.estimators"]}


@stage("real_noise", reads=READS, job=["recording"], uses=USES)
def run(run: Run) -> None:
    """Estimate on every patch; write patches, summary, the sensor's constants of raw frames, and the metrics."""
    from pathlib import Path

    from pipeline import store
    from pipeline.datasets.decoding.raw_frames import raw_frames
    from pipeline.errors import InputError
    from pipeline.experiments.real_noise import tables
    from pipeline.experiments.real_noise.experiment import measure_pairs, measure_raw, real_noise_metrics
    from pipeline.experiments.real_noise.sensor_constants import sensor_constants
    from pipeline.linked_folders import refuse_linked_folders
    from pipeline.noise.real_noise import summarise

    name, settings = run.job["recording"], run.params.real_noise
    section, label = settings.recordings[name], f"noise of {name}"
    refuse_linked_folders(section.folder, f"real_noise.recordings.{name}.folder")
    kinds = {key: (estimator.kind, estimator.options) for key, estimator in settings.estimators.items()}
    metrics: dict[str, object] = {"ran": section.folder is not None}
    with store.replacing_folder(run.outputs / "data/real_noise" / name) as out:
        store.write_json(out / "recording.json", {"ran": section.folder is not None, "source": section.source})
        if section.folder is not None:
            folder = Path(section.folder)
            if section.kind == "raw":
                if section.light is None or section.dark is None:
                    raise InputError(
                        f"real_noise.recordings.{name}: kind raw needs light and dark, folders below {folder}"
                    )
                light, dark = raw_frames(folder / section.light), raw_frames(folder / section.dark)
                sensor = sensor_constants(light, dark, section.white_dn)
                store.write_table(out / "transfer.parquet", sensor.transfer, tables.TRANSFER)
                store.write_table(out / "points.parquet", sensor.points, tables.TRANSFER_POINTS)
                store.write_table(out / "dark.parquet", sensor.dark, tables.DARK)
                store.write_table(out / "dark_means.parquet", sensor.dark_means, tables.DARK_MEANS)
                patches = measure_raw(light, sensor.fits, section.white_dn, kinds, run.map, label)
            else:
                patches = measure_pairs(folder, kinds, run.map, label)
            summary = summarise(patches, run.params.seed, settings.bootstrap_draws)
            store.write_table(out / "patches.parquet", patches, tables.REAL_NOISE_PATCHES)
            store.write_table(out / "summary.parquet", summary, tables.REAL_NOISE_SUMMARY)
            metrics |= real_noise_metrics(summary)
    store.write_json(run.outputs / f"reports/metrics/real_noise/{name}.json", metrics)


if __name__ == "__main__":
    run()
