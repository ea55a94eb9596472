"""``camera-monitor record``: experiments on frames of one's own, noise-levels, combined, denoised-blur and factors."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from pipeline.recording.frames import Request

OPTIONS = (
    click.argument("overrides", nargs=-1),
    click.option("--dataset", required=True, help="name of the dataset, which the overrides add"),
    click.option("--to", "out", required=True, type=click.Path(path_type=Path), help="folder to write; replaced"),
    click.option("--source", required=True, help="where the pictures come from: revision and licence, for the record"),
    click.option(
        "--keep", type=click.Path(path_type=Path),
        help="folder in which finished frames are kept, so that an interrupted recording continues; delete it after",
    ),
    click.option(
        "--workers", default=1, show_default=True, type=click.IntRange(min=1), help="processes; changes no result"
    ),
)  # fmt: skip


def recording(name: str) -> Callable[[Callable[..., None]], click.Command]:
    """A command of this name with the options that every recording has."""

    def decorated(function: Callable[..., None]) -> click.Command:
        for option in reversed(OPTIONS):
            function = option(function)
        return click.command(name)(function)

    return decorated


def request(
    overrides: tuple[str, ...], dataset: str, out: Path, source: str, keep: Path | None, workers: int,
    used: Callable[[Any], list[Any]],
) -> Request:  # fmt: skip
    """The request of a command line.

    Args:
        overrides: of ``conf/``.
        dataset: name.
        out: folder to write.
        source: of the pictures.
        keep: folder of finished frames, or None.
        workers: processes.
        used: (configuration) -> the estimators that are measured, whose weights the record names.

    Raises:
        InputError: the dataset is not in the configuration.
    """
    from pipeline.cli.estimator_files import weight_hashes
    from pipeline.cli.kept_results import keeping
    from pipeline.cli.outputs import refuse_unwritable
    from pipeline.config.compose import compose, parse
    from pipeline.config.references import check_references
    from pipeline.errors import InputError, did_you_mean
    from pipeline.recording.frames import Request

    refuse_unwritable(out, "--to")
    config = parse(compose(overrides), "conf/")
    check_references(config)
    if dataset not in config.datasets:
        hint = did_you_mean(dataset, config.datasets)
        raise InputError(f"--dataset {dataset}: not in the configuration; {hint}")
    return Request(config, dataset, out, source, keeping(keep, workers), weight_hashes(*used(config)))


def _noise_estimators(config: Any) -> list[Any]:
    from pipeline import noise

    return [noise.create(one.kind, **one.options) for one in config.noise.estimators.values()]


def _combined_estimators(config: Any) -> list[Any]:
    from pipeline import noise

    section, of_noise = config.combined, config.noise.estimators
    chosen = [of_noise[name] for name in [*section.noise_estimators, section.denoise.sigma_by]]
    return _blur_estimators(config, section.blur_estimators) + [noise.create(one.kind, **one.options) for one in chosen]


def _blur_estimators(config: Any, names: Any) -> list[Any]:
    from pipeline import blur

    return [blur.create(one.kind, **one.options) for one in (config.blur.estimators[name] for name in names)]


@recording("noise-levels")
def noise_levels_command(**given: Any) -> None:
    """Noise of several sources and levels added to frames, estimated tile by tile (the paper's noise figure).

    Every estimator of noise.estimators is measured. OVERRIDES are of conf/, as for ``dvc exp run -S``:
    +dataset@datasets.kitti=kitti datasets.kitti.root=/path noise.tiles_per_frame=6
    """
    from pipeline.recording.frames import record_noise

    summary = record_noise(request(**given, used=_noise_estimators))
    means = summary.groupby("estimator", sort=False)[["median_dn", "patch_error_dn"]].mean()
    for name, row in means.iterrows():
        click.echo(f"{name}: mean error of a tile {row['patch_error_dn']:.2f} DN")
    click.echo(f"written to {given['out']}")


@recording("combined")
def combined_command(**given: Any) -> None:
    """Blur and noise at once on frames, for the estimators and sizes of the section ``combined``.

    OVERRIDES are of conf/: +dataset@datasets.udacity=udacity datasets.udacity.root=/path psf=paper psf.folder=/path
    """
    from pipeline.recording.frames import record_combined

    _print_means(record_combined(request(**given, used=_combined_estimators)), given["out"])


@recording("denoised-blur")
def denoised_command(**given: Any) -> None:
    """Noisy patches smoothed by a disc before their blur is estimated (the supplement's table).

    OVERRIDES are of conf/: 'denoised_blur.blur_estimators=[cnn,spectral]' and those of the dataset.
    """
    from pipeline.recording.frames import record_denoised

    cells = record_denoised(
        request(**given, used=lambda config: _blur_estimators(config, config.denoised_blur.blur_estimators))
    )
    _print_means(cells, given["out"])


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
    from pipeline.recording.frames import record_factors

    made = request(**given, used=lambda config: _blur_estimators(config, ["cnn"]))
    effects = record_factors(made, frame_count, exact_sizes_px, with_grid=with_grid)
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
