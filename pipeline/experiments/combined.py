"""Blur and noise at once: frames under kernels and noise levels together, for blur and noise estimators.

The paper's combined experiments (Wischow et al. 2023, Sec. V and supplement). In the paper's order
photon noise is blurred by the optics, and dark current and readout noise, which come after them, stay sharp; in that of
a camera (``camera.order: detector``) all noise stays sharp.

Denoise, then estimate (the supplement's improved blur estimation, `pipeline.blur.denoise`): the MTF of a noisy patch is
also estimated after blurring it by a disc. The measurements hold the MTF of blur and disc together;
`pipeline.experiments.calibrate.divide_out_filter` divides the disc out, after any calibration.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipeline import blur, noise
from pipeline.blur.denoise import expected_amae
from pipeline.camera.psf.defocus import create as disc
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.settings import CameraSettings
from pipeline.datasets.selection import evenly_spread
from pipeline.errors import InputError, did_you_mean
from pipeline.experiments.calibrate import raw_and_calibrated
from pipeline.experiments.condition import Condition, Quantity, Subset, chosen_kernels, first_rotations, sharp_kernel
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.run import Executor, Method, PreFilter, Registered, in_process
from pipeline.experiments.run import run as run_experiment
from pipeline.experiments.summarise import mtf_cells, noise_cells
from pipeline.experiments.tables import BLUR_CELLS, NOISE_CELLS, rounded

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.experiments.settings import CombinedSettings, DenoisedBlurSettings, EstimatorSettings

CELL = (
    "dataset",
    "estimator",
    "experiment",
    "noise_source",
    "target_sigma_dn",
    "blur_kind",
    "kernel_size_px",
    "filter_px",
)
"""What the MTFs of one cell of the tables have in common."""

SIGMA_CELL = (
    "dataset",
    "estimator",
    "experiment",
    "blur_kind",
    "kernel_size_px",
    "noise_source",
    "target_sigma_dn",
)
"""What the noise estimates of one cell have in common."""

DISC = "disc"
"""Experiment that measures the filter discs themselves, without noise."""

MTF_ONLY: frozenset[Quantity] = frozenset({"mtf"})
SIGMA_ONLY: frozenset[Quantity] = frozenset({"sigma_dn"})


@dataclass(frozen=True)
class Pair:
    """A kind of blur and a noise source that come together.

    Attributes:
        name: of the experiment, e.g. ``"defocus_dcsn"``.
        blur_kind: of the kernels.
        noise_source: of the noise (`pipeline.camera.effects.PRESETS`).
    """

    name: str
    blur_kind: str
    noise_source: str


@dataclass(frozen=True)
class Combined:
    """A combined experiment before it is run.

    Attributes:
        pairs: what comes together.
        kernels: blurs; each pair takes those of its kind.
        target_sigmas_dn: target sigmas of the noise, DN.
        methods: blur estimators, and noise estimators, which run on the first rotation of each kernel and on frames
            without blur.
    """

    pairs: Sequence[Pair]
    kernels: Sequence[Kernel]
    target_sigmas_dn: Sequence[float]
    methods: Sequence[Method]

    @property
    def conditions(self) -> list[Condition]:
        """The reference, frames with noise alone, and every kernel with every noise of its pairs."""
        conditions = [Condition(quantities=MTF_ONLY)]
        for source in dict.fromkeys(pair.noise_source for pair in self.pairs):
            for level in self.target_sigmas_dn:
                conditions += [
                    Condition(sharp_kernel(pair.blur_kind), source, float(level), pair.name, SIGMA_ONLY)
                    for pair in self.pairs
                    if pair.noise_source == source
                ]
        first = first_rotations(self.kernels)
        for kernel in self.kernels:
            quantities = MTF_ONLY | SIGMA_ONLY if kernel in first else MTF_ONLY
            for pair in self.pairs:
                if pair.blur_kind == kernel.kind:
                    conditions += [
                        Condition(kernel, pair.noise_source, float(level), pair.name, quantities)
                        for level in self.target_sigmas_dn
                    ]
        return conditions

    def run(
        self,
        frames: Sequence[TestFrame],
        camera: CameraSettings,
        seed: int,
        executor: Executor = in_process,
        label: str = "",
    ) -> pd.DataFrame:
        """`pipeline.experiments.tables.MEASUREMENTS`; see `pipeline.experiments.run.run`."""
        exact = run_experiment(
            frames,
            self.conditions,
            self.methods,
            camera=camera,
            seed=seed,
            executor=executor,
            label=label,
            paired=False,
        )
        return rounded(exact)


def _registered(sections: Mapping[str, EstimatorSettings], name: str, key: str, where: str) -> Registered:
    """A configured estimator.

    Raises:
        InputError: it is not configured, or its answers hold only after a calibration that is not made here.
    """
    if name not in sections:
        raise InputError(f"{key}: '{name}' is not among {where}; {did_you_mean(name, sections)}")
    if getattr(sections[name], "calibration_samples", None) is not None:
        raise InputError(
            f"{key}: '{name}' has calibration_samples ({where}.{name}), to which only Table I calibrates; expected an "
            "estimator without"
        )
    create = blur.create if where == "blur.estimators" else noise.create
    return Registered(create, sections[name].kind, dict(sections[name].options))


def configured(
    section: CombinedSettings,
    blur_sections: Mapping[str, EstimatorSettings],
    noise_sections: Mapping[str, EstimatorSettings],
    bank: Sequence[Kernel],
) -> Combined:
    """The experiment of the section ``combined``.

    Args:
        section: of the configuration.
        blur_sections: ``blur.estimators``.
        noise_sections: ``noise.estimators``.
        bank: of kernels.

    Raises:
        InputError: an estimator that is not configured, or a kernel that the bank lacks.
    """
    denoise, of_noise = section.denoise, "noise.estimators"
    prefilter = PreFilter(
        () if denoise.filter_px is None else (denoise.filter_px,),
        denoise.from_sigma_dn,
        _registered(noise_sections, denoise.sigma_by, "combined.denoise.sigma_by", of_noise),
    )
    key = "combined.blur_estimators"
    methods = [
        Method(
            name,
            "mtf",
            _registered(blur_sections, name, key, "blur.estimators"),
            Subset(part.sizes_px, part.angles_deg, part.target_sigmas_dn, part.experiments),
            part.frames,
            prefilter=prefilter,
        )
        for name, part in section.blur_estimators.items()
    ] + [
        Method(name, "sigma_dn", _registered(noise_sections, name, "combined.noise_estimators", of_noise))
        for name in section.noise_estimators
    ]
    pairs = [Pair(name, each.blur_kind, each.noise_source) for name, each in section.experiments.items()]
    kernels = chosen_kernels(bank, [pair.blur_kind for pair in pairs], section.sizes_px, "combined.sizes_px")
    return Combined(pairs, kernels, section.target_sigmas_dn, methods)


def denoised(
    section: DenoisedBlurSettings, blur_sections: Mapping[str, EstimatorSettings], bank: Sequence[Kernel]
) -> Combined:
    """The experiment of the section ``denoised_blur``: every patch is filtered, and the discs are measured as well.

    Args:
        section: of the configuration.
        blur_sections: ``blur.estimators``.
        bank: of kernels.

    Raises:
        InputError: an estimator that is not configured, or a kernel that the bank lacks.
    """
    discs = [Kernel(f"disc_{size:g}", DISC, float(size), 0.0, disc(float(size))) for size in section.filters_px]
    prefilter, key = PreFilter(tuple(section.filters_px)), "denoised_blur.blur_estimators"
    return Combined(
        [
            Pair(f"{section.blur_kind}_{section.noise_source}", section.blur_kind, section.noise_source),
            Pair(DISC, DISC, section.noise_source),
        ],
        [*chosen_kernels(bank, [section.blur_kind], section.sizes_px, "denoised_blur.sizes_px"), *discs],
        [0.0, *section.target_sigmas_dn],
        [
            Method(name, "mtf", _registered(blur_sections, name, key, "blur.estimators"), prefilter=prefilter)
            for name in section.blur_estimators
        ],
    )


def frames_of(section: CombinedSettings | DenoisedBlurSettings, frames: Iterable[TestFrame]) -> list[TestFrame]:
    """The frames that the section takes, evenly spread over those with patches."""
    return evenly_spread(list(frames), section.frames)


def blur_cells(measurements: pd.DataFrame, seed: int, draws: int) -> pd.DataFrame:
    """Errors of every estimator for every experiment, kernel size, level and filter, raw and calibrated.

    Args:
        measurements: `pipeline.experiments.tables.MEASUREMENTS`; rows of noise are passed over.
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples of frames, the same for all rotations.

    Returns:
        `pipeline.experiments.tables.BLUR_CELLS`, without the expected error
        (`with_expected`).
    """
    import pandas as pd

    rows = measurements[measurements["quantity"] == "mtf"]
    parts = [
        mtf_cells(table, CELL, "combined", seed, draws, calibrated=calibrated, skip_missing=True)
        for calibrated, table in raw_and_calibrated(rows)
    ]
    return BLUR_CELLS.conform(pd.concat(parts, ignore_index=True))


def with_expected(cells: pd.DataFrame) -> pd.DataFrame:
    """The cells with the error to be expected of filtered estimates, and without the discs themselves.

    Expected is sqrt(a1^2 + a2^2), from the same estimator's AMAE for the blur (a1) and for the disc (a2), both without
    noise (Wischow et al. 2023, supplement).

    Args:
        cells: `pipeline.experiments.tables.BLUR_CELLS` with experiment `DISC` and level 0.
    """
    who = ["dataset", "estimator", "calibrated"]
    without = cells[(cells["target_sigma_dn"] == 0) & (cells["filter_px"] == 0)]
    error = {
        (*key[:3], key[3] == DISC, key[4]): value
        for *key, value in without[[*who, "experiment", "kernel_size_px", "amae_percent"]].itertuples(
            index=False, name=None
        )
    }
    expected = [
        float(expected_amae(error.get((*key[:3], False, size), np.nan), error.get((*key[:3], True, filter_px), np.nan)))
        for *key, size, filter_px in cells[[*who, "kernel_size_px", "filter_px"]].itertuples(index=False, name=None)
    ]
    changed = cells.assign(expected_amae_percent=expected)
    return changed[changed["experiment"] != DISC].reset_index(drop=True)


def sigma_cells(measurements: pd.DataFrame, seed: int, draws: int) -> pd.DataFrame:
    """Robust statistics of the noise per estimator, experiment, kernel size and level.

    Args:
        measurements: `pipeline.experiments.tables.MEASUREMENTS`; rows of the MTF are passed over.
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples.

    Returns:
        `pipeline.experiments.tables.NOISE_CELLS`.
    """
    rows = measurements[measurements["quantity"] == "sigma_dn"]
    cells = noise_cells(rows, SIGMA_CELL, "combined noise", seed, draws)
    cells = cells.rename(columns={"unclipped_error_dn": "patch_error_dn"})
    return NOISE_CELLS.conform(cells.reindex(columns=list(NOISE_CELLS.columns)))
