"""Stage blur with an estimator that is fitted to its camera: each half of the frames by a fit to the other half."""

from types import SimpleNamespace

import numpy as np
import pytest
from data_makers import make_folder

from pipeline import blur, datasets, store, tables
from pipeline.blur.camera_calibration import CalibratedEstimator, Calibration
from pipeline.camera.psf import stored
from pipeline.camera.psf.defocus import create as defocus
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.settings import CameraSettings
from pipeline.datasets.index import index
from pipeline.datasets.settings import DatasetSettings
from pipeline.errors import InputError
from pipeline.experiments import calibrate
from pipeline.experiments.condition import grid
from pipeline.experiments.frames import of_index
from pipeline.experiments.run import Method, Registered, run
from pipeline.experiments.settings import BlurEstimatorSettings
from pipeline.experiments.tables import BLUR_ESTIMATES, BLUR_SUMMARY
from pipeline.stages.blur import run as stage

BANK = [Kernel("defocus_7", "defocus", 7, 0, defocus(7.0))]
JOB = {"dataset": "mine", "estimator": "camera_calibrated"}
SAMPLES = 100


def prepared(place, frames, workers=1):
    """Configuration, and the folder that the stage reads."""
    root = make_folder(place / "frames", frames)
    indexed = index(datasets.open_dataset("folder", "mine", root))
    store.write_table(place / "data/index/mine/frames.parquet", indexed.frames, tables.FRAMES)
    store.write_table(place / "data/index/mine/patches.parquet", indexed.patches, tables.PATCHES)
    stored.write(place / "data/psf", BANK, "generated")
    estimators = {"camera_calibrated": BlurEstimatorSettings(kind="spectral", calibration_samples=SAMPLES)}
    config = SimpleNamespace(
        seed=1,
        camera=CameraSettings(),
        datasets={"mine": DatasetSettings(kind="folder", root=str(root), dvc_dependency=str(root))},
        blur=SimpleNamespace(patches_per_frame=1, bootstrap_draws=5, estimators=estimators),
        executor=SimpleNamespace(workers=workers, backend="processes", address=None),
    )
    return config, place


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    config, inputs = prepared(tmp_path_factory.mktemp("project"), 3)
    out = tmp_path_factory.mktemp("out")
    stage.run(config, JOB, inputs, out)
    return config, inputs, out / "data/blur/mine-camera_calibrated"


def test_answers_are_calibrated_ones_only(ran):
    _, _, folder = ran
    summary = store.read_table(folder / "summary.parquet", BLUR_SUMMARY)
    assert summary["calibrated"].all() and set(summary["blur_kind"]) == {"sharp", "defocus"}
    metrics = store.read_json(folder.parents[2] / "reports/metrics/blur/mine-camera_calibrated.json")
    assert set(metrics) == {"calibrated"}


def test_no_frame_is_judged_by_a_fit_to_itself(ran):
    config, inputs, folder = ran
    section = config.datasets["mine"]
    some, every = (of_index(inputs / "data/index/mine", "mine", section, {"mtf": count}) for count in (1, None))
    others = {0: every[2:], 1: every[:2]}  # of three frames two are the first half
    estimates = store.read_table(folder / "estimates.parquet", BLUR_ESTIMATES)
    for half, kept in others.items():
        selected = calibrate.fit_frames(kept, estimator=Registered(blur.create, "spectral"), samples=SAMPLES, seed=1)
        content = Calibration.load(folder / f"camera-{half}.json")
        assert np.array_equal(selected.matrix, content.matrix) and content.samples <= SAMPLES
        held_out = [item for item in some if item.frame.name not in {other.frame.name for other in kept}]
        method = Method("camera_calibrated", "mtf", CalibratedEstimator(blur.create("spectral"), content))
        rows = run(held_out, grid(BANK), [method])
        names = [item.frame.name for item in held_out]
        stored_rows = estimates[estimates["frame"].isin(names) & (estimates["kernel"] == "defocus_7")]
        assert stored_rows["mtf"].to_numpy() == pytest.approx(
            rows["estimate"].to_numpy(), abs=1e-5
        )  # stored to 5 decimals


@pytest.mark.parametrize("count", [2, 3, 8, 15])
def test_halves_are_of_frames_that_follow_each_other(count):
    halves = calibrate.folds(count)
    assert len(halves) == count and halves == sorted(halves) and set(halves) == {0, 1}
    assert abs(halves.count(0) - halves.count(1)) <= 1


@pytest.mark.full("two more calibrations take 25 s")
def test_two_workers_write_the_same_bytes(ran, tmp_path):
    config, inputs, folder = ran
    config = SimpleNamespace(
        **{**vars(config), "executor": SimpleNamespace(workers=2, backend="processes", address=None)}
    )
    stage.run(config, JOB, inputs, tmp_path)
    again = tmp_path / "data/blur/mine-camera_calibrated"
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["camera-0.json", "camera-1.json", "estimates.parquet", "summary.parquet"]
    assert all((folder / name).read_bytes() == (again / name).read_bytes() for name in names)


def test_one_frame_is_refused_with_a_way_out(tmp_path):
    config, inputs = prepared(tmp_path, 1)
    with pytest.raises(InputError, match="at least two, or leave calibration_samples out"):
        stage.run(config, JOB, inputs, tmp_path)


def test_a_subset_of_frames_keeps_the_halves_of_all(ran):
    config, inputs, _ = ran
    every = of_index(inputs / "data/index/mine", "mine", config.datasets["mine"], {"mtf": 1})
    assert len(every) == 3
    chosen = calibrate.in_folds([every[0], every[1]], every)  # on their own they would be two halves
    assert [item.fold for item in chosen] == [0, 0] and [item.frame for item in chosen] == [
        item.frame for item in every[:2]
    ]
    with pytest.raises(InputError, match=f"frame {every[2].frame.name} is not among those to calibrate on"):
        calibrate.in_folds(every, every[:2])
