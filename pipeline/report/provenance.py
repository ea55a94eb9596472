"""Where each item of the report comes from: its stage, parameters and input hashes, read from ``dvc.lock``."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from pipeline import yaml_text
from pipeline.errors import InputError
from pipeline.report.inputs import ReportInputs
from pipeline.report.spec import Figure
from pipeline.stage_files import existing

SHOWN_HASH = 10  # letters of a hash that are shown


@dataclass(frozen=True)
class Provenance:
    """The origin of the figures of one stage of DVC, and the command that makes them again.

    ``inputs``: path -> hash of what it read; parameters as a line of JSON; ``recorded``: whether ``dvc.lock`` holds it.
    """

    items: Sequence[str]
    stage: str
    line: str
    inputs: Mapping[str, str]
    parameters: Sequence[str]
    recorded: bool


def read_lock(path: Path | None) -> dict[str, Any]:
    """The stages of a ``dvc.lock``; empty where there is none.

    Raises:
        InputError: the file is not a DVC lock file.
    """
    import yaml

    location = existing(path)
    if location is None:
        return {}
    try:
        content = yaml_text.parse(location.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise InputError(f"{location}: not valid YAML ({error}); restore it from git or run dvc repro") from None
    if content is None:
        return {}
    stages = content.get("stages", {}) if isinstance(content, dict) else None
    if not isinstance(stages, dict):
        raise InputError(f"{location}: expected a mapping with 'stages'; restore it from git or run dvc repro")
    return stages


def shown_path(path: str) -> str:
    """A path as the report shows it: an absolute one, which belongs to one machine, keeps its last part only."""
    for kind in (PurePosixPath, PureWindowsPath):
        if kind(path).is_absolute():
            return f"…/{kind(path).name}"
    return path


def origin(items: Sequence[str], stage: str, stages: Mapping[str, Any], inputs: ReportInputs) -> Provenance:
    """The origin of the figures of one stage.

    ``items`` are names of figures, ``stage`` a member such as ``"noise@sim-pca"``, ``stages`` the content of the lock
    file.
    """
    name = inputs.in_graph(stage)
    entry = stages.get(name) or {}
    hashes = {}
    for dependency in entry.get("deps", []):
        path = str(dependency.get("path", ""))
        if not path.startswith("pipeline/"):  # code: an edit that changes no result re-runs that stage, not the report
            digest = dependency.get("md5") or dependency.get("etag") or dependency.get("checksum") or ""
            hashes[shown_path(path)] = str(digest).removesuffix(".dir")[:SHOWN_HASH]
    parameters = [
        f"{key} = {json.dumps(value, sort_keys=True, ensure_ascii=False)}"
        for values in (entry.get("params") or {}).values() for key, value in sorted(values.items())
    ]  # fmt: skip
    return Provenance(tuple(items), stage, inputs.line(stage), dict(sorted(hashes.items())), parameters, name in stages)


def origins(figures: Sequence[Figure], inputs: ReportInputs) -> list[Provenance]:
    """The origin of every stage that a figure shows, in the order of the figures."""
    stages, items = read_lock(inputs.lock), dict[str, list[str]]()
    for figure in figures:
        for stage in figure.stages:
            items.setdefault(stage, []).append(figure.name)
    return [origin(names, stage, stages, inputs) for stage, names in items.items()]
