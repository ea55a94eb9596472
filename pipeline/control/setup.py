"""From the section ``control`` of the configuration to the objects of the loop."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.exposure import Camera
from pipeline.camera.sensor import named
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera
from pipeline.control.settings import (
    ControlCameraSettings,
    ControlSettings,
    ControlSurfaceSettings,
    LimitsSettings,
    ScenarioSettings,
)
from pipeline.control.simulation.loop import Rig, StepRecord, make_policy, run
from pipeline.control.simulation.measured_surface import SurfaceDesign
from pipeline.control.simulation.scenario import Flicker, Scenario
from pipeline.control.simulation.views import View
from pipeline.control.state import BASE_ISO, CameraState, Limits
from pipeline.errors import InputError
from pipeline.store import read_arrays


def camera(section: ControlCameraSettings) -> Camera:
    """The camera of ``control.camera``."""
    return Camera(
        sensor=named(section.sensor),
        noise_gain=section.noise_gain,
        reference_exposure_s=section.reference_exposure_ms / 1e3,
        temperature_k=section.temperature_k,
    )


def limits(section: LimitsSettings) -> Limits:
    """The limits of ``control.camera.limits``."""
    return Limits(
        exposure_min_s=section.exposure_min_ms / 1e3,
        exposure_max_s=section.exposure_max_ms / 1e3,
        gain_min=section.iso_min / BASE_ISO,
        gain_max=section.iso_max / BASE_ISO,
        exposure_steps_per_stop=section.exposure_steps_per_stop,
        gain_step_db=section.gain_step_db,
    )


def designs(section: ControlSurfaceSettings) -> list[SurfaceDesign]:
    """The conditions of ``control.surface``: those of full brightness, then those of darker frames."""
    exposure_s = section.exposure_ms / 1e3
    bright = SurfaceDesign(tuple(section.target_sigmas_dn), tuple(section.sizes_px), section.target_level, exposure_s)
    darker = section.darker
    return [
        bright,
        *(
            SurfaceDesign(tuple(darker.target_sigmas_dn), tuple(darker.sizes_px), level, exposure_s)
            for level in darker.target_levels
        ),
    ]


def scenario(name: str, section: ScenarioSettings) -> Scenario:
    """The scenario ``control.scenarios.<name>``."""
    return Scenario(
        name=name,
        steps=section.steps,
        light=tuple(section.light),
        speed_px_s=tuple(section.speed_px_s),
        start=CameraState.of(section.start_exposure_ms, section.start_iso),
        direction_deg=section.direction_deg,
        frame_period_s=section.frame_period_s,
        delay_frames=section.delay_frames,
        sun_radius_fraction=section.sun_radius_fraction,
        flicker=Flicker(section.flicker_hz, section.flicker_depth),
        fault=section.fault,
    )


def policies(section: ControlSettings, scenario: str) -> dict[str, tuple[str, dict[str, Any]]]:
    """Policies that run in a scenario: name -> registry name and options."""
    chosen = [name for name in section.policies if name not in section.optional]
    chosen += [name for name in section.scenarios[scenario].also if name not in chosen]
    return {name: (section.policies[name].kind, dict(section.policies[name].options)) for name in chosen}


@dataclass(frozen=True)
class Drive:
    """One policy on one fold of one scenario: the unit of parallel work.

    Attributes:
        policy: its name in the configuration.
        kind, options: of the policy.
        fold: number.
        surface: file of the surface that the policy asks.
        views: of the fold.
    """

    policy: str
    kind: str
    options: dict[str, Any]
    fold: int
    surface: Path
    views: tuple[View, ...]


@lru_cache(maxsize=4)
def surface(path: Path) -> Performance:
    """A surface, kept by each worker process."""
    return Performance.load(path)


def reference(path: Path) -> NDArray[np.float64]:
    """(2, 8) MTF of the camera's sharp frames that a surface was measured with; the surface itself is not opened."""
    return np.asarray(read_arrays(path)["reference"], dtype=np.float64)


def drive(item: Drive, *, rig: Rig, scenario: Scenario, pictures: tuple[int, ...]) -> list[StepRecord]:
    """What one worker does: one policy through the scenario."""
    limits = replace(rig.controlled.limits, delay_frames=scenario.delay_frames)
    policy = make_policy(item.kind, item.options, replace(rig.controlled, limits=limits), surface(item.surface))
    return run(policy, rig, scenario, item.views, pictures)


def drives(chosen: dict[str, tuple[str, dict[str, Any]]], folds: list[list[View]], surfaces: Path) -> list[Drive]:
    """All drives of a scenario; the oracle asks the surface of its fold, every other policy that of the other folds.

    Args:
        chosen: `policies`.
        folds: views of each fold.
        surfaces: folder of the stage `control_surface`.

    Raises:
        InputError: a fold without views.
    """
    results = []
    for name, (kind, options) in chosen.items():
        for number, views in enumerate(folds):
            if not views:
                raise InputError("control.viewpoints: a fold is empty; use more viewpoints or fewer folds")
            which = f"fold{number}" if kind == "oracle" else f"without_fold{number}"
            results.append(Drive(name, kind, options, number, surfaces / f"{which}.npz", tuple(views)))
    return results


def film(records: list[StepRecord]) -> dict[str, NDArray[np.uint8]]:
    """Pictures of a drive, every third pixel: ``step_NN`` -> (h, w) uint8."""
    return {f"step_{record.step:02d}": record.picture[::3, ::3] for record in records if record.picture is not None}


def film_steps(steps: int, count: int) -> tuple[int, ...]:
    """Steps shown in a film strip, evenly spread, first and last among them."""
    return tuple(sorted({round(float(step)) for step in np.linspace(0, steps - 1, max(count, 2))}))


def as_json(options: dict[str, Any]) -> str:
    """A detector's options as the workers take them."""
    return json.dumps(options, sort_keys=True)


def controlled(section: ControlCameraSettings) -> ControlledCamera:
    """The camera as policies know it."""
    return ControlledCamera(limits(section.limits), camera(section))
