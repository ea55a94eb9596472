"""Table I of one estimator: frame by frame the same as by hand, whoever maps; fits only where asked for."""

import pickle
from functools import partial
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from data_makers import make_folder

from pipeline import blur, datasets, store, tables
from pipeline.blur import cross_fit, evaluation, table_one
from pipeline.camera.psf import stored
from pipeline.camera.psf.defocus import create as defocus
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.psf.linear_motion import create as motion
from pipeline.config.schema import CameraSection, DatasetSection, EstimatorSection, SensorSection
from pipeline.datasets.corrupted import CameraSettings
from pipeline.datasets.index import index
from pipeline.datasets.patches import Patch
from pipeline.errors import InputError
from pipeline.stages.blur import run as stage

BANK = [
    Kernel("defocus_7", "defocus", 7, 0, defocus(7.0)),
    *(Kernel(f"linear_motion_7_{angle}", "linear_motion", 7, angle, motion(7.0, angle)) for angle in (0, 90)),
]
SPECTRAL = EstimatorSection(kind="spectral")
FITTED = EstimatorSection(kind="spectral", camera_samples=100)


def in_turn(function, items, label):
    return [function(item) for item in items]


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return make_folder(tmp_path_factory.mktemp("frames"), 2)


@pytest.fixture(scope="module")
def found(root):
    return index(datasets.open_dataset("folder", "mine", root))


@pytest.fixture(scope="module")
def work(found):
    return [(frame, [Patch(0, 0, 192, "car"), Patch(120, 90, 192, "")][: 1 + place]) for place, frame in
            enumerate(found.usable)]  # fmt: skip


def measured(work, section=SPECTRAL, run_map=in_turn, name="mine"):
    camera = CameraSettings()
    return table_one.measure(name, section, work, work, BANK, camera, seed=1, draws=5, run_map=run_map)


@pytest.fixture(scope="module")
def once(work):
    return measured(work)


def test_it_is_the_evaluation_of_every_frame(work, once):
    estimator, kernels = blur.create("spectral"), [evaluation.sharp_kernel(), *BANK]
    parts = [
        pd.DataFrame(evaluation.evaluate_frame(frame, patches, kernels, estimator, CameraSettings(), 1))
        for frame, patches in work
    ]
    by_hand = evaluation.ESTIMATES.conform(pd.concat(parts).assign(estimator="mine"))
    pd.testing.assert_frame_equal(once.estimates, by_hand)
    assert len(once.estimates) == 3 * 4 * 16 and once.fits == []
    raw, divided = (once.summary[once.summary["calibrated"] == way].reset_index(drop=True) for way in (False, True))
    pd.testing.assert_frame_equal(raw, evaluation.summarise(by_hand, 1, 5))
    calibrated = evaluation.summarise(evaluation.calibrated(by_hand), 1, 5, is_calibrated=True)
    pd.testing.assert_frame_equal(divided, calibrated)


def test_the_order_of_work_changes_nothing(work, once):
    again = measured(work, run_map=lambda function, items, label: [function(one) for one in items[::-1]][::-1])
    pd.testing.assert_frame_equal(once.summary, again.summary)


def test_a_fitted_estimator_answers_calibrated_only_each_half_by_the_other(work):
    answer = measured(work, FITTED)
    assert answer.summary["calibrated"].all() and len(answer.fits) == 2
    own = cross_fit.fit_frames(work[1:], kind="spectral", options={}, samples=100, seed=1)
    assert np.array_equal(own.matrix, answer.fits[0].matrix)  # the first frame is judged by a fit to the second


def test_what_workers_are_given_can_be_sent(work):
    job = partial(
        table_one.estimate_frame, kernels=BANK, kind="spectral", options={}, camera=CameraSettings(), seed=1, fits=[]
    )
    again = pickle.loads(pickle.dumps(job))
    assert again((work[0], 0)) == job((work[0], 0))


def test_frames_without_patches_are_left_out_and_none_at_all_is_refused(found):
    first = found.usable[0]
    assert table_one.paired(found.usable, {first.name: [Patch(0, 0, 192, "")]}, "x")[0][0] == first
    with pytest.raises(InputError, match="here: no frame has a patch for blur"):
        table_one.paired(found.usable, {}, "here")


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
        camera=CameraSection(kind="physical", poisson="exact", sensor=SensorSection(model="paper")),
        datasets={"mine": DatasetSection(kind="folder", root=str(root), watch=str(root))},
        blur=SimpleNamespace(patches_per_frame=None, bootstrap_draws=5, estimators={"mine": SPECTRAL}),
        executor=SimpleNamespace(workers=1, backend="processes", address=None),
    )
    stage.run(config, {"dataset": "mine", "estimator": "mine"}, tmp_path, tmp_path)
    folder = tmp_path / "data/blur/mine-mine"
    kept = store.read_table(folder / "estimates.parquet", evaluation.ESTIMATES)
    pd.testing.assert_frame_equal(kept.drop(columns="mtf"), once.estimates.drop(columns="mtf"))
    assert kept["mtf"].to_numpy() == pytest.approx(once.estimates["mtf"].to_numpy(), abs=1e-6)
    summary = store.read_table(folder / "summary.parquet", evaluation.SUMMARY)
    assert summary["amae_percent"].to_numpy() == pytest.approx(once.summary["amae_percent"].to_numpy(), abs=1e-4)
