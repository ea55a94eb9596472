"""A stage's command line: every mistake is one line before Hydra begins, and options may stand anywhere."""

from __future__ import annotations

import itertools
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.config import from_conf
from pipeline.config.compose import CONF, compose, parse
from pipeline.config.from_conf import check_outputs
from pipeline.config.overrides import _checked, check_overrides, check_sweep, parsed, split
from pipeline.errors import InputError
from pipeline.stages import noise, sensor

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def at_top(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["+job=photos"], r"\+job=photos: expected \+job.KEY=NAME, e.g. \+job.dataset=photos"),
        (["job.dataset=photos"], r"expected \+job.dataset=photos"),
        (["seed=interval(1,3)", "--multirun"], "seed=interval.*listed values"),
        (["seed=1,2", "seed=3", "--multirun"], "seed=3: seed is given twice"),
        (["+dataset@datasets.a=kitti", "+dataset@datasets.a=photos"], "dataset@datasets.a is given twice"),
        (["--config-name", "x"], "--config-name: .*conf/config.yaml"),
        (["--config-dir=x"], "--config-dir: .*conf/config.yaml"),
        (["--multrun", "seed=1,2"], "--multrun: .*did you mean '--multirun'"),
        (["datasets.photos.root=/data/Fährten"], "quote.*'datasets.photos.root=\"/data/Fährten\"'"),
        (["camera=glob(*)", "--multirun"], r"camera=glob\(\*\): list the values, e.g. camera=FIRST,SECOND$"),
        (["+job.estimator=glob(p*)", "--multirun"], r"list the values, e.g. \+job.estimator=FIRST,SECOND$"),
        (["seed"], "seed: not an override KEY=VALUE$"),
        (["seed=true"], "'seed': .*valid integer"),
        (["executor.workers=true"], "'executor.workers': .*valid integer"),
    ],
)
def test_a_mistake_is_one_line(arguments: list[str], words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        check_overrides(arguments, CONF)
    assert "\n" not in str(caught.value)


def test_several_values_need_a_multirun() -> None:
    for allowed in (["seed=1,2", "-m"], ["--multirun", "seed=1,2"], ["seed=1,2", "hydra.mode=MULTIRUN"], ["a=[1,2]"]):
        check_sweep(allowed)
    with pytest.raises(InputError, match=r"seed=1,2: several values need --multirun"):
        check_sweep(["seed=1,2"])


def test_options_stand_anywhere() -> None:
    assert split(["a=1", "--cfg", "job", "b=2", "-m", "--info", "c=3"]) == (
        ["--cfg", "job", "-m", "--info"],
        ["a=1", "b=2", "c=3"],
    )
    check_overrides(["--cfg", "job", "seed=3"], CONF)
    check_overrides(["+job={dataset: photos}", "+job.estimator=pca,bf", "--multirun"], CONF)


def test_every_job_of_a_sweep_is_checked_before_the_first_runs(tmp_path: Path) -> None:
    jobs = ["+job.dataset=photos", "+job.estimator=pca,pcaa", "--multirun", f"hydra.sweep.dir={tmp_path / 'sweep'}"]
    with pytest.raises(InputError, match="'pcaa' is not among the configured noise.estimators; did you mean 'pca'"):
        from_conf.start(noise.run, jobs)
    assert not (tmp_path / "sweep").exists()
    own = ["+noise.estimators.pcaa={kind: pca}", "+job={dataset: photos}", "+job.estimator=pca,pcaa", "--multirun"]
    check_overrides(own, CONF, check_job=lambda config, job: from_conf.check_job(noise.run, config, job))


def test_of_many_combinations_each_value_is_checked() -> None:
    choices = [[f"{key}={value}" for value in range(10)] for key in "abc"]
    checked = list(_checked(choices))
    assert len(checked) < 100 and {value for chosen in checked for value in chosen} == set(itertools.chain(*choices))
    assert list(_checked(choices[:1])) == [(value,) for value in choices[0]]


@pytest.mark.parametrize("multirun", [False, True])
def test_a_file_where_results_need_a_folder_is_named_before_anything_runs(
    multirun: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "conf").symlink_to(ROOT / "conf")
    monkeypatch.chdir(tmp_path)
    name = "multirun" if multirun else "outputs"
    (tmp_path / name).write_text("")
    with pytest.raises(InputError, match=f"^{name}: a file, where results need a folder; move it"):
        from_conf.start(sensor.run, ["seed=1,2", "--multirun"] if multirun else [])
    if not multirun:
        with pytest.raises(InputError, match=f"{name}: a file"):
            from_conf.start(sensor.run, [f"hydra.run.dir={tmp_path / name}/below"])


def test_a_quoted_value_may_hold_any_letters() -> None:
    (override,) = parsed(['datasets.photos.root="/data/Fährten Süd"'])
    assert parse(compose([override.input_line]), "conf/").datasets["photos"].root == "/data/Fährten Süd"


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param(["hydra/launcher=basic", "--multirun", "seed=1,2"], marks=pytest.mark.full("one more takes 5 s")),
        ["--multirun", "seed=1,2"],
    ],
)
def test_an_option_between_overrides_sweeps_below_its_own_folder_only(arguments: list[str], tmp_path: Path) -> None:
    before = (ROOT / "reports/metrics/sensor.json").read_bytes()
    done = stage(*arguments, f'hydra.sweep.dir="{tmp_path}"')
    assert done.returncode == 0, done.stderr
    first, second = ((tmp_path / job / "reports/metrics/sensor.json").read_bytes() for job in "01")
    assert first != second
    assert (ROOT / "reports/metrics/sensor.json").read_bytes() == before


def stage(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "pipeline.stages.sensor", "profile=smoke", *arguments], capture_output=True, text=True
    )


def test_a_sweep_does_not_write_over_results_of_the_project() -> None:
    for folder in (Path(), ROOT, Path("runs/smoke"), Path("conf/..")):
        with pytest.raises(InputError, match="results of dvc repro"):
            check_outputs(folder)
    check_outputs(Path("outputs/sensor"))
    done = stage("hydra.run.dir=.")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1) and "hydra.run.dir=.: " in done.stderr
    assert not (ROOT / ".hydra").exists()


def test_links_lead_to_results_of_the_project_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (project := tmp_path / "project").mkdir()
    (tmp_path / "large/smoke").mkdir(parents=True)
    (tmp_path / "larger/paper").mkdir(parents=True)
    (project / "runs").symlink_to(tmp_path / "large")
    (tmp_path / "large/paper").symlink_to(tmp_path / "larger/paper")
    (tmp_path / "link").symlink_to(project)
    monkeypatch.chdir(project)
    for folder in ("runs/smoke", "runs/new", "../large/smoke", "runs/paper", "../larger/paper", "../link"):
        with pytest.raises(InputError, match="results of dvc repro"):
            check_outputs(Path(folder))
    for folder in ("../larger", "outputs/sensor", "runs/smoke/sweep", "../larger/else"):
        check_outputs(Path(folder))


@pytest.mark.parametrize("arguments", [[], pytest.param(["--multirun"], marks=pytest.mark.full("one more takes 4 s"))])
def test_changing_into_the_output_folder_is_refused_by_name(arguments: list[str], tmp_path: Path) -> None:
    done = stage("hydra.job.chdir=true", f'hydra.run.dir="{tmp_path}/one"', *arguments)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert done.stderr.startswith("error: hydra.job.chdir=true: ")
    assert not (tmp_path / "one").exists()


@pytest.mark.parametrize("content", [b"source: [", b"source: \xff"])
def test_a_file_of_conf_that_is_not_yaml_is_named(content: bytes, tmp_path: Path) -> None:
    shutil.copytree(CONF, tmp_path / "conf")
    (tmp_path / "conf/psf/generated.yaml").write_bytes(content)
    with pytest.raises(InputError, match=r"conf/psf/generated\.yaml: not valid YAML") as caught:
        compose([], tmp_path / "conf")
    assert "\n" not in str(caught.value)
