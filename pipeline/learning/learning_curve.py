"""Learning curves of the released networks: what each training left beside its weights.

A curve is a CSV with the column ``step``, measures on the training samples, and measures on held-out samples whose
names begin with ``validation_``. The header of the weight file beside it holds the network's size and its settings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError
from pipeline.stage_files import any_table, existing

if TYPE_CHECKING:
    import pandas as pd

HELD_OUT = "validation_"
TASKS = ("mtf", "sigma", "detector")
# What a network is judged by, the first that its curve holds; unit of those whose name does not end with it.
MEASURES = ("mtf_error_percent", "sigma_error_dn", "ap_percent", "ap", "missed_percent", "mean_squared_error")
_UNITS = {"_percent": "%", "_dn": "DN"}


@dataclass(frozen=True)
class LearningCurve:
    """One network's training.

    Attributes:
        name: of its files, e.g. ``"mtf_spectral"``.
        curve: column ``step`` and the measures.
        measure: name of the one shown, without ``validation_``.
        parameters: numbers in the weight file; None without one.
        chosen: step whose weights are released; None where that is not known.
        samples: patches or pictures of one step; None where the settings do not tell.
        settings: of the training.
        device: that it ran on; None without a weight file.
    """

    name: str
    curve: pd.DataFrame
    measure: str
    parameters: int | None = None
    chosen: int | None = None
    samples: int | None = None
    settings: Mapping[str, Any] | None = None
    device: str | None = None

    @property
    def unit(self) -> str:
        """Of the measure; empty where it has none."""
        return next((unit for ending, unit in _UNITS.items() if self.measure.endswith(ending)), "")

    @property
    def steps(self) -> int:
        """Of the whole training."""
        return int(self.curve["step"].max())

    def held_out(self, measure: str | None = None) -> pd.Series:
        """A measure on held-out samples by step, where it was taken."""
        name = HELD_OUT + (measure or self.measure)
        return self.curve.set_index("step")[name].dropna()

    def training(self) -> pd.Series | None:
        """The same measure on the training samples by step, or None."""
        return self.curve.set_index("step")[self.measure].dropna() if self.measure in self.curve else None

    def at_release(self, name: str) -> float:
        """A column's value at the step whose weights are released (the last, where that is not known)."""
        if name not in self.curve:
            return math.nan
        values = self.curve.set_index("step")[name].dropna()
        if values.empty:
            return math.nan
        chosen = self.chosen
        return float(values[chosen] if chosen is not None and chosen in values.index else values.iloc[-1])


def read(folder: Path | None) -> list[LearningCurve]:
    """Every curve of a folder of weights, in the order blur, noise, detectors, others.

    Raises:
        InputError: a table lacks its ``step`` or any measure on held-out samples, or a weight file is broken.
    """
    location = existing(folder)
    if location is None:
        return []
    names = [path.stem for path in sorted(location.glob("[!.]*.csv"))]

    def rank(name: str) -> tuple[int, str]:
        task = name.partition("_")[0]
        return (TASKS.index(task) if task in TASKS else len(TASKS)), name

    names.sort(key=rank)
    return [_one(location / f"{name}.csv") for name in names]


def _one(path: Path) -> LearningCurve:
    curve = any_table(path)
    held_out = [str(name).removeprefix(HELD_OUT) for name in curve.columns if str(name).startswith(HELD_OUT)]
    if "step" not in curve or not held_out or curve.empty:
        raise InputError(f"{path}: expected a column 'step' and columns '{HELD_OUT}...'; run its training stage again")
    measure = next((name for name in MEASURES if name in held_out), held_out[0])
    weights = existing(path.with_suffix(".safetensors"))
    if weights is None:
        return LearningCurve(path.stem, curve, measure)
    from pipeline.learning.weights import details

    header = details(weights)
    settings = header.get("settings") or {}
    step = header.get("step")
    chosen = int(step) if isinstance(step, (int, float)) else None
    device = header.get("device", "cpu")
    return LearningCurve(path.stem, curve, measure, _parameters(weights), chosen, _samples(settings), settings, device)


def _parameters(path: Path) -> int:
    """How many numbers a weight file holds."""
    from safetensors import safe_open

    with safe_open(path, framework="np") as file:
        return sum(math.prod(file.get_slice(name).get_shape()) for name in file.keys())  # noqa: SIM118


def _samples(settings: Mapping[str, Any]) -> int | None:
    """Samples of one step: chunks of a batch times what a chunk holds, or the batch itself."""
    if isinstance(settings.get("batch"), int):
        return int(settings["batch"])
    recipe = settings.get("recipe")
    if isinstance(recipe, Mapping) and "count" in recipe:
        return int(recipe["count"] * settings.get("replays", 1))
    if not isinstance(recipe, Mapping) or "views" not in recipe or "new_chunks_per_step" not in settings:
        return None
    each = recipe.get("kernels_per_view", recipe.get("noises", 1))
    return int(settings["new_chunks_per_step"] * settings.get("replays", 1) * recipe["views"] * each)
