"""Settings of the camera in the loop: what is simulated, which policies drive it, and through which scenarios."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from pipeline.experiments.settings import OrderStudySettings
from pipeline.settings import STRICT, UNIQUE, Count, Fraction, Level, Name, NonNegative, Positive, Settings

Step = Annotated[int, Field(ge=0)]
Iso = Annotated[float, Field(ge=100)]
"""From base ISO on: below it a full well stays below full scale."""
Knots = Annotated[list[tuple[NonNegative, NonNegative]], Field(min_length=1)]


class LimitsSettings(Settings):
    """What the camera accepts; see `pipeline.control.state.Limits`."""

    exposure_min_ms: Positive
    exposure_max_ms: Positive
    iso_min: Iso
    iso_max: Iso
    exposure_steps_per_stop: Annotated[int, Field(ge=0, le=100)]
    gain_step_db: NonNegative


class ControlCameraSettings(Settings):
    """The camera that is controlled; see `pipeline.camera.exposure.Camera`."""

    sensor: Name
    noise_gain: Literal["physical", "linear"]
    reference_exposure_ms: Positive
    temperature_k: Annotated[float, Field(ge=233, le=373)]
    limits: LimitsSettings


class DarkerSettings(Settings):
    """Conditions of darker frames: their mean levels, noise and motion."""

    target_levels: Annotated[list[Annotated[float, Field(gt=0, lt=1)]], UNIQUE]
    target_sigmas_dn: Annotated[list[Level], UNIQUE] = Field(min_length=2)
    sizes_px: Annotated[list[Annotated[float, Field(ge=0, le=36)]], UNIQUE] = Field(min_length=2)


class ControlSurfaceSettings(Settings):
    """Conditions of the surface that policies use (`pipeline.control.simulation.measured_surface`)."""

    target_sigmas_dn: Annotated[list[Level], UNIQUE] = Field(min_length=2)
    sizes_px: Annotated[list[Annotated[float, Field(ge=0, le=36)]], UNIQUE] = Field(min_length=2)
    moments: Annotated[list[Annotated[int, Field(ge=0, le=3)]], UNIQUE] = Field(min_length=1)
    target_level: Annotated[float, Field(gt=0, lt=1)]
    exposure_ms: Positive
    darker: DarkerSettings


class PolicySettings(Settings):
    """One policy by its registry name, with the options its class takes."""

    kind: Name
    options: dict[str, Any] = Field(default_factory=dict)


@dataclass(frozen=True, config=STRICT)
class EstimatorFault:
    """What is wrong with the estimator.

    Attributes:
        silent: first and last step at which it abstains; None for none.
        sigma_factor, motion_factor: by which noise and the length of motion blur are misjudged.
    """

    silent: tuple[Step, Step] | None = None
    sigma_factor: Positive = 1.0
    motion_factor: Positive = 1.0

    def is_silent(self, step: int) -> bool:
        """Whether the estimator abstains at a step."""
        return self.silent is not None and self.silent[0] <= step <= self.silent[1]


class ScenarioSettings(Settings):
    """One drive; see `pipeline.control.simulation.scenario.Scenario`."""

    steps: Annotated[int, Field(ge=2, le=10_000)]
    light: Knots
    speed_px_s: Knots
    start_exposure_ms: Positive = 8.0
    start_iso: Positive = 100.0
    direction_deg: Annotated[float, Field(ge=0, lt=360)] = 0.0
    frame_period_s: Positive = 0.0333
    delay_frames: Annotated[int, Field(ge=0, le=10)] = 0
    sun_radius_fraction: Fraction = 0.0
    flicker_hz: NonNegative = 0.0
    flicker_depth: Fraction = 0.0
    fault: EstimatorFault = Field(default_factory=EstimatorFault)
    also: Annotated[list[Name], UNIQUE] = Field(default_factory=list)
    """Policies that only this scenario runs."""


class ControlSettings(Settings):
    """Closed-loop evaluation."""

    detector: Name
    viewpoints: Count
    moments: Annotated[int, Field(ge=1, le=4)]
    """Of every viewpoint, taken in turn by the steps of a drive."""
    folds: Annotated[int, Field(ge=1, le=10)]
    camera: ControlCameraSettings
    surface: ControlSurfaceSettings
    policies: dict[Name, PolicySettings] = Field(min_length=1)
    optional: Annotated[list[Name], UNIQUE]
    scenarios: dict[Name, ScenarioSettings] = Field(min_length=1)
    film_policies: Annotated[list[Name], UNIQUE]
    film_steps: Count
    order_study: OrderStudySettings

    @model_validator(mode="after")
    def _policies_exist(self) -> ControlSettings:
        named = {*self.optional, *self.film_policies, *(one for part in self.scenarios.values() for one in part.also)}
        unknown = sorted(named - set(self.policies))
        if unknown:
            raise ValueError(f"{unknown} are not in control.policies")
        return self
