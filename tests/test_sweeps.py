"""The recipes of docs/sweep.md run on a tiny stage: launchers of Hydra, a queue of DVC, Dask on separate processes."""

from __future__ import annotations

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import composed
import pytest
import yaml

from pipeline import processor
from pipeline.errors import InputError
from pipeline.stages import render_sim

ROOT = Path(__file__).resolve().parents[1]
MODELS = ("paper", "automotive_3um")
LAUNCHERS = {
    "joblib": ("hydra_joblib_launcher", "sweep"),
    "submitit_local": ("hydra_submitit_launcher", "cluster"),
    "submitit_slurm": ("hydra_submitit_launcher", "cluster"),
}
PROJECT = (
    "pipeline",
    "conf",
    "data/paper",
    ".dvc/config",
    ".dvc/.gitignore",
    ".dvcignore",
    ".gitignore",
    "dvc.yaml",
    "params.yaml",
)
MOMENTS = 4
RENDER = (
    "pipeline.stages.render_sim", "profile=smoke", "scenes.viewpoints=1", "scenes.samples=1",
    "scenes.width_px=96", "scenes.height_px=64",
)  # fmt: skip
DASK_WAIT_S = 240


def results(folder: Path) -> dict[str, bytes]:
    """Files of a job, without Hydra's records and logs."""
    files = (file for part in ("data", "reports") for file in sorted((folder / part).rglob("*")) if file.is_file())
    return {file.relative_to(folder).as_posix(): file.read_bytes() for file in files}


def run(*command: str, cwd: Path = ROOT, **variables: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(cwd), "OMP_NUM_THREADS": "1", **variables}
    done = subprocess.run([sys.executable, "-m", *command], cwd=cwd, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def sweep(folder: Path, *options: str) -> list[dict[str, bytes]]:
    models = f"camera.sensor.model={','.join(MODELS)}"
    run("pipeline.stages.sensor", "profile=smoke", models, *options, f"hydra.sweep.dir={folder}", "--multirun")
    return [results(folder / str(job)) for job in range(len(MODELS))]


def slurm_answers() -> bool:
    """Whether there is a Slurm cluster that could start a job now."""
    if shutil.which("sinfo") is None:
        return False
    nodes = subprocess.run(["sinfo", "--noheader", "--states=idle,mixed"], capture_output=True, text=True)
    return nodes.returncode == 0 and bool(nodes.stdout.strip())


@pytest.fixture(scope="module")
def one_after_another(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, bytes]]:
    jobs = sweep(tmp_path_factory.mktemp("basic"))
    assert "reports/metrics/sensor.json" in jobs[0] and jobs[0] != jobs[1]
    return jobs


@pytest.mark.full("three sweeps take 30 s")
@pytest.mark.slow
@pytest.mark.parametrize("launcher", LAUNCHERS)
def test_a_launcher_of_hydra_gives_the_same_bytes(launcher, one_after_another, tmp_path):
    module, extra = LAUNCHERS[launcher]
    if importlib.util.find_spec(f"hydra_plugins.{module}") is None:
        pytest.skip(f"the extra '{extra}' is not installed")
    if launcher == "submitit_slurm" and not slurm_answers():
        pytest.skip("no Slurm with an idle node here")
    assert sweep(tmp_path, f"hydra/launcher={launcher}") == one_after_another


@pytest.mark.full("two sweeps, one of four worker processes, take 30 s")
@pytest.mark.slow
def test_jobs_of_joblib_start_worker_processes_of_their_own(tmp_path):
    """Most stages do; joblib's way of starting processes, which a job has as its default, is unknown in those."""
    if importlib.util.find_spec("hydra_plugins.hydra_joblib_launcher") is None:
        pytest.skip("the extra 'sweep' is not installed")
    tiles = ("pipeline.stages.index", "+job.dataset=photos", "datasets.photos.limit=2", "noise.tile_px=128,96")
    for name, options in (("basic", ("executor.workers=1",)), ("joblib", ("executor.workers=2",))):
        run(*tiles, *options, f"hydra/launcher={name}", f"hydra.sweep.dir={tmp_path / name}", "--multirun")
    alone, together = ([results(tmp_path / name / str(job)) for job in range(2)] for name in ("basic", "joblib"))
    assert alone == together and alone[0] != alone[1] and "data/index/photos/patches.parquet" in alone[0]


@pytest.mark.full("two experiments in copies of the project take 40 s")
def test_a_queue_of_experiments_is_run(tmp_path):
    """Two queued experiments, run side by side with the workspace, which they leave as it is."""
    if shutil.which("git") is None:
        pytest.skip("git is not installed")
    ignore = shutil.ignore_patterns("__pycache__")
    for name in PROJECT:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tmp_path / name, **({"ignore": ignore} if copy is shutil.copytree else {}))
    author = {"GIT_AUTHOR_NAME": "t", "GIT_AUTHOR_EMAIL": "t@example.org"}
    author |= {"GIT_COMMITTER_NAME": "t", "GIT_COMMITTER_EMAIL": "t@example.org"}

    def git(*words: str) -> str:
        command, environment = ["git", *words], os.environ | author
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True).stdout

    for words in (["init", "-q"], ["add", "-A"], ["commit", "-q", "-m", "start"]):
        git(*words)
    models = f"camera.sensor.model={','.join(MODELS)}"
    dvc = {"cwd": tmp_path, **author, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    queued = run("dvc", "exp", "run", "--queue", "-S", "profile=smoke", "-S", models, "sensor", **dvc)
    assert queued.count("Queued experiment") == len(MODELS)
    run("dvc", "exp", "run", "--run-all", **dvc)
    states = [line.split()[-1] for line in run("dvc", "queue", "status", **dvc).splitlines() if "Success" in line]
    assert len(states) == len(MODELS)
    kept = [line for line in git("for-each-ref", "--format=%(refname)", "refs/exps/").split() if "/exec/" not in line]
    used = [yaml.safe_load(git("show", f"{name}:params.yaml"))["camera"]["sensor"]["model"] for name in kept]
    assert set(MODELS) <= set(used)
    assert git("status", "--porcelain") == ""


def started(*words: str, file: Path) -> subprocess.Popen[bytes]:
    """A process of the project's Python, its output in a file; it does not inherit the pins of this one."""
    pins = processor.pins({"avx2", "fma", "avx512f"})
    environment = {name: value for name, value in os.environ.items() if name not in pins}
    environment |= {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    with file.open("wb") as log:
        return subprocess.Popen([sys.executable, "-m", *words], cwd=ROOT, env=environment, stdout=log, stderr=log)


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """A viewpoint of Sim by one worker, once: most of the time goes into its scene, whatever its size."""
    folder = tmp_path_factory.mktemp("rendered")
    run(*RENDER, "executor.workers=1", f"hydra.run.dir={folder}")
    files = results(folder)
    assert sum(name.endswith(".png") for name in files) == MOMENTS
    return files


@pytest.mark.full("two renderings, a scheduler and three workers take 45 s")
def test_dask_on_separate_processes_gives_the_same_bytes_though_a_worker_is_killed(rendered, tmp_path):
    distributed = pytest.importorskip("distributed", reason="the extra 'dask' is not installed")
    information = tmp_path / "scheduler.json"
    scheduler = ["dask", "scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(information)]
    processes = [started(*scheduler, file=tmp_path / "scheduler.log")]
    try:
        until(information.is_file, processes)
        worker = ["pipeline.dask_worker", "--scheduler-file", str(information), "--nthreads", "1"]
        worker += ["--no-dashboard", "--local-directory", str(tmp_path)]
        for number in range(2):
            processes.append(started(*worker, file=tmp_path / f"worker-{number}.log"))
        with distributed.Client(scheduler_file=str(information), timeout=DASK_WAIT_S) as client:
            client.wait_for_workers(2, timeout=DASK_WAIT_S)
            address = client.scheduler.address
            identifiers = client.run(os.getpid)
            cluster = ["executor=dask", f"executor.address={address}", f"hydra.run.dir={tmp_path / 'there'}"]
            computing = started(*RENDER, *cluster, file=tmp_path / "stage.log")
            processes.append(computing)
            busy: list[str] = []
            until(lambda: busy.extend(name for name, tasks in client.processing().items() if tasks) or busy, processes)
            os.kill(identifiers[busy[0]], signal.SIGKILL)  # its nanny starts another one
            assert computing.wait(DASK_WAIT_S) == 0, (tmp_path / "stage.log").read_text()
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            process.wait(60)
    assert results(tmp_path / "there") == rendered


def test_pictures_that_a_worker_writes_into_another_folder_are_an_error_and_leave_no_empty_dataset(
    tmp_path, monkeypatch
):
    def elsewhere(item: tuple[int, int], *, folder: Path, **options: object) -> Path:
        return folder / "written by a process in another folder.png"

    monkeypatch.setattr(render_sim, "render_viewpoint", elsewhere)
    config = composed.config("profile=smoke")
    with pytest.raises(InputError, match=r"executor\.address=.*start Dask workers in"):
        render_sim.run.run(config, {}, tmp_path, tmp_path)
    assert not list((tmp_path / "data").iterdir())


def until(condition, processes) -> None:
    """Wait for a condition while every process runs."""
    deadline = time.monotonic() + DASK_WAIT_S
    while not condition():
        assert time.monotonic() < deadline and all(process.poll() is None for process in processes)
        time.sleep(0.1)
