"""The walks of docs/walks.md: every function exists, is used by the one above it, and no file is entered again."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

PAGE = Path(__file__).resolve().parents[1] / "docs/walks.md"
STEP = re.compile(r"^( *)- `(pipeline\.[\w.]+)`$")


def walks() -> dict[str, list[tuple[int, str]]]:
    """Title of a walk -> depth and function of each step."""
    parts = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    steps = {
        part.splitlines()[0]: [match for line in part.splitlines() if (match := STEP.match(line))] for part in parts
    }
    return {title: [(len(match[1]) // 4, match[2]) for match in matches] for title, matches in steps.items()}


def located(path: str) -> tuple[str, Any]:
    """The module of a function, and the function or method itself."""
    parts = path.split(".")
    for length in range(len(parts) - 1, 0, -1):
        name = ".".join(parts[:length])
        try:
            target: Any = importlib.import_module(name)
        except ModuleNotFoundError:
            continue
        for part in parts[length:]:
            target = getattr(target, part)
        return name, target
    raise AssertionError(f"no module of {path}")


def calls(steps: list[tuple[int, str]]) -> Iterator[tuple[str, str]]:
    """Pairs of a function and one beneath it."""
    above: list[str] = []
    for depth, path in steps:
        del above[depth:]
        if above:
            yield above[-1], path
        above.append(path)


WALKS = walks()


def test_the_page_has_three_walks() -> None:
    assert [len(steps) > 10 for steps in WALKS.values()] == [True, True, True]


def names_in(node: ast.AST) -> set[str]:
    """Every name and attribute that a piece of code mentions."""
    names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
    return names | {part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)}


def used_by(module: str, function: str) -> set[str]:
    """Names that a function mentions, and those that other functions of its file mention on its behalf."""
    tree = ast.parse(inspect.getsource(importlib.import_module(module)))
    functions = {node.name: node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    known, waiting = set[str](), [function]
    while waiting:
        name = waiting.pop()
        new = names_in(functions[name]) - known
        known |= new
        waiting += [other for other in new if other in functions and other != name]
    return known


@pytest.mark.parametrize("title", WALKS)
def test_every_function_is_used_by_the_one_above_it(title: str) -> None:
    for caller, called in calls(WALKS[title]):
        module, _ = located(caller)
        located(called)
        assert called.rsplit(".", 1)[1] in used_by(module, caller.rsplit(".", 1)[1]), f"{caller} does not use {called}"


@pytest.mark.parametrize("title", WALKS)
def test_no_file_is_left_and_entered_again(title: str) -> None:
    """Functions of one file may follow each other beneath one caller, and stand beneath a function of that file."""
    entered: list[str] = []
    above: list[str] = []
    beside: list[str] = []  # by depth: the file of the step before
    for depth, path in WALKS[title]:
        module, _ = located(path)
        del above[depth:], beside[depth + 1 :]
        if module not in above and beside[depth:] != [module]:
            entered.append(module)
        above.append(module)
        beside[depth:] = [module]
    assert [name for name in dict.fromkeys(entered) if entered.count(name) > 1] == []
