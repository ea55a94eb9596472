"""Overrides of a sweep that change nothing a stage reads: all of its jobs would have the same results, silently."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.config.overrides import MOST_COMBINATIONS, parsed, split, values_of

if TYPE_CHECKING:
    from pipeline.config.entry import Stage

DVC_YAML = Path("dvc.yaml")
UNCOMPOSED = ("hydra", "job")
"""Keys that are no part of the configuration."""
ALWAYS_READ = ("executor", "root", "profile", *UNCOMPOSED)
OF_INDEX = ("limit", "whitelist", "max_rejected_fraction")
"""Keys of a dataset that act in the stage `index` alone; the others take the frames that it chose."""
READ_ANEW = ("detect", "measured")
"""Stages that follow them too, where ``detection.sweep.options`` has them read the dataset anew."""


def warnings(stage: Stage, arguments: Sequence[str], conf: Path) -> list[str]:
    """A sentence for each override that changes nothing the stage reads, by interpolation neither.

    Args:
        stage: that will run.
        arguments: of the command line, checked (`pipeline.config.overrides.check_overrides`).
        conf: the folder of groups.

    Returns:
        the sentences; none for an override that changes nothing at all, or where the job is incomplete.
    """
    overrides = parsed(split(arguments)[1])
    choices = [(override, values_of(override) or [override.input_line or ""]) for override in overrides]
    reads = _declared(stage, [line for override, lines in choices if _key(override) == "job" for line in lines])
    if reads is None:
        return []
    sentences = []
    for override, lines in choices:
        path = _path(override)
        if _key(override) in ALWAYS_READ or _read(stage.name, path, reads):
            continue
        others = [each[0] for other, each in choices if other is not override and _key(other) not in UNCOMPOSED]
        if _acts_elsewhere_only(lines, others, reads, conf) or _of_index(stage.name, path):
            readers = [name for name in _readers(path) if name != stage.name]
            by = f" (read by: {', '.join(readers)})" if readers else ""
            sentences.append(
                f"stage '{stage.name}' does not read {path}{by}: {override.input_line} changes nothing here"
            )
    return sentences


def _key(override: Any) -> str:
    return str(override.key_or_group).partition(".")[0]


def _path(override: Any) -> str:
    """Where in the configuration an override acts."""
    return str(override.package or override.key_or_group).replace("/", ".")


def _declared(stage: Stage, job_lines: Sequence[str]) -> set[str] | None:
    """What a stage reads in all of its jobs; None where a job lacks a key."""
    values: dict[str, list[str]] = {}
    for line in job_lines:
        key, _, value = line.lstrip("+").partition("=")
        values.setdefault(key.removeprefix("job."), []).append(value)
    if any(key not in values for key in stage.job):
        return None
    jobs = (dict(zip(values, chosen, strict=True)) for chosen in itertools.product(*values.values()))
    return {path for job in jobs for path in stage.declared(job)}


def _touches(path: str, key: str) -> bool:
    """Whether one of two dotted paths holds the other; ``*`` stands for any name."""
    pairs = zip(path.split("."), key.split("."), strict=False)
    return all(first == second or "*" in (first, second) for first, second in pairs)


def _of_index(stage: str, path: str) -> bool:
    head, _, last = path.rpartition(".")
    if stage in ("index", *READ_ANEW):
        return False
    return last in OF_INDEX and re.fullmatch(r"datasets\.[^.]+", head) is not None


def _read(stage: str, path: str, reads: Iterable[str]) -> bool:
    return not _of_index(stage, path) and any(_touches(each, path) for each in reads)


def _acts_elsewhere_only(lines: Sequence[str], others: Sequence[str], reads: Iterable[str], conf: Path) -> bool:
    """Whether an override changes the configuration, but nothing of what is read, whatever its value."""
    from pipeline import yaml_text
    from pipeline.config.compose import compose
    from pipeline.errors import InputError

    try:
        without = yaml_text.parse(compose(others, conf))
    except InputError:  # another override needs it
        return False
    changed = False
    for line in lines[:MOST_COMBINATIONS]:
        content = yaml_text.parse(compose([*others, line], conf))
        if any(_value(content, path) != _value(without, path) for path in (*reads, "executor", "root")):
            return False
        changed = changed or content != without
    return changed


def _value(content: Any, path: str) -> Any:
    for part in path.split("."):
        content = content.get(part) if isinstance(content, Mapping) else None
    return content


def _readers(path: str) -> list[str]:
    """Stages whose ``params`` in ``dvc.yaml`` hold a key."""
    from pipeline import yaml_text

    if _of_index("", path):
        return ["index"]
    if not DVC_YAML.is_file():
        return []
    names = set()
    for entry in yaml_text.parse(DVC_YAML.read_text(encoding="utf-8"))["stages"].values():
        body = entry.get("do", entry)
        module = re.search(r"-m pipeline\.stages\.(\w+)", str(body.get("cmd", "")))
        params = [re.sub(r"\$\{[^}]*\}", "*", line) for line in body.get("params", []) if isinstance(line, str)]
        if module and any(_touches(each, path) for each in params):
            names.add(module[1])
    return sorted(names)
