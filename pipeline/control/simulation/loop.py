"""The closed loop: one policy drives one camera through a scenario; every viewpoint is seen at the same settings.

At each step the camera's frame of the leading viewpoint is what the policy observes; detections in all viewpoints of
the fold are scored, so that average precision exists per step. Noise is keyed by viewpoint and moment, not by policy or
settings: policies share their random numbers. What a frame shows depends on its settings, light and motion only; it is
kept by a hash of these (`FrameCache`), which is how a killed run goes on and how equal frames of different policies
cost one. A worker keeps the last frames that it formed as well: policies with the same settings see the same picture.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline import control
from pipeline.camera.exposure import Camera, Motion, noise_generator
from pipeline.camera.quantise import to_8bit
from pipeline.control.decision import Decision
from pipeline.control.motion import CYCLES_PER_PX
from pipeline.control.observation import Estimate, Observation, Outcome, abstention_reason, brightness, estimates
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera, Policy, decided
from pipeline.control.simulation.measured_surface import monitor
from pipeline.control.simulation.scenario import Scenario
from pipeline.control.simulation.views import View, radiance_at, with_sun
from pipeline.control.state import CameraState, DelayLine
from pipeline.detection import opened
from pipeline.detection.inference import detections_in
from pipeline.store import read_arrays, write_arrays

Arrays = dict[str, NDArray[Any]]
FORMED_FRAMES = 128
"""Frames that a worker keeps, 0.7 MB each: about those that one scenario forms of its leading views."""


@dataclass(frozen=True)
class Rig:
    """What all loops of a run have in common.

    Attributes:
        camera: forms the frames.
        controlled: what policies know of it.
        detector: registry name.
        detector_options: as JSON.
        seed: root seed.
        cache: folder of `FrameCache`, or None.
    """

    camera: Camera
    controlled: ControlledCamera
    detector: str
    detector_options: str
    seed: int
    cache: Path | None = None


@dataclass(frozen=True, eq=False)
class StepRecord:
    """One step of one loop.

    Attributes:
        step: from 0.
        state: settings of the frames.
        light, speed_px_s: truth.
        blur_px, sigma_dn: true motion blur and noise of the leading frame.
        mean_level, saturated_fraction: of the leading frame.
        estimate_sigma_dn, estimate_mtf: noise and (2, 8) system MTF that the monitor estimated; None where it
            abstained.
        decision: for the next frame.
        detections: one entry per view: ``boxes``, ``score``, ``label``.
        views: seen at this step.
        picture: (H, W) uint8 leading frame, where it was asked for.
    """

    step: int
    state: CameraState
    light: float
    speed_px_s: float
    blur_px: float
    sigma_dn: float
    mean_level: float
    saturated_fraction: float
    estimate_sigma_dn: Estimate | None
    estimate_mtf: Estimate | None
    decision: Decision
    detections: list[Arrays]
    views: list[View]
    picture: NDArray[np.uint8] | None = None


@dataclass(frozen=True, eq=False)
class FormedFrame:
    """A frame on the 8-bit grid and the truth of its formation; see `pipeline.camera.exposure.Exposed`.

    Attributes:
        grey: (H, W) uint8.
        blur_px: length of the motion blur.
        saturated_fraction: fraction of saturated pixels.
        sigma_dn: noise.
    """

    grey: NDArray[np.uint8]
    blur_px: float
    saturated_fraction: float
    sigma_dn: float

    @property
    def image(self) -> NDArray[np.float32]:
        """(H, W) float32 in [0, 1]: the values that the camera gave."""
        return self.grey.astype(np.float32) / np.float32(255.0)


class FrameCache:
    """Detections and estimates of formed frames, by the hash of what forms them.

    Args:
        folder: where they are kept; None keeps nothing.
    """

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder

    def get(self, kind: str, key: Sequence[Any], make: Callable[[], Arrays]) -> Arrays:
        """What was kept for a key, or what `make` gives; a file that cannot be read is made again."""
        if self.folder is None:
            return make()
        from pipeline.errors import InputError

        text = hashlib.blake2b(json.dumps([kind, *key]).encode(), digest_size=12).hexdigest()
        path = self.folder / kind / text[:2] / f"{text}.npz"
        if path.is_file():
            try:
                return read_arrays(path)
            except InputError:
                path.unlink(missing_ok=True)
        arrays = make()
        write_arrays(path, **arrays)
        return arrays


class SimulatedScene:
    """What a camera sees of the rendered views at a step of a scenario.

    Args:
        rig: camera and detector.
        scenario: light, motion, sun and flicker.
        views: of one fold.
    """

    def __init__(self, rig: Rig, scenario: Scenario, views: Sequence[View]) -> None:
        self.rig, self.scenario, self.views = rig, scenario, list(views)
        self.cache = FrameCache(rig.cache)

    def at_step(self, step: int) -> list[View]:
        """The views of a step: every viewpoint at the moment ``step mod M`` of its M moments."""
        names = dict.fromkeys(view.viewpoint for view in self.views)
        results = []
        for name in names:
            moments = [view for view in self.views if view.viewpoint == name]
            results.append(moments[step % len(moments)])
        return results

    def expose(self, view: View, step: int, state: CameraState, keep: bool = False) -> FormedFrame:
        """The frame of a view at some settings.

        Args:
            view: to look at.
            step: of the scenario.
            state: settings.
            keep: whether other drives are likely to see it again: detections of all views are kept on disk, but a
                policy needs the picture of the leading one.
        """
        moving = Motion(self.scenario.speed_at(step), self.scenario.direction_deg)
        light = self.scenario.light_at(step, state.exposure_s)
        sun = self.scenario.sun_radius_fraction
        form = _kept_frame if keep else _formed
        return form(self.rig.camera, self.rig.seed, view.name, view.path, state, light, moving, sun)

    def key(self, view: View, step: int, state: CameraState) -> list[Any]:
        """Everything that a frame depends on, but for the rig."""
        scenario = self.scenario
        return [
            view.name,
            repr(state.exposure_s),
            repr(state.gain),
            repr(scenario.light_at(step, state.exposure_s)),
            repr(scenario.speed_at(step)),
            scenario.direction_deg,
            scenario.sun_radius_fraction,
        ]

    def detections(self, view: View, step: int, state: CameraState, frame: FormedFrame | None = None) -> Arrays:
        """Detections in a view: ``boxes`` (M, 4), ``score`` (M,), ``label`` (M,), best first."""

        def make() -> Arrays:
            image = (frame or self.expose(view, step, state)).image
            detector = opened(self.rig.detector, self.rig.detector_options)
            detected = detections_in(detector, image, self.rig.detector).best()
            return {
                "boxes": detected.boxes.reshape(-1, 4),
                "score": detected.score,
                "label": detected.label.astype(np.str_),
            }

        return self.cache.get("detections", self.key(view, step, state), make)

    def estimates(
        self, view: View, step: int, state: CameraState, frame: FormedFrame
    ) -> tuple[Estimate | None, Estimate | None, str]:
        """The monitor's noise and MTF with the scenario's faults, and why one is missing."""
        if self.scenario.fault.is_silent(step):
            return None, None, "estimator silent"

        def make() -> Arrays:
            condition = monitor().frame(frame.image)
            sigma, mtf = estimates(condition)
            nothing = np.full((3, 2, 8), np.nan)
            return {
                "sigma": np.full(3, np.nan) if sigma is None else np.array([float(end) for end in sigma]),
                "mtf": nothing if mtf is None else np.stack([np.asarray(end) for end in mtf]),
                "reason": np.array(abstention_reason(condition)),
            }

        arrays = self.cache.get("estimates", self.key(view, step, state), make)
        sigma, mtf = (
            Estimate(*(part[name] for name in range(3))) if np.isfinite(part[0]).all() else None
            for part in (arrays["sigma"], arrays["mtf"])
        )
        fault = self.scenario.fault
        if sigma is not None and fault.sigma_factor != 1.0:
            sigma = Estimate(*(end * fault.sigma_factor for end in sigma))
        if mtf is not None and fault.motion_factor != 1.0:
            mtf = _misjudged(mtf, fault.motion_factor)
        return sigma, mtf, str(arrays["reason"])

    def truth(self, view: View, step: int) -> Callable[[CameraState], Outcome]:
        """True condition of a view at any settings, in closed form."""
        camera, scenario = self.rig.camera, self.scenario
        thin = with_sun(view.radiance(), scenario.sun_radius_fraction)[::16, ::16]

        def outcome(state: CameraState) -> Outcome:
            electrons = camera.electrons(thin, state.exposure_s, scenario.light_at(step, state.exposure_s))
            level = electrons.astype(np.float64) * state.gain / camera.sensor.full_well_e
            mean = float((np.clip(level, 0.0, 1.0) ** (1.0 / camera.gamma)).mean())
            motion = scenario.speed_at(step) * state.exposure_s
            return Outcome(camera.sigma_dn(electrons, state.gain, state.exposure_s), motion, mean)

        return outcome


def _formed(
    camera: Camera,
    seed: int,
    name: str,
    path: Path,
    state: CameraState,
    light: float,
    motion: Motion,
    sun_radius_fraction: float,
) -> FormedFrame:
    """A frame of the radiance in a file, its noise keyed by the view's name."""
    radiance = with_sun(radiance_at(path), sun_radius_fraction)
    generator = noise_generator(seed, "closed loop", name)
    frame = camera.expose(radiance, state.exposure_s, state.gain, generator, light=light, motion=motion)
    grey = to_8bit(frame.image)
    return FormedFrame(grey, frame.blur_px, frame.saturated_fraction, frame.sigma_dn)


_kept_frame = lru_cache(maxsize=FORMED_FRAMES)(_formed)


def _misjudged(mtf: Estimate, factor: float) -> Estimate:
    """MTF as if frequencies were ``factor`` times as high: motion of L px is taken for ``factor`` L px."""
    at = np.concatenate([[0.0], CYCLES_PER_PX])
    parts = []
    for end in mtf:
        curves = np.concatenate([np.ones((2, 1)), end], axis=1)
        parts.append(np.stack([np.interp(CYCLES_PER_PX * factor, at, curve) for curve in curves]))
    return Estimate(*parts)


def make_policy(
    kind: str, options: dict[str, Any], controlled: ControlledCamera, performance: Performance | None
) -> Policy:
    """A policy from its registry name and options; lists in options become tuples."""
    plain = {name: tuple(value) if isinstance(value, list) else value for name, value in options.items()}
    return control.create(kind, camera=controlled, performance=performance, **plain)


def run(
    policy: Policy, rig: Rig, scenario: Scenario, views: Sequence[View], pictures: Sequence[int] = ()
) -> list[StepRecord]:
    """Drive a camera through a scenario.

    Args:
        policy: fresh, without memory of other drives.
        rig: camera and detector.
        scenario: the drive.
        views: of one fold; the first viewpoint leads.
        pictures: steps whose leading frame is kept.

    Returns:
        one record per step.

    Raises:
        InputError: the policy decides on settings that the camera cannot have, or the scenario starts with such.
    """
    scene = SimulatedScene(rig, scenario, views)
    limits = replace(rig.controlled.limits, delay_frames=scenario.delay_frames)
    state = scenario.first_state(limits)
    line = DelayLine.filled(state, 0 if policy.sees_truth else limits.delay_frames)
    take_step = _oracle_step if policy.sees_truth else _policy_step
    records: list[StepRecord] = []
    for step in range(scenario.steps):
        seen = scene.at_step(step)
        lead = seen[0]
        taken = take_step(policy, scene, lead, step, state)
        frame = taken.frame
        detections = [scene.detections(view, step, taken.state, frame if view is lead else None) for view in seen]
        records.append(
            StepRecord(
                step=step,
                state=taken.state,
                light=scenario.light_at(step, taken.state.exposure_s),
                speed_px_s=scenario.speed_at(step),
                blur_px=frame.blur_px,
                sigma_dn=frame.sigma_dn,
                mean_level=taken.mean_level,
                saturated_fraction=frame.saturated_fraction,
                estimate_sigma_dn=taken.sigma_dn,
                estimate_mtf=taken.mtf,
                decision=taken.decision,
                detections=detections,
                views=seen,
                picture=frame.grey if step in pictures else None,
            )
        )
        state = line.next(taken.decision.state)
    return records


@dataclass(frozen=True, eq=False)
class _Taken:
    """The leading frame of a step and the decision on it.

    Attributes:
        state: settings of the frame.
        frame: the frame.
        mean_level: of it.
        decision: for the next frame; of the oracle, for this one.
        sigma_dn, mtf: estimates; None where there are none.
    """

    state: CameraState
    frame: FormedFrame
    mean_level: float
    decision: Decision
    sigma_dn: Estimate | None = None
    mtf: Estimate | None = None


def _oracle_step(policy: Policy, scene: SimulatedScene, lead: View, step: int, state: CameraState) -> _Taken:
    """The ceiling has no delay: it chooses the settings of this very frame."""
    blank = Observation(np.zeros((1, 1), np.float32), 0.0, 0.0, truth=scene.truth(lead, step))
    decision = decided(policy, blank, state, scene.rig.controlled.limits)
    frame = scene.expose(lead, step, decision.state, keep=True)
    return _Taken(decision.state, frame, brightness(frame.image).mean_level, decision)


def _policy_step(policy: Policy, scene: SimulatedScene, lead: View, step: int, state: CameraState) -> _Taken:
    """A policy sees the frame taken with the present settings and decides on the next ones."""
    frame = scene.expose(lead, step, state, keep=True)
    image = frame.image
    sigma = mtf = None
    reason = ""
    if policy.uses_estimates:
        sigma, mtf, reason = scene.estimates(lead, step, state, frame)
    observation = Observation(image, *brightness(image), sigma, mtf, reason)
    decision = decided(policy, observation, state, scene.rig.controlled.limits)
    return _Taken(state, frame, observation.mean_level, decision, sigma, mtf)
