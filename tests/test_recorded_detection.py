"""What is kept of detection on recorded pictures: complete, of the named pictures and weights, and repeatable."""

from __future__ import annotations

import hashlib
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline import store
from pipeline.config.compose import compose, parse
from pipeline.curves import Surface
from pipeline.errors import InputError
from pipeline.executor import run_map
from pipeline.recording.detection import record

ROOT = Path(__file__).resolve().parents[1]
KITTI = ROOT / "reports/recorded/kitti-yolox"


@pytest.fixture(scope="module")
def precision() -> pd.DataFrame:
    return pd.read_csv(KITTI / "precision.csv")


@pytest.fixture(scope="module")
def provenance() -> dict:
    return store.read_json(KITTI / "provenance.json")


def test_sharp_cars_are_found_and_every_cell_has_an_interval(precision: pd.DataFrame) -> None:
    cars = precision[precision["label"] == "car"]
    clean = cars[(cars["kernel_size_px"] == 0) & (cars["target_sigma_dn"] == 0)]
    assert clean["ap_percent"].item() >= 80.0
    assert len(cars) == 6 * 6 and (cars["low_percent"] <= cars["high_percent"]).all()
    assert (cars["objects"] == clean["objects"].item()).all()


def test_blur_and_noise_each_lower_the_average_precision(precision: pd.DataFrame) -> None:
    cars = precision[precision["label"] == "car"].set_index(["kernel_size_px", "target_sigma_dn"])["ap_percent"]
    assert cars[0, 25] < cars[0, 10] < cars[0, 0] and cars[21, 0] < cars[11, 0] < cars[0, 0]
    assert cars[21, 25] < cars[21, 0] and cars[21, 25] < cars[0, 25]


def test_what_was_estimated_is_what_was_done(precision: pd.DataFrame) -> None:
    """The axes are estimates; they follow the noise and the blur put in."""
    assert np.abs(precision["sigma_dn"] - precision["target_sigma_dn"]).max() < 1.0
    table = pd.read_csv(KITTI / "conditions.csv")
    miss = np.abs(table["mtf"] - table["true_mtf"])
    assert miss.max() < 0.11 and miss.median() < 0.03  # at 7 px and noise the estimator reads a tenth too little


def test_source_licence_and_hashes_are_named(provenance: dict) -> None:
    assert "CC BY-NC-SA" in provenance["source"] and "KITTI" in provenance["source"]
    assert len(provenance["frames"]) == 16 and all(len(digest) == 64 for digest in provenance["frames"].values())
    assert len(provenance["detector"]["sha256"]) == 64 and provenance["detector"]["options"]["input_px"] == 1280
    assert not [path for path in KITTI.iterdir() if path.suffix == ".png" and not path.stem.startswith("iopc")]


def test_the_kept_surface_can_be_asked(precision: pd.DataFrame) -> None:
    surface = Surface.load(KITTI / "surface-car.npz")
    value, low, high = surface.at(5.0, 0.95)
    assert low <= value <= high and 60 < value < 100
    with pytest.raises(InputError, match="not extrapolated"):
        surface.at(5.0, 0.2)


def configured(shared: Path) -> list[str]:
    return [
        "+dataset@datasets.kitti=kitti",
        f"datasets.kitti.root={shared / 'realdata/kitti'}",
        "+detector@detection.detectors.yolox=yolox",
        f"detection.detectors.yolox.weights={shared / 'weights/yolox_nano.onnx'}",
        "detection.sweep.angles_deg=[0]",
        "detection.sweep.noise_source=dcsn",
        "detection.evaluation.min_height_px=25",
        "detection.evaluation.min_visible_fraction=0.3",
    ]


@pytest.mark.shared
def test_it_is_of_the_pictures_it_names(shared: Path, provenance: dict) -> None:
    folder = shared / "realdata/kitti/training/image_2"
    for name, digest in provenance["frames"].items():
        assert hashlib.sha256((folder / f"{name}.png").read_bytes()).hexdigest() == digest
    weights = (shared / "weights/yolox_nano.onnx").read_bytes()
    assert hashlib.sha256(weights).hexdigest() == provenance["detector"]["sha256"]


@pytest.mark.shared
@pytest.mark.slow
def test_it_can_be_repeated(shared: Path, precision: pd.DataFrame, tmp_path: Path) -> None:
    """A few cells again, on all frames: the same numbers to what a platform's rounding moves."""
    few = ["detection.sweep.sizes_px=[0,3,7]", "detection.sweep.target_sigmas_dn=[0,5]"]
    config = parse(compose([*configured(shared), *few], ROOT / "conf"), "conf/")
    record(config, "kitti", "yolox", tmp_path / "out", "again", partial(run_map, workers=1))
    again = pd.read_csv(tmp_path / "out/precision.csv")
    keys = ["label", "kernel", "target_sigma_dn"]
    both = again.merge(precision, on=keys, suffixes=("", "_kept"))
    assert len(both) == 2 * 3 * 2
    assert np.abs(both["ap_percent"] - both["ap_percent_kept"]).max() < 0.5
    assert np.abs(both["mtf"] - both["mtf_kept"]).max() < 0.005


def test_an_absent_dataset_or_detector_says_how(tmp_path: Path) -> None:
    overrides = ["+dataset@datasets.kitti=kitti", f"datasets.kitti.root={tmp_path / 'none'}"]
    overrides += ["+detector@detection.detectors.yolox=yolox", f"detection.detectors.yolox.weights={tmp_path / 'w'}"]
    config = parse(compose(overrides, ROOT / "conf"), "conf/")
    with pytest.raises(InputError, match="camera-monitor weights get yolox_nano"):
        record(config, "kitti", "yolox", tmp_path / "out", "", run_map)
    (tmp_path / "w").write_bytes(b"weights")
    with pytest.raises(InputError, match="datasets.kitti.root"):
        record(config, "kitti", "yolox", tmp_path / "out", "", run_map)
    assert not (tmp_path / "out").exists()
