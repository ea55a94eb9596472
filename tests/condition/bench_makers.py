"""A small bench of blur and noise at once, whose estimator answers from the pixels it sees."""

import numpy as np
import pandas as pd

from pipeline.blur.base import BlurEstimate
from pipeline.camera import mtf
from pipeline.camera.psf.bank import bank
from pipeline.condition import combined_tables
from pipeline.condition.combined import Bench
from pipeline.condition.combined_design import Experiment, Subset

KERNELS = bank(["defocus", "linear_motion"], [7], [0, 90], 1)
EXPERIMENTS = [Experiment("defocus_dcsn", "defocus", "dcsn"), Experiment("photon_defocus", "defocus", "photon"),
               Experiment("linear_dcsn", "linear_motion", "dcsn")]  # fmt: skip
LEVELS = [0.0, 15.0]


class Contrast:
    """Answers from a patch's own pixels, so that other pixels give another answer."""

    def estimate(self, patches):
        steps = [np.abs(np.diff(patches, axis=axis)).mean(axis=(1, 2, 3)) for axis in (-1, -2)]
        fall = (np.stack(steps, axis=1) / patches.mean(axis=(1, 2, 3))[:, None])[:, :, None]
        value = np.exp(-mtf.FREQUENCIES / (20 * fall))
        return BlurEstimate(value, np.zeros(len(patches), bool), np.full(len(patches), ""), low=value / 2, high=value)


def table(rows):
    return combined_tables.BLUR_READ.conform(pd.DataFrame(rows))


def bench(**changes):
    options = {"experiments": EXPERIMENTS, "kernels": KERNELS, "levels_dn": LEVELS,
               "blur": {"contrast": (Contrast(), Subset())}}  # fmt: skip
    return Bench(**{**options, **changes})


def readings(read, answer, filter_px):
    """Rows of one kernel as if smoothed, with `answer` as the MTF read."""
    rows = read[(read["experiment"] == "defocus_dcsn") & (read["level_dn"] == 15)].copy()
    return rows.assign(filter_px=filter_px, smoothed=True, mtf=answer(rows), low=np.nan, high=np.nan)
