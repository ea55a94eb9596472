"""Settings of the camera that forms corrupted images, and of the bank of point spread functions (PSF)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator
from pydantic.dataclasses import dataclass

from pipeline.camera.corruption import Camera
from pipeline.camera.draws import PoissonMethod
from pipeline.camera.sensor import Sensor, described, named
from pipeline.camera.truth import Light, Order
from pipeline.errors import InputError
from pipeline.settings import STRICT, UNIQUE, BlurKind, Settings


def _sensor(given: Any) -> Any:
    """The sensor of a mapping: a ``model`` by name, and parameters of `Sensor` that differ from it."""
    if not isinstance(given, Mapping):
        return given
    changes = dict(given)
    for name, value in changes.items():
        if (
            name not in ("model", "kind")
            and value is not None
            and (isinstance(value, bool) or not isinstance(value, (int, float)))
        ):
            raise ValueError(f"camera.sensor.{name}: expected a number (given: {value!r})")
    try:
        return named(changes.pop("model", "paper"), **changes)
    except (InputError, TypeError) as error:
        raise ValueError(str(error)) from None


@dataclass(frozen=True, config=STRICT)
class CameraSettings:
    """Which camera forms the corrupted image.

    Attributes:
        kind: ``"physical"``, or with the quirks of the authors' program, ``"authors"`` or ``"authors_2022"``.
        poisson: ``"exact"`` or ``"hybrid"`` draws.
        sensor: a `Sensor`; in the configuration its ``model`` by name with the parameters that differ from it.
        order: ``"paper"``: photon noise before the optics; ``"detector"``: behind them, as in a camera.
        light: ``"encoded"``: grey levels are corrupted, as in the paper; ``"linear"``: the light behind them.
    """

    kind: Camera = "physical"
    poisson: PoissonMethod = "exact"
    sensor: Annotated[Sensor, BeforeValidator(_sensor)] = field(default_factory=Sensor)
    order: Order = "paper"
    light: Light = "encoded"

    def described(self) -> dict[str, Any]:
        """As the configuration writes it, for records."""
        values = {name: getattr(self, name) for name in ("kind", "poisson", "order", "light")}
        return values | {"sensor": described(self.sensor)}


class PsfSettings(Settings):
    """The bank of point spread functions (PSF)."""

    source: Literal["generated", "paper"]
    folder: str | None
    match: Literal["nominal", "paper"]
    kinds: Annotated[list[BlurKind], UNIQUE] = Field(min_length=1)
    sizes_px: Annotated[list[Annotated[int, Field(ge=1, le=55)]], UNIQUE] = Field(min_length=1)
    angles_deg: Annotated[list[Annotated[float, Field(ge=0, lt=360)]], UNIQUE] = Field(min_length=1)

    @model_validator(mode="after")
    def _folder_with_paper(self) -> PsfSettings:
        if self.source == "paper" and not self.folder:
            raise ValueError("psf.folder must name the folder of the paper's kernels when psf.source is 'paper'")
        return self
