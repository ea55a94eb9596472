"""``camera-monitor record``: measure estimators on pictures with measured ground truth and keep the numbers."""

from __future__ import annotations

from pathlib import Path

import click

from pipeline.cli.options.given_paths import GivenPath
from pipeline.cli.options.numbers import FiniteRange
from pipeline.cli.recording.frame_commands import COMMANDS
from pipeline.cli.recording.options import source_option, to_option, workers_option
from pipeline.cli.results.refusals import refuse_foreign


@click.group("record")
def command() -> None:
    """Measure on recorded pictures and keep numbers and provenance; no picture is kept.

    combined, denoised-blur, factors and noise-levels run in the top folder of a checkout of the repository, whose
    conf/ they read; noise, sensor and examples in any.
    """


@command.command("noise")
@click.option(
    "--pairs", "named_folders", multiple=True, required=True, metavar="NAME=FOLDER",
    help="folder of photographs X_real.* with the mean X_mean.* of many of the same scene; may be repeated",
)  # fmt: skip
@click.option("--estimator", "chosen", multiple=True, help="one of those measured by default; may be repeated")
@source_option
@to_option
@workers_option
def noise_command(
    named_folders: tuple[str, ...], chosen: tuple[str, ...], source: str, out: Path, workers: int
) -> None:
    """Measure noise estimators on photographs whose noise is known from many shots of the same scene.

    Prints, per dataset and estimator, the mean absolute error in DN against the difference of photograph and mean, as
    it is and cleaned of misregistration, the share of patches whose 95 % interval holds the cleaned truth, the share
    answered, and what is read from the mean, which has next to no noise.
    """
    from functools import partial

    from pipeline.errors import InputError, did_you_mean
    from pipeline.executor import run_map
    from pipeline.noise.real_noise import ESTIMATORS
    from pipeline.recording.real_noise import RESULTS, record

    folders: dict[str, Path] = {}
    for text in named_folders:
        name, equals, folder = text.partition("=")
        if not (name and equals and folder) or name in folders:
            raise InputError(f"--pairs {text}: expected NAME=FOLDER, each name once")
        folders[name] = Path(folder)
    refuse_foreign(out, "--to", RESULTS, list(folders.values()))
    for name in chosen:
        if name not in ESTIMATORS:
            raise InputError(f"--estimator {name}: unknown; {did_you_mean(name, ESTIMATORS)}")
    kinds = {name: kind for name, kind in ESTIMATORS.items() if not chosen or name in chosen}
    summary = record(folders, kinds, out, source, partial(run_map, workers=workers))
    click.echo(
        f"{'dataset':10} {'estimator':13} {'error':>6} {'cleaned':>7} {'covered':>7} {'answered':>8} {'of mean':>7}"
    )
    for row in summary.to_dict("records"):
        click.echo(
            f"{row['dataset']:10} {row['estimator']:13} {row['true_mae_dn']:6.2f} {row['cleaned_mae_dn']:7.2f}"
            f" {row['cleaned_coverage_fraction']:7.2f} {row['answered_fraction']:8.2f}"
            f" {row['mean_picture_sigma_dn']:7.2f}"
        )
    click.echo(f"written to {out}")


@command.command("sensor")
@click.option(
    "--light", required=True, type=GivenPath(),
    help="folder of raw mosaics SCENE_250ms_*.tif, each scene twice at each exposure, or at two exposures or more",
)  # fmt: skip
@click.option("--dark", required=True, type=GivenPath(), help="folder of dark frames of three exposures or more")
@click.option(
    "--white-dn", default=255.0, show_default=True, type=FiniteRange(1, 65535), help="grey value of saturation"
)
@click.option("--source", required=True, help="where the frames come from: revision and licence, for the record")
@to_option
@workers_option
def sensor_command(light: Path, dark: Path, white_dn: float, source: str, out: Path, workers: int) -> None:
    """Measure gain, dark noise and dark current of a sensor from raw frames, after EMVA 1288.

    Noise estimators run on patches of the frames, whose noise follows the photon transfer. Prints, per colour plane,
    the system gain in DN per electron and the dark noise in electrons with their standard errors, and the electrons at
    full scale, by extrapolation; and the fixed pattern, what pixels differ by in every frame, in percent of the grey
    value.
    """
    from functools import partial

    from pipeline.executor import run_map
    from pipeline.noise.real_noise import ESTIMATORS
    from pipeline.recording.sensor import RESULTS, record

    refuse_foreign(out, "--to", RESULTS, [light, dark])
    rows = record(light, dark, white_dn, ESTIMATORS, out, source, partial(run_map, workers=workers))
    click.echo(
        f"{'plane':5} {'gain DN/e':>9} {'error':>7} {'dark noise e':>12} {'error':>7} {'full scale e':>12}"
        f" {'pattern %':>9}"
    )
    for row in rows.to_dict("records"):
        click.echo(
            f"{row['plane']:5} {row['gain_dn_per_e']:9.4f} {row['gain_error']:7.4f} {row['dark_sigma_e']:12.1f}"
            f" {row['dark_sigma_error']:7.1f} {row['full_scale_e']:12.0f} {100 * row['pattern_fraction']:9.1f}"
        )
        if row["dark_sigma_reason"]:
            click.echo(f"{row['plane']:5} no dark noise: {row['dark_sigma_reason']}")
    click.echo(f"written to {out}")


@command.command("examples")
@click.option("--real", required=True, type=GivenPath(), help="a photograph")
@click.option("--mean", required=True, type=GivenPath(), help="mean of many photographs of its scene")
@click.option(
    "--frame", "frames", multiple=True, required=True, type=GivenPath(),
    help="a sharp frame; repeated, consecutive frames in the order of time",
)  # fmt: skip
@source_option
@to_option
def examples_command(real: Path, mean: Path, frames: tuple[Path, ...], source: str, out: Path) -> None:
    """Noise estimates on three pictures: a photograph, a noisy frame stored as JPEG, and one stored as video.

    Prints, per picture and estimator, the median estimate with its interval in DN, the share of patches answered, the
    noise present, and why patches were abstained from.
    """
    from pipeline.recording.examples import RESULTS, record

    refuse_foreign(out, "--to", RESULTS, [real, mean, *frames])
    for row in record(real, mean, frames, out, source).to_dict("records"):
        click.echo(
            f"{row['example']:32} {row['estimator']:9} {row['sigma_dn']:6.2f} ({row['low_dn']:.2f} to"
            f" {row['high_dn']:.2f}) of {row['true_sigma_dn']:.2f} DN, {row['answered']} of {row['patches']} patches"
            f" {row['reasons']}"
        )
    click.echo(f"written to {out}")


for experiment in COMMANDS:
    command.add_command(experiment)
