"""What is kept of detection on recorded pictures: complete, of the named pictures and weights, and repeatable."""

from __future__ import annotations

import hashlib
from functools import partial
from pathlib import Path

import composed
import numpy as np
import pandas as pd
import pytest
from data_makers import make_folder

from pipeline import store
from pipeline.curves import Surface
from pipeline.errors import InputError
from pipeline.executor import run_map
from pipeline.recording.detection import labelled_frames, record

ROOT = Path(__file__).resolve().parents[1]
KITTI = ROOT / "reports/recorded/kitti-yolox"
PARTS = ("realdata/kitti", "realdata/kitti_more")


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
    assert len(cars) == (1 + 4 * 3) * 3 and (cars["low_percent"] <= cars["high_percent"]).all()
    assert (cars["objects"] == clean["objects"].item()).all()


def test_blur_and_noise_each_lower_the_average_precision(precision: pd.DataFrame) -> None:
    cars = precision[precision["label"] == "car"]
    means = cars.groupby(["kernel_size_px", "target_sigma_dn"])["ap_percent"].mean()  # over four directions
    assert means[0, 25] < means[0, 10] < means[0, 0] and means[21, 0] < means[11, 0] < means[7, 0] < means[0, 0]
    assert means[21, 25] < means[21, 0] and means[21, 25] < means[0, 25]


def test_the_direction_of_a_motion_matters_beyond_chance() -> None:
    """Best less worst of four directions, frames resampled: cars behind 11 px without noise."""
    spread = pd.read_csv(KITTI / "direction_spread.csv").set_index(["label", "target_sigma_dn", "kernel_size_px"])
    row = spread.loc[("car", 0, 11)]
    assert 20 < row["low_percent"] < row["spread_percent"] < row["high_percent"]
    assert row["worst_angle_deg"] in (45, 135)  # a diagonal motion blurs both axes


def test_what_was_estimated_is_what_was_done(precision: pd.DataFrame) -> None:
    """The axes are estimates; they follow the noise and the blur put in."""
    assert np.abs(precision["sigma_dn"] - precision["target_sigma_dn"]).max() < 1.0
    table = pd.read_csv(KITTI / "conditions.csv")
    miss = np.abs(table["mtf"] - table["true_mtf"])
    assert miss.max() < 0.11 and miss.median() < 0.03


def test_source_licence_and_hashes_are_named(provenance: dict) -> None:
    assert "CC BY-NC-SA" in provenance["source"] and "KITTI" in provenance["source"]
    assert len(provenance["frames"]) == 66 and all(len(digest) == 64 for digest in provenance["frames"].values())
    assert len(provenance["detector"]["sha256"]) == 64 and provenance["detector"]["options"]["input_px"] == 1280
    assert not [path for path in KITTI.iterdir() if path.suffix == ".png" and not path.stem.startswith("iopc")]


def test_the_kept_surface_can_be_asked(precision: pd.DataFrame) -> None:
    surface = Surface.load(KITTI / "surface-car.npz")
    value, low, high = surface.at(5.0, 0.97)
    assert low <= value <= high and 60 < value < 90
    with pytest.raises(InputError, match="not extrapolated"):
        surface.at(5.0, 0.2)


def configured(root: Path, shared: Path) -> list[str]:
    return [
        "+dataset@datasets.kitti=kitti",
        f"datasets.kitti.root={root}",
        "+detector@detection.detectors.yolox=yolox",
        f"detection.detectors.yolox.weights={shared / 'weights/yolox_nano.onnx'}",
        "detection.sweep.noise_source=sensor",
        "detection.sweep.frames=null",
        "detection.evaluation.min_height_px=25",
        "detection.evaluation.min_visible_fraction=0.3",
    ]


@pytest.mark.shared
def test_it_is_of_the_pictures_it_names(shared: Path, provenance: dict) -> None:
    pictures = {path.stem: path for part in PARTS for path in (shared / part / "training/image_2").iterdir()}
    for name, digest in provenance["frames"].items():
        assert hashlib.sha256(pictures[name].read_bytes()).hexdigest() == digest
    weights = (shared / "weights/yolox_nano.onnx").read_bytes()
    assert hashlib.sha256(weights).hexdigest() == provenance["detector"]["sha256"]


@pytest.mark.shared
@pytest.mark.full("the detector on 66 frames under four conditions takes 25 s")
def test_it_can_be_repeated(shared: Path, precision: pd.DataFrame, tmp_path: Path) -> None:
    """A few cells again, on all frames: the same numbers to what a platform's rounding moves."""
    for kind in ("image_2", "label_2"):
        (tmp_path / "kitti/training" / kind).mkdir(parents=True)
        for path in (path for part in PARTS for path in (shared / part / "training" / kind).iterdir()):
            (tmp_path / "kitti/training" / kind / path.name).symlink_to(path)
    few = [
        "detection.sweep.sizes_px=[0,7]",
        "detection.sweep.angles_deg=[0]",
        "detection.sweep.target_sigmas_dn=[0,10]",
    ]
    config = composed.config(*configured(tmp_path / "kitti", shared), *few)
    record(config, "kitti", "yolox", tmp_path / "out", "again", partial(run_map, workers=1))
    again = pd.read_csv(tmp_path / "out/precision.csv")
    keys = ["label", "kernel", "target_sigma_dn"]
    both = again.merge(precision, on=keys, suffixes=("", "_kept"))
    assert len(both) == 2 * 2 * 2
    assert np.abs(both["ap_percent"] - both["ap_percent_kept"]).max() < 0.5
    assert np.abs(both["mtf"] - both["mtf_kept"]).max() < 0.005


def test_an_absent_dataset_or_detector_says_how(tmp_path: Path) -> None:
    overrides = ["+dataset@datasets.kitti=kitti", f"datasets.kitti.root={tmp_path / 'none'}"]
    overrides += ["+detector@detection.detectors.yolox=yolox", f"detection.detectors.yolox.weights={tmp_path / 'w'}"]
    config = composed.config(*overrides)
    with pytest.raises(InputError, match="camera-monitor weights get yolox_nano"):
        record(config, "kitti", "yolox", tmp_path / "out", "", run_map)
    (tmp_path / "w").write_bytes(b"weights")
    with pytest.raises(InputError, match="datasets.kitti.root"):
        record(config, "kitti", "yolox", tmp_path / "out", "", run_map)
    assert not (tmp_path / "out").exists()


def test_frames_with_broken_labels_are_named_and_refused_where_they_are_more_than_allowed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "labels").mkdir()
    for number in range(4):
        store.write_image(tmp_path / f"{number}.png", np.full((8, 8), number / 4))
        words = "car 1 1 6" if number == 2 else "car 1 1 6 6"
        (tmp_path / "labels" / f"{number}.txt").write_text(f"{words}\n", encoding="utf-8")
    overrides = ["+dataset@datasets.mine=folder", f"datasets.mine.root={tmp_path}"]
    with pytest.raises(InputError, match=r"1 of 4 frames cannot be used.*2\.png.*line 1: expected 'class x1 y1 x2 y2"):
        labelled_frames(composed.config(*overrides), "mine")
    allowed = composed.config(*overrides, "datasets.mine.max_rejected_fraction=0.25")
    assert [frame.name for frame in labelled_frames(allowed, "mine")] == ["0", "1", "3"]
    assert "warning: dataset 'mine': 2.png is left out: labels/2.txt, line 1: expected" in capsys.readouterr().err


def test_a_damaged_picture_is_named_before_anything_is_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = make_folder(tmp_path / "mine", frames=4)
    damaged = root / "images/frame-3.png"
    damaged.write_bytes(damaged.read_bytes()[:3000])
    overrides = ["+dataset@datasets.mine=folder", f"datasets.mine.root={root}"]
    with pytest.raises(InputError, match=r"1 of 4 frames cannot be used.*images/frame-3\.png \(truncated"):
        labelled_frames(composed.config(*overrides), "mine")
    overrides += ["datasets.mine.max_rejected_fraction=0.25", "detection.sweep.frames=2"]
    assert [frame.name for frame in labelled_frames(composed.config(*overrides), "mine")] == ["frame-0", "frame-1"]
    assert "warning: dataset 'mine': images/frame-3.png is left out: truncated" in capsys.readouterr().err
