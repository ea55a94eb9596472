"""Stage blur with an estimator that is fitted to its camera: each half of the frames by a fit to the other half."""

from types import SimpleNamespace

import numpy as np
import pytest
from data_makers import make_folder

from pipeline import blur, datasets, store, tables
from pipeline.blur import cross_fit, evaluation
from pipeline.blur.camera_fit import Fit, Fitted
from pipeline.camera.psf import stored
from pipeline.camera.psf.defocus import create as defocus
from pipeline.camera.psf.kernel import Kernel
from pipeline.config.schema import CameraSection, DatasetSection, EstimatorSection, SensorSection
from pipeline.datasets.corrupted import CameraSettings
from pipeline.datasets.index import index, indexed_frames, indexed_patches
from pipeline.errors import InputError
from pipeline.stages.blur import run as stage

BANK = [Kernel("defocus_7", "defocus", 7, 0, defocus(7.0))]
JOB = {"dataset": "mine", "estimator": "fitted"}
SAMPLES = 100


def prepared(place, frames, workers=1):
    """Configuration, and the folder that the stage reads."""
    root = make_folder(place / "frames", frames)
    found = index(datasets.open_dataset("folder", "mine", root))
    store.write_table(place / "data/index/mine/frames.parquet", found.frames, tables.FRAMES)
    store.write_table(place / "data/index/mine/patches.parquet", found.patches, tables.PATCHES)
    stored.write(place / "data/psf", BANK, "generated")
    estimators = {"fitted": EstimatorSection(kind="spectral", camera_samples=SAMPLES)}
    config = SimpleNamespace(
        seed=1,
        camera=CameraSection(kind="physical", poisson="exact", sensor=SensorSection(model="paper")),
        datasets={"mine": DatasetSection(kind="folder", root=str(root), watch=str(root))},
        blur=SimpleNamespace(patches_per_frame=1, bootstrap_draws=5, estimators=estimators),
        executor=SimpleNamespace(workers=workers, backend="processes", address=None),
    )
    return config, place


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    config, inputs = prepared(tmp_path_factory.mktemp("project"), 3)
    out = tmp_path_factory.mktemp("out")
    stage.run(config, JOB, inputs, out)
    return config, inputs, out / "data/blur/mine-fitted"


def test_answers_are_calibrated_ones_only(ran):
    _, _, folder = ran
    summary = store.read_table(folder / "summary.parquet", evaluation.SUMMARY)
    assert summary["calibrated"].all() and set(summary["kind"]) == {"sharp", "defocus"}
    metrics = store.read_json(folder.parents[2] / "reports/metrics/blur/mine-fitted.json")
    assert set(metrics) == {"calibrated"}


def test_no_frame_is_judged_by_a_fit_to_itself(ran):
    config, inputs, folder = ran
    frames = indexed_frames(inputs / "data/index/mine", "mine", config.datasets["mine"])
    patches = indexed_patches(inputs / "data/index/mine", "blur")
    others = {0: frames[2:], 1: frames[:2]}  # of three frames two are the first half
    judged = indexed_patches(inputs / "data/index/mine", "blur", 1)
    estimates = store.read_table(folder / "estimates.parquet", evaluation.ESTIMATES)
    for half, kept in others.items():
        work = [(frame, patches[frame.name]) for frame in kept]
        own = cross_fit.fit_frames(work, kind="spectral", options={}, samples=SAMPLES, seed=1)
        found = Fit.load(folder / f"camera-{half}.json")
        assert np.array_equal(own.matrix, found.matrix) and found.samples <= SAMPLES
        for frame in (one for one in frames if one not in kept):
            rows = evaluation.evaluate_frame(
                frame, judged[frame.name], BANK, Fitted(blur.create("spectral"), found), CameraSettings(), 1
            )
            stored_rows = estimates[(estimates["frame"] == frame.name) & (estimates["kernel"] == "defocus_7")]
            assert stored_rows["mtf"].to_numpy() == pytest.approx([row["mtf"] for row in rows], abs=1e-6)


@pytest.mark.parametrize("count", [2, 3, 8, 15])
def test_halves_are_of_frames_that_follow_each_other(count):
    halves = cross_fit.halves(count)
    assert len(halves) == count and halves == sorted(halves) and set(halves) == {0, 1}
    assert abs(halves.count(0) - halves.count(1)) <= 1


def test_two_workers_write_the_same_bytes(ran, tmp_path):
    config, inputs, folder = ran
    config = SimpleNamespace(
        **{**vars(config), "executor": SimpleNamespace(workers=2, backend="processes", address=None)}
    )
    stage.run(config, JOB, inputs, tmp_path)
    again = tmp_path / "data/blur/mine-fitted"
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["camera-0.json", "camera-1.json", "estimates.parquet", "summary.parquet"]
    assert all((folder / name).read_bytes() == (again / name).read_bytes() for name in names)


def test_one_frame_is_refused_with_a_way_out(tmp_path):
    config, inputs = prepared(tmp_path, 1)
    with pytest.raises(InputError, match="at least two, or leave camera_samples out"):
        stage.run(config, JOB, inputs, tmp_path)
