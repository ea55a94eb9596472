"""Stage `detector`: one detector's weights, opened and hashed, so that what follows notices other weights."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

USES = {"pipeline.detection": ["detection.detectors.{detector}"]}


@stage("detector", reads=["detection.detectors.{detector}"], job=["detector"], uses=USES)
def run(run: Run) -> None:
    """Open the detector, which refuses a wrong or broken file, and write what it is."""
    from pathlib import Path

    from pipeline import store
    from pipeline.detection import opened
    from pipeline.detection.weights import file_sha256
    from pipeline.errors import InputError
    from pipeline.experiments.detect import options_of

    name = run.job["detector"]
    section = run.params.detection.detectors[name]
    path = Path(section.weights)
    if not path.is_file():
        raise InputError(
            f"detection.detectors.{name}.weights: no file {path}; '{section.fetch_command}' gets it, or name another "
            f"file"
        )
    opened(section.kind, options_of(section))
    with store.replacing_folder(run.outputs / "data/detector" / name) as out:
        about = {"kind": section.kind, "weights": path.name, "bytes": path.stat().st_size, "options": section.options}
        store.write_json(out / "detector.json", {**about, "sha256": file_sha256(path)})


if __name__ == "__main__":
    run()
