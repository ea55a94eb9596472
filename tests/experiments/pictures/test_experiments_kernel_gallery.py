"""The gallery shows the kernels behind the numbers; the stage writes both, the same bytes each time."""

from types import SimpleNamespace

import numpy as np
import pytest
from data_makers import make_folder

from pipeline import blur, datasets, store, tables
from pipeline.blur.base import BlurEstimate
from pipeline.camera import mtf
from pipeline.camera.psf import stored
from pipeline.camera.psf.defocus import create as defocus
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.psf.linear_motion import create as motion
from pipeline.camera.settings import CameraSettings
from pipeline.datasets.index import index
from pipeline.datasets.patches import object_patches
from pipeline.datasets.settings import DatasetSettings
from pipeline.errors import InputError
from pipeline.experiments.condition import grid
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.pictures.kernel_gallery import gallery
from pipeline.experiments.run import Method, run
from pipeline.experiments.settings import BlurEstimatorSettings
from pipeline.experiments.tables import BLUR_ESTIMATES, BLUR_SUMMARY
from pipeline.stages.blur import run as stage

BANK = [
    Kernel("defocus_7", "defocus", 7, 0, defocus(7.0)),
    *(Kernel(f"linear_motion_7_{angle}", "linear_motion", 7, angle, motion(7.0, angle)) for angle in (0, 90)),
]


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return make_folder(tmp_path_factory.mktemp("frames"), 1)


@pytest.fixture(scope="module")
def opened(root):
    return datasets.open_dataset("folder", "mine", root)


@pytest.fixture(scope="module")
def pmp():
    return blur.create("pmp", mode="fast", kernel_size=15)


@pytest.fixture(scope="module")
def shown(opened, pmp):
    frame = next(iter(opened.frames()))
    patches = object_patches(frame.image().shape, frame.boxes)
    return frame, patches, gallery(frame, patches, BANK, pmp, CameraSettings(), 1)


def test_every_kernel_at_rotation_0_is_shown_with_what_was_found(shown):
    _, patches, (arrays, metadata) = shown
    assert [entry["kernel"] for entry in metadata["kernels"]] == ["defocus_7", "linear_motion_7_0"]
    names = [entry["kernel"] for entry in metadata["kernels"]]
    assert set(arrays) == {f"{part}_{name}" for part in ("patch", "estimate", "truth") for name in names}
    assert (metadata["patch"], metadata["label"]) == (0, patches[0].label)
    for entry in metadata["kernels"]:
        result, truth = (arrays[f"{part}_{entry['kernel']}"] for part in ("estimate", "truth"))
        assert arrays[f"patch_{entry['kernel']}"].dtype == np.uint8
        assert result.shape == (15, 15) and result.sum() == pytest.approx(1, abs=1e-4)
        assert entry["mtf"] == pytest.approx(mtf.sample(result), abs=1e-5)
        assert entry["true_mtf"] == pytest.approx(mtf.sample(truth), abs=1e-5)
        assert entry["amae_percent"] == pytest.approx(float(mtf.amae(entry["mtf"], entry["true_mtf"])))
        assert not entry["abstained"]


def test_the_kernel_shown_is_the_one_behind_the_table(shown, pmp):
    frame, patches, (_, metadata) = shown
    rows = run([TestFrame(frame, {"mtf": patches[:1]})], grid(BANK[:1]), [Method("pmp", "mtf", pmp)])
    assert np.array(metadata["kernels"][0]["mtf"]).ravel() == pytest.approx(rows["estimate"].to_numpy())


def test_work_is_handed_to_the_given_map(opened, shown, pmp):
    frame, patches, (arrays, metadata) = shown
    requested = []

    def backwards(function, kernels, label):
        requested.append(len(kernels))
        return [function(kernel) for kernel in reversed(kernels)][::-1]

    again, same = gallery(frame, patches, BANK, pmp, CameraSettings(), 1, backwards)
    assert requested == [1] and same == metadata
    assert all(np.array_equal(arrays[name], again[name]) for name in arrays)


class Curves:
    """Answers curves without kernels, as a network does."""

    asked = 0

    def estimate(self, patches):
        self.asked += 1
        return BlurEstimate(np.ones((len(patches), 2, 8)), np.zeros(len(patches), bool), np.full(len(patches), ""))


def test_an_estimator_without_kernels_has_no_gallery(shown):
    frame, patches, _ = shown
    curves = Curves()
    assert gallery(frame, patches, BANK, curves, CameraSettings(), 1) is None
    assert curves.asked == 1


def test_abstentions_are_kept_with_their_reason(shown, pmp, tmp_path):
    frame, patches, _ = shown
    store.write_image(tmp_path / "flat.png", np.full((320, 448), 128, np.uint8))
    flat = type(frame)(**{**vars(frame), "path": tmp_path / "flat.png"})
    arrays, metadata = gallery(flat, patches, BANK[:1], pmp, CameraSettings(), 1)
    (entry,) = metadata["kernels"]
    assert entry["abstained"] and entry["reason"] == "flat" and np.isnan(entry["amae_percent"])
    assert np.isnan(arrays["estimate_defocus_7"]).all() and (arrays["patch_defocus_7"] == 128).all()


@pytest.fixture(scope="module")
def project(root, opened, tmp_path_factory):
    """A configuration of two estimators, and a folder with the index and the bank that the stage reads."""
    folder = tmp_path_factory.mktemp("project")
    indexed = index(opened)
    store.write_table(folder / "data/index/mine/frames.parquet", indexed.frames, tables.FRAMES)
    store.write_table(folder / "data/index/mine/patches.parquet", indexed.patches, tables.PATCHES)
    stored.write(folder / "data/psf", BANK, "generated")
    estimators = {
        "pmp": BlurEstimatorSettings(kind="pmp", options={"mode": "fast", "kernel_size": 15}),
        "curves": BlurEstimatorSettings(kind="curves"),
    }
    config = SimpleNamespace(
        seed=1,
        camera=CameraSettings(),
        datasets={"mine": DatasetSettings(kind="folder", root=str(root), dvc_dependency=str(root))},
        blur=SimpleNamespace(patches_per_frame=1, bootstrap_draws=5, estimators=estimators),
        executor=SimpleNamespace(workers=1, backend="processes", address=None),
    )
    return config, folder


def test_the_stage_writes_tables_gallery_and_metrics_the_same_each_time(project, tmp_path):
    config, inputs = project
    for item in ("a", "b"):
        stage.run(config, {"dataset": "mine", "estimator": "pmp"}, inputs, tmp_path / item)
    files = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*") if path.is_file())
    names = ["estimates.parquet", "gallery.json", "gallery.npz", "summary.parquet"]
    assert [str(path) for path in files] == [
        *(f"data/blur/mine-pmp/{name}" for name in names), "reports/metrics/blur/mine-pmp.json"
    ]  # fmt: skip
    assert all((tmp_path / "a" / path).read_bytes() == (tmp_path / "b" / path).read_bytes() for path in files)
    folder = tmp_path / "a/data/blur/mine-pmp"
    estimates = store.read_table(folder / "estimates.parquet", BLUR_ESTIMATES)
    summary = store.read_table(folder / "summary.parquet", BLUR_SUMMARY)
    content = store.read_json(folder / "gallery.json")
    assert set(estimates["kernel"]) == {"sharp", *(kernel.name for kernel in BANK)}
    assert set(estimates["estimator"]) == {"pmp"} and len(estimates) == 4 * 16
    assert summary.groupby("calibrated").size().to_dict() == {False: 3, True: 3}
    assert (content["dataset"], content["estimator"]) == ("mine", "pmp")
    one = estimates[(estimates["kernel"] == "defocus_7")]
    assert np.ravel(content["kernels"][0]["mtf"]) == pytest.approx(one["mtf"].to_numpy(), abs=1e-5)
    metrics = store.read_json(tmp_path / "a/reports/metrics/blur/mine-pmp.json")
    assert metrics["raw"]["defocus"]["7"]["count"] == 1


def test_the_stage_leaves_the_gallery_out_where_there_are_no_kernels(project, tmp_path, monkeypatch):
    config, inputs = project
    monkeypatch.setattr(blur, "create", lambda kind, **options: Curves())
    stage.run(config, {"dataset": "mine", "estimator": "curves"}, inputs, tmp_path)
    folder = tmp_path / "data/blur/mine-curves"
    assert sorted(path.name for path in folder.iterdir()) == ["estimates.parquet", "summary.parquet"]


def test_a_dataset_without_patches_is_refused_with_a_way_out(project, tmp_path):
    config, inputs = project
    patches = store.read_table(inputs / "data/index/mine/patches.parquet", tables.PATCHES)
    frames = store.read_table(inputs / "data/index/mine/frames.parquet", tables.FRAMES)
    folder = tmp_path / "data/index/mine"
    store.write_table(folder / "patches.parquet", patches[patches["purpose"] == "noise"], tables.PATCHES)
    store.write_table(folder / "frames.parquet", frames, tables.FRAMES)
    with pytest.raises(InputError, match="no frame has a patch for blur"):
        stage.run(config, {"dataset": "mine", "estimator": "pmp"}, tmp_path, tmp_path)
