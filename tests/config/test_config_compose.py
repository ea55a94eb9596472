"""Configuration: every option composes, params.yaml is in step, mistakes are one clear line."""

import itertools
import subprocess
import sys
from pathlib import Path

import composed
import pytest
import yaml

from pipeline.config import compose as compiling
from pipeline.config import from_params
from pipeline.config.compose import compile_params, compose, load, parse
from pipeline.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.usefixtures("remembered_compositions")
CONF = ROOT / "conf"
GROUPS = {
    folder.relative_to(CONF).as_posix(): sorted(path.stem for path in folder.glob("*.yaml"))
    for folder in CONF.rglob("*")
    if folder.is_dir() and list(folder.glob("*.yaml"))
}
EXPERIMENTS = {
    "noise": "noise",
    "real_noise": "real_noise",
    "blur": "table_one",
    "combined": "combined",
    "denoised_blur": "denoised_blur",
    "detection": "iopc",
    "corruption": "corruption",
    "ablation": "ablation",
}
TOP = {
    group: options
    for group, options in GROUPS.items()
    if group not in ("dataset", "detector", "recording", "estimator/noise", "estimator/blur", "experiment")
}
PLACED = [f"+dataset@datasets.extra_{name}={name}" for name in GROUPS["dataset"]]
PLACED += [f"experiment@{section}={name}" for section, name in EXPERIMENTS.items()]
PLACED += [f"+detector@detection.detectors.extra_{name}={name}" for name in GROUPS["detector"]]
PLACED += [f"+recording@real_noise.recordings.extra_{name}={name}" for name in GROUPS["recording"]]
PLACED += [
    f"+estimator/{what}@{what}.estimators.extra_{name}={name}"
    for what in ("noise", "blur")
    for name in GROUPS[f"estimator/{what}"]
]
TOGETHER = [PLACED] + [
    [override for override in row if override]
    for row in itertools.zip_longest(*([f"{group}={option}" for option in options] for group, options in TOP.items()))
]


@pytest.fixture(autouse=True)
def at_top(monkeypatch):
    monkeypatch.chdir(ROOT)


@pytest.mark.parametrize("overrides", TOGETHER, ids=" ".join)
def test_every_group_option_composes_and_is_valid(overrides):
    """As many options at once as exclude each other in no group: composing takes most of a second."""
    config = parse(compiling.compose(overrides), "conf/")
    assert list(config.datasets) == config.matrix.datasets
    assert list(config.noise.estimators) == config.matrix.noise_estimators
    assert list(config.blur.estimators) == config.matrix.blur_estimators
    assert list(config.detection.detectors) == config.matrix.detectors


@pytest.mark.parametrize("profile", GROUPS["profile"])
def test_profiles_know_their_name(profile):
    assert parse(compiling.compose([f"profile={profile}"]), "conf/").profile == profile


def test_every_experiment_is_a_file_of_its_own():
    assert sorted(EXPERIMENTS.values()) == GROUPS["experiment"]


def test_params_yaml_is_what_conf_gives():
    assert (ROOT / "params.yaml").read_text() == compiling.compose()


def test_the_text_is_the_one_dvc_writes(tmp_path):
    from dvc.utils.hydra import compose_and_dump

    compose_and_dump(tmp_path / "params.yaml", str(CONF), None, "config", None, ["profile=smoke"])
    assert (tmp_path / "params.yaml").read_text() == compiling.compose(["profile=smoke"])


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("noise.tile=64", ["noise.tile", "tile_px"]),
        ("scene.samples=1", ["scene", "scenes"]),
        ("noise.tile_px=-4", ["noise.tile_px", "-4"]),
        ("profile=smok", ["profile", "smoke"]),
        ("noise=3", ["noise"]),
        ("~camera", ["camera"]),
    ],
)
def test_mistakes_name_the_key_and_the_remedy(override, words, tmp_path):
    path = tmp_path / "params.yaml"
    with pytest.raises(InputError) as caught:
        compile_params([override], path)
    message = str(caught.value)
    assert all(word in message for word in words), message
    assert len(message.splitlines()) <= 2
    assert not path.exists()


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("noise.tile=64", ["noise.tile", "tile_px"]),
        ("noise.tile_px=many", ["noise.tile_px", "many"]),
        ("camera.kind=pinhole", ["camera.kind", "pinhole", "authors"]),
        ("denoised_blur.target_sigmas_dn=[]", ["denoised_blur.target_sigmas_dn"]),
        ("psf.source=paper", ["psf.folder"]),
        ("matrix.datasets=[sim]", ["matrix.datasets", "derived"]),
        ("noise.target_sigmas_dn=[0,5,5.0]", ["noise.target_sigmas_dn", "5.0 is given more than once"]),
        ("noise.noise_sources=[readout,readout]", ["noise.noise_sources", "'readout' is given more than once"]),
        ("corruption.target_sigmas_dn=[5,5]", ["corruption.target_sigmas_dn", "5.0 is given more than once"]),
        ("combined.sizes_px=[3,3]", ["combined.sizes_px", "more than once"]),
        ("detection.sweep.angles_deg=[0,0]", ["detection.sweep.angles_deg", "more than once"]),
        ("detection.datasets=[sim,sim]", ["detection.datasets", "'sim' is given more than once"]),
        ("psf.kinds=[defocus,defocus]", ["psf.kinds", "more than once"]),
        ("control.camera.limits.iso_min=50", ["control.camera.limits.iso_min", "100"]),
        ("control.surface.moments=[0,0]", ["control.surface.moments", "more than once"]),
        ("noise.target_sigmas_dn=[.nan]", ["noise.target_sigmas_dn", "finite", "nan"]),
        ("noise.estimators.pca=null", ["noise.estimators.pca", "valid dictionary", "None"]),
    ],
)
def test_what_the_schema_refuses_names_the_key_and_the_remedy(assignment, words):
    key, _, value = assignment.partition("=")
    content = section = composed.content()
    *parents, last = key.split(".")
    for parent in parents:
        section = section[parent]
    section[last] = yaml.safe_load(value)
    with pytest.raises(InputError) as caught:
        parse(yaml.safe_dump(content), "conf/")
    message = str(caught.value)
    assert all(word in message for word in words), message
    assert len(message.splitlines()) <= 2


def test_drift_between_conf_and_params_is_shown(tmp_path, monkeypatch):
    path = tmp_path / "params.yaml"
    compile_params([], path)
    compiling.check(path)
    path.write_text(path.read_text().replace("\nseed: 1", "\nseed: 2"))
    with pytest.raises(InputError, match=r"\+seed: 2"):
        compiling.check(path)
    monkeypatch.setenv("DVC_EXP_NAME", "an-experiment")
    compiling.check(path)


def test_compiling_twice_writes_once(tmp_path):
    path = tmp_path / "params.yaml"
    assert compile_params([], path)
    assert not compile_params([], path)
    assert load(path).seed == 1


@pytest.mark.parametrize("read", [load, from_params.read])
@pytest.mark.parametrize("content", [None, b"[1, 2]", b"a: [", b"", b"a: \xff"])
def test_broken_params_are_one_line_with_the_remedy(tmp_path, content, read):
    path = tmp_path / "params.yaml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"params\.yaml: .*run 'make params'") as caught:
        read(path)
    assert "\n" not in str(caught.value)


def test_params_that_are_no_text_are_compiled_anew(tmp_path):
    path = tmp_path / "params.yaml"
    path.write_bytes(b"\xff")
    assert compile_params([], path)
    assert load(path).seed == 1


def test_command_line_says_one_line_and_fails():
    for arguments, word in itertools.product([["noise.tile=1"]], ["tile_px"]):
        done = subprocess.run(
            [sys.executable, "-m", "pipeline.config", *arguments], capture_output=True, text=True, cwd=ROOT
        )
        assert done.returncode == 2
        assert word in done.stderr
        assert "Traceback" not in done.stderr


ALIKE = pytest.mark.full("two more compositions three times each take 4 s")


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (
            ["control.policies.mine={kind: fixed}"],
            "what is new needs a plus: '+control.policies.mine={kind",
        ),
        (["noise.estimators.pac.kind=bf"], "not in conf/ yet; did you mean 'pca'?; what is new needs a plus"),
        pytest.param(
            ["control.scenarios.ramp.start_iso=200"], "not in conf/ yet; what is new needs a plus", marks=ALIKE
        ),
        pytest.param(
            ["control.policies.mean_intensity.options.tolerance=0.1"],
            "not in conf/ yet; what is new needs a plus",
            marks=ALIKE,
        ),
        (["control.scenarios.ramp.start_is=200"], "did you mean 'start_iso'"),
        (["dataset@datasets.mine=folder"], "needs a plus: '+dataset@datasets.mine=folder'"),
        (
            ["datasets.mine.root=/mine"],
            "datasets.mine.root' (no 'mine' in datasets); known: photos, sim",
        ),
        (["camera.sensor.full_wel_e=9000"], "not a parameter of the sensor; did you mean 'full_well_e'"),
        (["noise.estimators.pca.per_frame=many"], "noise.estimators.pca.per_frame': input should be a valid integer"),
        (["seed=2", "sede=2"], "unknown key 'sede'; did you mean 'seed'"),
    ],
)
def test_a_key_that_is_not_there_is_answered_by_how_to_add_it_or_by_the_nearest(overrides, words, monkeypatch):
    monkeypatch.chdir(ROOT)
    with pytest.raises(InputError) as caught:
        compose(overrides)
    assert words in str(caught.value) and len(str(caught.value).splitlines()) == 1
