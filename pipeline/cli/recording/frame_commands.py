"""``camera-monitor record``: experiments on frames of one's own, noise-levels, combined, denoised-blur and factors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipeline.cli.recording import options

if TYPE_CHECKING:
    from pipeline.recording.frames import Request

OPTIONS = (
    options.overrides_argument, options.dataset_option, options.to_option, options.source_option, options.keep_option,
    options.workers_option,
)  # fmt: skip


def recording(name: str) -> Callable[[Callable[..., None]], click.Command]:
    """A command of this name with the options that every recording has."""

    def decorated(function: Callable[..., None]) -> click.Command:
        for option in reversed(OPTIONS):
            function = option(function)
        return click.command(name, epilog=options.IN_CHECKOUT)(function)

    return decorated


def request(
    tables: Sequence[str],
    overrides: tuple[str, ...],
    dataset: str,
    out: Path,
    source: str,
    keep: Path | None,
    workers: int,
) -> Request:
    """The request of a command line.

    Args:
        tables: file names that the recording writes beside `pipeline.recording.frames.COMMON_FILES`.
        overrides: of ``conf/``.
        dataset: name.
        out: folder to write; replaced, so nothing but an earlier record may be in it.
        source: of the pictures.
        keep: folder of finished frames, or None.
        workers: processes.

    Raises:
        InputError: the dataset is not in the configuration, or the folder holds something else.
    """
    from pipeline.cli.recording.config import recording_config
    from pipeline.recording.frames import COMMON_FILES, Request
    from pipeline.recording.kept_results import keeping

    config = recording_config(overrides, out, dataset, (*COMMON_FILES, *tables), keep)
    return Request(config, dataset, out, source, keeping(keep, workers))


@recording("noise-levels")
def noise_levels_command(**given: Any) -> None:
    """Noise of several sources and levels added to frames, estimated tile by tile (the paper's noise figure).

    Every estimator of noise.estimators is measured. OVERRIDES are of conf/, as for ``dvc exp run -S``:
    +dataset@datasets.kitti=kitti datasets.kitti.root=/path noise.tiles_per_frame=6
    """
    from pipeline.experiments.recorded.frames import NOISE_FILE
    from pipeline.recording.frames import record_noise

    summary = record_noise(request((NOISE_FILE,), **given))
    means = summary.groupby("estimator", sort=False)[["median_dn", "patch_error_dn"]].mean()
    for name, row in means.iterrows():
        click.echo(f"{name}: mean error of a tile {row['patch_error_dn']:.2f} DN")
    click.echo(f"written to {given['out']}")


@recording("combined")
def combined_command(**given: Any) -> None:
    """Blur and noise at once on frames, for the estimators and sizes of the section ``combined``.

    OVERRIDES are of conf/: +dataset@datasets.udacity=udacity datasets.udacity.root=/path psf=paper psf.folder=/path
    """
    from pipeline.experiments.recorded.frames import COMBINED_FILES
    from pipeline.recording.frames import record_combined

    _print_means(record_combined(request(COMBINED_FILES, **given)), given["out"])


@recording("denoised-blur")
def denoised_command(**given: Any) -> None:
    """Noisy patches smoothed by a disc before their blur is estimated (the supplement's table).

    OVERRIDES are of conf/: 'denoised_blur.blur_estimators=[cnn,spectral]' and those of the dataset.
    """
    from pipeline.experiments.recorded.frames import DENOISED_FILE
    from pipeline.recording.frames import record_denoised

    _print_means(record_denoised(request((DENOISED_FILE,), **given)), given["out"])


@recording("factors")
@click.option(
    "--frames", "frame_count", default=6, show_default=True, type=click.IntRange(min=2), help="of the dataset"
)
@click.option(
    "--exact-size", "exact_sizes_px", multiple=True, type=float, default=(3.0, 11.0), show_default=True,
    help="size of kernels on which the slow exact programs run too, px; may be repeated",
)  # fmt: skip
@click.option("--grid/--no-grid", "with_grid", default=True, help="patches on a grid too, which doubles the time")
def factors_command(frame_count: int, exact_sizes_px: tuple[float, ...], with_grid: bool, **given: Any) -> None:
    """Switch each choice behind Table I: kernel size, JPEG storage, boundary, patches, mode, discs.

    OVERRIDES are of conf/: those of the dataset, psf=paper psf.folder=/path blur.patches_per_frame=1
    """
    from pipeline.experiments.factors import ALL
    from pipeline.experiments.recorded.frames import FACTOR_FILES
    from pipeline.recording.frames import record_factors

    effects = record_factors(request(FACTOR_FILES, **given), frame_count, exact_sizes_px, with_grid=with_grid)
    for row in effects[effects["blur_kind"] == ALL].to_dict("records"):
        click.echo(
            f"{row['estimator']}, {row['factor']}, {row['second']} instead of {row['first']}:"
            f" {row['effect_percent']:+.2f} points ({row['low_percent']:+.2f} to {row['high_percent']:+.2f})"
        )
    click.echo(f"written to {given['out']}")


def _print_means(cells: Any, out: Path) -> None:
    """Print the mean error of every estimator and experiment."""
    raw = cells[~cells["calibrated"].astype(bool)]
    for key, part in raw.groupby(["estimator", "experiment", "filter_px"], sort=False):
        name, experiment, filter_px = key
        click.echo(f"{name}, {experiment}, disc {filter_px:g} px: mean AMAE {part['amae_percent'].mean():.2f} %")
    click.echo(f"written to {out}")


COMMANDS = (noise_levels_command, combined_command, denoised_command, factors_command)
