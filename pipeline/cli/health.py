"""``camera-monitor health``: blur and noise of one's own pictures, with intervals and maps."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.condition import Condition

COLUMNS = (
    "picture", "sigma_dn", "sigma_low_dn", "sigma_high_dn", "noise_patches", "noise_abstained", "mtf50_horizontal",
    "mtf50_vertical", "blur_patches", "blur_abstained", "milliseconds",
)  # fmt: skip


@click.command("health")
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(path_type=Path), help="folder for health.csv, health.json and pictures with maps"
)
@click.option(
    "--blur", "blur_name", default="spectral", show_default=True, help="spectral, pmp, gbb or a plug-in's name"
)
@click.option(
    "--noise", "noise_name", default="cellwise", show_default=True, help="cellwise, pca, bf, wavelet, immerkaer, ..."
)
@click.option(
    "--sharp", multiple=True, type=click.Path(path_type=Path),
    help="pictures of the same camera, known to be sharp (may be repeated): blur is then told relative to them",
)  # fmt: skip
@click.option(
    "--fit", "fitted", is_flag=True,
    help="with --sharp: fit the estimator to the camera, by blurring its sharp pictures on purpose (takes seconds)",
)  # fmt: skip
@click.option(
    "--added", is_flag=True,
    help="without --sharp: tell the blur beyond that of a typical lens, and not the lens's too (estimator spectral)",
)  # fmt: skip
@click.option("--every", default=1, show_default=True, type=click.IntRange(min=1), help="of a video, each n-th frame")
def command(
    paths: tuple[Path, ...], out: Path | None, blur_name: str, noise_name: str, sharp: tuple[Path, ...], fitted: bool,
    added: bool, every: int,
) -> None:  # fmt: skip
    """Estimate blur and noise of PATHS: pictures, videos, or folders of them.

    Prints per frame the noise in grey levels (DN, 0..255) with its 95 % interval, the frequency at which contrast falls
    to half (MTF50, fraction of Nyquist; > 0.59 where it stays above), horizontal and vertical, and how many patches
    told nothing (flat, saturated). Hold the camera upright; --sharp removes what its lens does anyway; --fit
    also mends what the estimator misreads in this camera's pictures. Without sharp pictures, --added takes off a
    typical lens.
    """
    from tqdm import tqdm

    from pipeline.cli.pictures import expand, read
    from pipeline.condition import ConditionMonitor
    from pipeline.errors import InputError
    from pipeline.executor import one_thread

    one_thread()
    files = expand(paths)
    if fitted and not sharp:
        raise InputError("--fit needs pictures of the same camera that are known to be sharp; give them by --sharp")
    if added and (sharp or blur_name != "spectral"):
        raise InputError("--added is for the estimator spectral without --sharp, which tells the same more exactly")
    monitor = ConditionMonitor(blur_name, noise_name, blur_options={"answer": "added"} if added else None)
    if sharp:
        monitor.calibrate([image for path in expand(sharp) for _, image in read(path, every)], fitted=fitted)
    rows: list[dict[str, Any]] = []
    drawn: set[str] = set()
    failed = 0
    click.echo(f"{'sigma DN':>9} {'95 % interval':>15} {'MTF50 H':>8} {'MTF50 V':>8} {'told':>11} {'ms':>6}  picture")
    for name, image, problem in tqdm(_frames(files, every, read), delay=2, leave=False, unit=" frames"):
        try:
            if image is None:
                raise InputError(problem)
            found = monitor.frame(image)
        except InputError as error:
            failed += 1
            click.echo(f"set aside: {error}", err=True)
            continue
        rows.append(_row(name, found))
        if out is not None:
            rows[-1]["drawn"] = _picture(out, name, image, found, drawn)
            drawn.add(rows[-1]["drawn"])
        click.echo(_line(rows[-1]))
    if out is not None and rows:
        _write(out, rows)
        click.echo(f"written to {out}")
    if failed:
        raise InputError(f"{failed} of the pictures given could not be used; see above")


def _frames(files: list[Path], every: int, read: Any) -> Iterator[tuple[str, NDArray[np.float32] | None, str]]:
    """Name, picture or None, and what is wrong with it, of every frame of every file."""
    from pipeline.errors import InputError

    for path in files:
        try:
            for name, image in read(path, every):
                yield name, image, ""
        except InputError as error:
            yield str(path), None, str(error)


def _row(name: str, found: Condition) -> dict[str, Any]:
    from pipeline.condition.summary import half_contrast

    across, down = half_contrast(found.mtf.value)
    noise, blur = found.noise.estimate, found.blur.estimate
    numbers = (
        name, float(found.sigma_dn.value), float(found.sigma_dn.low), float(found.sigma_dn.high), len(noise),
        int(noise.abstained.sum()), float(across), float(down), len(blur), int(blur.abstained.sum()),
        round(found.milliseconds, 1),
    )  # fmt: skip
    told = {"mtf": found.mtf.value, "mtf_low": found.mtf.low, "mtf_high": found.mtf.high, "abstained": found.reasons}
    return dict(zip(COLUMNS, numbers, strict=True)) | told


def _line(row: dict[str, Any]) -> str:
    """One row of the table printed."""
    asked = row["noise_patches"] + row["blur_patches"]
    told = f"{asked - row['noise_abstained'] - row['blur_abstained']}/{asked}"
    interval = f"{_number(row['sigma_low_dn'], 2)} .. {_number(row['sigma_high_dn'], 2)}"
    halves = " ".join(f"{_number(row[f'mtf50_{way}'], 2):>8}" for way in ("horizontal", "vertical"))
    why = ", ".join(f"{part} {what} {count}" for part, why in row["abstained"].items() for what, count in why.items())
    note = f"  ({why})" if why else ""
    return (
        f"{_number(row['sigma_dn'], 2):>9} {interval:>15} {halves} {told:>11} {row['milliseconds']:>6.0f}"
        f"  {row['picture']}{note}"
    )


def _number(value: float, decimals: int) -> str:
    """A number; ``-`` where nothing is known; ``> 0.59`` beyond the last frequency looked at."""
    from math import isinf, isnan

    from pipeline.camera.mtf import FREQUENCIES

    if isnan(value):
        return "-"
    return f"> {FREQUENCIES[-1]:.2f}" if isinf(value) else f"{value:.{decimals}f}"


def _picture(out: Path, name: str, image: NDArray[np.float32], found: Condition, taken: set[str]) -> str:
    """Draw a frame's maps; the file's name, which no other frame of this call has."""
    from pipeline.cli.health_picture import draw
    from pipeline.store import write_image

    stem = Path(name).name.replace("#", "-")
    file = f"{stem}.health.png"
    while file in taken:
        stem = f"{stem}+"
        file = f"{stem}.health.png"
    write_image(out / file, draw(image, found))
    return file


def _write(out: Path, rows: list[dict[str, Any]]) -> None:
    """The rows as a table, and with whole MTF curves as JSON."""
    import csv
    import io

    from pipeline.camera.mtf import FREQUENCIES
    from pipeline.store import write_json, write_text

    text = io.StringIO()
    table = csv.DictWriter(text, COLUMNS, extrasaction="ignore", lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    write_text(out / "health.csv", text.getvalue())
    write_json(out / "health.json", {"frequencies_of_nyquist": FREQUENCIES, "pictures": rows})
