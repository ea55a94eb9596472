"""One corrupted frame taken apart: what it looked like after each step of the chain, for people to look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.truth import Corrupted, Float, through_optics


@dataclass(frozen=True)
class Step:
    """The frame after one step.

    Attributes:
        name: of the array in a file.
        title: for a picture's heading.
        caption: what happened, in one sentence.
        image: (H, W) float32; clipped to [0, 1] for display.
    """

    name: str
    title: str
    caption: str
    image: NDArray[np.float32]


def steps(shown: Corrupted) -> list[Step]:
    """The frame after each step, in the order of the chain.

    Args:
        shown: a corrupted frame; steps that were off are left out.

    Returns:
        the input first, the 8-bit frame last; each as the camera would have encoded it.
    """
    electrons = shown.signal_e
    results = [_step("input", "scene", "The sharp frame.", electrons, shown)]
    for name in ("photon", "optics") if shown.order == "paper" else ("optics", "photon"):
        if name == "photon" and "photon" in shown.noise_e:
            electrons = electrons + shown.noise_e["photon"]
            grows = "Photon shot noise grows with the root of the light."
            results.append(_step("photon", "photons", grows, electrons, shown))
        elif name == "optics" and shown.psf is not None:
            electrons = through_optics(electrons, shown.psf, shown.boundary)
            smooths = "photon" in shown.noise_e and shown.order == "paper"
            spreads = "Blur spreads light and smooths the photon noise." if smooths else "Blur spreads light."
            results.append(_step("optics", "optics", spreads, electrons, shown))
    if "dark" in shown.noise_e:
        electrons = electrons + shown.noise_e["dark"]
        results.append(
            _step("dark", "dark current", "Dark-current shot noise is the same everywhere.", electrons, shown)
        )
    if "readout" in shown.noise_e:
        electrons = electrons + shown.noise_e["readout"]
        results.append(
            _step("readout", "readout", "Reset and source-follower noise of the electronics.", electrons, shown)
        )
    if "total" in shown.noise_e:  # the authors' program adds all sensor noise in one piece
        electrons = electrons + shown.noise_e["total"]
        results.append(_step("total", "sensor noise", "Dark current and readout, added together.", electrons, shown))
    last = Step("quantised", "quantisation", "Full well, conversion and rounding to 8 bit.", shown.image)
    return [*results, last]


def _step(name: str, title: str, caption: str, electrons: Float, shown: Corrupted) -> Step:
    image = np.clip(shown.encoded_dn(electrons) / np.float32(FULL_SCALE_DN), 0.0, 1.0)
    return Step(name, title, caption, image.astype(np.float32))
