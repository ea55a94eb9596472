"""Code dependencies in ``dvc.yaml``: computed from the import closure of each stage, compared, or written in place.

A stage depends on the closure of its module, with the registry names that its `uses` leads to under ``params.yaml``, in
its ``--params`` mode and with the sections that it reads. Folders stand for all that is in them where the closure has
all of it. Only code (``pipeline/...``) and data files that code names (weights, published tables) are managed; every
other line of ``deps`` is left as it is.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence, Set
from pathlib import Path
from typing import Any

from pipeline import yaml_text
from pipeline.dependencies.closure import ROOT, closure, registered
from pipeline.dependencies.source_file import PACKAGE, read_source
from pipeline.dependencies.stage_groups import (
    ESTIMATORS,
    ROOTED,
    Group,
    all_outs,
    chosen_of,
    filled,
    groups,
    lookup,
    outs_of,
)
from pipeline.errors import InputError

WIDTH = 120
Contents = Mapping[str, Set[str]]
"""Folder -> files below it."""
_MANAGED = re.compile(rf"^({PACKAGE}/|(\$\{{root\}})?data/weights/.|data/paper/.|benchmarks/results/.)")


def files_of(group: Group, params: Mapping[str, Any], root: Path = ROOT) -> frozenset[str]:
    """Source and data files that the members of a group can execute or open by name; see `closure`."""
    module = group.module
    if (root / module.replace(".", "/") / "__main__.py").is_file():
        module += ".__main__"
    # members that choose the same names, as those that differ in the dataset do, execute the same
    # a third party's class is not followed, but what it derives from is
    bases = [f"{registry}.base" for registry, name in group.kinds.items() if name == "other"]
    choices = {tuple(sorted(chosen_of(group, job, params).items())) for job in group.jobs()}
    return frozenset().union(*(closure([module, *bases], dict(chosen), root) for chosen in choices))


def expected(
    group: Group, params: Mapping[str, Any], outs: frozenset[str], contents: Contents, root: Path = ROOT
) -> list[str]:
    """The lines of code and named data in ``deps`` of a group, but for what lies in folders that are written by hand.

    Args:
        group: of ``dvc.yaml``.
        params: content of ``params.yaml``.
        outs: outputs of all stages, as written in ``dvc.yaml``; a file among them with ``${root}`` gets it too.
        contents: folders of the package with the files below them; see `contents_of`.
        root: folder that holds the package.
    """
    selected = {filled(line.removeprefix(ROOTED), item) for line in outs_of(group.body) for item in group.items}
    by_hand = _by_hand(group)
    given = {filled(line, item).removeprefix(params["root"]) for line in by_hand for item in group.items}
    lines = []
    for path in _folders(files_of(group, params, root), contents):
        if path.startswith(f"{PACKAGE}/"):
            lines.append(path)
        elif group.is_stage and path not in selected and path not in given:
            rooted = f"{ROOTED}{path}"
            lines.append(rooted if rooted in outs else path)
    folders = tuple(f"{line.rstrip('/')}/" for line in by_hand)
    stage = f"{group.module.replace('.', '/')}.py"
    return sorted(
        (line for line in lines if not line.startswith(folders)),
        key=lambda line: (line != stage, not line.startswith(PACKAGE), line),
    )


def _by_hand(group: Group) -> list[str]:
    """Lines of ``deps`` that are not managed here."""
    return [line for line in group.body.get("deps", []) if not _MANAGED.match(line)]


def _folders(files: frozenset[str], contents: Contents) -> list[str]:
    """Paths with each folder that is there as a whole in place of its files."""
    whole: set[str] = set()
    for path in files:
        best = path
        for parent in list(Path(path).parents)[:-1]:
            folder = parent.as_posix()
            if not folder.startswith(f"{PACKAGE}/") or not contents.get(folder, frozenset()) <= files:
                break
            best = folder
        whole.add(best)
    return sorted(whole)


def contents_of(root: Path = ROOT) -> Contents:
    """Files below each folder of the package as DVC sees them (``.dvcignore``), all relative to `root`."""
    contents: dict[str, set[str]] = {}
    for path in (root / PACKAGE).rglob("*"):
        if path.is_file() and path.suffix != ".pyc" and "__pycache__" not in path.parts:
            file = path.relative_to(root)
            for folder in file.parents:
                contents.setdefault(folder.as_posix(), set()).add(file.as_posix())
    return contents


def differences(text: str, params: Mapping[str, Any], root: Path = ROOT) -> list[str]:
    """What is wrong with the code dependencies of a ``dvc.yaml``, one line each; empty where nothing is.

    Args:
        text: of the file.
        params: content of ``params.yaml``.
        root: folder that holds the package.
    """
    graph = yaml_text.parse(text)
    outs = all_outs(graph, params)
    problems, contents = _without_group(graph, params, root), contents_of(root)
    for group in groups(graph, params):
        declared = [line for line in group.body.get("deps", []) if _MANAGED.match(line)]
        wanted = expected(group, params, outs, contents, root)
        problems += [
            f"dvc.yaml: stage '{group.name}': add to deps:  - {line}" for line in wanted if line not in declared
        ]
        problems += [
            f"dvc.yaml: stage '{group.name}': remove from deps:  - {line}" for line in declared if line not in wanted
        ]
    return problems


def unlisted(graph: Mapping[str, Any], params: Mapping[str, Any], root: Path = ROOT) -> list[str]:
    """Built-in registry names that parameters choose for a stage without their module among its ``deps``.

    `differences` finds these too, but reads all source for it; here a list of names that was written for other
    parameters is noticed in the time of reading ``dvc.yaml``.

    Args:
        graph: content of ``dvc.yaml``.
        params: content of ``params.yaml``.
        root: folder that holds the package.

    Returns:
        ``STAGE: NAME, NAME``, one for each stage.
    """
    modules = dict[str, Mapping[str, str]]()
    result = []
    for group in groups(graph, params):
        listed = group.body.get("deps", [])
        chosen = [item for job in group.jobs() for item in chosen_of(group, job, params).items()]
        names = set()
        for registry, kinds in chosen:
            if registry not in modules:
                modules[registry] = _module_files(registry, root)
            files = modules[registry]
            names |= {name for name in kinds & files.keys() if not _is_listed(files[name], listed)}
        if names:
            result.append(f"{group.name}: {', '.join(sorted(names))}")
    return result


def _module_files(registry: str, root: Path) -> Mapping[str, str]:
    """Built-in names of a registry -> their source files; none where no module of the package has the group's name."""
    path = _source_file(registry, root)
    if path is None:
        return {}
    targets = read_source((root / path).read_text(encoding="utf-8"), registry, True).registries.get(registry, {})
    files = {name: _source_file(target, root) for name, target in targets.items()}
    return {name: file for name, file in files.items() if file is not None}


def _source_file(module: str, root: Path) -> str | None:
    base = module.replace(".", "/")
    return next((path for path in (f"{base}.py", f"{base}/__init__.py") if (root / path).is_file()), None)


def _is_listed(path: str, listed: Sequence[str]) -> bool:
    return any(path == line or path.startswith(f"{line.rstrip('/')}/") for line in listed)


def _without_group(graph: Mapping[str, Any], params: Mapping[str, Any], root: Path) -> list[str]:
    """Registry names that ``by_kind`` in ``conf/config.yaml`` lacks, or that a stage has no group for."""
    problems = []
    everything = groups(graph, params)
    for registry in ESTIMATORS:
        section = registry.rpartition(".")[2]
        names = {*registered(registry, root), "other"}
        listed = set(lookup(params, f"by_kind.{section}"))
        problems += [f"conf/config.yaml: by_kind.{section}: add {name}" for name in sorted(names - listed)]
        problems += [f"conf/config.yaml: by_kind.{section}: remove {name}" for name in sorted(listed - names)]
        over: dict[str, set[str]] = {}
        for group in everything:
            if registry in group.kinds:
                over.setdefault(group.module, set()).add(group.kinds[registry])
        problems += [
            f"dvc.yaml: add a stage of {module} over ${{by_kind.{section}.{name}}}"
            for module, kinds in over.items()
            for name in sorted(names - kinds)
        ]
    return problems


def rewritten(text: str, params: Mapping[str, Any], root: Path = ROOT) -> str:
    """A ``dvc.yaml`` with its code dependencies as they should be; comments and all other lines are kept.

    Args:
        text: of the file.
        params: content of ``params.yaml``.
        root: folder that holds the package.
    """
    graph = yaml_text.parse(text)
    outs, contents = all_outs(graph, params), contents_of(root)
    lines = text.splitlines()
    for group in groups(graph, params):
        depth = 6 if "do" in graph["stages"][group.name] else 4
        first, last = _deps_lines(lines, group.name, depth)
        lines[first:last] = _deps_text(_by_hand(group), expected(group, params, outs, contents, root), depth)
    return "\n".join(lines) + "\n"


def _deps_lines(lines: Sequence[str], name: str, depth: int) -> tuple[int, int]:
    """First line of ``deps`` of a stage and the line after its last; both behind ``cmd`` where it has none."""
    start, end = _block(lines, name)
    head = re.compile(rf"^ {{{depth}}}deps:")
    first = next((number for number in range(start, end) if head.match(lines[number])), None)
    if first is None:
        commands = (number for number in range(start, end) if lines[number].strip().startswith("cmd:"))
        behind = next(commands, start) + 1
        return behind, behind
    ends = (number for number in range(first + 1, end) if re.match(rf"^ {{0,{depth}}}\S", lines[number]))
    last = next(ends, end)
    while not lines[last - 1].strip():
        last -= 1
    return first, last


def _deps_text(others: Sequence[str], code: Sequence[str], depth: int) -> list[str]:
    """The key ``deps`` as lines: a flow sequence, filled to the width, code behind what is written by hand."""
    lines = [f"{' ' * depth}deps: ["]
    for part in (others, code):
        for number, entry in enumerate(part):
            word = (json.dumps(entry) if "{" in entry else entry) + ","
            if number and len(lines[-1]) + 1 + len(word) <= WIDTH:
                lines[-1] += f" {word}"
            else:
                lines.append(f"{' ' * (depth + 2)}{word}")
    lines[-1] = lines[-1].removesuffix(",") + "]"
    return lines


def _block(lines: Sequence[str], name: str) -> tuple[int, int]:
    """First line of a stage and the line after its last."""
    head = re.compile(rf"^  {re.escape(name)}:(\s|$)")
    start = next((number for number, line in enumerate(lines) if head.match(line)), None)
    if start is None:
        raise InputError(f"dvc.yaml: stage '{name}' is not written as a line '  {name}:'")
    end = next(
        (number for number in range(start + 1, len(lines)) if re.match(r"^( {0,2})[^\s#]", lines[number])), len(lines)
    )
    return start, end
