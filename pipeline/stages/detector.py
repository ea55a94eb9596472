"""Stage `detector`: one detector, opened, and its weights or its source hashed, so that what follows notices others."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

USES = {"pipeline.detection": ["detection.detectors.{detector}"]}


@stage("detector", reads=["detection.detectors.{detector}"], job=["detector"], uses=USES)
def run(run: Run) -> None:
    """Open the detector, which refuses a wrong or broken file, and write what it is."""
    from pipeline import store
    from pipeline.config.detector_identity import detector_identity
    from pipeline.detection import opened
    from pipeline.experiments.detect import options_of

    name = run.job["detector"]
    section = run.params.detection.detectors[name]
    about = detector_identity(name, section)
    opened(section.kind, options_of(section))
    with store.replacing_folder(run.outputs / "data/detector" / name) as out:
        store.write_json(out / "detector.json", about)


if __name__ == "__main__":
    run()
