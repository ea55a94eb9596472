"""Table I: the same for any executor; calibrations only where asked for; foreign estimators."""

import pickle
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from data_makers import make_folder

from pipeline import blur, datasets, store, tables
from pipeline.blur.base import BlurEstimate
from pipeline.camera.psf import stored
from pipeline.camera.psf.defocus import create as defocus
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.psf.linear_motion import create as motion
from pipeline.camera.settings import CameraSettings
from pipeline.datasets.index import index
from pipeline.datasets.patches import Patch
from pipeline.datasets.settings import DatasetSettings
from pipeline.errors import InputError
from pipeline.experiments import calibrate, table_one
from pipeline.experiments.condition import grid, sharp_kernel
from pipeline.experiments.frames import TestFrame, with_patches
from pipeline.experiments.run import Method, Registered, run
from pipeline.experiments.settings import BlurEstimatorSettings
from pipeline.experiments.tables import BLUR_ESTIMATES, BLUR_SUMMARY, rounded, written
from pipeline.stages.blur import run as stage

ROOT = Path(__file__).resolve().parents[2]
BANK = [
    Kernel("defocus_7", "defocus", 7, 0, defocus(7.0)),
    *(Kernel(f"linear_motion_7_{angle}", "linear_motion", 7, angle, motion(7.0, angle)) for angle in (0, 90)),
]
SPECTRAL = BlurEstimatorSettings(kind="spectral")
CALIBRATED = BlurEstimatorSettings(kind="spectral", calibration_samples=100)


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return make_folder(tmp_path_factory.mktemp("frames"), 2)


@pytest.fixture(scope="module")
def found(root):
    return index(datasets.open_dataset("folder", "mine", root))


@pytest.fixture(scope="module")
def work(found):
    patches = [Patch(0, 0, 192, "car"), Patch(120, 90, 192, "")]
    return [TestFrame(frame, {"mtf": patches[: 1 + number]}) for number, frame in enumerate(found.usable)]


def measured(work, section=SPECTRAL, **options):
    return table_one.measure({"mine": table_one.Candidate.configured(section)}, work, BANK, draws=5, **options)


@pytest.fixture(scope="module")
def once(work):
    return measured(work)


def test_it_is_the_experiment_of_every_kernel_and_the_sharp_frame(work, once):
    rows = rounded(
        run(work, grid([sharp_kernel(), *BANK]), [Method("mine", "mtf", Registered(blur.create, "spectral"))])
    )
    pd.testing.assert_frame_equal(once.estimates, written(rows, "mtf", BLUR_ESTIMATES))
    assert len(once.estimates) == 3 * 4 * 16 and once.calibrations == {}
    raw, divided = (once.summary[once.summary["calibrated"] == way].reset_index(drop=True) for way in (False, True))
    pd.testing.assert_frame_equal(raw, table_one.summarise(rows, 1, 5))
    calibrated = table_one.summarise(calibrate.divided_by_sharp(rows), 1, 5, calibrated=True)
    pd.testing.assert_frame_equal(divided, calibrated)


def test_the_order_of_work_changes_nothing(work, once):
    again = measured(work, executor=lambda function, items, label: [function(one) for one in items[::-1]][::-1])
    pd.testing.assert_frame_equal(once.summary, again.summary)


def test_an_estimator_calibrated_to_the_camera_is_cross_fitted_and_not_divided_again(work):
    result = measured(work, CALIBRATED)
    assert result.summary["calibrated"].all() and len(result.calibrations["mine"]) == 2
    other = calibrate.fit_frames(work[1:], estimator=Registered(blur.create, "spectral"), samples=100, seed=1)
    assert np.array_equal(other.matrix, result.calibrations["mine"][0].matrix)  # the first frame: that to the second


def test_a_relative_mtf_is_not_divided_again(work):
    generic = BlurEstimatorSettings(kind="spectral", options={"output": "relative"})
    assert not measured(work, generic).summary["calibrated"].any()


def test_what_workers_are_given_can_be_sent(work):
    jobs = []
    measured(work[:1], executor=lambda function, items, label: jobs.append(function) or [function(i) for i in items])
    item = work[0], (("mtf", "mine"),)
    one, again = jobs[0](item), pickle.loads(pickle.dumps(jobs[0]))(item)
    assert all(np.array_equal(one[name], again[name], equal_nan=one[name].dtype.kind == "f") for name in one)


def test_frames_without_patches_are_left_out_and_none_at_all_is_refused(found):
    first = found.usable[0]
    chosen = with_patches(found.usable, {"mtf": {first.name: [Patch(0, 0, 192, "")]}}, "x")
    assert [item.frame for item in chosen] == [first]
    with pytest.raises(InputError, match="here: no frame has a patch for blur"):
        with_patches(found.usable, {"mtf": {}}, "here")


class Half:
    """A foreign estimator: an MTF of one half everywhere."""

    def estimate(self, patches):
        count = len(patches)
        return BlurEstimate(np.full((count, 2, 8), 0.5), np.zeros(count, bool), np.full(count, ""))


@pytest.mark.slow
def test_readmes_foreign_estimator_enters_table_one():
    """README's example, executed as printed: at most ten lines, and its table holds the foreign estimator."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    code = next(block for block in re.findall(r"```python\n(.*?)```", readme, re.S) if "table_one.measure" in block)
    assert len([line for line in code.splitlines() if line.strip()]) <= 10
    printed = []
    known = {"print": printed.append, "MyEstimator": Half}
    exec(code, known)
    summary = known["result"].summary
    assert set(summary["estimator"]) == {"mine"} and summary["amae_percent"].notna().all()
    lines = printed[0].splitlines()
    assert len(lines) == 1 + len(summary) and {"blur_kind", "amae_percent", "high_percent"} <= set(lines[0].split())
    assert set(summary["blur_kind"]) == {"sharp", "defocus", "linear_motion", "nonlinear_motion"}


def test_the_stage_writes_it(root, found, once, tmp_path):
    """With the index's patches moved to those of this test, the stage's tables are those measured here."""
    patches = found.patches[found.patches["purpose"] == "blur"].groupby("frame").head(1)
    rows = [(0, 0, 0, "car"), (1, 0, 0, "car"), (1, 120, 90, "")]
    table = pd.concat([patches.iloc[[frame]].assign(x_px=x, y_px=y, label=label) for frame, x, y, label in rows])
    table["patch"] = table.groupby("frame").cumcount()
    store.write_table(tmp_path / "data/index/mine/frames.parquet", found.frames, tables.FRAMES)
    store.write_table(tmp_path / "data/index/mine/patches.parquet", table, tables.PATCHES)
    stored.write(tmp_path / "data/psf", BANK, "generated")
    config = SimpleNamespace(
        seed=1,
        camera=CameraSettings(),
        datasets={"mine": DatasetSettings(kind="folder", root=str(root), dvc_dependency=str(root))},
        blur=SimpleNamespace(patches_per_frame=None, bootstrap_draws=5, estimators={"mine": SPECTRAL}),
        executor=SimpleNamespace(workers=1, backend="processes", address=None),
    )
    stage.run(config, {"dataset": "mine", "estimator": "mine"}, tmp_path, tmp_path)
    folder = tmp_path / "data/blur/mine-mine"
    kept = store.read_table(folder / "estimates.parquet", BLUR_ESTIMATES)
    pd.testing.assert_frame_equal(kept.drop(columns="mtf"), once.estimates.drop(columns="mtf"))
    assert kept["mtf"].to_numpy() == pytest.approx(once.estimates["mtf"].to_numpy(), abs=1e-6)
    summary = store.read_table(folder / "summary.parquet", BLUR_SUMMARY)
    assert summary["amae_percent"].to_numpy() == pytest.approx(once.summary["amae_percent"].to_numpy(), abs=1e-4)


class Answers:
    """Answers every call in the same way."""

    def __init__(self, answer):
        self.answer = answer

    def estimate(self, patches):
        return self.answer(len(patches))


def estimate_of(count):
    return BlurEstimate(np.full((count, 2, 8), 0.5), np.zeros(count, bool), np.full(count, "", "<U9"))


@pytest.mark.parametrize(
    ("estimators", "count", "words"),
    [
        ({}, 2, "estimators: expected at least one"),
        ({"mine": Answers(estimate_of)}, 0, "frames: expected at least one"),
        ({"mine": Answers(lambda count: estimate_of(count - 1))}, 2, "estimator 'mine': answered for 0 of 1 patches"),
        ({"mine": Answers(lambda count: np.ones((count, 2, 8)))}, 2, "estimator 'mine': returned ndarray, expected"),
        ({"mine": Answers(lambda count: None)}, 2, "estimator 'mine': returned NoneType, expected .*BlurEstimate"),
    ],
)
def test_what_cannot_become_a_table_is_named(work, estimators, count, words):
    with pytest.raises(InputError, match=words):
        table_one.measure(estimators, work[:count], BANK, draws=5)
