"""A small combined experiment, whose estimator computes its MTF from the pixels it is given."""

import numpy as np

from pipeline.blur.base import BlurEstimate
from pipeline.camera import mtf
from pipeline.camera.psf.bank import bank
from pipeline.camera.settings import CameraSettings
from pipeline.experiments.combined import Combined, Pair
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.run import Method

KERNELS = bank(["defocus", "linear_motion"], [7], [0, 90], 1)
PAIRS = [Pair("defocus_dcsn", "defocus", "dcsn"), Pair("photon_defocus", "defocus", "photon"),
         Pair("linear_dcsn", "linear_motion", "dcsn")]  # fmt: skip
LEVELS = [0.0, 15.0]


class Contrast:
    """Computes an MTF from a patch's own pixels, so that other pixels give another one."""

    def estimate(self, patches):
        steps = [np.abs(np.diff(patches, axis=axis)).mean(axis=(1, 2, 3)) for axis in (-1, -2)]
        fall = (np.stack(steps, axis=1) / patches.mean(axis=(1, 2, 3))[:, None])[:, :, None]
        value = np.exp(-mtf.FREQUENCIES / (20 * fall))
        return BlurEstimate(value, np.zeros(len(patches), bool), np.full(len(patches), ""), low=value / 2, high=value)


def measured(frame, patches, tiles=(), methods=None, **changes):
    """The measurements of one frame."""
    methods = [Method("contrast", "mtf", Contrast())] if methods is None else methods
    experiment = Combined(
        **{"pairs": PAIRS, "kernels": KERNELS, "target_sigmas_dn": LEVELS, "methods": methods, **changes}
    )
    return experiment.run([TestFrame(frame, {"mtf": patches, "sigma_dn": tiles})], CameraSettings(), 1)


def with_estimates(measurements, estimates, filter_px):
    """Rows of one kernel as if filtered, with `estimates` as the MTF."""
    rows = measurements[(measurements["experiment"] == "defocus_dcsn") & (measurements["target_sigma_dn"] == 15)].copy()
    return rows.assign(filter_px=filter_px, smoothed=True, estimate=estimates(rows), low=np.nan, high=np.nan)
