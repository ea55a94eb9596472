"""Corrupted sets: the frames of a dataset as another camera would have seen them.

Nothing is stored: a corrupted frame is a pure function of the sharp frame, the effect, the level, the camera and the
seed (its random stream is keyed by them), so every stage that needs it makes it again, bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pipeline.camera.draws import PoissonMethod
from pipeline.camera.levels import Camera, corrupt
from pipeline.camera.sensor import Sensor, named
from pipeline.camera.truth import Corrupted, Light, Order
from pipeline.streams import stream

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.datasets.frame import Frame


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


def corrupted(
    sharp: NDArray[np.float32],
    frame: Frame,
    effect: str,
    level_dn: float,
    camera: CameraSettings,
    seed: int,
    psf: NDArray[np.floating] | None = None,
    psf_name: str | None = None,
) -> Corrupted:
    """One frame under one effect at one level.

    Args:
        sharp: (H, W) float32 in [0, 1], the frame's picture.
        frame: names the random stream.
        effect: noise source or preset (`pipeline.camera.chain`).
        level_dn: standard deviation of the noise asked for, DN; 0 adds none.
        camera: the camera.
        seed: root seed.
        psf: (h, w) unit-sum kernel, or None for none.
        psf_name: the kernel's name; part of the stream's key.

    Returns:
        the 8-bit image as float32 in [0, 1] and its truth.
    """
    key = ("corrupt", frame.dataset, frame.name, effect, float(level_dn), psf_name)
    return corrupt(
        sharp,
        effect,
        sigma_dn=float(level_dn),
        generator=stream(seed, *key),
        sensor=camera.sensor,
        psf=psf,
        camera=camera.kind,
        poisson=camera.poisson,
        order=camera.order,
        light=camera.light,
        key=(seed, *key),
    )
