"""Constants of the camera model: the scale of grey levels, physical constants, the paper's sensor.

Physical constants have the digits of the paper's program (Wischow et al. 2023), so that its numbers are met exactly.
"""

from __future__ import annotations

FULL_SCALE_DN = 255.0
"""White. Grey levels are on the 8-bit scale, 0..255 DN, whatever the converter's depth."""

ELECTRON_CHARGE_C = 1.602176487e-19
BOLTZMANN_J_PER_K = 1.3806504e-23
BOLTZMANN_EV_PER_K = 8.617343e-5
SILICON_GAP_EV = 1.1557  # at 0 K; Varshni 1967 with the two numbers below
SILICON_GAP_SLOPE_EV_PER_K = 7.021e-4
SILICON_GAP_OFFSET_K = 1108.0
DARK_CURRENT_FACTOR = 2.5e15  # e- per (s cm^2 K^1.5 nA/cm^2); Janesick 2001

PAPER_FULL_WELL_E = 20_000.0
PAPER_HOT_K, PAPER_HOT_EXPOSURE_S = 330.0, 0.1
"""Temperature and exposure in which the paper's program draws isolated dark current and readout noise."""

PAPER_HOT_DARK_E, PAPER_HOT_READOUT_E = 1428.0, 75.5
"""Mean dark signal and standard deviation of readout noise of the paper's sensor in these conditions, e-:
`pipeline.camera.sensor.Sensor` to 0.3 %, for training samples, which are scaled to a level anyway."""

RANGE_SLACK = 1e-6
"""How far grey levels in [0, 1] may lie outside: rounding of 1 in single precision."""
