"""The sweep of a detector: a killed run goes on, workers change nothing, and every odd input has a clear end."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import composed
import numpy as np
import pandas as pd
import pytest
import yaml
from data_makers import make_folder, make_kitti, make_udacity, write
from plug_in_makers import Darkening
from yolox_makers import LABELS, tiny_yolox

from pipeline import store
from pipeline.camera.settings import CameraSettings
from pipeline.config.hydra_plugins import plug_in_sources
from pipeline.config.schema import Config, validate
from pipeline.curves import precision
from pipeline.datasets import open_dataset
from pipeline.datasets.frame import Box, Frame
from pipeline.dependencies import closure
from pipeline.detection import checkpoint
from pipeline.detection.base import Detections
from pipeline.errors import InputError
from pipeline.experiments import detect as sweep
from pipeline.experiments.class_maps import class_map
from pipeline.experiments.condition import sharp_kernel
from pipeline.experiments.tables import CONDITIONS
from pipeline.stages import curves, detect, detector, direction, index, measured, regression

ROOT = Path(__file__).resolve().parents[2]
LEVELS = [0.0, 10.0]
KERNELS = 5  # sharp, and two lengths in two directions


def configured(folder: Path, workers: int = 1, name: str = "kitti", **options: object) -> Config:
    """The smoke profile on a made-up dataset with a detector that calls every bright cell a car."""
    content = composed.content("profile=smoke", f"executor.workers={workers}")
    content["datasets"] = {
        name: {**yaml.safe_load((ROOT / f"conf/dataset/{name}.yaml").read_text()), "root": str(folder / name)}
    }
    content["datasets"][name]["dvc_dependency"] = "."
    weights = str(folder / "tiny.onnx")
    given = {"labels": LABELS, "input_px": 128, "score_floor": 0.6, **options}
    tiny = {
        "kind": "yolox",
        "weights": weights,
        "dvc_dependency": weights,
        "fetch_command": "make it",
        "options": given,
    }
    content["detection"]["detectors"] = {"tiny": tiny}
    content["detection"]["datasets"] = [name]
    content["detection"]["sweep"] |= {
        "target_sigmas_dn": LEVELS,
        "sizes_px": [3, 9],
        "angles_deg": [0, 90],
        "frames": None,
    }
    content["matrix"] |= {"datasets": [name], "detectors": ["tiny"], "detection_datasets": [name]}
    content["control"]["detector"] = "tiny"
    content["by_kind"]["detection"] = {"yolox": {"tiny": weights}}
    return validate(content)


def prepare(config: Config, out: Path, name: str = "kitti") -> None:
    index.run.run(config, {"dataset": name}, out, out)
    detector.run.run(config, {"detector": "tiny"}, out, out)


def run(config: Config, out: Path, name: str = "kitti") -> None:
    detect.run.run(config, {"dataset": name, "detector": "tiny"}, out, out)


def digests(folder: Path) -> dict[str, str]:
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    make_kitti(folder / "kitti", frames=2)
    tiny_yolox(folder / "tiny.onnx", "side")
    return folder


@pytest.fixture(scope="module")
def once(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sweep run without interruption by one worker."""
    out = tmp_path_factory.mktemp("once")
    prepare(configured(data), out)
    run(configured(data), out)
    return out


def test_every_condition_of_every_frame_is_looked_at(once: Path) -> None:
    folder = once / "data/detect/kitti-tiny"
    looked = store.read_table(folder / "looked.parquet", sweep.LOOKED)
    assert len(looked) == 2 * KERNELS * len(LEVELS)
    assert not looked.duplicated(["frame", "kernel", "target_sigma_dn"]).any()
    table = store.read_table(folder / "detections.parquet", sweep.DETECTIONS)
    assert set(table["label"]) == {"car"} and len(table) == looked["detections"].sum() > 0
    assert (table.groupby(["frame", "kernel", "target_sigma_dn"])["score"].diff().dropna() <= 0).all()  # best first
    objects = store.read_table(folder / "objects.parquet", sweep.OBJECTS)
    assert objects[~objects["ignore"]].groupby("label").size().to_dict() == {"car": 2, "person": 2}
    assert not (once / ".cache/detect").exists()  # the pieces are gone once the run is done


def test_two_workers_write_the_same_bytes(data: Path, once: Path, tmp_path: Path) -> None:
    prepare(configured(data), tmp_path)
    run(configured(data, workers=2), tmp_path)
    assert digests(tmp_path / "data/detect") == digests(once / "data/detect")


def test_a_detector_in_place_leaves_the_next_noise_levels_their_pixels(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A frame without noise is handed out twice, of the same pixels."""
    frame = next(iter(open_dataset("kitti", "kitti", data / "kitti").frames()))
    work = sweep.Sweep("mine", "{}", ("car",), "readout", (0.0, 0.0, 5.0), CameraSettings(), 1)
    monkeypatch.setattr(sweep, "opened", lambda kind, options: Darkening())
    score = work.detect(frame, sharp_kernel())["score"]
    assert score[0] == score[1] == pytest.approx(score[2], rel=0.02)


def test_a_detection_that_is_none_ends_the_sweep(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = next(iter(open_dataset("kitti", "kitti", data / "kitti").frames()))
    wrong = Detections(np.ones((1, 4)), np.array([np.nan]), np.array(["car"]))
    monkeypatch.setattr(sweep, "opened", lambda kind, options: SimpleNamespace(detect=lambda images: [wrong]))
    work = sweep.Sweep("mine", "{}", ("car",), "readout", (0.0,), CameraSettings(), 1)
    with pytest.raises(InputError, match="detector 'mine': score of detection 0 is nan"):
        work.detect(frame, sharp_kernel())


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {tests!r})
sys.path.insert(0, {here!r})
from test_experiments_detect import configured, run
from pipeline.experiments.detect import Sweep
looked, left = Sweep.detect, [4]
def look(self, frame, kernel):
    if not left[0]:
        os.kill(os.getpid(), signal.SIGKILL)
    left[0] -= 1
    return looked(self, frame, kernel)
Sweep.detect = look
run(configured(Path({data!r})), Path({out!r}))
"""


def test_a_killed_run_goes_on_and_its_result_is_the_same_bytes(
    data: Path, once: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepare(configured(data), tmp_path)
    here = Path(__file__).parent
    script = KILLED.format(tests=str(here.parent), here=str(here), data=str(data), out=str(tmp_path))
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    died = subprocess.run([sys.executable, "-c", script], cwd=ROOT, env=environment, capture_output=True, check=False)
    assert died.returncode == -signal.SIGKILL, died.stderr.decode()
    kept = sorted((tmp_path / ".cache/detect").rglob("*.npz"))
    assert len(kept) == 4
    assert not (tmp_path / "data/detect").exists()
    kept[0].write_bytes(kept[0].read_bytes()[:100])  # and one piece was cut short
    fresh = []
    looked = sweep.Sweep.detect
    monkeypatch.setattr(sweep.Sweep, "detect", lambda *given: fresh.append(1) or looked(*given))
    run(configured(data), tmp_path)
    assert len(fresh) == 2 * KERNELS - 3
    assert digests(tmp_path / "data/detect") == digests(once / "data/detect")


def test_runs_side_by_side_keep_their_pieces_apart(
    data: Path, once: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of another dataset of equal settings, or of another job of a sweep; none takes the other's pieces away."""
    folders = []
    kept = checkpoint.load_or_compute
    monkeypatch.setattr(
        checkpoint, "load_or_compute", lambda folder, *more: folders.append(folder) or kept(folder, *more)
    )
    make_udacity(tmp_path / "udacity", frames=2)
    (tmp_path / "tiny.onnx").write_bytes((data / "tiny.onnx").read_bytes())
    (tmp_path / "kitti").symlink_to(data / "kitti")
    configurations = {name: configured(tmp_path, name=name) for name in ("kitti", "udacity")}
    others = tmp_path / "out/.cache/detect/other/piece.npz"
    for name, config in configurations.items():
        prepare(config, tmp_path / "out", name)
        store.write_arrays(others, x=np.zeros(1))
        run(config, tmp_path / "out", name)
        assert others.is_file()
    detect.run.run(
        configurations["kitti"], {"dataset": "kitti", "detector": "tiny"}, tmp_path / "out", tmp_path / "job1"
    )
    assert len(set(folders)) == 3 and not any(folder.exists() for folder in folders)


def test_pieces_of_another_run_are_not_taken_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = checkpoint.fingerprint("pipeline.experiments.detect", {"weights": "a", "levels": (0, 5)}, "compact")
    assert one == checkpoint.fingerprint("pipeline.experiments.detect", {"levels": (0, 5), "weights": "a"}, "compact")
    assert one != checkpoint.fingerprint("pipeline.experiments.detect", {"weights": "b", "levels": (0, 5)}, "compact")
    assert one != checkpoint.fingerprint("pipeline.experiments.detect", {"weights": "a", "levels": (0, 5)}, "yolox")
    names = frozenset({"x"})
    made = [checkpoint.load_or_compute(tmp_path, "frame", depends, names, lambda n=n: {"x": np.array(n)})["x"].item()
            for n, depends in enumerate((b"sharp", b"other picture", b"sharp"))]  # fmt: skip
    assert made == [0, 1, 0]
    store.write_arrays(next(tmp_path.glob("frame-*")), y=np.zeros(1))  # a piece of another shape is made again
    again = [
        checkpoint.load_or_compute(tmp_path, "frame", d, names, lambda: {"x": np.array(9)})["x"].item()
        for d in (b"sharp", b"other picture")
    ]
    assert sorted(again)[-1] == 9 and len(set(again)) == 2


def test_an_edit_of_what_reads_a_frame_begins_a_killed_sweep_anew(
    data: Path, once: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of this package's frames, and of a third party's dataset, whose frames may read pictures in another way."""
    config = configured(data)
    folders: list[Path] = []

    def killed(folder: Path, *more: Any) -> Any:
        folders.append(folder)
        raise KeyboardInterrupt

    def start() -> None:
        closure._source_digest.cache_clear()
        with pytest.raises(KeyboardInterrupt):
            detect.run.run(config, {"dataset": "kitti", "detector": "tiny"}, once, tmp_path)

    monkeypatch.setattr(checkpoint, "load_or_compute", killed)
    read = Path.read_bytes
    with monkeypatch.context() as patched:
        patched.setattr(Path, "read_bytes", lambda path: read(path) + b"# edited" * (path.name == "frame.py"))
        start()
    reader = {("pipeline.datasets", "kitti"): "edited"}
    with monkeypatch.context() as patched:
        patched.setattr(plug_in_sources, "digest", lambda group, kind: reader.get((group, kind)))
        start()
    start()
    assert len(set(folders)) == 3


def whole(config: Config, out: Path, name: str) -> None:
    """All stages of detection, in the graph's order."""
    prepare(config, out, name)
    run(config, out, name)
    measured.run.run(config, {"dataset": name}, out, out)
    for stage in (curves, direction, regression):
        stage.run.run(config, {"dataset": name, "detector": "tiny"}, out, out)


@pytest.mark.parametrize("floor", [0.6, 1.0])
def test_frames_without_objects_and_without_detections_are_counted(data: Path, tmp_path: Path, floor: float) -> None:
    """Udacity's last frame has no object; at a score floor of 1 nothing is ever found."""
    make_udacity(tmp_path / "udacity", frames=3, layout="autti")
    (tmp_path / "tiny.onnx").write_bytes((data / "tiny.onnx").read_bytes())
    config = configured(tmp_path, name="udacity", score_floor=floor)
    whole(config, tmp_path / "out", "udacity")
    table = store.read_table(tmp_path / "out/data/curves/udacity-tiny/precision.parquet", precision.PRECISION)
    cars, people = table[table["label"] == "car"], table[table["label"] == "person"]
    assert (table["images"] == 3).all() and (cars["objects"] == 2).all()
    assert people["ap_percent"].isna().all() and (people["objects"] == 0).all()  # a class without an object has no AP
    assert ((cars["detections"] == 0) == (floor == 1.0)).all()
    if floor == 1.0:
        assert (cars["ap_percent"] == 0).all()
    assert (cars["scenes"] == 1).all() and cars["high_percent"].isna().all()  # a second of a drive is one scene
    refused = store.read_json(tmp_path / "out/data/curves/udacity-tiny/refused.json")
    assert "no object" in refused["person"]
    fits = store.read_json(tmp_path / "out/data/regression/udacity-tiny/fits.json")
    assert "expected at least as many" in fits["person"]["reason"]


def _interval(folder: Path, copies: int, **options: object) -> tuple[float, float, float, int]:
    """AP, its interval and the scenes of five places, each a burst of equal frames, of which three are detected in."""
    root = folder / "folder"
    for place in range(5):
        for shot in range(copies):
            write(root / f"images/place{place}_{shot}.png", np.full((200, 200), 40 * place, np.uint8))
            (root / "labels").mkdir(exist_ok=True)
            (root / f"labels/place{place}_{shot}.txt").write_text("car 20 20 90 90\n")
    tiny_yolox(folder / "tiny.onnx", "side")  # asked for its words, not for detections
    config = configured(folder, name="folder")
    config.datasets["folder"].options.update(options)
    config.detection.sweep.sizes_px[:], config.detection.sweep.target_sigmas_dn[:] = [0], [0.0]
    index.run.run(config, {"dataset": "folder"}, folder, folder)
    run(config, folder, "folder")
    detections, looked, objects = (
        store.read_table(folder / f"data/detect/folder-tiny/{name}.parquet", schema)
        for name, schema in (("detections", sweep.DETECTIONS), ("looked", sweep.LOOKED), ("objects", sweep.OBJECTS))
    )
    none = CONDITIONS.conform(pd.DataFrame(columns=list(CONDITIONS.columns)))
    criteria = config.detection.evaluation
    table, _ = precision.average_precision(detections, looked, objects, none, ["car"], criteria, config.seed)
    (row,) = table.to_dict("records")
    return row["ap_percent"], row["low_percent"], row["high_percent"], row["scenes"]


def test_the_interval_of_an_ap_is_over_scenes_that_names_of_ones_own_frames_tell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Six equal shots of a place are worth as much as one of them, and not six."""

    def look(self: sweep.Sweep, frame: Frame, kernel: object) -> dict[str, Any]:
        seen = frame.name[:6] in ("place0", "place1", "place3")
        boxes, score, label = ([[20.0, 20, 90, 90]], [0.9], ["car"]) if seen else (np.zeros((0, 4)), [], [])
        return {"level": np.zeros(len(score)), "boxes": np.asarray(boxes), "score": np.asarray(score),
                "label": np.asarray(label, np.str_), "other": np.array([], np.str_)}  # fmt: skip

    monkeypatch.setattr(sweep.Sweep, "detect", look)
    single = _interval(tmp_path / "single", 1)
    bursts = _interval(tmp_path / "bursts", 6, scene="(.+)_")
    apart = _interval(tmp_path / "apart", 6)
    assert bursts == pytest.approx(single) and bursts[3] == 5 and apart[3] == 30
    assert apart[0] == pytest.approx(single[0]) and apart[2] - apart[1] < 0.6 * (bursts[2] - bursts[1])


def test_a_dataset_without_any_object_is_refused_by_name(data: Path, tmp_path: Path) -> None:
    make_folder(tmp_path / "folder", frames=2, labels=True)
    for path in (tmp_path / "folder/labels").iterdir():
        path.write_text("")
    (tmp_path / "tiny.onnx").write_bytes((data / "tiny.onnx").read_bytes())
    config = configured(tmp_path, name="folder")
    with pytest.raises(InputError, match="'folder'.*no frame has an object"):
        measured.run.run(config, {"dataset": "folder"}, tmp_path, _indexed(config, tmp_path, "folder"))


def _indexed(config: Config, out: Path, name: str) -> Path:
    index.run.run(config, {"dataset": name}, out, out)
    return out


def test_all_detections_of_the_classes_are_kept_and_other_words_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many of another class are surer: the rule that judges them limits their number, or does not."""
    labels = ["tree"] * 3 + ["car"] * 150 + ["person"]
    detected = Detections.of(np.tile([0.0, 0, 9, 9], (154, 1)), np.linspace(0.9, 0.1, 154), labels)
    monkeypatch.setattr(sweep, "opened", lambda kind, options: SimpleNamespace(detect=lambda images: [detected]))
    frame = open_dataset("kitti", "kitti", make_kitti(tmp_path, frames=1)).frames()[0]
    looking = sweep.Sweep("any", "{}", ("car", "person"), "dcsn", (0.0, 1.0), CameraSettings(), 1)
    piece = looking.detect(frame, sharp_kernel())
    assert piece["label"].tolist() == 2 * labels[3:] and piece["other"].tolist() == ["tree"]
    assert sweep.words_of([piece, piece]) == {"tree", "car", "person"}


def test_a_name_too_long_for_a_file_is_looked_at_as_others_are(data: Path, once: Path, tmp_path: Path) -> None:
    """A stem of 240 bytes leaves no room for a kernel in a file name of 255."""
    make_kitti(tmp_path / "kitti", frames=1)
    (tmp_path / "tiny.onnx").write_bytes((data / "tiny.onnx").read_bytes())
    for path in sorted((tmp_path / "kitti").rglob("000000.*")):
        path.rename(path.with_stem("9" * 240))
    config = configured(tmp_path)
    prepare(config, tmp_path)
    run(config, tmp_path)
    looked = store.read_table(tmp_path / "data/detect/kitti-tiny/looked.parquet", sweep.LOOKED)
    assert set(looked["frame"]) == {"9" * 240} and len(looked) == KERNELS * len(LEVELS)


def test_neighbours_and_ignored_words_become_ignored_objects() -> None:
    boxes = (Box("Van", 0, 0, 9, 9), Box("DontCare", 1, 1, 5, 5, True), Box("Car", 2, 2, 8, 8))
    frames = [Frame("kitti", "a", Path("a.png"), boxes), Frame("kitti", "b", Path("b.png"))]
    table = sweep.objects(frames, class_map("kitti"))
    rows = sorted(map(tuple, table[["frame", "label", "ignore"]].to_numpy().tolist()))
    assert rows == [("a", "car", False), ("a", "car", True), ("a", "car", True), ("a", "person", True)]


def test_absent_and_corrupt_weights_say_what_to_do(data: Path, tmp_path: Path) -> None:
    config = configured(tmp_path)
    with pytest.raises(InputError, match=r"tiny\.weights: no file .*'make it' gets it"):
        detector.run.run(config, {"detector": "tiny"}, tmp_path, tmp_path)
    (tmp_path / "tiny.onnx").write_bytes((data / "tiny.onnx").read_bytes()[:2000])
    sweep.opened.cache_clear()
    with pytest.raises(InputError, match="not an ONNX network"):
        detector.run.run(config, {"detector": "tiny"}, tmp_path, tmp_path)


def test_other_weights_are_noticed(data: Path, once: Path, tmp_path: Path) -> None:
    about = json.loads((once / "data/detector/tiny/detector.json").read_text())
    assert about["sha256"] == hashlib.sha256((data / "tiny.onnx").read_bytes()).hexdigest()
    assert about["kind"] == "yolox"
