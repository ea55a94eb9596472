"""Stage `index`: the frames and patches used of one dataset, and what was set aside and why."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = [
    "datasets.{dataset}", "noise.tile_px", "blur.patch_px", "report.example_frames", "detection.sweep.options",
]  # fmt: skip


@stage("index", reads=READS, job=["dataset"])
def run(run: Run) -> None:
    """Scan the dataset, write the tables, a few example frames and a manifest of content hashes."""
    from pipeline import store, tables
    from pipeline.camera.quantise import to_8bit
    from pipeline.config.hydra_plugins.named_files import with_files
    from pipeline.config.hydra_plugins.plug_in_sources import digest
    from pipeline.datasets.content import content_of
    from pipeline.datasets.index import index
    from pipeline.datasets.open import open_section
    from pipeline.datasets.selection import with_options
    from pipeline.linked_folders import refuse_linked_folders

    name, params = run.job["dataset"], run.params
    refuse_linked_folders(params.datasets[name].root, f"datasets.{name}.root")
    refuse_linked_folders(params.datasets[name].options.get("images"), f"datasets.{name}.options.images")
    dataset = open_section(name, params.datasets[name])
    result = index(
        dataset,
        tile_px=params.noise.tile_px,
        patch_px=params.blur.patch_px,
        max_rejected_fraction=params.datasets[name].max_rejected_fraction,
        run_map=run.map,
    )
    count = min(params.report.example_frames, len(result.usable))
    shown = [result.usable[round(i * (len(result.usable) - 1) / max(1, count - 1))] for i in range(count)]
    boxes = {
        frame.name: [
            {"label": b.label, "x1": b.x1, "y1": b.y1, "x2": b.x2, "y2": b.y2, "ignore": b.ignore} for b in frame.boxes
        ]
        for frame in shown
    }
    with store.replacing_folder(run.outputs / "data/index" / name) as folder:
        store.write_table(folder / "frames.parquet", result.frames, tables.FRAMES)
        store.write_table(folder / "patches.parquet", result.patches, tables.PATCHES)
        store.write_table(folder / "quarantine.parquet", result.quarantine, tables.QUARANTINE)
        store.write_json(folder / "notes.json", result.notes)
        store.write_json(folder / "samples.json", boxes)
        store.write_arrays(folder / "samples.npz", **{f"frame_{f.name}": to_8bit(f.image()) for f in shown})
        # What stages that depend on this index read of the dataset itself: an edit of it must run them again.
        store.write_json(folder / "manifest.json", content_of(result.usable))
        sweep_options = params.detection.sweep.options.get(name, {})
        if sweep_options:
            more = with_options(name, params.datasets[name], sweep_options)
            store.write_json(folder / "detection_manifest.json", content_of(more))
        source = digest("pipeline.datasets", params.datasets[name].kind)
        if source is not None:  # a third party's reader, which all that depends on this index executes
            options = {**params.datasets[name].options, "detection.sweep.options": sweep_options}
            source = with_files(source, options)  # it may read scenes out of a file
            store.write_json(folder / "reader.json", {"package_sha256": source})
    patches = result.patches.groupby("purpose").size()
    store.write_json(
        run.outputs / f"reports/metrics/index/{name}.json",
        {
            "frames": len(result.frames),
            "quarantined": len(result.quarantine),
            "notes": result.notes,
            "objects": int(result.frames["objects"].sum()),
            "patches": {purpose: int(count) for purpose, count in patches.items()},
            "statistics": result.frames.select_dtypes("float").mean().to_dict(),
        },
    )


if __name__ == "__main__":
    run()
