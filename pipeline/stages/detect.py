"""Stage `detect`: one detector on one dataset under every blur, direction and noise; goes on where it was killed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.config.entry import Run, stage

if TYPE_CHECKING:
    from pipeline.camera.psf.kernel import Kernel
    from pipeline.datasets.frame import Frame
    from pipeline.experiments.detect import Sweep

READS = ["seed", "camera", "datasets.{dataset}", "detection.sweep", "detection.detectors.{detector}"]
USES = {"pipeline.detection": ["detection.detectors.{detector}"]}
ARRAYS = frozenset({"level", "boxes", "score", "label", "other"})


@stage("detect", reads=READS, job=["dataset", "detector"], uses=USES)
def run(run: Run) -> None:
    """Detect in every frame behind every kernel; write detections, what was looked at, and what is to be found."""
    from functools import partial

    from pipeline import store
    from pipeline.config.detector_identity import detector_identity
    from pipeline.config.hydra_plugins.named_files import hashes
    from pipeline.config.hydra_plugins.plug_in_sources import digest
    from pipeline.datasets.selection import scenes_of
    from pipeline.detection import checkpoint
    from pipeline.detection.words import warn_of_words
    from pipeline.experiments import detect
    from pipeline.experiments.class_maps import class_map, refuse_mistaken_words
    from pipeline.experiments.condition import sweep_kernels
    from pipeline.experiments.sweep_frames import sweep_frames

    dataset, name, params = run.job["dataset"], run.job["detector"], run.params
    section, source, settings = params.detection.detectors[name], params.datasets[dataset], params.detection.sweep
    words = class_map(source.kind)
    options = settings.options.get(dataset, {})
    index_folder = run.inputs / "data/index" / dataset
    frames = sweep_frames(dataset, source, options, settings.frames, index_folder, run.map)
    refuse_mistaken_words(frames, dataset, source.kind)
    blurs = sweep_kernels(settings.blur, settings.sizes_px, settings.angles_deg, settings.match, params.seed)
    sweep = detect.Sweep(
        kind=section.kind,
        options=detect.options_of(section),
        classes=tuple(words.classes),
        noise_source=settings.noise_source,
        target_sigmas_dn=tuple(settings.target_sigmas_dn),
        camera=params.camera,
        seed=params.seed,
    )
    about = detector_identity(name, section)
    detector = [about["sha256"], digest("pipeline.detection", section.kind)]
    reader_options = {**source.options, **options}  # a third party's frames may read pictures by them
    about_run = {
        "sweep": vars(sweep),
        "detector": detector,
        "reader": [digest("pipeline.datasets", source.kind), reader_options, hashes(reader_options)],
        "job": dict(run.job),
        "outputs": str(run.outputs),
    }
    # the sweep is given its frames: it does not import the code that reads their pictures
    key = checkpoint.fingerprint((detect.__name__, "pipeline.datasets.frame"), about_run, section.kind)
    folder = run.inputs / ".cache/detect" / key
    work = [(frame, kernel) for frame in frames for kernel in blurs]
    warn = partial(warn_of_words, section.kind, sweep.options, sweep.classes, dataset=dataset)
    warned = warn(())  # at once, of a detector that states its words
    result = run.map(partial(detect_frame, sweep=sweep, folder=folder), work, f"{name} on {dataset}")
    if not warned:
        warn(detect.words_of(result))
    detections, looked = detect.tables(work, result, sweep, scenes_of(frames))
    with store.replacing_folder(run.outputs / f"data/detect/{dataset}-{name}") as out:
        store.write_table(out / "detections.parquet", detections, detect.DETECTIONS)
        store.write_table(out / "looked.parquet", looked, detect.LOOKED)
        store.write_table(out / "objects.parquet", detect.objects(frames, words), detect.OBJECTS)
        store.write_json(out / "about.json", {**about, "classes": words.classes})
    checkpoint.clear(folder)


def detect_frame(work: tuple[Frame, Kernel], *, sweep: Sweep, folder: Path) -> Any:
    """What one worker does: one frame behind one kernel at every level, kept as soon as it is done."""
    from pipeline.detection import checkpoint

    frame, kernel = work
    depends = frame.path.read_bytes() + kernel.psf.tobytes()
    make = lambda: sweep.detect(frame, kernel)  # noqa: E731
    return checkpoint.load_or_compute(folder, f"{frame.name}-{kernel.name}", depends, ARRAYS, make)


if __name__ == "__main__":
    run()
