"""Constants of a sensor from its raw frames, after EMVA 1288: photon transfer, fixed pattern and dark current.

Each colour plane has its own. The black level of each plane comes from its dark frames and is subtracted before the
photon transfer, so that the dark noise is the noise at no light. See `pipeline.camera.characterisation.emva1288` for
the equations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Any

from pipeline.camera.characterisation import emva1288
from pipeline.datasets.decoding.raw_frames import RawFrame
from pipeline.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

BEYOND_WHITE = 1.2
"""Times white: above are grey values of more bits; full wells of pixels differ by a few hundredths."""

DEFECTIVE_FRACTION = 0.01
"""Of pixels, which may show any grey value."""


@dataclass(frozen=True)
class SensorConstants:
    """What raw frames show of a sensor.

    Attributes:
        fits: colour plane -> its photon transfer.
        transfer: a row per plane: ``plane``, ``gain_dn_per_e``, ``gain_error``, ``dark_variance_dn2``,
            ``dark_sigma_e`` and ``dark_sigma_error`` (NaN where quantisation leaves none, for ``dark_sigma_reason``),
            ``full_scale_e`` and ``snr_at_full_scale`` (of white less black, by extrapolation of the line), ``blocks``,
            ``pattern_fraction`` (of the grey value).
        points: the photon-transfer curve: ``plane``, ``mean_dn`` above black and ``variance_dn2`` of bins of equal
            count, by medians.
        dark: a row per plane: ``plane``, ``slope_dn_per_s``, ``slope_error``, ``dark_current_e_per_s``, ``offset_dn``,
            ``zero_fraction``.
        dark_means: ``plane``, ``exposure_s``, ``mean_dn`` of each dark frame.
    """

    fits: Mapping[str, emva1288.PhotonTransfer]
    transfer: pd.DataFrame
    points: pd.DataFrame
    dark: pd.DataFrame
    dark_means: pd.DataFrame


def sensor_constants(light: Sequence[RawFrame], dark: Sequence[RawFrame], white_dn: float) -> SensorConstants:
    """Photon transfer and dark current of every colour plane.

    Args:
        light: frames of lit scenes, by scene and exposure; each scene at two exposures or more, or twice at each.
        dark: dark frames of three exposures or more.
        white_dn: raw grey value of saturation, DN.

    Raises:
        InputError: frames are broken, of unequal shape or too few, no scene has a pair, dark frames are brighter than
            lit ones, or white is not above the black level or below grey values of lit frames.
    """
    import pandas as pd

    pairs = [pair for _, scene in groupby(light, key=lambda frame: frame.scene) for pair in _pairs(list(scene))]
    if not pairs:
        raise InputError(
            f"{light[0].path.parent}: no scene has two frames, expected names alike up to the exposure, "
            f"as {light[0].scene}_250ms_1.tif and {light[0].scene}_500ms_1.tif"
        )
    pictures, exposures = [frame.pixels() for frame in dark], [frame.exposure_s for frame in dark]
    step_dn = emva1288.grey_step_dn(frame.pixels() for frame in (*dark, *light))
    dark_planes = {name: [emva1288.plane(picture, name) for picture in pictures] for name in emva1288.PLANES}
    currents = {name: emva1288.dark_current(exposures, planes) for name, planes in dark_planes.items()}
    curves: dict[str, list[emva1288.TransferPoints]] = {name: [] for name in emva1288.PLANES}
    brightest_dn = 0.0
    for pair in pairs:
        first, second = (frame.pixels() for frame in pair)
        if first.shape != second.shape:
            raise InputError(f"{pair[1].path}: shape {second.shape}, expected {first.shape} of {pair[0].path.name}")
        brightest_dn = max(brightest_dn, second.mean())
        for name, curve in curves.items():
            a, b = emva1288.plane(first, name), emva1288.plane(second, name)
            curve.append(emva1288.points_of_pair(a, b, white_dn, currents[name].black_dn, step_dn))
        if (second > BEYOND_WHITE * white_dn).mean() > DEFECTIVE_FRACTION:
            raise InputError(
                f"{pair[1].path}: grey values up to {second.max()} DN, expected at most white_dn, {white_dn:g} DN: "
                "the grey value of saturation, which is 4095 for 12 bits"
            )
    if min(picture.mean() for picture in pictures) > brightest_dn:
        raise InputError(
            f"{dark[0].path.parent}: all frames brighter than those of {light[0].path.parent}, expected dark frames; "
            "give the folders the other way round"
        )
    fits = {name: emva1288.photon_transfer(curve, currents[name].black_dn, step_dn) for name, curve in curves.items()}
    dark_rows = [_dark_row(name, current, fits[name]) for name, current in currents.items()]
    means = [
        {"plane": name, "exposure_s": exposure_s, "mean_dn": float(plane.mean())}
        for name, planes in dark_planes.items()
        for exposure_s, plane in zip(exposures, planes, strict=True)
    ]
    transfer = pd.DataFrame([_transfer_row(name, fit, white_dn) for name, fit in fits.items()])
    points = pd.concat([_points(name, curve, step_dn) for name, curve in curves.items()], ignore_index=True)
    return SensorConstants(fits, transfer, points, pd.DataFrame(dark_rows), pd.DataFrame(means))


def _pairs(scene: Sequence[RawFrame]) -> list[tuple[RawFrame, RawFrame]]:
    """Neighbours by exposure; where each exposure has two frames, only those of equal exposure.

    In these the offsets of pixels cancel. Between unequal exposures pairs share frames, too, so that the errors of the
    line are a quarter too small.
    """
    pairs = list(pairwise(scene))
    equal = [pair for pair in pairs if pair[0].exposure_s == pair[1].exposure_s]
    return equal if {pair[0].exposure_s for pair in equal} == {frame.exposure_s for frame in scene} else pairs


def _dark_row(name: str, current: emva1288.DarkCurrent, fit: emva1288.PhotonTransfer) -> dict[str, Any]:
    return {
        "plane": name,
        "slope_dn_per_s": current.slope_dn_per_s,
        "slope_error": current.slope_error,
        "dark_current_e_per_s": current.slope_dn_per_s / fit.gain_dn_per_e,
        "offset_dn": current.offset_dn,
        "zero_fraction": current.zero_fraction,
    }


def _transfer_row(name: str, fit: emva1288.PhotonTransfer, white_dn: float) -> dict[str, Any]:
    full_scale_dn = white_dn - fit.black_dn
    return {
        "plane": name,
        "gain_dn_per_e": fit.gain_dn_per_e,
        "gain_error": fit.gain_error,
        "dark_variance_dn2": fit.dark_variance_dn2,
        "dark_sigma_e": fit.dark_sigma_e,
        "dark_sigma_error": fit.dark_sigma_error,
        "dark_sigma_reason": fit.dark_sigma_reason,
        "full_scale_e": full_scale_dn / fit.gain_dn_per_e,
        "snr_at_full_scale": fit.snr(full_scale_dn),
        "blocks": fit.points,
        "pattern_fraction": fit.pattern_fraction,
    }


def _points(name: str, curve: Sequence[emva1288.TransferPoints], step_dn: float) -> pd.DataFrame:
    """The points of a curve in bins of equal count, as the line is fitted to them."""
    import pandas as pd

    bins = emva1288.binned(curve, step_dn)
    return pd.DataFrame({"plane": name, "mean_dn": bins.mean_dn, "variance_dn2": bins.variance_dn2})
