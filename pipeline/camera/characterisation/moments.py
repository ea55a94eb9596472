"""The sensor's own measurements: constants by formula, moments by drawing, and the photon-transfer curve.

Photon transfer (Janesick 2007; EMVA Standard 1288): on evenly lit frames the variance of the grey value grows with
its mean, ``var = K mean + var_read``, and the slope is the system gain K in DN per electron. Finding K again from
simulated frames shows that photon noise, conversion and scale fit together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.dark_current import dark_noise
from pipeline.camera.photon import photon_shot
from pipeline.camera.readout import read_noise
from pipeline.camera.sensor import Sensor
from pipeline.streams import stream

_SIDE_PX = 512
_DARK_CONDITIONS = {
    "293k_100ms": (293.15, 0.1),
    "300k_2ms": (300.0, 0.002),
    "300k_100ms": (300.0, 0.1),
    "330k_100ms": (330.0, 0.1),
    "330k_1s": (330.0, 1.0),
}
_RESET_TEMPERATURES_K = {"293k": 293.15, "300k": 300.0, "330k": 330.0}


@dataclass(frozen=True)
class SimulatedTransfer:
    """Mean and variance of evenly lit frames, and the line through them.

    Attributes:
        mean_dn: (L,) mean grey values, DN.
        variance_dn2: (L,) variance between the pixels, DN squared.
        slope: DN per electron by least squares.
        offset_dn2: variance at zero light, DN squared.
    """

    mean_dn: np.ndarray
    variance_dn2: np.ndarray
    slope: float
    offset_dn2: float


def simulated_transfer(sensor: Sensor, seed: int, levels: int = 12) -> SimulatedTransfer:
    """Simulate evenly lit frames between 5 and 80 % of full well and fit the photon-transfer line.

    Args:
        sensor: the camera's sensor.
        seed: root of the random streams.
        levels: number of exposures.

    Returns:
        the curve; its slope estimates ``sensor.dn_per_electron``.
    """
    shape = (_SIDE_PX, _SIDE_PX)
    means, variances = np.empty(levels), np.empty(levels)
    for index, share in enumerate(np.linspace(0.05, 0.80, levels)):
        signal = np.full(shape, share * sensor.electrons_at_full_scale, np.float32)
        electrons = photon_shot(signal, stream(seed, "photon transfer", "photon", index))
        electrons = electrons + read_noise(shape, sensor, 293.15, stream(seed, "photon transfer", "read", index))
        grey = sensor.dn(electrons).astype(np.float64)
        means[index], variances[index] = grey.mean(), grey.var()
    weight = 1.0 / variances  # the standard error of a variance is proportional to it
    slope, offset = np.polyfit(means, variances, 1, w=weight)
    return SimulatedTransfer(means, variances, float(slope), float(offset))


def moments(sensor: Sensor, seed: int) -> dict[str, float]:
    """Constants of the sensor and moments measured on draws from it.

    Args:
        sensor: the camera's sensor.
        seed: root of the random streams.

    Returns:
        quantity -> value in the unit its name ends with; names as in ``data/paper/image_formation.csv``.
    """
    shape = (_SIDE_PX, _SIDE_PX)
    values = {
        "full_well_e": sensor.full_well_e,
        "sense_node_gain_v_per_e": sensor.sense_node_gain_v_per_e,
        "source_follower_gain": sensor.source_follower_gain,
        "cds_gain": sensor.cds_gain,
        "cds_time_s": sensor.cds_interval_s,
        "clock_hz": sensor.clock_hz,
        "pixel_pitch_cm": sensor.pixel_pitch_um * 1e-4,
        "dark_figure_na_per_cm2": sensor.dark_figure_na_per_cm2,
        "sense_node_capacitance_f": sensor.sense_node_capacitance_f,
        "gain_e_per_dn": sensor.electrons_per_dn,
        "gain_from_photon_transfer_e_per_dn": 1.0 / simulated_transfer(sensor, seed).slope,
        "source_follower_std_e": sensor.source_follower_sigma_e(),
    }
    for name, (temperature_k, exposure_s) in _DARK_CONDITIONS.items():
        generator = stream(seed, "moments", "dark", name)
        drawn = dark_noise(shape, sensor, temperature_k, exposure_s, generator, zero_mean=False)
        values[f"dark_mean_{name}_e"] = float(drawn.mean(dtype=np.float64))
        if name == "330k_100ms":
            values[f"dcsn_std_{name}_dn"] = float(drawn.std(dtype=np.float64)) * sensor.dn_per_electron
    for name, temperature_k in _RESET_TEMPERATURES_K.items():
        generator = stream(seed, "moments", "reset", name)
        drawn = read_noise(shape, sensor, temperature_k, generator, source_follower=False)
        values[f"ktc_std_{name}_e"] = float(drawn.std(dtype=np.float64))
    for name, share in {"mid_grey": 0.5, "full_well": 1.0}.items():
        signal = np.full(shape, share * sensor.electrons_at_full_scale, np.float32)
        drawn = photon_shot(signal, stream(seed, "moments", "photon", name))
        values[f"photon_std_{name}_e"] = float(drawn.std(dtype=np.float64))
    return values


def transfer_rows(curve: SimulatedTransfer, sensor: Sensor) -> dict[str, object]:
    """The photon-transfer curve as plain numbers, with the gain it should show."""
    return {
        "mean_dn": curve.mean_dn.tolist(),
        "variance_dn2": curve.variance_dn2.tolist(),
        "slope_dn_per_e": curve.slope,
        "offset_dn2": curve.offset_dn2,
        "gain_dn_per_e": sensor.dn_per_electron,
        "full_scale_dn": FULL_SCALE_DN,
    }
