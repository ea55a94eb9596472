"""A record of blur: what the stage would have measured, with its sources named and no place of the machine in it."""

from __future__ import annotations

import hashlib
import shutil
from functools import partial
from pathlib import Path

import composed
import numpy as np
import pandas as pd
import pytest
from data_makers import make_folder, make_kitti

from pipeline import store, tables
from pipeline.camera.psf import configured_bank as kernel_bank
from pipeline.camera.psf import stored
from pipeline.config.schema import Config
from pipeline.datasets.index import index
from pipeline.datasets.open import open_section
from pipeline.errors import InputError
from pipeline.executor import run_map
from pipeline.experiments.recorded import blur as blur_records
from pipeline.experiments.tables import BLUR_ESTIMATES, BLUR_SUMMARY
from pipeline.recording.blur import record
from pipeline.recording.frames import Request
from pipeline.stages.blur import run as stage

REPO = Path(__file__).resolve().parents[2]

SMALL = [
    "psf.kinds=[defocus,linear_motion]",
    "psf.sizes_px=[7]",
    "psf.angles_deg=[0,90]",
    "blur.bootstrap_draws=5",
    "executor.workers=1",
    "blur.estimators.camera_calibrated.calibration_samples=100",
]
ESTIMATORS = ["spectral", "camera_calibrated"]
MAP = partial(run_map, workers=1)


def configured(root: Path, *more: str, kind: str = "folder") -> Config:
    overrides = [f"+dataset@datasets.mine={kind}", f"datasets.mine.root={root}", *SMALL, *more]
    return composed.config(*overrides)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_folder(tmp_path_factory.mktemp("pictures") / "mine", 2)


@pytest.fixture(scope="module")
def recorded(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    position = tmp_path_factory.mktemp("recorded")
    numbers = record(Request(configured(root), "mine", position / "mine-blur", "made up (CC0)", MAP), ESTIMATORS)
    assert set(numbers) == set(ESTIMATORS) and set(numbers["camera_calibrated"]) == {"calibrated"}
    assert store.read_json(position / "mine-blur/metrics.json")["spectral"]["raw"] == numbers["spectral"]["raw"]
    return position


@pytest.fixture(scope="module")
def read(recorded: Path) -> blur_records.BlurRecord:
    (one,) = blur_records.read(recorded)
    return one


def test_the_numbers_are_those_of_the_stages(root: Path, read: blur_records.BlurRecord, tmp_path: Path) -> None:
    config = configured(root)
    indexed = index(open_section("mine", config.datasets["mine"]))
    store.write_table(tmp_path / "data/index/mine/frames.parquet", indexed.frames, tables.FRAMES)
    store.write_table(tmp_path / "data/index/mine/patches.parquet", indexed.patches, tables.PATCHES)
    stored.write(tmp_path / "data/psf", kernel_bank.configured(config.psf, "physical", config.seed), "generated")
    for name in ESTIMATORS:
        stage.run(config, {"dataset": "mine", "estimator": name}, tmp_path, tmp_path)
        table = store.read_table(tmp_path / f"data/blur/mine-{name}/summary.parquet", BLUR_SUMMARY)
        kept = read.summary[read.summary["estimator"] == name].reset_index(drop=True)
        pd.testing.assert_frame_equal(kept, table, rtol=1e-5)
    estimates = store.read_table(tmp_path / "data/blur/mine-spectral/estimates.parquet", BLUR_ESTIMATES)
    sharp = estimates[(estimates["kernel"] == "sharp") & (estimates["axis"] == "V")]
    median = sharp.groupby("frequency")["mtf"].median()  # two patches: none is an outlier
    assert read.sharp[read.sharp["axis"] == "V"]["median"].to_numpy() == pytest.approx(median.to_numpy(), rel=1e-5)
    assert set(read.sharp["estimator"]) == {"spectral"}  # fitted answers are relative to the sharp frames


def test_everything_is_named_by_its_hash(root: Path, read: blur_records.BlurRecord) -> None:
    frames = {path.stem: hashlib.sha256(path.read_bytes()).hexdigest() for path in (root / "images").iterdir()}
    assert read.provenance["frames"] == frames and read.provenance["previous"] == {}
    assert set(read.provenance["kernels"]) == {"defocus_7", "linear_motion_7_0", "linear_motion_7_90"}
    assert len(set(read.provenance["kernels"].values())) == 3
    networks = ("mtf_spectral.safetensors", "mtf_spectral_processed.safetensors")
    named = {name: hashlib.sha256((REPO / "data/weights" / name).read_bytes()).hexdigest() for name in networks}
    assert read.provenance["weights"] == {"spectral": named, "camera_calibrated": named}
    assert (read.provenance["source"], read.provenance["kind"], read.provenance["seed"]) == (
        "made up (CC0)",
        "folder",
        1,
    )
    assert read.provenance["blur"]["estimators"]["camera_calibrated"]["calibration_samples"] == 100
    assert set(read.estimators) == set(ESTIMATORS) and read.patches == 2


def test_earlier_moments_and_the_papers_kernels_are_named_too(tmp_path: Path) -> None:
    root = make_kitti(tmp_path / "kitti", 2, previous=1)
    disc = tmp_path / "kernels/defocusBlur/7/7.png"
    disc.parent.mkdir(parents=True)
    store.write_image(disc, np.full((7, 7), 255, np.uint8))
    config = configured(root, "psf=paper", f"psf.folder={tmp_path / 'kernels'}", "psf.kinds=[defocus]", kind="kitti")
    record(Request(config, "mine", tmp_path / "out", "made up", MAP), ["spectral"])
    content = store.read_json(tmp_path / "out/provenance.json")
    assert content["kernels"] == {"defocus_7": hashlib.sha256(disc.read_bytes()).hexdigest()}
    assert set(content["previous"]) == {"000000_01.png", "000001_01.png"} and set(content["frames"]) == {
        "000000",
        "000001",
    }
    assert content["psf"]["source"] == "paper" and "folder" not in content["psf"]


def test_no_place_of_the_machine_and_no_picture_is_kept(root: Path, recorded: Path, tmp_path: Path) -> None:
    weights = REPO / "data/weights/mtf_spectral.safetensors"
    selected = configured(root, f"+blur.estimators.spectral.options.weights={weights}")
    record(Request(selected, "mine", tmp_path / "out", "made up", MAP), ["spectral"])
    assert store.read_json(tmp_path / "out/provenance.json")["blur"]["estimators"]["spectral"]["options"] == {
        "weights": weights.name
    }
    names = ["estimates.parquet", "metrics.json", "patches.csv", "provenance.json", "sharp.csv", "summary.csv"]
    for folder in (recorded / "mine-blur", tmp_path / "out"):
        assert sorted(path.name for path in folder.iterdir()) == names
        for path in folder.iterdir():
            content = path.read_bytes()
            assert str(root).encode() not in content and str(REPO).encode() not in content


@pytest.mark.full("measuring again takes 10 s")
def test_one_and_two_workers_write_the_same_bytes(root: Path, tmp_path: Path) -> None:
    """Calibrated: see the stage's test."""
    for workers in (1, 2):
        position = tmp_path / str(workers)
        record(
            Request(configured(root), "mine", position, "made up (CC0)", partial(run_map, workers=workers)),
            ["spectral"],
        )
    for path in (tmp_path / "1").iterdir():
        assert path.read_bytes() == (tmp_path / "2" / path.name).read_bytes(), path.name


def test_what_is_absent_is_named_and_nothing_is_written(root: Path, tmp_path: Path) -> None:
    def refused(config: Config, names: list[str], match: str) -> None:
        with pytest.raises(InputError, match=match):
            record(Request(config, "mine", tmp_path / "out", "", MAP), names)
        assert not (tmp_path / "out").exists()

    refused(configured(tmp_path / "none"), ["spectral"], "datasets.mine.root")
    refused(configured(root), ["spektral"], "blur.estimators.spektral: .* did you mean 'spectral'")
    refused(configured(root, "psf=paper", "psf.folder=/nowhere"), ["spectral"], "no kernels of the paper in '/nowhere'")
    options = "+blur.estimators.spectral.options.weights=/nowhere/w.safetensors"
    refused(configured(root, options), ["spectral"], "no file /nowhere/w.safetensors")


def test_records_are_told_apart_by_what_they_hold(recorded: Path, tmp_path: Path) -> None:
    assert blur_records.read(None) == [] == blur_records.read(tmp_path / "none")
    store.write_text(tmp_path / "other/precision.csv", "label\n")
    store.write_json(tmp_path / "other/provenance.json", {"dataset": "kitti"})
    assert blur_records.read(tmp_path) == []
    assert blur_records.estimators(recorded) == {"mine": set(ESTIMATORS)}
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        for path in (recorded / "mine-blur").iterdir():
            (tmp_path / name / path.name).write_bytes(path.read_bytes())
    with pytest.raises(InputError, match="both hold summary.csv of 'mine'"):
        blur_records.read(tmp_path)
    store.write_json(tmp_path / "two/provenance.json", {"dataset": "mine"})
    with pytest.raises(InputError, match=r"two/provenance.json: expected the keys \['blur', "):
        blur_records.read(tmp_path)


def test_an_estimator_joins_those_recorded(root: Path, recorded: Path, tmp_path: Path) -> None:
    """One after the other gives what both at once give; measuring one again leaves the other as it was."""
    out, together = tmp_path / "mine-blur", recorded / "mine-blur"
    for names in (ESTIMATORS[:1], ESTIMATORS[1:], ESTIMATORS[:1]):
        record(Request(configured(root), "mine", out, "made up (CC0)", MAP), names, join=True)
        assert store.read_json(out / "provenance.json")["blur"]["estimators"].keys() >= set(names)
    for name in ("metrics.json", "provenance.json"):
        assert store.read_json(out / name) == store.read_json(together / name)
    for name in ("summary.csv", "sharp.csv", "patches.csv"):
        selected, both = (sorted((item / name).read_text().splitlines()) for item in (out, together))
        assert selected == both
    for name in ESTIMATORS:
        selected, both = (blur_records.estimates_of(item) for item in (out, together))
        rows = (table[table["estimator"] == name].reset_index(drop=True) for table in (selected, both))
        pd.testing.assert_frame_equal(*rows)


def test_only_what_was_measured_alike_can_join(root: Path, recorded: Path, tmp_path: Path) -> None:
    out = tmp_path / "mine-blur"
    shutil.copytree(recorded / "mine-blur", out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    for other, word in (("seed=7", "seed"), ("blur.patches_per_frame=2", "blur"), ("psf.sizes_px=[3]", "kernels, psf")):
        with pytest.raises(InputError, match=f"measured with another {word}"):
            record(Request(configured(root, other), "mine", out, "made up (CC0)", MAP), ["spectral"], join=True)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
