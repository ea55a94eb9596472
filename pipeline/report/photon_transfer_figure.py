"""The photon-transfer figure: variance over mean of evenly lit frames, whose slope is the sensor's gain.

Method: Janesick, *Photon Transfer* (SPIE 2007); EMVA Standard 1288.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pipeline.errors import InputError
from pipeline.report import style
from pipeline.report.style import Drawing

_KEYS = ("mean_dn", "variance_dn2", "slope_dn_per_e", "offset_dn2", "gain_dn_per_e")


@style.styled
def draw(curve: Mapping[str, Any]) -> Drawing:
    """Measured points, the fitted line, and the line that the sensor's parameters imply.

    Args:
        curve: ``mean_dn`` and ``variance_dn2`` (equally long), ``slope_dn_per_e`` and ``offset_dn2`` of the fit, and
            ``gain_dn_per_e`` of the sensor.

    Raises:
        InputError: a quantity is missing, or the two lists differ in length.
    """
    import pandas as pd

    absent = [key for key in _KEYS if key not in curve]
    if absent or len(curve["mean_dn"]) != len(curve["variance_dn2"]):
        raise InputError(f"photon_transfer.json: expected {', '.join(_KEYS)} with equally long lists; missing {absent}")
    mean, variance = np.asarray(curve["mean_dn"], dtype=float), np.asarray(curve["variance_dn2"], dtype=float)
    slope, offset, gain = (float(curve[key]) for key in ("slope_dn_per_e", "offset_dn2", "gain_dn_per_e"))
    figure = style.new_figure(style.ONE_COLUMN_IN * 1.4, 2.5)
    axes = figure.subplots()
    ends = np.array([0.0, mean.max() * 1.05])
    axes.plot(ends, gain * ends + offset, color=style.INK, linewidth=0.9, label=f"sensor: {gain:.5f} DN/e⁻")
    axes.plot(
        ends, slope * ends + offset, color=style.PALETTE[1], linestyle=(0, (4, 2)), label=f"fit: {slope:.5f} DN/e⁻"
    )
    axes.plot(mean, variance, color=style.PALETTE[0], marker="o", linestyle="none", label="simulated frames")
    axes.set(xlabel="mean [DN]", ylabel="variance [DN²]", xlim=(0, None), ylim=(0, None))
    axes.legend(loc="upper left")
    alt = (
        f"Variance over mean of {len(mean)} evenly lit exposures: the fitted slope is {slope:.5f} DN per electron, "
        f"{100 * (slope / gain - 1):+.2f} % from the sensor's gain of {gain:.5f}."
    )
    return Drawing(figure, alt, pd.DataFrame({"mean_dn": mean, "variance_dn2": variance}))
