"""How detection depends on the camera's condition: the paper's curves of average precision (IOPC), and its regression.

>>> from pipeline import curves
>>> surface = curves.build(sigma_dn, mtf, ap_percent, generator=stream(1, "curves"))   # tuples (sigma~, MTF~, AP)
>>> surface.at(12.0, 0.75)                     # average precision in percent, with its interval; refuses to extrapolate
>>> fit = curves.fit(iso, exposure_ms, ap_percent)                          # the paper's c1..c8
"""

from __future__ import annotations

from pipeline.curves.calibration import PAPER, Calibration, calibrate
from pipeline.curves.cells import MTF_BINS, SIGMA_BINS_DN, Cells, gather
from pipeline.curves.direction import Directions, by_direction
from pipeline.curves.isolated import Curve, isolated
from pipeline.curves.regression import Fit, LeftOut, evaluate, fit, leave_one_out
from pipeline.curves.surface import Answer, Surface, build

__all__ = [
    "MTF_BINS",
    "PAPER",
    "SIGMA_BINS_DN",
    "Answer",
    "Calibration",
    "Cells",
    "Curve",
    "Directions",
    "Fit",
    "LeftOut",
    "Surface",
    "build",
    "by_direction",
    "calibrate",
    "evaluate",
    "fit",
    "gather",
    "isolated",
    "leave_one_out",
]
