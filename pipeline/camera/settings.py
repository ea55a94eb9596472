"""Which camera forms the corrupted images."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pipeline.camera.draws import PoissonMethod
from pipeline.camera.levels import Camera
from pipeline.camera.sensor import Sensor, named
from pipeline.camera.truth import Light, Order


@dataclass(frozen=True)
class CameraSettings:
    """Which camera forms the corrupted image.

    Attributes:
        kind: ``"physical"`` or ``"authors"`` (with the quirks of the authors' program).
        poisson: ``"exact"`` or ``"hybrid"`` draws.
        sensor: parameters that differ from the paper's.
        order: ``"paper"``: photon noise before the optics; ``"detector"``: behind them, as in a camera.
        light: ``"encoded"``: grey levels are corrupted, as in the paper; ``"linear"``: the light behind them.
    """

    kind: Camera = "physical"
    poisson: PoissonMethod = "exact"
    sensor: Sensor = field(default_factory=Sensor)
    order: Order = "paper"
    light: Light = "encoded"

    @classmethod
    def from_section(cls, section: Any) -> CameraSettings:
        """From the section ``camera`` of the configuration."""
        changes: dict[str, Any] = section.sensor.model_dump()
        sensor = named(changes.pop("model"), **changes)
        return cls(section.kind, section.poisson, sensor, section.order, section.light)
