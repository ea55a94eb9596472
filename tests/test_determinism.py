"""Same inputs, same bytes: every stage twice, one and two workers, shuffled, on a subset; rendering: test_sweeps."""

import hashlib
import random
import shutil
from pathlib import Path

import composed
import pytest
from control_makers import make_views
from data_makers import make_kitti

from pipeline import store, tables
from pipeline.camera.settings import CameraSettings
from pipeline.config.schema import validate
from pipeline.control.simulation.loop import SimulatedScene
from pipeline.datasets.frame import Frame
from pipeline.experiments.condition import Condition
from pipeline.experiments.corrupt import SharpFrame
from pipeline.stages import (
    closed_loop,
    control_surface,
    corrupt,
    detector,
    index,
    noise,
    psf_bank,
    report,
    sensor,
    star,
)

ROOT = Path(__file__).resolve().parents[1]


def tiny(folder, workers, **changes):
    """The smoke profile on three made-up KITTI frames and one small Sim viewpoint."""
    overrides = ["profile=smoke", "+dataset@datasets.kitti=kitti", f"executor.workers={workers}"]
    content = composed.content(*overrides)
    content["datasets"] = {"kitti": {**content["datasets"]["kitti"], "root": str(folder / "kitti"), **changes}}
    content["matrix"]["datasets"] = ["kitti"]
    content["corruption"]["target_sigmas_dn"] = content["noise"]["target_sigmas_dn"] = [0, 10]
    content["scenes"] |= {"viewpoints": 1, "samples": 1, "width_px": 256, "height_px": 256, "star_periods": 40}
    content["scenes"]["star_frequencies"] = [0.1, 0.2]
    content["corruption"]["noise_sources"] = content["noise"]["noise_sources"] = ["photon", "combined"]
    return validate(content)


def run_all(config, out):
    """Every stage but rendering, in the graph's order, into a folder."""
    inputs = out
    for module, jobs in (
        (sensor, [{}]),
        (psf_bank, [{}]),
        (star, [{}]),
        (index, [{"dataset": "kitti"}]),
        (corrupt, [{"dataset": "kitti"}]),
        (noise, [{"dataset": "kitti", "estimator": name} for name in ("pca", "bf")]),
    ):
        for job in jobs:
            module.run.run(config, job, inputs, out)


def digests(folder):
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    make_kitti(folder / "kitti", frames=3)
    return folder


@pytest.fixture(scope="module")
def once(data, tmp_path_factory):
    """Everything once, with one worker."""
    folder = tmp_path_factory.mktemp("once")
    run_all(tiny(data, 1), folder)
    return folder


def test_every_stage_gives_the_same_bytes_for_one_and_two_workers(data, once, tmp_path):
    before = digests(once)
    run_all(tiny(data, 2), tmp_path)
    assert len(before) > 15
    assert before == digests(tmp_path)


def test_a_subset_gives_the_same_rows(data, once, tmp_path):
    run_all(tiny(data, 1, limit=1), tmp_path)
    for name, schema in (
        ("corrupt/kitti/corruption.parquet", tables.CORRUPTION),
        ("noise/kitti-pca/estimates.parquet", tables.NOISE_ESTIMATES),
    ):
        everything = store.read_table(once / "data" / name, schema)
        some = store.read_table(tmp_path / "data" / name, schema)
        same = everything[everything["frame"].isin(some["frame"].unique())].reset_index(drop=True)
        assert 0 < len(some) < len(everything)
        assert some.equals(same)


def test_corruption_does_not_depend_on_the_order_of_frames(data):
    frames = [Frame("kitti", path.stem, path) for path in sorted((data / "kitti/training/image_2").iterdir())]
    shuffled = random.Random(3).sample(frames, len(frames))
    camera, condition = CameraSettings(), Condition(noise_source="combined", target_sigma_dn=10.0)

    def noise_of(some):
        return {frame.name: SharpFrame(frame, camera, 1).under(condition).image.tobytes() for frame in some}

    assert noise_of(frames) == noise_of(shuffled)
    assert len(set(noise_of(frames).values())) == len(frames)


@pytest.mark.full("two reports take 20 s")
def test_the_report_is_a_pure_function_of_its_inputs(data, once, tmp_path, monkeypatch):
    """Without the records of recorded pictures, whose figures take most of the time: tests of the report draw them."""
    shutil.copytree(once, tmp_path / "run")
    shutil.copytree(ROOT / "data/paper", tmp_path / "run/data/paper")
    for name in ("dvc.yaml", "dvc.lock"):
        shutil.copy(ROOT / name, tmp_path / "run")
    monkeypatch.chdir(tmp_path / "run")
    monkeypatch.setattr(report, "MOST_WORKERS", 1)  # more change nothing (test_report_page) and start slowly
    for name in ("first", "second"):
        report.run.run(tiny(data, 1), {}, tmp_path / "run", tmp_path / name)
    first = digests(tmp_path / "first")
    assert "reports/index.html" in first
    assert first == digests(tmp_path / "second")
    page = (tmp_path / "first/reports/index.html").read_text()
    assert str(tmp_path) not in page
    assert "not run" in page


def control(workers):
    """The smoke profile's control with two small viewpoints, three policies and one scenario."""
    content = composed.content("profile=smoke", f"executor.workers={workers}")
    section = content["control"]
    names = ("fixed", "iopc_continuous", "oracle")
    section["policies"] = {name: section["policies"][name] for name in names}
    section |= {"optional": [], "film_policies": ["iopc_continuous"], "film_steps": 2}
    section["scenarios"] = {"tunnel_in": {**section["scenarios"]["tunnel_in"], "steps": 3}}
    content["matrix"]["scenarios"] = ["tunnel_in"]
    content["detection"]["detectors"]["compact"]["weights"] = str(ROOT / "data/weights/detector_compact.safetensors")
    section["surface"] |= {"target_sigmas_dn": [0, 20], "sizes_px": [0, 15], "moments": [0]}
    section["surface"]["darker"] = {"target_levels": [0.25], "target_sigmas_dn": [0, 15], "sizes_px": [0, 15]}
    return validate(content)


def run_control(folder, workers, out):
    """Surface, then the scenario, from the views of a folder into another; returns what was written."""
    config = control(workers)
    control_surface.run.run(config, {}, folder, out)
    shutil.copytree(out / "data/control_surface", folder / "data/control_surface", dirs_exist_ok=True)
    closed_loop.run.run(config, {"scenario": "tunnel_in"}, folder, out)
    return digests(out)


@pytest.fixture(scope="module")
def controlled(tmp_path_factory):
    """Views with a detector, and what one worker made of them."""
    folder, out = tmp_path_factory.mktemp("control"), tmp_path_factory.mktemp("controlled")
    make_views(folder / "data/sim")
    detector.run.run(control(1), {"detector": "compact"}, folder, folder)
    return folder, run_control(folder, 1, out)


@pytest.mark.full("control, measured again, takes 20 s")
def test_control_gives_the_same_bytes_for_one_and_two_workers(controlled, tmp_path):
    folder, before = controlled
    shutil.rmtree(folder / ".cache")
    assert {"data/control_surface/all.npz", "data/closed_loop/tunnel_in/pairs.parquet"} <= set(before)
    assert run_control(folder, 2, tmp_path) == before


def test_a_killed_closed_loop_goes_on_and_gives_the_same_bytes(controlled, tmp_path, monkeypatch):
    folder, before = controlled
    shutil.rmtree(folder / ".cache")
    whole = SimulatedScene.detections
    calls = []

    def killed(self, *args, **kwargs):
        calls.append(args)
        if len(calls) > 5:
            raise KeyboardInterrupt
        return whole(self, *args, **kwargs)

    monkeypatch.setattr(SimulatedScene, "detections", killed)
    job = {"scenario": "tunnel_in"}
    with pytest.raises(KeyboardInterrupt):
        closed_loop.run.run(control(1), job, folder, tmp_path / "out")
    assert not (tmp_path / "out/data").exists()
    kept = {path: path.stat().st_mtime_ns for path in (folder / ".cache/closed_loop").rglob("*.npz")}
    assert len(kept) >= 5
    monkeypatch.undo()
    closed_loop.run.run(control(1), job, folder, tmp_path / "out")
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    after = digests(tmp_path / "out")
    assert after and after == {name: before[name] for name in after}
    assert len(after) == sum("closed_loop" in name for name in before)
