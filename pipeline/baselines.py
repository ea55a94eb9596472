"""Compare a run's metrics with stored ones: ``python -m pipeline.baselines --metrics DIR --baselines DIR``.

Metrics are JSON files in a folder tree; each number has a name like ``noise/sim-pca.json:photon.25.median_dn``. A
tolerance file maps patterns of such names to how far a number may move::

    default: {abs: 0, rel: 1.0e-6}
    "noise/*.json:*.median_dn": {abs: 0.05, rel: 0.01}
    "detection/*.json:*.ap": {rel: 0.02, direction: higher_is_better}

The first pattern that matches counts; a number that none matches takes ``default`` (exact where there is none). With
a direction only a change for the worse beyond the tolerance fails. A number that is missing, new, null or not finite
fails always: a run that produced nothing must not pass.
"""

from __future__ import annotations

import fnmatch
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline import yaml_text
from pipeline.errors import InputError, did_you_mean
from pipeline.store import read_json, replacing_folder, write_json

BOTH, LOWER, HIGHER = "both", "lower_is_better", "higher_is_better"
TOLERANCES = "tolerances.yaml"


@dataclass(frozen=True)
class Allowance:
    """How far one number may move.

    Attributes:
        absolute: in the number's unit; at least 0.
        relative: fraction of the baseline's magnitude; the larger of the two bounds counts.
        direction: ``both``, ``lower_is_better`` or ``higher_is_better``.
    """

    absolute: float = 0.0
    relative: float = 0.0
    direction: str = BOTH

    def allows(self, baseline: float, found: float) -> bool:
        """Whether a move from the baseline to the value found is within bounds, or for the better."""
        change = found - baseline
        if (self.direction == LOWER and change < 0) or (self.direction == HIGHER and change > 0):
            return True
        return abs(change) <= max(self.absolute, self.relative * abs(baseline))


@dataclass(frozen=True)
class Failure:
    """One number that did not hold.

    Attributes:
        metric: ``file:key``.
        baseline, found: the two values; None where one is absent.
        why: in words.
    """

    metric: str
    baseline: Any
    found: Any
    why: str


def flatten(content: Any, where: str = "") -> dict[str, Any]:
    """The leaves of nested JSON by dotted path; a list's items are numbered; an empty list or object is a leaf.

    Args:
        content: of a JSON file.
        where: the file, for messages.

    Raises:
        InputError: two leaves have the same path, since a key may hold a dot, or an integer exceeds double precision.
    """
    start = f"{where}: " if where else ""
    leaves: dict[str, Any] = {}
    waiting = [("", content)]
    while waiting:
        path, value = waiting.pop()
        if isinstance(value, (Mapping, list)) and value:
            items = list(value.items() if isinstance(value, Mapping) else enumerate(value))
            waiting += [(f"{path}.{key}" if path else str(key), item) for key, item in reversed(items)]
            continue
        if path in leaves:
            raise InputError(f"{start}two values have the name '{path}'; give one of their keys without a dot")
        if isinstance(value, int) and abs(value) > sys.float_info.max:
            raise InputError(f"{start}'{path}' is an integer of {len(str(abs(value)))} digits, which no float holds")
        leaves[path] = value
    return leaves


def metric_files(folder: Path) -> list[Path]:
    """JSON files beneath a folder, sorted; not those that begin with a dot, or lie in such a folder: half-written."""
    paths = (path for path in folder.rglob("*.json") if path.is_file())
    return sorted(path for path in paths if not any(part.startswith(".") for part in path.relative_to(folder).parts))


def read_metrics(folder: str | Path) -> dict[str, Any]:
    """Every leaf of every JSON file beneath a folder, as ``relative/file.json:key``.

    Raises:
        InputError: the folder is absent or holds no JSON, or see `flatten`.
    """
    folder = Path(folder)
    paths = metric_files(folder) if folder.is_dir() else []
    if not paths:
        raise InputError(f"{folder}: no metrics (*.json) here; run dvc repro, or name the right folder")
    leaves = {}
    for path in paths:
        name = path.relative_to(folder).as_posix()
        leaves.update({f"{name}:{key}": value for key, value in flatten(read_json(path), str(path)).items()})
    return leaves


def read_tolerances(path: str | Path) -> dict[str, Allowance]:
    """Patterns of metric names with what they allow, in the file's order.

    Raises:
        InputError: the file is absent, not YAML of UTF-8, or an entry has an unknown or ill-typed setting.
    """
    import yaml

    path = Path(path)
    try:
        content = yaml_text.parse(path.read_text(encoding="utf-8")) or {}
    except FileNotFoundError:
        raise InputError(f"{path}: no such file of tolerances; name it with --tolerances") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not valid YAML ({error})") from None
    if not isinstance(content, dict):
        raise InputError(f"{path}: expected a mapping from patterns to {{abs, rel, direction}}")
    entries = {str(pattern): {} if entry is None else entry for pattern, entry in content.items()}
    return {pattern: _allowance(path, pattern, entry) for pattern, entry in entries.items()}


def _allowance(path: Path, pattern: str, entry: Any) -> Allowance:
    known = ("abs", "rel", "direction")
    if not isinstance(entry, dict):
        raise InputError(f"{path}: '{pattern}' expects {{abs, rel, direction}}, not {entry!r}")
    for key in entry:
        if key not in known:
            raise InputError(f"{path}: '{pattern}' has unknown key '{key}'; {did_you_mean(str(key), known)}")
    bounds = []
    for key in ("abs", "rel"):
        value = entry.get(key, 0.0)
        if not _is_number(value) or not 0 <= value <= sys.float_info.max:
            hint = " (YAML reads 1e-6 as text; write 1.0e-6)" if isinstance(value, str) else ""
            raise InputError(f"{path}: '{pattern}' {key} must be a number of at least 0, not {value!r}{hint}")
        bounds.append(float(value))
    direction = entry.get("direction", BOTH)
    if direction not in (BOTH, LOWER, HIGHER):
        raise InputError(
            f"{path}: '{pattern}' direction '{direction}'; {did_you_mean(str(direction), (BOTH, LOWER, HIGHER))}"
        )
    return Allowance(bounds[0], bounds[1], direction)


def allowance_for(metric: str, tolerances: Mapping[str, Allowance]) -> Allowance:
    """The first pattern that matches a metric's name, else ``default``, else exactness."""
    for pattern, allowance in tolerances.items():
        if pattern != "default" and fnmatch.fnmatchcase(metric, pattern):
            return allowance
    return tolerances.get("default", Allowance())


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _compare(metric: str, baseline: Any, found: Any, allowance: Allowance) -> Failure | None:
    for value, side in ((found, "found"), (baseline, "baseline")):
        if value is None or (_is_number(value) and not math.isfinite(value)):
            return Failure(metric, baseline, found, f"{side} is null or not finite")
    if _is_number(baseline) and _is_number(found):
        if allowance.allows(float(baseline), float(found)):
            return None
        better = "" if allowance.direction == BOTH else f", {allowance.direction.replace('_', ' ')}"
        bounds = f"abs {allowance.absolute:.4g}, rel {allowance.relative:.4g}{better}"
        return Failure(metric, baseline, found, f"moved by {found - baseline:+.4g}; allowed: {bounds}")
    if type(baseline) is not type(found):
        kinds = f"{type(baseline).__name__} became {type(found).__name__}"
        return Failure(metric, baseline, found, kinds)
    return None if baseline == found else Failure(metric, baseline, found, "another word or flag")


def check(metrics_dir: str | Path, baselines_dir: str | Path, tolerances: str | Path) -> list[Failure]:
    """Compare a run's metrics with their baselines.

    Args:
        metrics_dir: folder of the run's JSON metrics.
        baselines_dir: folder of the stored ones, same layout.
        tolerances: YAML file, see the module's text.

    Returns:
        what did not hold, by name; empty if all is well.

    Raises:
        InputError: a folder or the tolerance file is absent or malformed.
    """
    allowed = read_tolerances(tolerances)
    result, stored = read_metrics(metrics_dir), read_metrics(baselines_dir)
    failures = []
    for metric in sorted(result.keys() | stored.keys()):
        if metric not in result:
            failures.append(Failure(metric, stored[metric], None, "missing in this run"))
        elif metric not in stored:
            failures.append(Failure(metric, None, result[metric], "new: no baseline yet"))
        else:
            failure = _compare(metric, stored[metric], result[metric], allowance_for(metric, allowed))
            failures += [failure] if failure else []
    return failures


def update(metrics_dir: str | Path, baselines_dir: str | Path) -> int:
    """Replace the stored metrics by a run's, file by file; tolerance files in the folder stay.

    Returns:
        how many numbers were stored.

    Raises:
        InputError: there are no metrics, or one is null or not finite, which no later run could meet; or the folder
            of the stored ones holds anything else, or cannot be replaced.
    """
    result = read_metrics(metrics_dir)
    for metric, value in result.items():
        if value is None or (_is_number(value) and not math.isfinite(value)):
            raise InputError(f"{metric} is null or not finite; mend the stage that writes it before storing a baseline")
    source, target = Path(metrics_dir), Path(baselines_dir)
    _refuse_others(target, source)
    try:
        kept = {path.relative_to(target): path.read_bytes() for path in sorted(target.rglob("*.yaml"))}
        with replacing_folder(target) as folder:
            for name, content in kept.items():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).write_bytes(content)
            for path in metric_files(source):
                write_json(folder / path.relative_to(source), read_json(path))
    except OSError as error:
        raise InputError(f"{target}: baselines not stored in full ({error.strerror})") from None
    return len(result)


def _refuse_others(target: Path, source: Path) -> None:
    """Refuse to replace a folder that holds anything but baselines and tolerances."""
    for inside in (Path.cwd(), source):
        if inside.resolve().is_relative_to(target.resolve()):
            raise InputError(f"{target}: holds {inside.resolve()}, which storing baselines there would delete")
    for path in sorted(target.rglob("*")) if target.is_dir() else ():
        if not path.is_dir() and path.suffix not in (".json", ".yaml"):
            raise InputError(f"{target}: holds {path.relative_to(target)}, which storing baselines there would delete")


def _shown(value: Any) -> str:
    return "–" if value is None else f"{value:.6g}" if _is_number(value) else str(value)


def _find_tolerances(baselines_dir: Path) -> Path:
    """The tolerance file in the folder of baselines, else in the one above, which profiles share."""
    beside, above = baselines_dir / TOLERANCES, baselines_dir.parent / TOLERANCES
    return beside if beside.exists() else above


def _aligned(failures: list[Failure]) -> str:
    """What does not hold, in columns for a terminal."""
    lines = [["Metric", "Baseline", "Found", "Why"]]
    lines += [[one.metric, _shown(one.baseline), _shown(one.found), one.why] for one in failures]
    widths = [max(len(line[index]) for line in lines) for index in range(len(lines[0]))]
    rows = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines]
    return "\n".join([rows[0], "  ".join("-" * width for width in widths), *rows[1:]])


def main(arguments: list[str] | None = None) -> int:
    """Command line; see ``--help``.

    Returns:
        exit status: 0 if all metrics hold, 1 if some do not, 2 for wrong input.
    """
    import argparse

    parser = argparse.ArgumentParser(
        prog="python -m pipeline.baselines", description="Compare a run's metrics with stored ones."
    )
    parser.add_argument("--metrics", type=Path, required=True, help="folder of the run's metrics")
    parser.add_argument("--baselines", type=Path, required=True, help="folder of the stored metrics")
    parser.add_argument(
        "--tolerances", type=Path, help=f"YAML file; {TOLERANCES} in the folder of baselines, or above it, by default"
    )
    parser.add_argument("--update", action="store_true", help="store the run's metrics as the new baselines")
    options = parser.parse_args(arguments)
    try:
        if options.update:
            print(f"stored {update(options.metrics, options.baselines)} numbers in {options.baselines}")
            return 0
        tolerances = options.tolerances or _find_tolerances(options.baselines)
        failures = check(options.metrics, options.baselines, tolerances)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    if failures:
        print(f"{len(failures)} metrics do not hold.\n\n{_aligned(failures)}")
        print("\nIf the change is wanted, store it: the same line with --update.")
        return 1
    print(f"all metrics hold ({len(read_metrics(options.baselines))} numbers)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
