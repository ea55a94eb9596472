"""Which sources of noise are on, under which conditions, and the names the paper gives to such settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.camera.constants import PAPER_HOT_EXPOSURE_S, PAPER_HOT_K
from pipeline.errors import InputError, did_you_mean

Range = tuple[float, float]


@dataclass(frozen=True)
class Effects:
    """Which effects are on, and the conditions they happen in.

    Attributes:
        photon: photon shot noise.
        dark: dark-current shot noise.
        reset: reset (kTC) noise.
        source_follower: source-follower noise.
        temperature_k: range from which the sensor temperature is drawn evenly; equal ends fix it.
        exposure_s: range of the exposure time, likewise; it acts on dark current only.
        zero_mean_dark: subtract the mean dark signal.
        quantise: full well, whole electrons, rounding and clipping to 8 bit.
    """

    photon: bool = False
    dark: bool = False
    reset: bool = False
    source_follower: bool = False
    temperature_k: Range = (293.15, 293.15)
    exposure_s: Range = (0.00014, 0.00014)
    zero_mean_dark: bool = True
    quantise: bool = True

    @property
    def noisy(self) -> bool:
        """Whether any source of noise is on."""
        return self.photon or self.dark or self.reset or self.source_follower


_HOT_K: Range = (PAPER_HOT_K, PAPER_HOT_K)
_HOT_EXPOSURE_S: Range = (PAPER_HOT_EXPOSURE_S, PAPER_HOT_EXPOSURE_S)
_ANY_TEMPERATURE_K: Range = (300.0, PAPER_HOT_K)
_ANY_EXPOSURE_S: Range = (1.0 / 500.0, 1.0)

PRESETS: dict[str, Effects] = {
    "photon": Effects(photon=True),
    "dcsn": Effects(dark=True, temperature_k=_HOT_K, exposure_s=_HOT_EXPOSURE_S),
    "readout": Effects(reset=True, source_follower=True, temperature_k=_HOT_K),
    "combined": Effects(True, True, True, True, _ANY_TEMPERATURE_K, _ANY_EXPOSURE_S),
    "sensor": Effects(False, True, True, True, _ANY_TEMPERATURE_K, _ANY_EXPOSURE_S),
}
"""The paper's effects: isolated sources, all of them, and all but photon noise, in the conditions of its program."""


def preset(effect: str | Sequence[str]) -> tuple[str, Effects]:
    """The effects behind a name or several names.

    Args:
        effect: a key of `PRESETS`, or several: their sources together, in the random conditions of ``combined``
            where there are two or more.

    Returns:
        the name (several joined by ``+``) and the effects.

    Raises:
        InputError: an unknown name.
    """
    names = [effect] if isinstance(effect, str) else list(effect)
    for name in names:
        if name not in PRESETS:
            raise InputError(f"noise effect '{name}' is unknown; {did_you_mean(name, PRESETS)}")
    if len(names) == 1:
        return names[0], PRESETS[names[0]]
    chosen = [PRESETS[name] for name in names]
    together = Effects(
        photon=any(item.photon for item in chosen),
        dark=any(item.dark for item in chosen),
        reset=any(item.reset for item in chosen),
        source_follower=any(item.source_follower for item in chosen),
        temperature_k=_ANY_TEMPERATURE_K,
        exposure_s=_ANY_EXPOSURE_S,
    )
    return "+".join(names), together
