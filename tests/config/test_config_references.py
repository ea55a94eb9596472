"""Wrong names and paths are refused when the configuration is compiled, in one line with the nearest name."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import composed
import pytest

from pipeline.config.compose import CONF, check, compile_params, compose, parse
from pipeline.config.overrides import check_overrides, check_scheduler
from pipeline.config.references import _may_be_made, check_references
from pipeline.config.schema import validate
from pipeline.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.usefixtures("remembered_compositions")


@pytest.fixture(autouse=True)
def at_top(monkeypatch):
    monkeypatch.chdir(ROOT)


@pytest.mark.full("forty compositions take 20 s")
@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["camera.sensor.model=papr"], ["camera.sensor", "did you mean 'paper'"]),
        (["+camera.sensor.full_wel_e=3"], ["full_wel_e", "did you mean 'full_well_e'"]),
        (["+camera.sensor.full_well_e=many"], ["camera.sensor.full_well_e", "expected a number", "many"]),
        (["noise.estimators.pca.kind=pcaa"], ["noise.estimators.pca.kind", "did you mean 'pca'"]),
        (["+noise.estimators.pca.options.rul=2"], ["noise.estimators.pca.options.rul", "did you mean 'rule'"]),
        (["detection.detectors.compact.kind=compakt"], ["detection.detectors.compact.kind", "did you mean 'compact'"]),
        (["+dataset@datasets.mine=kittti"], ["conf/dataset", "did you mean 'kitti'"]),
        (["+dataset@datasets.mine=kitti", "datasets.mine.root=/nowhere"], ["datasets.mine.root=/nowhere"]),
        (["datasets.photos.whitelist=/nowhere"], ["datasets.photos.whitelist=/nowhere", "no such file"]),
        (["+detector@detection.detectors.mine=yolox"], ["detection.detectors.mine.weights", "weights list"]),
        (["psf=paper", "psf.folder=/nowhere"], ["psf.folder=/nowhere"]),
        (["combined.noise_estimators=[pcaa]"], ["combined.noise_estimators", "did you mean 'pca'"]),
        (["detection.datasets=[simm]"], ["detection.datasets", "did you mean 'sim'"]),
        (["combined.denoise.sigma_by=cellwize"], ["combined.denoise.sigma_by", "did you mean 'cellwise'"]),
        (["+combined.blur_estimators.camera_calibrated={}"], ["camera_calibrated", "without calibration_samples"]),
        (["denoised_blur.blur_estimators=[camera_calibrated]"], ["denoised_blur", "without calibration_samples"]),
        (["+combined.blur_estimators.spectral.experiments=[defocus]"], ["spectral.experiments", "defocus_dcsn"]),
        (["+noise.estimators.pca.calibration_samples=200"], ["noise.estimators.pca.calibration_samples"]),
        (["+real_noise.estimators.pca.per_frame=2"], ["real_noise.estimators.pca.per_frame"]),
        (["+detection.sweep.options.simm.limit=2"], ["detection.sweep.options", "did you mean 'sim'"]),
        (["+detection.sweep.options.sim.limit=2"], ["detection.sweep.options.sim.limit", "set datasets.sim.limit"]),
        (["+detection.sweep.options.sim.momnts=all"], ["sweep.options.sim.momnts: unknown option", "mean 'moments'"]),
        (["+detection.sweep.options.photos.images=data"], ["photos.images: ", "set datasets.photos.options.images"]),
        (["+datasets.sim.options.name=x"], ["datasets.sim.options.name", "called as its section, 'sim'"]),
        (["detection.measure.mtf=spectrall"], ["detection.measure.mtf", "did you mean 'spectral'"]),
        (["control.camera.sensor=papre"], ["control.camera.sensor", "did you mean 'paper'"]),
        (["control.scenarios.dropout.fault={silent: [6, 3]}"], ["dropout.fault.silent=[6, 3]", "first and last step"]),
        (["control.scenarios.dropout.fault={silent: [3, 10]}"], ["dropout.fault.silent=[3, 10]", "10 from 0"]),
        (["control.scenarios.flicker.flicker_depth=0"], ["scenarios.flicker: flicker_hz=100 with flicker_depth=0"]),
        (["+control.scenarios.ramp.flicker_depth=0.5"], ["scenarios.ramp: flicker_hz=0 with flicker_depth=0.5"]),
        (["control.scenarios.ramp.light=[[0,0]]"], ["control.scenarios.ramp", "values of at least 1e-09"]),
        (["control.scenarios.ramp.light=[[3,1],[2,1]]"], ["control.scenarios.ramp", "rising steps"]),
        (["control.camera.limits.exposure_min_ms=50"], ["control.camera.limits", "exposure_min_s <= exposure_max_s"]),
        (["+control.scenarios.ramp.start_exposure_ms=40"], ["ramp: ", "40 ms at ISO 100", "expected 0.05 to 33 ms"]),
        (["+control.scenarios.ramp.motion_in_poor_light=false"], ["unknown key", "ramp.motion_in_poor_light"]),
        (["control.policies.shin2019.options.probes=-1"], ["control.policies.shin2019.options: ", "probes is -1"]),
        (
            ["+control.policies.oracle.options={camera: 3}"],
            ["oracle.options.camera: unknown option"],
        ),
        (["+control.policies.oracle.options={target: 3}"], ["control.policies.oracle.options: ", "target is 3"]),
        (["control.surface.sizes_px=[3,7]"], ["control.surface.sizes_px: begins at 3"]),
        (["control.surface.darker.target_levels=[0.3,0.5]"], ["darker.target_levels: 0.5", "target_level, 0.5"]),
        (["executor.backend=dask"], ["executor.address"]),
        (["executor.address=tcp://127.0.0.1:8786"], ["executor.address=tcp", "executor.backend=dask"]),
        (["camera=authors", "camera.poisson=hybrid"], ["camera.poisson=hybrid", "authors"]),
        (["+noise.estimators.cellwise.options.weights=/nowhere"], ["options.weights=/nowhere", "no such file"]),
        (["+blur.estimators.fused.options.weights=/nowhere"], ["blur.estimators.fused.options.weights"]),
        (["executor.backend=dask", "executor.address=nowhere"], ["executor.address=nowhere"]),
        (["detection.datasets=[sim,photos]"], ["detection.datasets: 'photos'", "detector_classes"]),
        (["+detection.detectors.mine={kind: yolox}"], ["detection.detectors.mine.weights", "'yolox' needs a file"]),
        (["datasets.sim.limit=true"], ["datasets.sim.limit", "valid integer"]),
    ],
)
def test_what_does_not_exist_is_refused_when_compiling(tmp_path, overrides, words):
    path = tmp_path / "params.yaml"
    with pytest.raises(InputError) as caught:
        compile_params(overrides, path, check_references)
    message = str(caught.value)
    assert all(word in message for word in words), message
    assert len(message.splitlines()) == 1
    assert not path.exists()


@pytest.mark.parametrize("root", ["./", "data/../", "../other/", "runs/../", "runs/./", "runs/", "runs/a/b/", "mine/"])
def test_a_run_beside_the_released_one_writes_below_its_own_folder(root):
    with pytest.raises(InputError, match="root"):
        validate(composed.content("profile=smoke") | {"root": root}, "test")


def test_a_folder_below_runs_may_have_any_name():
    assert parse(compose(["profile=smoke", "root=runs/night_v1.2/"]), "test").root == "runs/night_v1.2/"


def test_a_stage_with_overrides_refuses_what_does_not_exist():
    command = [sys.executable, "-m", "pipeline.stages.sensor", "noise.estimators.pca.kind=pcaa"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 2
    assert "did you mean 'pca'" in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr


def test_the_first_stage_of_an_experiment_refuses_too(tmp_path, monkeypatch):
    monkeypatch.setenv("DVC_EXP_NAME", "an-experiment")  # its params.yaml is written by DVC
    path = tmp_path / "params.yaml"
    path.write_text(compose(["camera.sensor.model=papr"]))
    with pytest.raises(InputError, match="did you mean 'paper'"):
        check(path, check_references)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["noise.tile=3"], "tile_px"),
        (["profile=smok", "--multirun"], "did you mean 'smoke'"),
        (["noise.tile_px=64,8", "--multirun"], "noise.tile_px"),
        (["noise.tile_px"], "not an override KEY=VALUE"),
        (["seed=[", "+job.dataset=sim"], "seed=["),
        (["+job.dataset=sim", "+job.dataset=photos"], "job.dataset is given twice"),
        (["hydra/launcher=jobli", "--multirun"], "hydra/launcher=jobli: did you mean 'joblib'"),
    ],
)
def test_overrides_of_a_sweep_are_refused_in_one_line(arguments, word):
    with pytest.raises(InputError) as caught:
        check_overrides(arguments, CONF)
    assert word in str(caught.value) and len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(("launcher", "extra"), [("joblib", "sweep"), ("submitit_slurm", "cluster")])
def test_a_launcher_that_is_not_installed_is_refused_with_its_extra(launcher, extra, monkeypatch):
    monkeypatch.setattr("hydra.core.config_store.ConfigStore.list", lambda self, path: ["basic.yaml"])
    check_overrides(["hydra/launcher=basic", "--multirun"], CONF)
    with pytest.raises(InputError, match=rf"hydra/launcher={launcher}: not installed; pip install -e '\.\[{extra}\]'"):
        check_overrides([f"hydra/launcher={launcher}", "--multirun"], CONF)


def test_the_launcher_of_slurm_is_refused_where_there_is_none(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError, match="no Slurm here"):
        check_scheduler(["hydra/launcher=submitit_slurm", "--multirun"])
    check_scheduler(["hydra/launcher=submitit_local", "--multirun"])
    (tmp_path / "srun").touch(mode=0o755)
    check_scheduler(["hydra/launcher=submitit_slurm", "--multirun"])


def test_what_stages_write_may_be_absent_what_users_bring_may_not():
    assert _may_be_made("data/sim", "") and _may_be_made("runs/mine/data/weights/a.safetensors", "runs/mine/")
    assert not _may_be_made("data/raw/kitti", "") and not _may_be_made("/data/kitti", "")


def test_good_overrides_pass():
    check_overrides(["seed=1,2", "noise.tile_px=64", "+job.dataset=sim", "hydra.sweep.dir=/tmp/x", "--multirun"], CONF)


def test_a_stage_answers_an_unknown_key_in_one_line():
    command = [sys.executable, "-m", "pipeline.stages.sensor", "camera.sensr.model=paper", "--multirun"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 2
    assert "did you mean 'sensor'" in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr
