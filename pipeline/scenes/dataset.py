"""The Sim dataset: viewpoints on streets and villages, four consecutive frames each, with exact labels.

A frame is a pure function of (seed, split, number, moment, samples, size). Everything is placed at t = 0, each
object from a random stream of its own, and then moves; moments are 0.1 s apart and the camera moves too. Streams
carry the split's name, so training and evaluation share no street, house, tree or car.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.quantise import to_8bit
from pipeline.errors import InputError, did_you_mean
from pipeline.scenes import labels, lens
from pipeline.scenes.labels import SimBox
from pipeline.scenes.layout.plan import Key, Plan
from pipeline.scenes.render import render as take

Array = NDArray[np.float32]

SPLITS = ("train", "evaluation")
MOMENTS = 4
MOMENT_S = 0.1
WIDTH_PX, HEIGHT_PX = 896, 768


@dataclass(frozen=True)
class Viewpoint:
    """One place of the dataset.

    Attributes:
        split: ``"train"`` or ``"evaluation"``.
        number: from 0; even numbers are streets, odd ones villages.
    """

    split: str
    number: int

    def __post_init__(self) -> None:
        if self.split not in SPLITS:
            raise InputError(f"split '{self.split}' of the Sim dataset; {did_you_mean(self.split, SPLITS)}")
        if self.number < 0:
            raise InputError(f"viewpoint number {self.number} of the Sim dataset: expected 0 or more")

    @property
    def scene(self) -> str:
        """``"street"`` or ``"village"``."""
        return "village" if self.number % 2 else "street"

    def name(self, moment: int) -> str:
        """Name of a frame, e.g. ``"evaluation-0003-2"``."""
        return f"{self.split}-{self.number:04d}-{moment}"


@dataclass(frozen=True)
class SimFrame:
    """One rendered frame.

    Attributes:
        name: unique in the dataset.
        grey: (H, W) float32 grey levels in [0, 1], of which the 8-bit frame is made by rounding.
        radiance: (H, W) float32, linear, before the tone curve, after lens and pixels; in the unit of
            `pipeline.scenes.light` (1 is a white surface under irradiance 1, about 9200 cd/m^2).
        boxes: labelled objects.
        exposure: grey = (exposure * radiance) ** (1 / gamma) for areas of one radiance.
        gamma: see `exposure`.
    """

    name: str
    grey: Array
    radiance: Array
    boxes: list[SimBox]
    exposure: float
    gamma: float

    def eight_bit(self) -> NDArray[np.uint8]:
        """(H, W) grey levels 0..255, rounded."""
        return to_8bit(self.grey)


@lru_cache(maxsize=2)
def plan(viewpoint: Viewpoint, seed: int) -> Plan:
    """What is at a viewpoint and how it moves; kept for its four frames."""
    from pipeline.scenes.layout.street import street
    from pipeline.scenes.layout.village import village

    key = Key(seed, viewpoint.split, viewpoint.number)
    return village(key) if viewpoint.scene == "village" else street(key)


def render(
    viewpoint: Viewpoint,
    moment: int,
    seed: int,
    *,
    samples: int = 3,
    width_px: int = WIDTH_PX,
    height_px: int = HEIGHT_PX,
    lens_sigma_px: float = lens.LENS_SIGMA_PX,
) -> SimFrame:
    """Render one frame and its labels.

    Args:
        viewpoint: where.
        moment: 0 to 3, in steps of 0.1 s.
        seed: root seed of the dataset.
        samples: N of N x N samples a pixel; the MTF is `lens.true_mtf` of it.
        width_px: width of the frame; the horizontal field of view does not depend on it.
        height_px: height of the frame.
        lens_sigma_px: standard deviation of the Gaussian lens, pixels.

    Raises:
        InputError: a moment or size out of range.
    """
    if not 0 <= moment < MOMENTS:
        raise InputError(f"moment {moment} of a Sim viewpoint: expected 0 to {MOMENTS - 1}")
    if width_px < 32 or height_px < 32:
        raise InputError(f"size {width_px}x{height_px} of a Sim frame: expected at least 32 pixels a side")
    scene = plan(viewpoint, seed)
    time_s = moment * MOMENT_S
    world = scene.world(time_s)
    pose = scene.camera.pose(time_s, width_px, height_px)
    picture = take(world, scene.light, pose, scene.tone, samples=samples, lens_sigma_px=lens_sigma_px)
    return SimFrame(
        name=viewpoint.name(moment),
        grey=picture.grey,
        radiance=picture.radiance,
        boxes=labels.boxes(world, pose, picture),
        exposure=scene.tone.exposure,
        gamma=scene.tone.gamma,
    )
