"""The fused estimator's calibration to one camera: maps of its networks and GBB's MTF of sharp frames.

PMP is left as it is: its answers for sharp frames are no measure of the camera, and dividing by them makes it worse.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import FREQUENCIES, BlurEstimate
from pipeline.blur.camera_calibration import Calibration
from pipeline.blur.estimator_identity import EstimatorIdentity
from pipeline.errors import InputError

SHARP_FLOOR = 0.3  # GBB's sharp MTF is not divided by below this: it is noise there
SHARP_PATCHES = 10  # that GBB is run on


@dataclass(frozen=True)
class FusionMap:
    """See the module.

    Attributes:
        spectral: map of the spectral networks' answers.
        gbb_sharp_mtf: (2, 8) median MTF by GBB over sharp patches; 1 where it could measure none.
        networks: map of these and of the pixel network (`pipeline.blur.spectral_and_pixels`); None where the latter
            takes no part, as in calibrations made before there was one.
        made_for: the estimator that it was fitted to; None where that is not known, as in files of earlier versions.
    """

    spectral: Calibration
    gbb_sharp_mtf: NDArray[np.float64]
    networks: Calibration | None = None
    made_for: EstimatorIdentity | None = None

    @property
    def samples(self) -> int:
        """Blurred patches that the spectral map was fitted on."""
        return self.spectral.samples

    @property
    def error_percent(self) -> tuple[float, float]:
        """Mean absolute error of the spectral network on them before and after."""
        return self.spectral.error_percent

    def relative(self, gbb_mtf: NDArray[np.floating]) -> NDArray[np.float64]:
        """GBB's MTF (..., 2, 8) relative to the sharp frames, in [0, 1]."""
        return np.asarray(np.clip(gbb_mtf / np.maximum(self.gbb_sharp_mtf, SHARP_FLOOR), 0.0, 1.0))

    def answer(self, estimator: Any, patches: Any) -> BlurEstimate:
        """The MTF added to the camera's sharp frames, by a `pipeline.blur.fused.Fused`."""
        calibrated: BlurEstimate = estimator.with_camera(self).estimate(patches)
        return calibrated

    def save(self, path: str | Path) -> None:
        """Write it as JSON."""
        from pipeline.store import write_json

        content = {"spectral": self.spectral.content(), "gbb_sharp_mtf": self.gbb_sharp_mtf.tolist()}
        if self.networks is not None:
            content["networks"] = self.networks.content()
        if self.made_for is not None:
            content["made_for"] = self.made_for.content()
        write_json(Path(path), content)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote.

        Raises:
            InputError: no such file, or not such a file.
        """
        try:
            content = json.loads(Path(path).read_text())
            sharp = np.array(content["gbb_sharp_mtf"], float)
            if sharp.shape != (2, FREQUENCIES) or not np.isfinite(sharp).all():
                raise ValueError(f"gbb_sharp_mtf of shape {sharp.shape}, expected (2, {FREQUENCIES}) finite numbers")
            networks = Calibration.from_content(content["networks"]) if "networks" in content else None
            made_for = EstimatorIdentity.from_content(content["made_for"]) if "made_for" in content else None
            return cls(Calibration.from_content(content["spectral"]), sharp, networks, made_for)
        except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
            raise InputError(
                f"{path}: not the calibration of the fused estimator ({error}); "
                'make one with blur.create("fused").fit_camera(sharp_patches).save(path)'
            ) from None
