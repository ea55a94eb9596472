"""Stages of ``dvc.yaml`` as groups: members of a matrix or ``foreach``, and the registry names that each of them uses.

Estimators differ in what they execute, but DVC gives all members of one matrix the same list of dependencies. Their
stages are therefore groups, one per registry name, over ``${by_kind.REGISTRY.NAME}``.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from pipeline.dependencies.closure import Chosen
from pipeline.dependencies.source_file import PACKAGE
from pipeline.errors import InputError

ESTIMATORS = {
    "pipeline.noise": "noise.estimators",
    "pipeline.blur": "blur.estimators",
    "pipeline.detection": "detection.detectors",
}
"""Registry group -> section whose members name an entry of it by ``kind``."""
ROOTED = "${root}"
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
        return [{key: filled(value, item) for key, value in given} for item in self.items or [{}]]


def filled(template: str, item: Mapping[str, str]) -> str:
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
    over = entry.get("matrix", {})
    if "foreach" in entry:
        items = _foreach_items(_resolved(entry["foreach"], params))
        over = {"": entry["foreach"]}
    elif over:
        names = [f"item.{variable}" for variable in over]
        values = [
            [str(_resolved(value, params)) for value in _resolved(variable, params)] for variable in over.values()
        ]
        items = [dict(zip(names, each, strict=True)) for each in product(*values)]
    else:
        items = [{}]
    matches = (_BY_KIND.match(value) for value in over.values() if isinstance(value, str))
    kinds = {f"{PACKAGE}.{match[1]}": match[2] for match in matches if match}
    return Group(name, entry.get("do", entry), items, kinds)


def _resolved(value: Any, params: Mapping[str, Any]) -> Any:
    """What ``${path}`` stands for; anything else is as it is."""
    match = _VALUE.fullmatch(value) if isinstance(value, str) else None
    return lookup(params, match[1]) if match else value


def _foreach_items(members: Any) -> list[dict[str, str]]:
    """Names in the template of each member of a list, or of a mapping to a value or to parts."""
    if not isinstance(members, Mapping):
        return [{"key": str(member), "item": str(member)} for member in members]
    items = []
    for key, value in members.items():
        parts = (
            {f"item.{part}": str(content) for part, content in value.items()} if isinstance(value, Mapping) else None
        )
        items.append({"key": str(key), "item": str(key)} | ({"item": str(value)} if parts is None else parts))
    return items


def chosen_of(group: Group, job: Mapping[str, str], params: Mapping[str, Any]) -> Chosen:
    """Registry names that one member of a group can use."""
    stage = getattr(importlib.import_module(group.module), "run", None)
    if stage is None:
        return {}
    mode = "params" if "--params" in str(group.body["cmd"]).split() else "conf"
    chosen = {
        f"{PACKAGE}.config.modes": frozenset({mode}),
        f"{PACKAGE}.config.sections": frozenset(stage.sections()),
    }
    for registry, paths in stage.uses.items():
        kind = group.kinds.get(registry, "other")
        if kind != "other":
            chosen[registry] = frozenset({kind})
        elif registry in group.kinds and not group.items:  # nobody's own is configured
            chosen[registry] = frozenset()
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


def outs_of(body: Mapping[str, Any]) -> list[str]:
    """Outputs of a stage, as they are written."""
    return [next(iter(out)) if isinstance(out, Mapping) else out for out in body.get("outs", [])]


def all_outs(graph: Mapping[str, Any], params: Mapping[str, Any]) -> frozenset[str]:
    """Outputs of all stages with their items filled in and ``${root}`` left."""
    return frozenset(
        filled(out, {"root": ROOTED, **item})
        for group in groups(graph, params)
        for item in group.items
        for out in outs_of(group.body)
    )
