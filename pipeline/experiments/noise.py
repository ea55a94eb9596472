"""The noise experiment: one estimator on the tiles of frames, over noise sources and levels.

The paper's noise figure (Wischow et al. 2023, Sec. IV-B): noise of one source is scaled to a level, the estimator runs
on 128 x 128 px tiles, and the robust median, minimum and maximum over all tiles are drawn over the level. Clipping and,
for photon noise, local brightness make the noise of a tile differ from the level, so an estimator is compared with the
noise present in each tile; one that undoes the clipping, with the noise before it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pipeline.camera.settings import CameraSettings
from pipeline.errors import InputError
from pipeline.experiments.arguments import check_estimators, check_measured
from pipeline.experiments.condition import grid, sharp_kernel
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.run import Executor, Method, in_process, run
from pipeline.experiments.summarise import NOISE_CELL, noise_cells
from pipeline.experiments.tables import rounded, written
from pipeline.tables import NOISE_ESTIMATES, NOISE_SUMMARY

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class NoiseResult:
    """What the noise experiment gives.

    Attributes:
        estimates: `pipeline.tables.NOISE_ESTIMATES`.
        summary: `pipeline.tables.NOISE_SUMMARY`.
    """

    estimates: pd.DataFrame
    summary: pd.DataFrame


def measure(
    estimators: Mapping[str, Any],
    frames: Sequence[TestFrame],
    noise_sources: Sequence[str],
    target_sigmas_dn: Sequence[float],
    *,
    camera: CameraSettings | None = None,
    seed: int = 1,
    draws: int = 500,
    executor: Executor = in_process,
    label: str = "",
) -> NoiseResult:
    """Estimates the noise of every tile under every source and level, and summarises it.

    Args:
        estimators: name in the tables -> estimator, see `pipeline.experiments.run.Method`; all on the same corrupted
            frames, each of which is formed once.
        frames: sharp frames with their tiles, as quantity ``"sigma_dn"``.
        noise_sources: as in `pipeline.camera.effects`.
        target_sigmas_dn: levels, DN.
        camera: that adds the noise; the paper's if None.
        seed: root of the random streams.
        draws: bootstrap resamples of the intervals.
        executor: changes no result.
        label: of its progress bar.

    Raises:
        InputError: nothing to measure: no estimator, noise source, level, or frame with a tile; see
            `pipeline.experiments.run.run`, too.
    """
    check_estimators(estimators)
    for name, given in (("noise_sources", noise_sources), ("target_sigmas_dn", target_sigmas_dn)):
        if not len(given):
            raise InputError(f"{name}: expected at least one")
    exact = run(
        frames,
        grid([sharp_kernel()], noise_sources, target_sigmas_dn),
        [Method(name, "sigma_dn", estimator) for name, estimator in estimators.items()],
        camera=camera,
        seed=seed,
        executor=executor,
        label=label,
        paired=False,
    )
    check_measured(exact, "sigma_dn")
    measurements = rounded(exact)
    return NoiseResult(written(measurements, "sigma_dn", NOISE_ESTIMATES), summarise(measurements, seed, draws))


def summarise(measurements: pd.DataFrame, seed: int, draws: int) -> pd.DataFrame:
    """Robust statistics per dataset, estimator, source and level.

    Args:
        measurements: of sigma (`pipeline.experiments.tables.MEASUREMENTS`).
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples.

    Returns:
        `pipeline.tables.NOISE_SUMMARY`.
    """
    cells = noise_cells(measurements, NOISE_CELL, "noise", seed, draws, sort=False)
    renamed = cells.rename(columns={"clipped_error_dn": "patch_error_dn"})
    return NOISE_SUMMARY.conform(renamed)
