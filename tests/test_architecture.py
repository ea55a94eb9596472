"""The shape of the house: floors, file sizes, where randomness begins, what a light command may import."""

import ast
import collections
import functools
import graphlib
import statistics
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.cli import COMMANDS

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "pipeline"
FILES = sorted(PACKAGE.rglob("*.py"))
PACKAGES = sorted(path.parent.name for path in PACKAGE.glob("*/__init__.py"))

FLOORS = {
    "errors": 0, "streams": 0, "store": 0, "registry": 0, "executor": 0, "statistics": 0, "tables": 0, "settings": 0,
    "cluster_intervals": 0, "arrays": 0, "bisection": 0,
    "grouped_statistics": 0, "dependencies": 0, "processor": 0, "project_files": 0, "weight_files": 0,
    "stage_files": 0, "baselines": 0, "signals": 0, "freed_memory": 0, "yaml_text": 0,
    "answers": 0, "linked_folders": 0, "dask_worker": 0, "downloads": 0,
    "camera": 1,
    "scenes": 2,
    "datasets": 3, "learning": 3,
    "blur": 4, "noise": 4, "detection": 4,
    "condition": 5,
    "experiments": 6,
    "curves": 7,
    "control": 8,
    "report": 9,
    "config": 10, "recording": 10,
    "stages": 11, "cli": 11, "dvc": 11,
}  # fmt: skip

CLI_FLOORS = {
    "addresses": 0, "data_folders": 0, "ending_signals": 0, "exit_codes": 0, "lazy_group": 0, "new_project": 0,
    "onnx_networks": 0, "package_version": 0,
    "options": 1, "results": 1,
    "frames": 2,
    "analysis": 3, "calibration": 3, "corruption": 3, "recording": 3,
    "health": 4, "watching": 4,
    "commands": 5,
}  # fmt: skip
"""Of the folders and modules of ``pipeline/cli``."""


def folder(path):
    """The top-level folder or module of the package a file belongs to."""
    parts = path.relative_to(PACKAGE).parts
    return Path(parts[0]).stem


@functools.cache
def nodes(path):
    """All nodes of a file's syntax tree, the module first: files are parsed once, though several tests read each."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def imported(path):
    """Dotted names within the package that a file imports, anywhere in it, but for type checking."""
    skipped = {
        id(inner)
        for node in nodes(path)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        for inner in ast.walk(node)
    }
    for node in nodes(path):
        if id(node) in skipped:
            continue
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        for name in names:
            if name.startswith("pipeline."):
                yield name.split("."), node.lineno


def imports(path):
    """Names of the package's folders a file imports (`imported`)."""
    for parts, line in imported(path):
        yield parts[1], line


@functools.cache
def calls(path):
    """Dotted names of everything a file calls, each with its line."""
    return [(ast.unparse(node.func), node.lineno) for node in nodes(path) if isinstance(node, ast.Call)]


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_modules_import_only_from_lower_floors(path):
    selected = folder(path)
    if selected == "__init__":
        return
    assert selected in FLOORS, f"{selected} has no floor; say where it belongs"
    for other, line in imports(path):
        if other != selected:
            below = FLOORS[other] < FLOORS[selected] or FLOORS[selected] == FLOORS[other] == 0
            assert below, f"{path.relative_to(ROOT)}:{line} reaches from floor {FLOORS[selected]} to {other}"


@pytest.mark.parametrize("path", sorted((PACKAGE / "cli").rglob("*.py")), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_the_command_line_has_floors_too_and_no_command_imports_another(path):
    selected = Path(path.relative_to(PACKAGE / "cli").parts[0]).stem
    if selected.startswith("__"):
        return
    assert selected in CLI_FLOORS, f"{selected} has no floor; say where it belongs"
    for (_, top, *below), line in imported(path):
        if top == "cli" and (below[0] != selected or selected == "commands"):
            floor, other = CLI_FLOORS[selected], CLI_FLOORS[below[0]]
            reached = f"{path.relative_to(ROOT)}:{line} reaches from {selected} to {below[0]}"
            assert other < floor or other == floor == 0, reached


@pytest.mark.parametrize("name", PACKAGES)
def test_the_parts_of_a_package_do_not_import_each_other_in_circles(name):
    imports_of = {}
    for path in (PACKAGE / name).rglob("*.py"):
        part = Path(path.relative_to(PACKAGE / name).parts[0]).stem
        below = {parts[2] for parts, _ in imported(path) if parts[1] == name and len(parts) > 2}
        imports_of.setdefault(part, set()).update(below - {part})
    tuple(graphlib.TopologicalSorter(imports_of).static_order())  # CycleError names the circle


def test_folders_can_be_overlooked():
    modules = collections.Counter(path.parent for path in FILES if path.name != "__init__.py")
    del modules[PACKAGE / "stages"]  # one file per stage
    assert max(modules.values()) <= 25, max(modules, key=modules.get)


def test_every_command_is_a_file_of_its_name():
    assert {path.stem for path in (PACKAGE / "cli/commands").glob("*.py")} == {"__init__", *COMMANDS}


def test_the_readme_names_every_package_on_its_floor():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    lines = readme.split("## How it is built")[1].splitlines()
    for folder in sorted(path.name for path in (ROOT / "pipeline").iterdir() if (path / "__init__.py").is_file()):
        if FLOORS[folder]:
            (line,) = [line for line in lines if line[:1].isdigit() and f" {folder}/" in line]
            assert line.startswith(f"{FLOORS[folder]} "), line


def test_files_are_one_idea_long():
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in FILES}
    assert max(lengths.values()) <= 500, max(lengths, key=lengths.get)
    assert statistics.median(n for path, n in lengths.items() if path.name != "__init__.py") <= 150


def test_stage_files_hold_no_science():
    for path in (PACKAGE / "stages").glob("*.py"):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 110, path.name


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_randomness_begins_in_streams_only(path):
    if path.name == "streams.py":
        return
    banned = (
        "np.random.",
        "numpy.random.",
        "random.",
        "torch.manual_seed",
        "torch.seed",
        "cv2.setRNGSeed",
        "cv2.randn",
    )
    for name, line in calls(path):
        assert not name.startswith(banned), f"{path.relative_to(ROOT)}:{line} calls {name}"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_nothing_is_swallowed_or_unpickled(path):
    for node in nodes(path):
        if isinstance(node, ast.ExceptHandler):
            everything = node.type is None or ast.unparse(node.type) in ("Exception", "BaseException")
            swallowed = all(isinstance(step, (ast.Pass, ast.Continue, ast.Return)) for step in node.body)
            assert not (everything and swallowed), f"{path.relative_to(ROOT)}:{node.lineno} swallows every error"
    for name, line in calls(path):
        assert name not in ("yaml.load", "pickle.load", "pickle.loads", "eval", "exec", "torch.load"), f"{path}:{line}"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_every_module_and_public_name_says_what_it_is(path):
    tree = nodes(path)[0]
    assert ast.get_docstring(tree), f"{path.relative_to(ROOT)} has no docstring"
    for node in tree.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
            assert ast.get_docstring(node), f"{path.relative_to(ROOT)}:{node.lineno} {node.name} has no docstring"


def test_light_commands_stay_light():
    """Configuration and the help of every command load neither torch nor anything that draws."""
    code = (
        "import importlib, sys, pipeline.config.entry, pipeline.cli\n"
        "for name in pipeline.cli.COMMANDS: importlib.import_module(f'pipeline.cli.commands.{name}')\n"
        "heavy = {'torch', 'kornia', 'matplotlib', 'cv2', 'skimage', 'scipy', 'numba', 'onnxruntime', 'hydra'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert result.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "line", ["health a.png --calibrate-estimator", "calibrate front a.png --calibrate-estimator --chart star"]
)
def test_a_refused_option_is_refused_before_anything_heavy_is_loaded(line):
    code = (
        "import sys\n"
        "from pipeline.cli import main\n"
        "try: main()\n"
        "except SystemExit as ended: print(ended.code, sorted({'torch', 'cv2', 'scipy'} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", code, *line.split()]
    result = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert result.stdout.strip() == "2 []", result.stderr
