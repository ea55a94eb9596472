"""The graph of stages: reads and files are those dvc.yaml declares and exist, and messages name its stages."""

import ast
import importlib
import re
from pathlib import Path

import composed
import pytest

from pipeline import yaml_text

ROOT = Path(__file__).resolve().parents[1]
GRAPH = composed.graph()["stages"]
STAGES = {name: body.get("do", body) for name, body in GRAPH.items() if name != "config"}
PARAMS = yaml_text.parse((ROOT / "params.yaml").read_text(encoding="utf-8"))


def module_of(name):
    """The stage's module: its command names it, since one module serves several groups of `dvc.yaml`."""
    return re.search(r"pipeline\.stages\.(\w+)", STAGES[name]["cmd"])[1]


def plain(template, job):
    """``datasets.${item.dataset}`` names the job's dataset; ``${key}`` what the only key of a job does."""
    return re.sub(r"\$\{(?:item\.)?(\w+)\}", lambda m: "{" + (job[0] if m[1] == "key" else m[1]) + "}", template)


@pytest.mark.parametrize("name", STAGES)
def test_declared_parameters_are_those_the_stage_reads(name):
    module = importlib.import_module(f"pipeline.stages.{module_of(name)}")
    assert module.run.name == module_of(name) and name.startswith(module.run.name)
    hashes = ("plug_ins.", "option_files.")  # of source and of files, which no stage reads
    read = [path for path in STAGES[name]["params"] if not path.startswith(hashes)]
    assert sorted(module.run.reads) == sorted(plain(path, module.run.job) for path in read)


@pytest.mark.parametrize("name", STAGES)
def test_jobs_are_those_of_the_matrix(name):
    module = importlib.import_module(f"pipeline.stages.{module_of(name)}")
    keys = re.findall(r"\+job\.(\w+)=", STAGES[name]["cmd"])
    assert list(module.run.job) == keys


def test_stages_that_execute_third_parties_code_follow_an_edit_of_it():
    """Stages of detections follow it by what `detector` writes; those of a dataset by what `index` writes."""
    followed = {
        name: {path.removeprefix("plug_ins.").partition(".")[0] for path in body["params"] if "plug_ins." in path}
        for name, body in STAGES.items()
    }
    assert {name: sections for name, sections in followed.items() if sections} == {
        "index": {"datasets"},
        "noise_other": {"noise"},
        "real_noise": {"real_noise"},
        "blur_other": {"blur"},
        "combined": {"blur", "noise"},
        "denoised_blur": {"blur"},
        "detector_other": {"detection"},
        "measured": {"measured_mtf", "measured_sigma"},
        "closed_loop": {"control"},
    }
    assert set.union(*followed.values()) == set(PARAMS["plug_ins"])


def test_stages_that_run_estimators_by_their_options_follow_the_files_that_these_name():
    sections = {"noise.estimators": "noise", "blur.estimators": "blur", "real_noise.estimators": "real_noise"}
    for name, body in STAGES.items():
        read = {part for path in body["params"] for key, part in sections.items() if path.startswith(key)}
        followed = {path.split(".")[1] for path in body["params"] if path.startswith("option_files.")}
        assert followed == read, name


@pytest.mark.parametrize("name", GRAPH)
def test_code_dependencies_exist(name):
    body = GRAPH[name].get("do", GRAPH[name])
    for path in body["deps"]:
        if path.startswith(("pipeline", "conf", "params")):
            assert list(ROOT.glob(re.sub(r"\$\{.*?\}", "*", path))), path


def test_the_report_depends_on_all_of_its_package():
    """A text that is edited must not leave the page as it is."""
    deps = [ROOT / path for path in GRAPH["report"]["deps"] if path.startswith("pipeline/report")]
    files = {path for path in (ROOT / "pipeline/report").rglob("*.*") if path.is_file() and path.suffix != ".pyc"}
    assert files and {path for path in files if not {path, *path.parents} & set(deps)} == set()


def test_every_stage_file_is_in_the_graph():
    files = {path.stem for path in (ROOT / "pipeline" / "stages").glob("*.py")} - {"__init__"}
    assert files == {module_of(name) for name in STAGES}


WORDS_AFTER_REPRO = {"makes", "or", "trains"}
"""Words of sentences about ``dvc repro`` without a stage."""


def named_in_messages():
    """(Where, stage) of every ``dvc repro STAGE`` in strings and docstrings of the package."""
    for path in sorted((ROOT / "pipeline").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                for options, name in re.findall(r"dvc repro((?:\s+-[\w-]+)*)\s+(\w[\w@-]*)", node.value):
                    if options or name not in WORDS_AFTER_REPRO:
                        yield f"{path.relative_to(ROOT)}:{node.lineno}", name


def test_messages_name_stages_that_exist():
    """A member of a matrix is named as ``stage@item``, all of them by the stage's name."""
    named = list(named_in_messages())
    assert {"index", "psf_bank", "train_sigma_cellwise", "train_sigma_correlated"} <= {name for _, name in named}
    for where, name in named:
        stage, member, _ = name.partition("@")
        assert stage in GRAPH, f"{where}: dvc.yaml has no stage '{stage}'"
        assert not member or {"matrix", "foreach"} & GRAPH[stage].keys(), f"{where}: '{stage}' has no members"


def test_real_data_is_no_dependency_of_the_default_graph():
    """A fresh machine has none, and a missing dependency would stop the whole run."""
    assert set(PARAMS["datasets"]) == {"sim", "photos"}
