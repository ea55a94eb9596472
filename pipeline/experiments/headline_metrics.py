"""The headline metrics of a run: the few numbers that two runs are compared by, from the metrics of its stages.

``dvc metrics diff`` compares these; every other number stays in ``reports/metrics`` and ``reports/tables``.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from statistics import fmean
from typing import Any

from pipeline.store import read_json

LEDGER_KEYS = ("printed", "compared", "match", "close", "better", "differs", "not_run")
DECIMALS = 4


def headline(metrics: Path, ledger: Mapping[str, Any], members: Mapping[str, Collection[str]]) -> dict[str, Any]:
    """Gather the headline metrics.

    Args:
        metrics: folder of the stages' metrics, ``reports/metrics``; a stage that did not run leaves its part out.
        ledger: counts of the ledger by verdict.
        members: stage (``blur``, ``noise``, ``curves``, ``regression``, ``closed_loop``) -> its members that are
            configured, for example DATASET-ESTIMATOR. Files of others are of an earlier configuration and do not count.

    Returns:
        by quantity: mean error of every blur estimator (calibrated, percent) and noise estimator (DN) per dataset,
        average precision of every detector (percent), clean and as the mean over all conditions, R squared of the
        regressions, average precision of every policy (percent, mean over the scenarios, of those that drive in all of
        them), and the ledger's counts.

    Raises:
        InputError: a file of metrics is damaged.
    """
    blur, noise, curves, regression, closed_loop = (
        _contents(metrics / stage, members[stage]) for stage in ("blur", "noise", "curves", "regression", "closed_loop")
    )
    content = {
        "blur_amae_percent": _of_each(blur, _blur_error),
        "noise_error_dn": _of_each(noise, _noise_error),
        "ap_percent": _of_each(curves, lambda part: _of_labels(part, "clean_ap_percent")),
        "mean_ap_percent": _of_each(curves, lambda part: _of_labels(part, "mean_ap_percent")),
        "regression_r2": _of_each(regression, lambda part: _of_labels(part, "r2")),
        "control_ap_percent": _policies(closed_loop.values()),
        "ledger": {key: ledger[key] for key in LEDGER_KEYS if key in ledger},
    }
    return {name: values for name, values in content.items() if values}


def _contents(folder: Path, members: Collection[str]) -> dict[str, Any]:
    """Member -> its metrics, of the members that have a file in a folder."""
    return {path.stem: read_json(path) for path in sorted(folder.glob("*.json")) if path.stem in members}


def _of_each(contents: Mapping[str, Any], value: Callable[[Any], Any]) -> dict[str, Any]:
    """Member -> the value of its metrics, where they have one."""
    values = {name: value(content) for name, content in contents.items()}
    return {name: part for name, part in values.items() if part is not None}


def _blur_error(content: Any) -> float | None:
    """Mean AMAE, calibrated where the estimator was calibrated, else raw."""
    part = content.get("calibrated") or content.get("raw") or {}
    mean = part.get("mean_amae_percent")
    return None if mean is None else round(float(mean), DECIMALS)


def _noise_error(content: Any) -> float | None:
    """Mean over noise sources and levels of the mean absolute error per patch."""
    errors = [level.get("patch_error_dn") for source in content.values() for level in source.values()]
    known = [float(error) for error in errors if error is not None]
    return round(fmean(known), DECIMALS) if known else None


def _of_labels(content: Any, key: str) -> dict[str, float]:
    """One number of every class of objects."""
    return {label: round(float(part[key]), DECIMALS) for label, part in content.items() if part.get(key) is not None}


def _policies(scenarios: Collection[Any]) -> dict[str, float]:
    """Average precision of every policy that drives in all scenarios, mean over them."""
    drives: dict[str, list[float]] = {}
    for scenario in scenarios:
        for policy, part in scenario.items():
            if "ap_percent" in part:  # absent where the drive shows no object
                drives.setdefault(policy, []).append(float(part["ap_percent"]))
    in_all = {policy: values for policy, values in sorted(drives.items()) if len(values) == len(scenarios)}
    return {policy: round(fmean(values), DECIMALS) for policy, values in in_all.items()}
