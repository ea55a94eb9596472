"""``camera-monitor curves``: ask measured curves of average precision, or measure them on recorded pictures."""

from __future__ import annotations

from pathlib import Path

import click

from pipeline.cli.options.given_paths import GivenPath
from pipeline.cli.recording import options


@click.group("curves")
def command() -> None:
    """Ask the curves that ``dvc repro`` measured (data/curves), or measure them on pictures of one's own."""


@command.command("query")
@click.argument("surface", type=GivenPath())
@click.option("--sigma", "sigma_dn", required=True, multiple=True, type=float, help="noise, DN on the 0..255 scale")
@click.option("--mtf", required=True, multiple=True, type=float, help="MTF at 0.1 of Nyquist, mean of H and V, 0..1")
def query(surface: Path, sigma_dn: tuple[float, ...], mtf: tuple[float, ...]) -> None:
    """Average precision of SURFACE (a surface-*.npz) at a noise and an MTF, with its 95 % interval.

    Several --sigma and --mtf give every pair. Nothing is extrapolated: a place where nothing was measured is an error.
    An MTF just above 1, as of a sharpened frame, lies in the bin of 1 and has the answer at its edge.
    """
    from pipeline.cli.analysis.surface import refuse_other_format
    from pipeline.curves import Surface
    from pipeline.errors import InputError
    from pipeline.store import read_arrays

    refuse_other_format(surface)
    if "calibration" in read_arrays(surface):
        raise InputError(
            f"{surface}: a surface for control; expected surface-CLASS.npz of a stage curves (data/curves)"
        )
    known = Surface.load(surface)
    lines, refused = [], []
    for sigma in sigma_dn:
        for contrast in mtf:
            try:
                precision, low, high = known.at(sigma, contrast)
            except InputError as error:
                refused.append(str(error))
                continue
            lines.append(f"{sigma:9.2f} {contrast:6.3f} {precision:7.2f} {low:7.2f} {high:7.2f}")
    if lines:
        click.echo("\n".join([f"{'sigma DN':>9} {'MTF':>6} {'AP %':>7} {'low':>7} {'high':>7}", *lines]))
    if refused:
        raise InputError("\n".join(refused))


@command.command("record", epilog=options.IN_CHECKOUT)
@options.overrides_argument
@options.dataset_option
@click.option("--detector", required=True, help="name of the detector, likewise")
@options.to_option
@options.keep_option
@options.source_option
@options.workers_option
def record_command(
    overrides: tuple[str, ...], dataset: str, detector: str, out: Path, keep: Path | None, source: str, workers: int
) -> None:
    """Measure a detector on recorded pictures and keep numbers, figures and provenance; no picture is kept.

    OVERRIDES are of conf/, as for ``dvc exp run -S``: +dataset@datasets.kitti=kitti datasets.kitti.root=/path
    +detector@detection.detectors.yolox=yolox detection.sweep.angles_deg=[0]
    """
    from pipeline.cli.recording.config import recording_config
    from pipeline.recording.detection import RESULTS, record
    from pipeline.recording.kept_results import keeping

    config = recording_config(overrides, out, dataset, RESULTS, keep, detector=detector)
    numbers = record(config, dataset, detector, out, source, keeping(keep, workers))
    for label, item in numbers.items():
        clean = item.get("clean_ap_percent")
        known = "not swept" if clean is None else f"{clean:.1f} %"
        click.echo(f"{label}: {known} sharp and without noise")
    click.echo(f"written to {out}")
