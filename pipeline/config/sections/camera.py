"""The camera that forms corrupted images."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from pipeline.config.schema_base import Name, Section


class SensorSection(BaseModel):
    """A sensor by name; any parameter of `pipeline.camera.sensor.Sensor` may be changed beside it."""

    model_config = ConfigDict(extra="allow", frozen=True)

    model: Name


class CameraSection(Section):
    """The camera that forms corrupted images."""

    kind: Literal["physical", "authors", "authors_2022"]
    poisson: Literal["exact", "hybrid"]
    order: Literal["paper", "detector"] = "paper"
    light: Literal["encoded", "linear"] = "encoded"
    sensor: SensorSection


SECTION = CameraSection
