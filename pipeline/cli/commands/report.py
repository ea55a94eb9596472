"""``camera-monitor report``: compare the numbers of two reports."""

from __future__ import annotations

import json
from math import isfinite
from pathlib import Path
from typing import Any

import click

from pipeline.baselines import flatten, metric_files
from pipeline.cli.exit_codes import DIFFERENT
from pipeline.cli.options.given_paths import GivenPath
from pipeline.cli.options.numbers import FiniteRange
from pipeline.errors import InputError


@click.group("report")
def command() -> None:
    """Work with reports that ``dvc repro`` wrote."""


@command.command("diff")
@click.argument("before", type=GivenPath())
@click.argument("after", type=GivenPath())
@click.option(
    "--tolerance-percent", default=0.0, show_default=True, type=FiniteRange(0, 100),
    help="relative changes up to this do not count",
)  # fmt: skip
@click.option("--most", default=30, show_default=True, type=click.IntRange(0, 1_000_000), help="changes listed; 0: all")
@click.option("--json", "as_json", is_flag=True, help="print everything as one JSON object")
@click.option("--fail", is_flag=True, help="exit code 3 where anything differs")
def diff(before: Path, after: Path, tolerance_percent: float, most: int, as_json: bool, fail: bool) -> None:
    """Compare the metrics of two reports: folders of the project, reports/, reports/metrics, or single JSON files.

    Prints how many numbers are equal, changed, added and removed, per stage, then the changes: first those
    without a ratio (a number that was 0, or that is missing or not finite in either report), then the largest relative
    ones. Exit codes: 0, or 3 with --fail where anything differs.
    """
    old, new = metrics(before), metrics(after)
    changes = compare(old, new, tolerance_percent / 100)
    counts = {
        "equal": len(old.keys() & new.keys()) - len(changes), "changed": len(changes),
        "added": len(new.keys() - old.keys()), "removed": len(old.keys() - new.keys()),
    }  # fmt: skip
    if as_json:
        content = {
            **counts, "changes": changes, "added_names": sorted(new.keys() - old.keys()),
            "removed_names": sorted(old.keys() - new.keys()),
        }  # fmt: skip
        click.echo(json.dumps(content, indent=2))
    else:
        click.echo(", ".join(f"{count} {name}" for name, count in counts.items()))
        for name in sorted({change["name"].split(":")[0] for change in changes}):
            count = sum(change["name"].split(":")[0] == name for change in changes)
            click.echo(f"  {count:5d} changed in {name}")
        shown = changes[: most or None]
        if shown:
            click.echo(f"\n{'before':>12} {'after':>12} {'change %':>9}  number")
        for change in shown:
            ratio = "" if change["relative"] is None else f"{100 * change['relative']:+9.2f}"
            click.echo(f"{_text(change['before']):>12} {_text(change['after']):>12} {ratio:>9}  {change['name']}")
        if len(changes) > len(shown):
            click.echo(f"... and {len(changes) - len(shown)} more changes (--most 0 lists all)")
        for word, names in (("added", new.keys() - old.keys()), ("removed", old.keys() - new.keys())):
            files = sorted({name.split(":")[0] for name in names})
            if files:
                click.echo(f"{word} in: {', '.join(files)}")
    if fail and (changes or old.keys() != new.keys()):
        raise SystemExit(DIFFERENT)


def metrics(path: Path) -> dict[str, Any]:
    """The numbers of a report.

    Args:
        path: folder of the project, ``reports`` or ``reports/metrics``, or one JSON file.

    Returns:
        ``FILE:key.key`` -> number or text.

    Raises:
        InputError: no such report, a damaged file, or two values of one name.
    """
    if path.is_file():
        files, root = [path], path.parent
    else:
        folders = [path / inside for inside in ("reports/metrics", "metrics") if (path / inside).is_dir()]
        root = folders[0] if folders else path
        files = metric_files(root) if root.is_dir() else []
    if not files:
        raise InputError(f"{path}: no metrics; expected a folder reports/ with metrics/*.json, or one JSON file")
    values: dict[str, Any] = {}
    for file in files:
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            raise InputError(f"{file}: not readable JSON ({error})") from None
        name = "" if path.is_file() else file.relative_to(root).with_suffix("").as_posix()
        values |= {f"{name}:{key}": value for key, value in flatten(content, str(file)).items()}
    return values


def compare(old: dict[str, Any], new: dict[str, Any], tolerance: float) -> list[dict[str, Any]]:
    """Numbers of both that differ by more than a relative tolerance: those without a ratio, then the largest changes.

    Args:
        old: of `metrics`.
        new: likewise.
        tolerance: fraction of the old number.

    Returns:
        rows with ``name``, ``before``, ``after`` and ``relative`` (None where the old number is 0 or one is no finite
        number).
    """
    rows = []
    for name in sorted(old.keys() & new.keys()):
        before, after = old[name], new[name]
        numbers = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in (before, after))
        if before == after or (numbers and before != before and after != after):
            continue
        relative = (after - before) / abs(before) if numbers and before else None
        if relative is not None and not isfinite(relative):
            relative = None
        if relative is not None and abs(relative) <= tolerance:
            continue
        rows.append({"name": name, "before": before, "after": after, "relative": relative})
    return sorted(rows, key=lambda row: (row["relative"] is not None, -abs(row["relative"] or 0.0), row["name"]))


def _text(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)
