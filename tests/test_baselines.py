"""The checker of metrics against baselines."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import baselines
from pipeline.baselines import Allowance, check, flatten, main, read_tolerances, update
from pipeline.errors import InputError

STORED = {"photon": {"5": {"median_dn": 5.0, "count": 72}}, "name": "pca", "ok": True, "list": [1.0, 2.0]}


def write(folder: Path, content: Any, name: str = "noise/sim-pca.json") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))
    return folder


def tolerances(folder: Path, text: str = "") -> Path:
    path = folder / "tolerances.yaml"
    path.write_text(text)
    return path


def changed(key: str, value: Any) -> dict[str, Any]:
    content = json.loads(json.dumps(STORED))
    position = content
    *parents, last = key.split(".")
    for parent in parents:
        position = position[parent]
    position[last] = value
    return content


def failures(tmp_path: Path, content: Any, text: str = "") -> list[baselines.Failure]:
    stored, result = write(tmp_path / "stored", STORED), write(tmp_path / "found", content)
    return check(result, stored, tolerances(tmp_path, text))


def test_equal_metrics_hold(tmp_path: Path) -> None:
    assert failures(tmp_path, STORED) == []


@pytest.mark.parametrize(
    ("key", "value", "why"),
    [
        ("photon.5.median_dn", 5.000001, "moved"),
        ("photon.5.median_dn", math.nan, "found is null or not finite"),
        ("photon.5.median_dn", math.inf, "found is null or not finite"),
        ("photon.5.median_dn", None, "found is null or not finite"),
        ("photon.5.median_dn", "5.0", "float became str"),
        ("photon.5.count", True, "int became bool"),
        ("name", "bf", "another word or flag"),
        ("ok", False, "another word or flag"),
    ],
)
def test_any_change_fails_without_a_tolerance(tmp_path: Path, key: str, value: Any, why: str) -> None:
    result = failures(tmp_path, changed(key, value))
    assert [item.metric for item in result] == [f"noise/sim-pca.json:{key}"]
    assert why in result[0].why


def test_missing_and_new_numbers_and_files_fail(tmp_path: Path) -> None:
    content = changed("photon.10", {"median_dn": 10.0})
    del content["name"]
    results = {item.metric.partition(":")[2]: item.why for item in failures(tmp_path, content)}
    assert results == {"name": "missing in this run", "photon.10.median_dn": "new: no baseline yet"}
    write(tmp_path / "found", {"a": 1}, "extra.json")
    again = check(tmp_path / "found", tmp_path / "stored", tmp_path / "tolerances.yaml")
    assert "extra.json:a" in [item.metric for item in again]
    (tmp_path / "found/noise/sim-pca.json").unlink()
    gone = check(tmp_path / "found", tmp_path / "stored", tmp_path / "tolerances.yaml")
    assert sum(item.why == "missing in this run" for item in gone) == len(flatten(STORED))


def test_a_nan_in_the_baseline_fails_too(tmp_path: Path) -> None:
    stored, result = write(tmp_path / "s", {"a": math.nan}), write(tmp_path / "f", {"a": math.nan})
    assert [item.why for item in check(result, stored, tolerances(tmp_path))] == ["found is null or not finite"]


@pytest.mark.parametrize(
    "content",
    [{"c.d": 5, "c": {"d": 6}}, {"c": {"d": 6}, "c.d": 5}, {"a": [1, 2], "a.0": 1}, {"": 1, "a": {"": 3}, "a.": 2}],
)
def test_two_values_of_one_name_are_refused_with_the_file(tmp_path: Path, content: Any) -> None:
    stored, result = write(tmp_path / "stored", STORED), write(tmp_path / "found", content)
    with pytest.raises(InputError, match=r"found/noise/sim-pca\.json: two values have the name '[ac]\.[d0]?'"):
        check(result, stored, tolerances(tmp_path))


def test_leaves_keep_their_order_and_may_lie_deep() -> None:
    content: Any = 1.0
    for _ in range(5000):
        content = [content]
    assert flatten(content) == {".".join(["0"] * 5000): 1.0}
    assert list(flatten({"b": {"z": 1, "a": []}, "a": [True, {}, None]}).items()) == [
        ("b.z", 1), ("b.a", []), ("a.0", True), ("a.1", {}), ("a.2", None),
    ]  # fmt: skip
    assert flatten(3) == {"": 3}


def test_half_written_files_are_no_metrics(tmp_path: Path) -> None:
    stored, result = write(tmp_path / "stored", STORED), write(tmp_path / "found", STORED)
    for name in (
        ".writing-a.json",
        "noise/.writing-b.json",
        ".writing-folder/c.json",
        ".replaced-noise-x/noise/c.json",
    ):
        write(result, {"a": 1}, name)
    assert check(result, stored, tolerances(tmp_path)) == []
    assert update(result, stored) == len(flatten(STORED))
    assert [path.name for path in stored.rglob("*.json")] == ["sim-pca.json"]
    with pytest.raises(InputError, match="no metrics"):
        check(write(tmp_path / "only", {"a": 1}, ".writing-a.json"), stored, tolerances(tmp_path))


def test_a_list_that_lost_an_item_or_became_empty_fails(tmp_path: Path) -> None:
    assert [item.metric[-6:] for item in failures(tmp_path, changed("list", [1.0]))] == ["list.1"]
    assert len(failures(tmp_path, changed("list", []))) == 3


@pytest.mark.parametrize(
    ("text", "value", "holds"),
    [
        ('"noise/*.json:photon.*.median_dn": {abs: 0.1}', 5.1, True),
        ('"noise/*.json:photon.*.median_dn": {abs: 0.1}', 5.11, False),
        ('"noise/*.json:*": {rel: 0.02}', 5.1, True),
        ('"noise/*.json:*": {rel: 0.02}', 4.89, False),
        ('"blur/*.json:*": {abs: 1}', 5.1, False),
        ("default: {abs: 1}", 5.1, True),
        ('"*": {}\n"noise/*": {abs: 9}', 5.1, False),
        ('"*": {direction: lower_is_better}', 1.0, True),
        ('"*": {direction: lower_is_better, abs: 0.1}', 5.2, False),
        ('"*": {direction: higher_is_better}', 9.0, True),
        ('"*": {direction: higher_is_better}', 4.9, False),
    ],
)
def test_patterns_bounds_and_directions(tmp_path: Path, text: str, value: float, holds: bool) -> None:
    assert (failures(tmp_path, changed("photon.5.median_dn", value), text) == []) is holds


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(0, 10), st.floats(0, 1))
def test_directions_split_the_two_sided_rule(stored: float, found: float, absolute: float, relative: float) -> None:
    both, lower, higher = (
        Allowance(absolute, relative, direction).allows(stored, found)
        for direction in (baselines.BOTH, baselines.LOWER, baselines.HIGHER)
    )
    assert both == (lower and higher)
    assert lower or higher


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('"a*": 0', "expects {abs, rel, direction}, not 0"),
        ('"a*": {absolute: 1}', "unknown key 'absolute'; known: abs, direction, rel"),
        ('"a*": {abs: -1}', "at least 0"),
        ('"a*": {abs: 1e-6}', "write 1.0e-6"),
        ('"a*": {abs: .nan}', "at least 0"),
        ('"a*": {direction: lower}', "direction 'lower'.*lower_is_better"),
        ('"a*": 3', "expects"),
        ("- a", "expected a mapping"),
        ("a: b: c", "not valid YAML"),
        (f'"a*": {{abs: {"9" * 400}}}', "at least 0"),
    ],
)
def test_bad_tolerances_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_tolerances(tolerances(tmp_path, text))


def test_empty_folders_never_pass(tmp_path: Path) -> None:
    (tmp_path / "found").mkdir()
    with pytest.raises(InputError, match="no metrics"):
        check(tmp_path / "found", write(tmp_path / "stored", STORED), tolerances(tmp_path))


def test_update_replaces_what_is_stored_and_keeps_tolerances(tmp_path: Path) -> None:
    stored, result = write(tmp_path / "stored", {"old": 1}, "old.json"), write(tmp_path / "found", STORED)
    (stored / "tolerances.yaml").write_text("default: {abs: 1}\n")
    assert update(result, stored) == len(flatten(STORED))
    assert not (stored / "old.json").exists()
    assert check(result, stored, stored / "tolerances.yaml") == []
    write(tmp_path / "found", {"a": None}, "bad.json")
    with pytest.raises(InputError, match=r"bad\.json:a is null"):
        update(result, stored)


def one_line(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """What the command line says about wrong input."""
    assert main([str(argument) for argument in arguments]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    return message


def test_what_no_number_or_text_holds_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stored, result = write(tmp_path / "b", STORED), write(tmp_path / "m", {"n": {"x": -int("9" * 400)}})
    (stored / "tolerances.yaml").write_bytes(b"default: {abs: 1} # \xe4")
    line = ("--metrics", result, "--baselines", stored)
    assert "b/tolerances.yaml: not valid YAML" in one_line(capsys, *line)
    assert "b: cannot be read" in one_line(capsys, *line, "--tolerances", stored)
    (stored / "tolerances.yaml").unlink()
    tolerances(tmp_path)
    assert "sim-pca.json: 'n.x' is an integer of 400 digits" in one_line(capsys, *line)
    assert "400 digits" in one_line(capsys, *line, "--update")
    write(tmp_path / "m", STORED)
    (stored / "tolerances.yaml").write_bytes(b"# \xe4")
    assert main([str(word) for word in (*line, "--update")]) == 0
    assert (stored / "tolerances.yaml").read_bytes() == b"# \xe4"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (".", "which storing baselines there would delete"),
        ("..", "which storing baselines there would delete"),
        ("m", "m: holds .*/here/m, which"),
        ("notes", r"notes: holds deep/notes\.md, which"),
        ("held.json", r"held\.json.*: baselines not stored in full \(Not a directory\)"),
    ],
)
def test_nothing_but_baselines_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str, message: str
) -> None:
    here = tmp_path / "here"
    write(here / "m", STORED)
    write(here / "notes", STORED, "deep/notes.md")
    write(here, STORED, "held.json")
    monkeypatch.chdir(here)
    before = sorted(tmp_path.rglob("*"))
    assert re.search(message, one_line(capsys, "--metrics", "m", "--baselines", name, "--update"))
    assert sorted(tmp_path.rglob("*")) == before


def test_the_command_line_tells_by_its_exit_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stored, result = write(tmp_path / "b/smoke", STORED), write(tmp_path / "m", STORED)
    tolerances(tmp_path / "b")  # in the folder above, for all profiles
    line = ["--metrics", str(result), "--baselines", str(stored)]
    assert main(line) == 0
    assert f"({len(flatten(STORED))} numbers)" in capsys.readouterr().out
    write(tmp_path / "m", changed("photon.5.median_dn", 6.0))
    assert main(line) == 1
    shown = capsys.readouterr().out
    assert "noise/sim-pca.json:photon.5.median_dn" in shown and "moved by +1" in shown and "--update" in shown
    assert main([*line, "--update"]) == 0 and main(line) == 0
    assert main(["--metrics", str(tmp_path / "none"), "--baselines", str(stored)]) == 2
    assert "no metrics" in capsys.readouterr().err


def test_it_runs_as_a_module(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pipeline.baselines", "--metrics", str(tmp_path), "--baselines", "x"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).resolve().parents[1], check=False)
    assert done.returncode == 2 and "Traceback" not in done.stderr
