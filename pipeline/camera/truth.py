"""What is known about a corrupted frame: the noise really added, before and after the 8-bit range cuts it.

Estimators are scored against this truth, not against the level asked for: where a frame is bright or dark, clipping
takes part of the noise away, so that a tile's true deviation may lie well below the nominal one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.quantise import to_8bit
from pipeline.camera.sensor import Sensor
from pipeline.camera.tone_curve import encode
from pipeline.errors import InputError
from pipeline.streams import KeyPart

Float = NDArray[np.float32]
Boundary = Literal["reflect", "zero"]
Order = Literal["paper", "detector"]
ORDERS: tuple[Order, ...] = ("paper", "detector")
Light = Literal["encoded", "linear"]
LIGHTS: tuple[Light, ...] = ("encoded", "linear")


@dataclass(frozen=True, eq=False)
class Corrupted:
    """A corrupted frame and its truth. What costs a second blur is computed when first asked for.

    Attributes:
        image: (H, W) float32. Formed frames are in [0, 1] on the 8-bit grid; without quantisation
            (`chain.Effects.quantise`) neither rounded nor clipped, but at black behind a tone curve. A frame to which
            nothing happened (level 0, no blur) is the input itself, whatever its grid.
        noise_source: its name, or several joined by ``+``; empty for none.
        target_sigma_dn: sigma asked for, DN; NaN where the noise has its natural size.
        noise_scale: factor on the sensor's own noise that reaches it; 1 is natural, 0 no noise.
        sensor: the sensor.
        temperature_k, exposure_s: conditions used, drawn where the noise source has a range.
        signal_e: (H, W) mean electrons before any effect.
        noise_e: noise of each source as it was added, ``noise_scale`` included, e-: ``photon`` (before or after the
            optics, see ``order``), ``dark`` and ``readout`` (after).
        psf: (h, w) kernel, or None for no blur.
        boundary: how the blur saw beyond the frame.
        clipped_fraction: share of pixels that noise drove out of the 8-bit range.
        poisson: how Poisson counts were drawn.
        camera: whose program was followed.
        order: ``paper``: photon noise was added before the optics; ``detector``: after them.
        light: ``encoded``: electrons are proportional to the grey levels of the picture; ``linear``: to its light.
        key: of the random stream, where the caller gave one.
    """

    image: Float
    noise_source: str
    target_sigma_dn: float
    noise_scale: float
    sensor: Sensor
    temperature_k: float
    exposure_s: float
    signal_e: Float
    noise_e: dict[str, Float] = field(default_factory=dict)
    psf: NDArray[np.floating] | None = None
    boundary: Boundary = "reflect"
    clipped_fraction: float = 0.0
    poisson: str = "exact"
    camera: str = "physical"
    order: Order = "paper"
    light: Light = "encoded"
    key: tuple[KeyPart, ...] = ()

    @cached_property
    def image_8bit(self) -> NDArray[np.uint8]:
        """(H, W) the frame's 8-bit numbers."""
        return to_8bit(self.image)

    @cached_property
    def electrons(self) -> Float:
        """(H, W) electrons at the converter: noise included, neither saturated nor whole, e-."""
        return self._through_optics(self.signal_e) + self._noise_e

    @cached_property
    def clean_dn(self) -> Float:
        """(H, W) what the frame would be without noise: blurred, neither rounded nor clipped, DN."""
        return self.encoded_dn(self._through_optics(self.signal_e))

    @cached_property
    def noise_dn(self) -> Float:
        """(H, W) noise before full well, rounding and the 8-bit range, DN; after the tone curve if there is one.

        A curve ends at black: what noise would be below it is no part of this.
        """
        if self.light == "linear":
            return self.encoded_dn(self.electrons) - self.clean_dn
        return self.sensor.dn(self._noise_e)

    @property
    def _noise_e(self) -> Float:
        """(H, W) noise at the converter, e-; photon noise as blurred by the optics where it came before them."""
        total = np.zeros_like(self.signal_e)
        for source, noise in self.noise_e.items():
            total += self._through_optics(noise) if source == "photon" and self.order == "paper" else noise
        return total

    def encoded_dn(self, electrons: Float) -> Float:
        """(H, W) e- as grey levels of this frame, DN: after a tone curve, which ends at black, if any; not rounded."""
        if self.light == "encoded":
            return self.sensor.dn(electrons)
        level = electrons / np.float32(self.sensor.electrons_at_full_scale)
        return np.asarray(encode(level) * np.float32(FULL_SCALE_DN), dtype=np.float32)

    @cached_property
    def noise_clipped_dn(self) -> Float:
        """(H, W) noise really present: the frame less `clean_dn`."""
        return self.image * np.float32(FULL_SCALE_DN) - self.clean_dn

    @cached_property
    def unclipped_sigma_dn(self) -> float:
        """Standard deviation of `noise_dn` over the frame."""
        return float(np.std(self.noise_dn, dtype=np.float64))

    @cached_property
    def clipped_sigma_dn(self) -> float:
        """Standard deviation of `noise_clipped_dn` over the frame."""
        return float(np.std(self.noise_clipped_dn, dtype=np.float64))

    @cached_property
    def shift_dn(self) -> float:
        """Mean of `noise_clipped_dn`: how much clipping and rounding moved the frame's mean."""
        return float(np.mean(self.noise_clipped_dn, dtype=np.float64))

    @cached_property
    def mtf(self) -> NDArray[np.float64]:
        """(2, 8) MTF of the optics at the paper's frequencies, H and V; ones without blur."""
        from pipeline.camera import mtf

        return np.ones((2, 8)) if self.psf is None else mtf.sample(self.psf)

    def row(self) -> dict[str, Any]:
        """The truth as one row of the corruption table, all but dataset and frame."""
        return {
            "noise_source": self.noise_source,
            "target_sigma_dn": self.target_sigma_dn,
            "noise_scale": self.noise_scale,
            "unclipped_sigma_dn": self.unclipped_sigma_dn,
            "clipped_sigma_dn": self.clipped_sigma_dn,
            "shift_dn": self.shift_dn,
            "clipped_fraction": self.clipped_fraction,
            "temperature_k": self.temperature_k,
            "exposure_s": self.exposure_s,
        }

    def _through_optics(self, electrons: Float) -> Float:
        return electrons if self.psf is None else through_optics(electrons, self.psf, self.boundary)


def through_optics(electrons: Float, psf: NDArray[np.floating], boundary: Boundary) -> Float:
    """Blur a frame: (H, W) with (h, w); see `pipeline.camera.blur.blur`."""
    from pipeline.camera.blur import blur

    return np.asarray(blur(electrons, psf, boundary=boundary), dtype=np.float32)


def local_sigma(
    truth: Corrupted, tiles: Iterable[Any], when: Literal["before", "after"] = "after"
) -> NDArray[np.float64]:
    """Standard deviation of the noise really present in each tile.

    Args:
        truth: a corrupted frame.
        tiles: N rows ``(x_px, y_px, size_px)``, or objects with these attributes; inside the frame.
        when: ``after`` the 8-bit range has cut the noise (what an estimator can see), or ``before``.

    Returns:
        (N,) DN.

    Raises:
        InputError: a tile is empty or leaves the frame, or ``when`` is unknown.
    """
    if when not in ("before", "after"):
        raise InputError(f"local_sigma: when is 'before' or 'after', got '{when}'")
    noise = truth.noise_dn if when == "before" else truth.noise_clipped_dn
    height, width = noise.shape
    results = []
    for tile in tiles:
        x, y, size = (tile.x_px, tile.y_px, tile.size_px) if hasattr(tile, "x_px") else (int(v) for v in tile)
        if not (size > 0 and 0 <= x <= width - size and 0 <= y <= height - size):
            raise InputError(f"tile at x={x}, y={y} of {size} px does not lie in a frame of {width} x {height} px")
        results.append(np.std(noise[y : y + size, x : x + size], dtype=np.float64))
    return np.array(results, dtype=np.float64)
