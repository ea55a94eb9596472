"""Stage `detector`: one detector, opened, and its weights or its source hashed, so that what follows notices others."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

USES = {"pipeline.detection": ["detection.detectors.{detector}"]}


@stage("detector", reads=["detection.detectors.{detector}"], job=["detector"], uses=USES)
def run(run: Run) -> None:
    """Open the detector, which refuses a wrong or broken file, and write what it is."""
    from pipeline import store
    from pipeline.config.hydra_plugins.named_files import in_one_file, with_files
    from pipeline.config.hydra_plugins.plug_in_sources import digest
    from pipeline.detection import opened
    from pipeline.errors import InputError
    from pipeline.experiments.detect import identifying_file, options_of
    from pipeline.store import file_sha256

    name = run.job["detector"]
    section = run.params.detection.detectors[name]
    path = identifying_file(name, section)
    if sentence := in_one_file(f"detection.detectors.{name}.weights", path):
        raise InputError(sentence)
    opened(section.kind, options_of(section))
    with store.replacing_folder(run.outputs / "data/detector" / name) as out:
        hashed = "source" if section.weights is None else "weights"
        about = {"kind": section.kind, hashed: path.name, "bytes": path.stat().st_size, "options": section.options}
        source = digest("pipeline.detection", section.kind)
        about |= {} if source is None else {"package_sha256": source}  # of a third party, with its other modules
        store.write_json(out / "detector.json", {**about, "sha256": with_files(file_sha256(path), section.options)})


if __name__ == "__main__":
    run()
