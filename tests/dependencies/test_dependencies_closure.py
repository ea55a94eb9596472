"""Import closure: what importing and calling a module can execute, and fingerprints of it."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from pipeline.dependencies import closure as walker
from pipeline.dependencies.closure import closure, fingerprint, registered
from pipeline.errors import InputError

PACKAGE = {
    "pipeline/__init__.py": "",
    "pipeline/registry.py": "import importlib\nimportlib.import_module(name)\n",
    "pipeline/base.py": "import numpy\n",
    "pipeline/typed.py": "",
    "pipeline/alone.py": "",
    "pipeline/noise/__init__.py": (
        "from pipeline.registry import Registry\n"
        "REGISTRY = Registry('noise', 'pipeline.noise', {'a': 'pipeline.noise.a:A', 'b': 'pipeline.noise.b:B'})\n"
    ),
    "pipeline/noise/a.py": "def f():\n    from pipeline import base\n",
    "pipeline/noise/b.py": "RELEASED = 'data/weights/b.safetensors'\n",
    "pipeline/noise/tables.py": "",
    "pipeline/uses.py": "from pipeline import noise\n",
    "pipeline/reads.py": "from pipeline.noise.tables import SCHEMA\n",
    "pipeline/checks.py": (
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from pipeline import typed\n"
        "else:\n    from . import base\n"
    ),
    "pipeline/page/__init__.py": "from importlib import resources\nresources.files(__package__)\n",
    "pipeline/page/style.css": "",
    "pipeline/computed.py": "import importlib\nname = 'x'\nimportlib.import_module(f'pipeline.{name}')\n",
}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for path, text in PACKAGE.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    return tmp_path


def names(files: frozenset[str]) -> set[str]:
    return {path.removeprefix("pipeline/") for path in files}


NOISE = {"__init__.py", "registry.py", "noise/__init__.py"}


@pytest.mark.parametrize(
    ("module", "chosen", "expected"),
    [
        ("pipeline.noise.a", None, {*NOISE, "noise/a.py", "base.py"}),  # imports inside functions count
        ("pipeline.checks", None, {"__init__.py", "checks.py", "base.py"}),  # those for types do not
        ("pipeline.reads", None, {*NOISE, "reads.py", "noise/tables.py"}),  # a submodule leads to no registry entry
        (
            "pipeline.uses",
            None,
            {*NOISE, "uses.py", "noise/a.py", "noise/b.py", "base.py", "data/weights/b.safetensors"},
        ),
        ("pipeline.uses", {"pipeline.noise": frozenset({"a"})}, {*NOISE, "uses.py", "noise/a.py", "base.py"}),
        ("pipeline.uses", {"pipeline.noise": frozenset()}, {*NOISE, "uses.py"}),
        ("pipeline.page", None, {"__init__.py", "page/__init__.py", "page/style.css"}),
    ],
)
def test_closure(root, module, chosen, expected):
    assert names(closure(module, chosen, root)) == expected


def test_what_cannot_be_followed_is_an_error(root):
    with pytest.raises(InputError, match=r"computed.py:3 imports a module by a computed name"):
        closure("pipeline.computed", None, root)
    with pytest.raises(InputError, match=r"pipeline\.nothing: no such module"):
        closure("pipeline.nothing", None, root)


def test_a_chosen_name_that_is_not_registered_is_an_error(root):
    with pytest.raises(InputError, match=r"pipeline\.noise: 'nope' is not registered; known: a, b"):
        closure("pipeline.uses", {"pipeline.noise": frozenset({"a", "nope"})}, root)
    assert closure("pipeline.alone", {"pipeline.noise": frozenset({"nope"})}, root)  # reaches no such registry


def test_in_the_package_too():
    with pytest.raises(InputError, match=r"pipeline\.noise: 'nope' is not registered"):
        closure("pipeline.stages.noise", {"pipeline.noise": frozenset({"nope"})})


def test_a_chosen_name_of_a_third_party_is_not_followed(root, monkeypatch):
    def entry_points(group):
        return [SimpleNamespace(name="theirs")] if group == "pipeline.noise" else []

    monkeypatch.setattr(walker, "entry_points", entry_points)
    files = closure("pipeline.uses", {"pipeline.noise": frozenset({"a", "theirs"})}, root)
    assert names(files) == {*NOISE, "uses.py", "noise/a.py", "base.py"}


def test_an_edit_of_any_file_of_the_closure_changes_the_fingerprint_and_no_other(root):
    chosen = {"pipeline.noise": frozenset({"a"})}
    files = closure("pipeline.uses", chosen, root)
    before = fingerprint("pipeline.uses", {"size": 1}, chosen=chosen, root=root)
    assert before == fingerprint("pipeline.uses", {"size": 1}, chosen=chosen, root=root)
    assert before != fingerprint("pipeline.uses", {"size": 2}, chosen=chosen, root=root)
    for path in PACKAGE:
        text = (root / path).read_text()
        (root / path).write_text(text + "\n# edited\n")
        walker._source_digest.cache_clear()
        after = fingerprint("pipeline.uses", {"size": 1}, chosen=chosen, root=root)
        assert (after != before) is (path in files), path
        (root / path).write_text(text)


def test_names_of_a_registry(root):
    assert registered("pipeline.noise", root) == {"a", "b"}
