"""The electron-level sensor: every parameter of the paper's camera model and what follows from them.

Model: Janesick-type photon transfer as in Wischow et al. 2023 (Sec. III and its published program), after Konnik
and Welsh 2014 ("High-level numerical simulations of noise in CCD and CMOS photosensors"). One photo-electron per
photon; no fixed pattern. Pixel values are on the 8-bit scale, 0..255 DN, whatever the converter's own depth.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.camera.constants import (
    BOLTZMANN_EV_PER_K,
    BOLTZMANN_J_PER_K,
    DARK_CURRENT_FACTOR,
    ELECTRON_CHARGE_C,
    FULL_SCALE_DN,
    PAPER_FULL_WELL_E,
    SILICON_GAP_EV,
    SILICON_GAP_OFFSET_K,
    SILICON_GAP_SLOPE_EV_PER_K,
)
from pipeline.errors import InputError, did_you_mean

_NOISE_BAND_STEP_HZ = 5.0e4  # step of the source-follower sum, from 1 Hz to the pixel clock


@dataclass(frozen=True)
class Sensor:
    """Parameters of one camera's sensor; the defaults are the paper's.

    Attributes:
        full_well_e: charge at which a pixel saturates, e-.
        pixel_pitch_um: side of a square pixel, micrometres.
        dark_figure_na_per_cm2: dark current at 300 K, nA/cm^2.
        sense_node_gain_v_per_e: volts per electron at the sense node.
        source_follower_gain: V/V.
        cds_gain: gain of correlated double sampling, V/V.
        cds_interval_s: time between its two samples.
        cds_time_factor: its time constant as a share of that interval.
        reset_factor: share of the reset (kTC) noise that remains; 1 is all of it, as in the paper.
        thermal_noise_v_per_sqrt_hz: white noise of the source follower.
        flicker_corner_hz: where flicker noise equals white noise.
        current_modulation_a: random telegraph noise, CMOS only.
        telegraph_time_s: its time constant.
        clock_hz: pixel clock, upper end of the noise band.
        reference_v: sense node reference; cancels in the signal and is kept for completeness.
        over_exposure: the scene is multiplied by this and clipped to [0, 1] first.
        kind: ``cmos`` keeps reset noise; ``ccd`` removes it by double sampling.
        gain: camera gain, at least 1 (base ISO): full scale is reached at ``full_well_e / gain`` electrons.
        read_noise_e: measured read noise before the gain stage, e-; replaces reset and source-follower noise.
        read_noise_after_gain_e: read noise after the gain stage, in e- at gain 1; only with ``read_noise_e``.

    Raises:
        InputError: a parameter is out of range.
    """

    full_well_e: float = PAPER_FULL_WELL_E
    pixel_pitch_um: float = 5.0
    dark_figure_na_per_cm2: float = 1.0
    sense_node_gain_v_per_e: float = 5e-6
    source_follower_gain: float = 1.0
    cds_gain: float = 1.0
    cds_interval_s: float = 1e-6
    cds_time_factor: float = 0.5
    reset_factor: float = 1.0
    thermal_noise_v_per_sqrt_hz: float = 15e-9
    flicker_corner_hz: float = 1e6
    current_modulation_a: float = 1e-8
    telegraph_time_s: float = 5e-8
    clock_hz: float = 20e6
    reference_v: float = 3.1
    over_exposure: float = 1.0
    kind: Literal["cmos", "ccd"] = "cmos"
    gain: float = 1.0
    read_noise_e: float | None = None
    read_noise_after_gain_e: float = 0.0

    def __post_init__(self) -> None:
        zero_is_fine = {
            "dark_figure_na_per_cm2",
            "reset_factor",
            "thermal_noise_v_per_sqrt_hz",
            "flicker_corner_hz",
            "current_modulation_a",
            "read_noise_e",
            "read_noise_after_gain_e",
        }
        if self.kind not in ("cmos", "ccd"):
            raise InputError(f"sensor.kind is 'cmos' or 'ccd', got '{self.kind}'")
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name == "kind" or (item.name == "read_noise_e" and value is None):
                continue
            if not np.isfinite(value) or value < 0 or (value == 0 and item.name not in zero_is_fine):
                bound = "at least 0" if item.name in zero_is_fine else "above 0"
                raise InputError(f"sensor.{item.name} must be a number {bound}, got {value!r}")
        check_base_gain("sensor.gain", self.gain)
        if self.read_noise_after_gain_e and self.read_noise_e is None:
            raise InputError("sensor.read_noise_after_gain_e needs sensor.read_noise_e (0 is allowed)")

    # -- conversion between pixel values and electrons

    @property
    def electrons_at_full_scale(self) -> float:
        """Electrons that give 255 DN: ``N_fw / gain``."""
        return self.full_well_e / self.gain

    @property
    def dn_per_electron(self) -> float:
        """System gain ``K = 255 gain / N_fw``, DN per e-."""
        return FULL_SCALE_DN / self.electrons_at_full_scale

    @property
    def electrons_per_dn(self) -> float:
        """``1 / K``, e- per DN."""
        return 1.0 / self.dn_per_electron

    def electrons(self, image: ArrayLike) -> NDArray[np.float32]:
        """Mean signal of an image: ``clip(I * over_exposure, 0, 1) * N_fw / gain``.

        Args:
            image: (..., H, W) in [0, 1].

        Returns:
            float32 electrons, same shape.
        """
        given = np.asarray(image, dtype=np.float32)
        if self.over_exposure != 1.0:
            given = np.clip(given * np.float32(self.over_exposure), 0.0, 1.0)
        return given * np.float32(self.electrons_at_full_scale)

    def dn(self, electrons: ArrayLike) -> NDArray[np.float32]:
        """Electrons on the 0..255 scale, neither rounded nor clipped; any shape, float32."""
        return np.asarray(electrons, dtype=np.float32) * np.float32(self.dn_per_electron)

    # -- quantities that follow

    @property
    def sense_node_capacitance_f(self) -> float:
        """``C = q / A_SN``, farads."""
        return ELECTRON_CHARGE_C / self.sense_node_gain_v_per_e

    @property
    def voltage_at_full_well_v(self) -> float:
        """``V_max = N_fw q / C``, volts."""
        return self.full_well_e * ELECTRON_CHARGE_C / self.sense_node_capacitance_f

    def dark_electrons(self, temperature_k: float, exposure_s: float) -> float:
        """Mean dark signal, e- per pixel.

        ``D = 2.5e15 t A D_FM T^1.5 exp(-E_g / (2 k T))``, ``E_g = E_0 - a T^2 / (T + b)``, A in cm^2.

        Args:
            temperature_k: sensor temperature, above 0 K.
            exposure_s: exposure time, at least 0 s.

        Raises:
            InputError: temperature or time out of range.
        """
        check_conditions(temperature_k, exposure_s)
        gap_ev = SILICON_GAP_EV - SILICON_GAP_SLOPE_EV_PER_K * temperature_k**2 / (temperature_k + SILICON_GAP_OFFSET_K)
        thermal = temperature_k**1.5 * np.exp(-gap_ev / (2.0 * BOLTZMANN_EV_PER_K * temperature_k))
        area_cm2 = (self.pixel_pitch_um * 1e-4) ** 2
        return float(DARK_CURRENT_FACTOR * exposure_s * area_cm2 * self.dark_figure_na_per_cm2 * thermal)

    def reset_sigma_e(self, temperature_k: float) -> float:
        """Standard deviation of reset noise, ``r sqrt(k T / C) / A_SN``, e-; 0 for a CCD.

        Raises:
            InputError: temperature out of range.
        """
        check_conditions(temperature_k, 0.0)
        if self.kind == "ccd":
            return 0.0
        volts = float(np.sqrt(BOLTZMANN_J_PER_K * temperature_k / self.sense_node_capacitance_f))
        return self.reset_factor * volts / self.sense_node_gain_v_per_e

    def source_follower_sigma_e(self, integral: Literal["corrected", "authors"] = "corrected") -> float:
        """Standard deviation of source-follower noise after double sampling, e-.

        ``sqrt(sum_f S(f) H(f) df) / (A_SN A_SF (1 - exp(-t_s / tau)))`` with
        ``S = W^2 (1 + f_c / f) + [cmos] 2 I^2 t / (4 + (2 pi f t)^2)``,
        ``H = (2 - 2 cos(2 pi f t_s)) / (1 + (2 pi f tau)^2)`` and ``tau = cds_time_factor t_s``; f runs from 1 Hz to
        the pixel clock in steps of 50 kHz.

        Args:
            integral: ``authors`` leaves out the step ``df``, as the paper's program does (0.027 e- instead of 6.1).
        """
        frequency_hz = np.arange(1.0, self.clock_hz + 0.5, _NOISE_BAND_STEP_HZ)
        turn = 2.0 * np.pi * frequency_hz
        spectrum = self.thermal_noise_v_per_sqrt_hz**2 * (1.0 + self.flicker_corner_hz / frequency_hz)
        if self.kind == "cmos":
            spectrum += (
                2.0 * self.current_modulation_a**2 * self.telegraph_time_s / (4.0 + (turn * self.telegraph_time_s) ** 2)
            )
        tau_s = self.cds_time_factor * self.cds_interval_s
        transfer = (2.0 - 2.0 * np.cos(turn * self.cds_interval_s)) / (1.0 + (turn * tau_s) ** 2)
        power = float(np.sum(spectrum * transfer)) * (_NOISE_BAND_STEP_HZ if integral == "corrected" else 1.0)
        settled = 1.0 - np.exp(-self.cds_interval_s / tau_s)
        return float(np.sqrt(power) / (self.sense_node_gain_v_per_e * self.source_follower_gain * settled))

    def readout_sigma_e(self, temperature_k: float, *, reset: bool = True, source_follower: bool = True) -> float:
        """Standard deviation of all read noise, referred to electrons.

        Reset and source-follower noise added in squares; or, where a measured ``read_noise_e`` is given,
        ``sqrt(before^2 + (after / gain)^2)``, which no switch divides.
        """
        if self.read_noise_e is not None:
            return float(np.hypot(self.read_noise_e, self.read_noise_after_gain_e / self.gain))
        squares = self.reset_sigma_e(temperature_k) ** 2 if reset else 0.0
        squares += self.source_follower_sigma_e() ** 2 if source_follower else 0.0
        return float(np.sqrt(squares))

    def at_gain(self, gain: float) -> Sensor:
        """The same sensor at another camera gain (``ISO / base ISO``)."""
        return replace(self, gain=gain)


def check_conditions(temperature_k: float, exposure_s: float) -> None:
    """Refuse temperatures outside (0, 1000] K and negative exposures.

    Raises:
        InputError: naming the value.
    """
    if not 0.0 < temperature_k <= 1000.0:
        raise InputError(f"temperature_k is in kelvin, above 0 and at most 1000, got {temperature_k!r}")
    if not 0.0 <= exposure_s < float("inf"):
        raise InputError(f"exposure_s is a time of at least 0 s, got {exposure_s!r}")


def check_base_gain(name: str, gain: float) -> None:
    """Refuse gains below that of base ISO, with which a full well stays below full scale and clips unseen.

    Args:
        name: of the setting, for the error.
        gain: ISO / base ISO.

    Raises:
        InputError: below 1, or not a number.
    """
    if not gain >= 1.0:
        raise InputError(
            f"{name} is a factor of at least 1 (ISO / base ISO), got {gain!r}; a full well gives full scale at 1, "
            "the lowest gain; for darker pictures lower exposure time or light"
        )


# Real sensors beside the paper's; numbers and their sources in each entry.
SENSORS: dict[str, dict[str, Any]] = {
    # Wischow et al. 2023, published program
    "paper": {},
    # Allied Vision Prosilica GC1380H, Sony ICX285 CCD: values calibrated by the follow-up work (Wischow et al. 2024);
    # its dark-current figure, 0.00889, belongs to a factor of 2.55e15 and is restated here for 2.5e15
    "prosilica_gc1380h": {
        "full_well_e": 14_000.0,
        "pixel_pitch_um": 6.45,
        "dark_figure_na_per_cm2": 0.009068,
        "clock_hz": 28.64e6,
        "kind": "ccd",
        "read_noise_e": 12.5,
    },
    # e2v EV76C661, CMOS global shutter: values of the same follow-up work; its dark-current figure was fitted for
    # another temperature, so the data sheet's 312 e-/s is assumed to hold at 60 C
    "ev76c661": {
        "full_well_e": 8_400.0,
        "pixel_pitch_um": 5.3,
        "dark_figure_na_per_cm2": 0.0157,
        "clock_hz": 90e6,
        "read_noise_e": 24.0,
    },
    # Sony ICX625, CCD: EMVA 1288 sheet of a Basler camera with it
    "icx625": {
        "full_well_e": 7_000.0,
        "pixel_pitch_um": 3.45,
        "dark_figure_na_per_cm2": 0.009068,
        "kind": "ccd",
        "read_noise_e": 13.0,
    },
    # Sony IMX255, CMOS global shutter: from the maker's SNR of 40.3 dB and dynamic range of 71.3 dB at 12 bit; its
    # dark current is assumed
    "imx255": {
        "full_well_e": 10_700.0,
        "pixel_pitch_um": 3.45,
        "dark_figure_na_per_cm2": 0.0047,
        "read_noise_e": 2.9,
    },
    # a 3 um rolling-shutter automotive CMOS in linear mode: assumed, typical values (2.5 e- at base gain falling to
    # 1.8 e- at high gain, about 30 e-/s dark signal at 60 C)
    "automotive_3um": {
        "full_well_e": 12_000.0,
        "pixel_pitch_um": 3.0,
        "dark_figure_na_per_cm2": 0.0047,
        "read_noise_e": 1.8,
        "read_noise_after_gain_e": 1.735,
    },
}


def named(name: str, **changes: Any) -> Sensor:
    """A sensor by name, with changed fields.

    Args:
        name: a key of `SENSORS`.
        changes: fields of `Sensor` that differ.

    Raises:
        InputError: unknown name or field, or a value out of range.
    """
    if name not in SENSORS:
        raise InputError(f"sensor '{name}' is unknown; {did_you_mean(name, SENSORS)}")
    known = {item.name for item in fields(Sensor)}
    for key in changes:
        if key not in known:
            raise InputError(f"sensor.{key} is not a parameter of the sensor; {did_you_mean(key, known)}")
    return Sensor(**{**SENSORS[name], **changes})


def described(sensor: Sensor) -> dict[str, Any]:
    """A sensor as `named` makes it: its ``model``, the one with the fewest differences, and the fields that differ."""
    values = asdict(sensor)

    def changes(model: str) -> dict[str, Any]:
        return {key: values[key] for key, value in asdict(named(model)).items() if values[key] != value}

    model = min(SENSORS, key=lambda name: len(changes(name)))
    return {"model": model, **changes(model)}
