"""Stages: both ways in, only declared parameters, clear words for a wrong job."""

import os
import shutil
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from pipeline.config.compose import compose, parse
from pipeline.config.entry import stage
from pipeline.config.from_conf import fresh_folder
from pipeline.config.unread import warnings
from pipeline.errors import InputError
from pipeline.stages import sensor

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.usefixtures("remembered_compositions")


@pytest.fixture(scope="module")
def config():
    import os

    here = Path.cwd()
    os.chdir(ROOT)
    try:
        return parse(compose(), "conf/")
    finally:
        os.chdir(here)


def run_stage(config, reads, body, job=(), **given):
    stage("probe", reads=reads, job=job)(body).run(config, given, Path("in"), Path("out"))


def test_declared_parameters_are_seen_and_no_others(config):
    seen = {}

    def body(run):
        seen["levels"] = run.params.corruption.target_sigmas_dn
        seen["datasets"] = list(run.params.datasets)
        with pytest.raises(AttributeError, match="without declaring"):
            _ = run.params.seed
        with pytest.raises(AttributeError, match="corruption.noise_sources"):
            _ = run.params.corruption.noise_sources

    run_stage(config, ["corruption.target_sigmas_dn", "datasets.{dataset}"], body, ["dataset"], dataset="sim")
    assert seen == {"levels": config.corruption.target_sigmas_dn, "datasets": ["sim"]}


@pytest.mark.parametrize(
    ("given", "word"),
    [({}, r"\+job.dataset"), ({"dataset": "simm"}, "did you mean 'sim'"), ({"dataset": "sim", "x": "1"}, "job.x")],
)
def test_a_wrong_job_is_named(config, given, word):
    with pytest.raises(InputError, match=word):
        run_stage(config, ["datasets.{dataset}"], lambda run: None, ["dataset"], **given)


def test_params_mode_takes_job_keys_only():
    done = subprocess.run(
        [sys.executable, "-m", "pipeline.stages.psf_bank", "--params", "seed=2"],
        capture_output=True, text=True, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 2
    assert "seed=2" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_mistake_in_a_multirun_is_one_line():
    done = subprocess.run(
        [sys.executable, "-m", "pipeline.stages.sensor", "camera.sensor.model=papr"],
        capture_output=True, text=True, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode != 0
    assert "did you mean 'paper'" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_stage_ended_by_term_takes_half_written_outputs_away(tmp_path):
    shutil.copy(ROOT / "params.yaml", tmp_path)
    program = """
import pathlib, time
from pipeline import store
from pipeline.config.entry import stage

def body(run):
    with store.replacing_folder(run.outputs / "table") as folder:
        pathlib.Path(folder, "half").touch()
        print("writing", flush=True)
        time.sleep(60)

stage("probe", reads=["seed"])(body)(["--params"])
"""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    child = subprocess.Popen([sys.executable, "-c", program], cwd=tmp_path, env=environment, stdout=subprocess.PIPE)
    try:
        assert child.stdout.readline() == b"writing\n"
        child.send_signal(signal.SIGTERM)
        assert child.wait(30) == 128 + signal.SIGTERM
    finally:
        child.kill()
        child.stdout.close()
    assert [path.name for path in tmp_path.iterdir()] == ["params.yaml"]


DISTURBED = """
import os, resource, sys
from pathlib import Path
from pipeline import store
from pipeline.config.entry import stage

def body(run):
    if sys.argv[1] == "interrupt":
        raise KeyboardInterrupt
    if sys.argv[1] == "forbidden":
        raise PermissionError(13, os.strerror(13), "reports/x")
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
    store.write_text(run.outputs / "table.txt", "x" * 5000)

stage("probe", reads=["seed"])(body)(["--params"])
"""


@pytest.mark.parametrize(
    ("kind", "status", "line"),
    [
        ("full", 2, "error: table.txt: File too large; make room and run again\n"),
        ("forbidden", 2, "error: reports/x: Permission denied; give permission and run again\n"),
        ("interrupt", 130, "interrupted\n"),
    ],
)
def test_what_a_user_has_to_mend_and_an_interrupt_are_one_line(kind, status, line, tmp_path):
    shutil.copy(ROOT / "params.yaml", tmp_path)
    done = subprocess.run(
        [sys.executable, "-c", DISTURBED, kind], cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (status, line)
    assert [path.name for path in tmp_path.iterdir()] == ["params.yaml"]


NOW = "2026-01-02_03-04-05"


def test_each_sweep_has_a_folder_of_its_own(tmp_path, monkeypatch):
    """Sweeps that start at the same moment, too."""
    monkeypatch.setattr("pipeline.config.from_conf.time.strftime", lambda form: NOW)
    barrier = threading.Barrier(4)

    def start(_):
        barrier.wait()
        return fresh_folder(tmp_path / "multirun")

    with ThreadPoolExecutor(4) as pool:
        folders = list(pool.map(start, range(4)))
    assert sorted(path.name for path in folders) == [NOW, f"{NOW}_2", f"{NOW}_3", f"{NOW}_4"]
    assert all(path.is_dir() for path in folders)


@pytest.mark.parametrize(
    ("words", "folders"),
    [
        (["seed=1,2", "--multirun"], [f"multirun/sensor/{NOW}"]),
        (["seed=1", "hydra.mode=MULTIRUN"], [f"multirun/sensor/{NOW}"]),
        (["seed=1,2", "-m", "hydra.sweep.dir=mine"], ["mine"]),
        (["seed=1"], []),
        (["seed=1", "hydra.mode=RUN"], []),
    ],
)
def test_only_a_sweep_has_a_folder_made_for_it(words, folders, tmp_path, monkeypatch):
    """It goes again where Hydra starts no job."""
    passed, made = [], []

    def main():
        passed.extend(word.partition("=")[2] for word in sys.argv if word.startswith("hydra.sweep.dir="))
        made.extend(path.as_posix() for path in Path("multirun").glob("*/*"))

    monkeypatch.setattr("pipeline.config.from_conf.time.strftime", lambda form: NOW)
    monkeypatch.setattr("hydra.main", lambda **options: lambda entry: main)
    monkeypatch.setattr("pipeline.config.overrides.check_overrides", lambda *given: None)  # composing takes seconds
    monkeypatch.setattr("pipeline.config.unread.warnings", lambda *given: [])
    monkeypatch.setattr("sys.argv", ["sensor"])
    monkeypatch.chdir(tmp_path)
    (tmp_path / "conf").symlink_to(ROOT / "conf")
    sensor.run(words)
    assert passed == folders
    assert made == [folder for folder in folders if folder != "mine"]
    assert not list(tmp_path.glob("multirun/*/*"))


NOISE = stage(
    "noise", reads=["noise.target_sigmas_dn", "datasets.{dataset}", "noise.estimators.{estimator}"],
    job=["dataset", "estimator"],
)(lambda run: None)  # fmt: skip
JOB = ("+job.dataset=photos,sim", "+job.estimator=pca,bf")


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("noise.tile_px=64,128", ["noise.tile_px", "index"]),
        ("datasets.photos.limit=1", ["datasets.photos.limit", "(read by: index)"]),
        ("datasets.photos.whitelist=frames.txt", ["datasets.photos.whitelist", "(read by: index)"]),
        ("+noise.estimators.mine={kind: pca}", ["noise.estimators.mine", "combined"]),
        ("noise.target_sigmas_dn=[5],[10]", []),
        ("corruption.target_sigmas_dn=[5],[10]", []),  # which the noise experiment follows
        ("experiment@noise=noise", []),
        ("noise.estimators.bf.options={}", []),
        ("executor.workers=2", []),
        ("profile=smoke", []),
    ],
)
def test_an_override_that_the_stage_does_not_read_is_pointed_out(override, words, monkeypatch):
    monkeypatch.chdir(ROOT)
    sentences = warnings(NOISE, [*JOB, override, "hydra.sweep.dir=x", "--multirun"], ROOT / "conf")
    assert len(sentences) == bool(words)
    assert all(word in sentences[0] for word in ["stage 'noise' does not read", *words] if words)
    assert warnings(NOISE, [override], ROOT / "conf") == []  # whose job is refused later


def test_a_stage_that_may_read_a_dataset_anew_follows_its_whitelist_and_limit(monkeypatch):
    """As `detect`, with ``detection.sweep.options`` of the dataset."""
    monkeypatch.chdir(ROOT)
    detect = stage("detect", reads=["datasets.{dataset}"], job=["dataset"])(lambda run: None)
    job = ["+job.dataset=photos"]
    for override in ("whitelist=frames.txt", "limit=1"):
        assert warnings(detect, [*job, f"datasets.photos.{override}"], ROOT / "conf") == []


def test_the_stage_noise_warns_of_a_key_that_acts_in_the_index_only():
    job = ["+job.dataset=photos", "+job.estimator=pca", "--cfg", "job"]  # which is shown, not run
    arguments = [sys.executable, "-m", "pipeline.stages.noise", "noise.tile_px=64", *job]
    done = subprocess.run(arguments, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0
    assert "warning: stage 'noise' does not read noise.tile_px (read by: index" in done.stderr, done.stderr
