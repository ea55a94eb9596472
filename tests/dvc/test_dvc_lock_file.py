"""``python -m pipeline.dvc``: the same ``dvc.lock`` as DVC's, byte for byte."""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from dvc.utils.serialize import dumps_yaml, parse_yaml

from pipeline.dvc.lock_file import HEAD, with_entry

ROOT = Path(__file__).resolve().parents[2]
GRAPH = {
    "stages": {
        "one": {"cmd": "echo 1 > one.txt", "deps": ["a.txt"], "params": ["top"], "outs": ["one.txt"]},
        "each": {
            "matrix": {"name": ["x", "y-z"]},
            "cmd": f"echo {'a command that is so long that it is folded ' * 3} > each-${{item.name}}.txt",
            "deps": ["one.txt"],
            "outs": ["each-${item.name}.txt"],
        },
    }
}
PARAMS = {"top": {"none": None, "list": [1, 2.5, "on", "1e-3"], "text": "word " * 30, "true": True}}


def make(folder, command):
    folder.mkdir()
    (folder / "a.txt").write_text("a")
    (folder / "dvc.yaml").write_text(yaml.safe_dump(GRAPH))
    (folder / "params.yaml").write_text(yaml.safe_dump(PARAMS))
    run(folder, "dvc", "init", "--no-scm", "-q")
    locks = []
    for content in ("a", "b"):
        (folder / "a.txt").write_text(content)
        run(folder, command, "repro", "-q")
        locks.append((folder / "dvc.lock").read_text())
    assert "up to date" in run(folder, "dvc", "status")
    return locks


def run(folder, module, *arguments):
    command = [sys.executable, "-m", module, *arguments]
    environment = {"PYTHONPATH": str(ROOT), "PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin", "HOME": str(folder)}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=True).stdout


@pytest.mark.full("a graph, four times by DVC, takes 12 s")
def test_the_lock_file_is_that_of_dvc(tmp_path):
    quick = make(tmp_path / "quick", "pipeline.dvc")
    assert quick == make(tmp_path / "plain", "dvc")
    assert quick[0] != quick[1] and "each@y-z" in quick[1]
    assert not list((tmp_path / "quick").glob(".dvc.lock*"))


def test_entries_are_replaced_in_place_and_added_at_the_end():
    entries = {name: {"cmd": f"echo {name}", "deps": [{"path": name, "size": 1}]} for name in ("a", "ab", "c")}
    text = ""
    for name, entry in entries.items():
        text = with_entry(text, {name: entry})
    assert text == HEAD + dumps_yaml({"stages": entries}).removeprefix("stages:\n")
    for name in entries:
        entries[name] = {"cmd": "echo more", "outs": [{"path": "x"}, {"path": "y"}]}
        text = with_entry(text, {name: entries[name]})
        assert text == HEAD + dumps_yaml({"stages": entries}).removeprefix("stages:\n")


def test_a_new_entry_goes_before_its_followers():
    entries = {name: {"cmd": f"echo {name}"} for name in ("old", "a", "b", "c")}
    ordered = HEAD + dumps_yaml({"stages": entries}).removeprefix("stages:\n")
    text = ""
    for name, followers in (("old", ()), ("c", ()), ("a", ("b", "c")), ("b", ("c",)), ("a", ("b", "c"))):
        text = with_entry(text, {name: entries[name]}, followers)
    assert text == ordered
    text = ""
    for name, followers in (("old", ()), ("c", ()), ("b", ("c",)), ("a", ("b", "c"))):  # before the first of several
        text = with_entry(text, {name: entries[name]}, followers)
    assert text == ordered


@pytest.mark.parametrize("text", ["schema: '1.0'\nstages:\n", f"{HEAD}  a:\n    cmd: x\ndatasets: []\n"])
def test_another_layout_is_left_to_dvc(text):
    with pytest.raises(ValueError, match="layout"):
        with_entry(text, {"a": {"cmd": "y"}})


def test_the_committed_file_is_rebuilt_from_its_entries():
    text = (ROOT / "dvc.lock").read_text(encoding="utf-8")
    stages = parse_yaml(text, "dvc.lock")["stages"]
    for name in ("config", "sensor", "report", "curves@sim-compact", list(stages)[-1]):
        assert with_entry(text, {name: stages[name]}) == text, name
