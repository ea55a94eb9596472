"""Code dependencies in ``dvc.yaml``: complete, nothing beside, and written without touching other lines."""

import importlib
import inspect
import re
from pathlib import Path

import composed
import pytest

from pipeline import yaml_text
from pipeline.condition.estimate import ConditionMonitor
from pipeline.dependencies import dvc_yaml
from pipeline.dependencies.closure import closure
from pipeline.dependencies.stage_groups import ESTIMATORS, groups

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "dvc.yaml").read_text(encoding="utf-8")
PARAMS = composed.content()
GRAPH = composed.graph()
GROUPS = {group.name: group for group in groups(GRAPH, PARAMS)}
MODULES = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "pipeline").rglob("*.py"))


@pytest.fixture(scope="module", autouse=True)
def closed_once():
    """Stages that execute the same modules have the same closure; sources do not change here."""
    kept = {}

    def once(modules, chosen=None, root=ROOT):
        key = (tuple([modules] if isinstance(modules, str) else modules), tuple(sorted((chosen or {}).items())), root)
        if key not in kept:
            kept[key] = closure(modules, chosen, root)
        return kept[key]

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(dvc_yaml, "closure", once)
        yield


def covered(group, path):
    """Whether DVC names a group's stages when a file is edited: it, or a folder above it, is among ``deps``."""
    return any(path == line or path.startswith(f"{line}/") for line in group.body["deps"])


@pytest.mark.parametrize("name", GROUPS)
def test_dvc_names_a_stage_when_a_module_it_can_execute_is_edited_and_no_other(name):
    files = dvc_yaml.files_of(GROUPS[name], PARAMS)
    assert [path for path in MODULES if covered(GROUPS[name], path) != (path in files)] == []


def test_nothing_is_to_be_added_or_removed():
    assert dvc_yaml.differences(TEXT, PARAMS) == []
    assert dvc_yaml.rewritten(TEXT, PARAMS) == TEXT


def test_a_missing_and_a_needless_line_are_named_and_mended():
    broken = TEXT.replace("pipeline/stages/star.py, ", "", 1).replace(
        "pipeline/camera/characterisation/star.py", "pipeline/cli", 1
    )
    problems = dvc_yaml.differences(broken, PARAMS)
    assert problems == [
        "dvc.yaml: stage 'star': add to deps:  - pipeline/stages/star.py",
        "dvc.yaml: stage 'star': add to deps:  - pipeline/camera/characterisation/star.py",
        "dvc.yaml: stage 'star': remove from deps:  - pipeline/cli",
    ]
    assert dvc_yaml.rewritten(broken, PARAMS) == TEXT


def test_other_lines_and_comments_stay():
    commented = TEXT.replace("  star:\n", "  # the star\n  star:\n    # its words\n", 1)
    assert dvc_yaml.rewritten(commented, PARAMS) == commented


def test_stages_of_one_noise_estimator_do_not_depend_on_another():
    pca, cellwise = (dvc_yaml.files_of(GROUPS[f"noise_{kind}"], PARAMS) for kind in ("pca", "cellwise"))
    assert {"pipeline/noise/pca.py", "pipeline/experiments/corrupt.py"} <= pca
    assert not any("cellwise" in path or path.startswith(("data/weights", "pipeline/learning")) for path in pca)
    assert {"pipeline/noise/networks/cellwise_net.py", "data/weights/sigma_cellwise.safetensors"} <= cellwise
    assert "pipeline/noise/pca.py" not in cellwise


@pytest.mark.parametrize("name", ["closed_loop", "control_surface", "order_study", "worked_examples"])
def test_control_depends_on_what_the_condition_monitor_creates(name):
    defaults = {key: value.default for key, value in inspect.signature(ConditionMonitor).parameters.items()}
    stage = importlib.import_module(GROUPS[name].module).run
    assert stage.uses["pipeline.blur"] == (defaults["blur_name"],)
    assert stage.uses["pipeline.noise"] == (defaults["noise_name"],)
    files = dvc_yaml.files_of(GROUPS[name], PARAMS)
    assert "data/weights/mtf_spectral_processed.safetensors" in files
    assert "data/weights/detector_compact.safetensors" in files
    others = {"mtf_fusion.safetensors", "mtf_cnn.safetensors", "sigma_cnn.safetensors"}
    assert not {f"data/weights/{other}" for other in others} & files


def test_trainings_do_not_depend_on_sections_they_do_not_read():
    files = dvc_yaml.files_of(GROUPS["train_mtf_cnn"], PARAMS)
    packages = {path.split("/")[1] for path in files if path.count("/") == 2 and path.endswith("/settings.py")}
    assert packages == {"blur", "detection", "learning", "noise"}  # the section train is made of these
    assert {path for path in files if path.startswith("pipeline/config/") and "detection" in path} == set()
    assert not any("spectral" in path for path in files)


@pytest.mark.parametrize("registry", ESTIMATORS)
def test_every_registry_name_has_a_group(registry):
    section = registry.rpartition(".")[2]
    without = {**PARAMS, "by_kind": {**PARAMS["by_kind"], section: dict(PARAMS["by_kind"][section])}}
    gone = sorted(set(without["by_kind"][section]) - {"other"})[0]
    del without["by_kind"][section][gone]
    graph = {
        "stages": {name: body for name, body in GRAPH["stages"].items() if f".{section}.{gone}}}" not in str(body)}
    }
    problems = dvc_yaml._without_group(graph, without, ROOT)
    assert f"conf/config.yaml: by_kind.{section}: add {gone}" in problems
    assert any(f"over ${{by_kind.{section}.{gone}}}" in problem for problem in problems)


def test_outputs_of_stages_that_are_read_below_the_root_are_declared_below_it():
    lines = GROUPS["noise_cnn"].body["deps"]
    assert "${root}data/weights/sigma_cnn.safetensors" in lines
    assert re.search(r"\$\{root\}data/index/\$\{item\.dataset\}", " ".join(lines))


@pytest.mark.parametrize("name", GROUPS)
def test_a_profile_writes_below_its_root_and_does_not_stand_for_another_training(name):
    group = GROUPS[name]
    given = [*group.body.get("outs", []), *group.body.get("metrics", [])]
    outs = [next(iter(out)) if isinstance(out, dict) else out for out in given]
    assert all(out.startswith("${root}") for out in outs), outs
    if any("data/weights/" in out for out in outs):
        assert GRAPH["stages"][name]["matrix"]["profile"] == ["${profile}"]
    made = re.compile(r"(data/(?!paper|raw)|reports/(?!recorded))")
    assert not [line for line in group.body["deps"] if made.match(line)]


def test_every_stage_module_can_be_followed():
    for group in GROUPS.values():
        assert closure(group.module)


@pytest.mark.parametrize("name", ["noise_other", "blur_other", "detector_other", "detect_other"])
def test_stages_of_third_parties_depend_on_what_their_classes_derive_from(name):
    registry = next(iter(GROUPS[name].kinds))
    assert covered(GROUPS[name], f"{registry.replace('.', '/')}/base.py")


@pytest.mark.parametrize(
    ("overrides", "listed"),
    [
        ([], []),
        (["detection.measure.sigma=pca", "detection.measure.mtf=gbb"], ["measured: gbb, pca"]),
        *(
            pytest.param([override], listed, marks=pytest.mark.full("one more takes 3 s"))
            for override, listed in (
                ("profile=smoke", []),
                ("+detector@detection.detectors.yolox=yolox", []),
                ("+noise.estimators.mine={kind: immerkaer}", []),
                ("+real_noise.estimators.cnn={kind: cnn}", ["real_noise: cnn"]),
                ("combined.noise_estimators=[bf]", ["combined: bf"]),
            )
        ),
    ],
)
def test_a_name_whose_code_is_not_listed_is_noticed_as_by_the_whole_comparison(overrides, listed, monkeypatch):
    monkeypatch.chdir(ROOT)
    params = composed.content(*overrides)
    assert dvc_yaml.unlisted(GRAPH, params) == listed
    added = {line.split("'")[1] for line in dvc_yaml.differences(TEXT, params) if "add to deps" in line}
    assert added == {line.partition(":")[0] for line in listed}
    written = yaml_text.parse(dvc_yaml.rewritten(TEXT, params))
    assert dvc_yaml.unlisted(written, params) == []
