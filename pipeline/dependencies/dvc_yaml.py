"""Code dependencies in ``dvc.yaml``: computed from the import closure of each stage, compared, or written in place.

A stage depends on the closure of its module, with the registry names that its `uses` leads to under ``params.yaml``, in
its ``--params`` mode and with the sections that it reads. Folders stand for all that is in them where the closure has
all of it. Only code (``pipeline/...``) and data files that code names (weights, published tables) are managed; every
other line of ``deps`` is left as it is.

Estimators differ in what they execute, but DVC gives all members of one matrix the same list of dependencies. Their
stages are therefore groups, one per registry name, over ``${by_kind.REGISTRY.NAME}``.
"""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from pipeline import yaml_text
from pipeline.dependencies.closure import PACKAGE, ROOT, Chosen, closure, registered
from pipeline.errors import InputError

ESTIMATORS = {
    "pipeline.noise": "noise.estimators",
    "pipeline.blur": "blur.estimators",
    "pipeline.detection": "detection.detectors",
}
"""Registry group -> section whose members name an entry of it by ``kind``."""
WIDTH = 120
Contents = Mapping[str, Set[str]]
"""Folder -> files below it."""
_ROOTED = "${root}"
_MANAGED = re.compile(rf"^({PACKAGE}/|(\$\{{root\}})?data/weights/.|data/paper/.|benchmarks/results/.)")
_BY_KIND = re.compile(r"^\$\{by_kind\.(\w+)\.(\w+)\}$")
_VALUE = re.compile(r"\$\{([^}]+)\}")


@dataclass(frozen=True)
class Group:
    """One entry under ``stages`` of ``dvc.yaml``.

    Attributes:
        name: its key.
        body: its content, of ``do`` where there is one.
        items: per member of its matrix or ``foreach``: name in the template (``item.dataset``, ``key``) -> value; one
            empty mapping where it is a single stage.
        kinds: registry group -> name, where it goes over ``${by_kind.REGISTRY.NAME}``.
    """

    name: str
    body: Mapping[str, Any]
    items: Sequence[Mapping[str, str]]
    kinds: Mapping[str, str]

    @property
    def module(self) -> str:
        """The module that its command runs."""
        match = re.search(r"python -m (\S+)", str(self.body["cmd"]))
        if match is None:
            raise InputError(f"dvc.yaml: stage '{self.name}': expected cmd: python -m MODULE ...")
        return match[1]

    @property
    def is_stage(self) -> bool:
        """Whether it runs a stage; the check of the configuration only imports what it names and opens no data."""
        return self.module.startswith(f"{PACKAGE}.stages.")

    def jobs(self) -> list[dict[str, str]]:
        """What ``+job.KEY=`` gives each member; names in the place of values where it has no member."""
        given = re.findall(r"\+job\.(\w+)=(\S+)", str(self.body["cmd"]))
        return [{key: _filled(value, item) for key, value in given} for item in self.items or [{}]]


def _filled(template: str, item: Mapping[str, str]) -> str:
    """A template with the values of an item; what the item does not have is left as its name."""
    return _VALUE.sub(lambda match: item.get(match[1], match[1]), template)


def lookup(content: Any, path: str) -> Any:
    """A value of nested mappings by its dotted path.

    Raises:
        InputError: there is none.
    """
    for part in path.split("."):
        if not isinstance(content, Mapping) or part not in content:
            raise InputError(f"params.yaml: no '{path}'; run 'python -m pipeline.config'")
        content = content[part]
    return content


def groups(graph: Mapping[str, Any], params: Mapping[str, Any]) -> list[Group]:
    """The groups of a graph.

    Args:
        graph: content of ``dvc.yaml``.
        params: content of ``params.yaml``.
    """
    return [_group(name, entry, params) for name, entry in graph["stages"].items()]


def _group(name: str, entry: Mapping[str, Any], params: Mapping[str, Any]) -> Group:
    def resolved(value: Any) -> Any:
        match = _VALUE.fullmatch(value) if isinstance(value, str) else None
        return lookup(params, match[1]) if match else value

    over = entry.get("matrix", {"": entry["foreach"]} if "foreach" in entry else {})
    kinds = {
        f"{PACKAGE}.{match[1]}": match[2]
        for value in over.values()
        if isinstance(value, str) and (match := _BY_KIND.match(value))
    }
    items: list[dict[str, str]]
    if "foreach" in entry:
        members = resolved(entry["foreach"])
        items = [{"key": str(member), "item": str(member)} for member in members]
        if isinstance(members, Mapping):
            for item, value in zip(items, members.values(), strict=True):
                parts = (
                    {f"item.{key}": str(part) for key, part in value.items()} if isinstance(value, Mapping) else None
                )
                item |= {"item": str(value)} if parts is None else parts
    elif over:
        names = [f"item.{variable}" for variable in over]
        values = [[str(resolved(value)) for value in resolved(variable)] for variable in over.values()]
        items = [dict(zip(names, each, strict=True)) for each in product(*values)]
    else:
        items = [{}]
    return Group(name, entry.get("do", entry), items, kinds)


def chosen_of(group: Group, job: Mapping[str, str], params: Mapping[str, Any]) -> Chosen:
    """Registry names that one member of a group can use."""
    chosen: dict[str, frozenset[str]] = {}
    module = importlib.import_module(group.module)
    stage = getattr(module, "run", None)
    if stage is not None:
        mode = "params" if "--params" in str(group.body["cmd"]).split() else "conf"
        chosen = {
            f"{PACKAGE}.config.modes": frozenset({mode}),
            f"{PACKAGE}.config.sections": frozenset(stage.sections()),
        }
        for registry, paths in stage.uses.items():
            if registry in group.kinds:
                chosen[registry] = frozenset({group.kinds[registry]})
                if group.kinds[registry] == "other":
                    chosen[registry] = _kinds(registry, paths, job, params) if group.items else frozenset()
            else:
                chosen[registry] = _kinds(registry, paths, job, params)
    return chosen


def _kinds(registry: str, paths: Sequence[str], job: Mapping[str, str], params: Mapping[str, Any]) -> frozenset[str]:
    kinds: set[str] = set()
    for path in paths:
        path = path.format(**job)
        value = lookup(params, path) if "." in path else path
        kinds |= set(_kinds_in(registry, value, params))
    return frozenset(kinds)


def _kinds_in(registry: str, value: Any, params: Mapping[str, Any]) -> Iterator[str]:
    """Registry names in a section, in a mapping of sections or names, in a list of names, or a name itself."""
    members = lookup(params, ESTIMATORS[registry]) if registry in ESTIMATORS else {}
    if isinstance(value, str):
        yield str(members[value]["kind"]) if value in members else value
    elif isinstance(value, Mapping) and isinstance(value.get("kind"), str):
        yield value["kind"]
    elif isinstance(value, Mapping):
        for name, member in value.items():
            given = isinstance(member, Mapping) and "kind" in member
            yield from _kinds_in(registry, member if given else name, params)
    elif isinstance(value, Sequence):
        for name in value:
            yield from _kinds_in(registry, name, params)


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
    """The lines of code and named data in ``deps`` of a group.

    Args:
        group: of ``dvc.yaml``.
        params: content of ``params.yaml``.
        outs: outputs of all stages, as written in ``dvc.yaml``; a file among them with ``${root}`` gets it too.
        contents: folders of the package with the files below them; see `contents_of`.
        root: folder that holds the package.
    """
    selected = {_filled(_plain(line), item) for line in _outs(group.body) for item in group.items}
    given = [line for line in group.body.get("deps", []) if not _MANAGED.match(line)]
    by_hand = {_filled(line, item).removeprefix(params["root"]) for line in given for item in group.items}
    lines = []
    for path in _folders(files_of(group, params, root), contents):
        if path.startswith(f"{PACKAGE}/"):
            lines.append(path)
        elif group.is_stage and path not in selected and path not in by_hand:
            rooted = f"{_ROOTED}{path}"
            lines.append(rooted if rooted in outs else path)
    stage = f"{group.module.replace('.', '/')}.py"
    return sorted(lines, key=lambda line: (line != stage, not line.startswith(PACKAGE), line))


def _outs(body: Mapping[str, Any]) -> list[str]:
    return [next(iter(out)) if isinstance(out, Mapping) else out for out in body.get("outs", [])]


def _plain(line: str) -> str:
    return line.removeprefix(_ROOTED)


def all_outs(graph: Mapping[str, Any], params: Mapping[str, Any]) -> frozenset[str]:
    """Outputs of all stages with their items filled in and ``${root}`` left."""
    return frozenset(
        _filled(out, {"root": _ROOTED, **item})
        for group in groups(graph, params)
        for item in group.items
        for out in _outs(group.body)
    )


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
        folders = tuple(f"{line.rstrip('/')}/" for line in group.body.get("deps", []) if not _MANAGED.match(line))
        wanted = [line for line in wanted if not line.startswith(folders)] if folders else wanted
        problems += [
            f"dvc.yaml: stage '{group.name}': add to deps:  - {line}" for line in wanted if line not in declared
        ]
        problems += [
            f"dvc.yaml: stage '{group.name}': remove from deps:  - {line}" for line in declared if line not in wanted
        ]
    return problems


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
        start, end = _block(lines, group.name)
        depth = 6 if "do" in graph["stages"][group.name] else 4
        head = re.compile(rf"^ {{{depth}}}deps:")
        first = next((number for number in range(start, end) if head.match(lines[number])), None)
        if first is None:
            commands = (number for number in range(start, end) if lines[number].strip().startswith("cmd:"))
            first = last = next(commands, start) + 1
        else:
            ends = (number for number in range(first + 1, end) if re.match(rf"^ {{0,{depth}}}\S", lines[number]))
            last = next(ends, end)
            while not lines[last - 1].strip():
                last -= 1
        others = [line for line in group.body.get("deps", []) if not _MANAGED.match(line)]
        inside = tuple(f"{line}/" for line in others)
        wanted = [
            line for line in expected(group, params, outs, contents, root) if not (inside and line.startswith(inside))
        ]
        lines[first:last] = _deps_text(others, wanted, depth)
    return "\n".join(lines) + "\n"


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
