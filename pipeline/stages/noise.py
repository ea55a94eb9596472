"""Stage `noise`: one estimator on the tiles of one dataset, over noise sources and levels."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = [
    "seed",
    "camera",
    "datasets.{dataset}",
    "noise.noise_sources",
    "noise.target_sigmas_dn",
    "noise.tiles_per_frame",
    "noise.bootstrap_draws",
    "noise.map_target_sigma_dn",
    "noise.estimators.{estimator}",
]
USES = {"pipeline.noise": ["noise.estimators.{estimator}"]}


@stage("noise", reads=READS, job=["dataset", "estimator"], uses=USES)
def run(run: Run) -> None:
    """Estimate on every indexed frame; write estimates, their summary, a frame's local noise, and the metrics."""
    from functools import partial

    from pipeline import noise as estimators
    from pipeline import store, tables
    from pipeline.experiments import noise
    from pipeline.experiments.frames import of_index
    from pipeline.experiments.metrics import noise_metrics
    from pipeline.experiments.pictures import noise_maps
    from pipeline.experiments.run import Registered

    dataset, name, params = run.job["dataset"], run.job["estimator"], run.params
    section, camera = params.noise.estimators[name], params.camera
    folder, sources = run.inputs / "data/index" / dataset, params.noise.noise_sources
    per_frame = section.per_frame or params.noise.tiles_per_frame
    frames = of_index(folder, dataset, params.datasets[dataset], {"sigma_dn": per_frame})
    estimator = Registered(estimators.create, section.kind, section.options)
    result = noise.measure(
        {name: estimator},
        frames,
        sources,
        params.noise.target_sigmas_dn,
        camera=camera,
        seed=params.seed,
        draws=params.noise.bootstrap_draws,
        executor=run.map,
        label=f"noise of {dataset} by {name}",
    )
    show = partial(
        noise_maps.noise_maps,
        estimator=estimator,
        noise_sources=sources,
        target_sigma_dn=params.noise.map_target_sigma_dn,
        camera=camera,
        seed=params.seed,
    )
    maps = next(iter(run.map(show, [item.frame for item in frames[:1]], "")), None)
    with store.replacing_folder(run.outputs / f"data/noise/{dataset}-{name}") as out:
        store.write_table(out / "estimates.parquet", result.estimates, tables.NOISE_ESTIMATES)
        store.write_table(out / "summary.parquet", result.summary, tables.NOISE_SUMMARY)
        if maps is not None:  # an estimator without a map has none to show
            store.write_arrays(out / "maps.npz", **maps[0])
            store.write_json(out / "maps.json", {**maps[1], "estimator": name})
    store.write_json(run.outputs / f"reports/metrics/noise/{dataset}-{name}.json", noise_metrics(result.summary))


if __name__ == "__main__":
    run()
