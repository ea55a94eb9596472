"""``camera-monitor health``: blur and noise of one's own pictures, with intervals and maps."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipeline.cli.numbers import FiniteRange

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.condition import ConditionMonitor

ALARM = 3  # exit code
SHARP_MTF50 = 0.2  # fraction of Nyquist below which a frame given as sharp is doubted: about a 4 px disc of defocus


@click.command("health")
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(path_type=Path),
    help="folder for health.csv, health.jsonl, health.json and pictures with maps; results of the last run there go",
)  # fmt: skip
@click.option(
    "--blur", "blur_name", default="spectral", show_default=True, help="spectral, fused, pmp, gbb or a plug-in's name"
)
@click.option(
    "--quality", type=click.Choice(["fast", "best"]), default="fast", show_default=True,
    help="best: blur by the estimator fused, which takes about two seconds more for each blurred frame",
)  # fmt: skip
@click.option(
    "--noise",
    "noise_name",
    default="adaptive",
    show_default=True,
    help="adaptive, cellwise, correlated, pca, bf, wavelet, immerkaer, ...",
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
@click.option("--json", "as_json", is_flag=True, help="print the whole run as one JSON object instead of the table")
@click.option("--jsonl", "as_lines", is_flag=True, help="print one JSON object per frame, as it comes, instead of it")
@click.option(
    "--alarm-sigma-dn", type=FiniteRange(0, 255), help="alarm (exit code 3) when noise exceeds this, grey levels"
)
@click.option(
    "--alarm-mtf50", type=FiniteRange(0, 1),
    help="alarm (exit code 3) when contrast falls to half below this fraction of Nyquist, on either axis",
)  # fmt: skip
@click.option("--alarm-flags", is_flag=True, help="alarm on black, dark, over-exposed and frozen frames too")
@click.option("--every", default=1, show_default=True, type=click.IntRange(min=1), help="of a video, each n-th frame")
def command(
    paths: tuple[Path, ...], out: Path | None, blur_name: str, quality: str, noise_name: str, sharp: tuple[Path, ...],
    fitted: bool, added: bool, as_json: bool, as_lines: bool, alarm_sigma_dn: float | None, alarm_mtf50: float | None,
    alarm_flags: bool, every: int,
) -> None:  # fmt: skip
    """Estimate blur and noise of PATHS: pictures, videos, or folders of them.

    Prints per frame the noise in grey levels (DN, 0..255) with its 95 % interval, the frequency at which contrast falls
    to half (MTF50, fraction of Nyquist; > 0.59 where it stays above), horizontal and vertical, and how many patches
    gave an answer (flat and saturated ones do not). Hold the camera upright; --sharp removes what its lens does anyway;
    --fit also mends what the estimator misreads in this camera's pictures. Without sharp pictures, --added takes off a
    typical lens.

    Frames that are black, dark, over-exposed or frozen are flagged, in brackets after their name.

    Exit codes: 0 fine; 3 a threshold was violated; else 2 if a file could not be used; 130 interrupted.
    """
    import json

    from tqdm import tqdm

    from pipeline.cli.health_files import HealthFiles, run_content
    from pipeline.cli.health_rows import HEADER, alarms, condition_row, line
    from pipeline.cli.pictures import expand, named, readable, stream_of
    from pipeline.condition import ConditionMonitor
    from pipeline.condition.frame_flags import FrameInspector
    from pipeline.errors import InputError
    from pipeline.executor import one_thread
    from pipeline.store import plain_json

    one_thread()
    if quality == "best":
        if blur_name != "spectral":
            raise InputError(f"--quality best chooses the blur estimator; leave --blur {blur_name} out")
        blur_name = "fused"
    files = expand(paths)
    sharp_files = expand(sharp) if sharp else []
    if fitted and not sharp:
        raise InputError("--fit needs pictures of the same camera that are known to be sharp; give them by --sharp")
    if added and (sharp or blur_name != "spectral"):
        raise InputError("--added is for the estimator spectral without --sharp, which tells the same more exactly")
    if as_json and as_lines:
        raise InputError("--json and --jsonl: choose one of the two")
    about: dict[str, Any] = {
        "blur_estimator": blur_name, "noise_estimator": noise_name, "sharp": [str(file) for file in sharp_files],
        "thresholds": {"sigma_dn": alarm_sigma_dn, "mtf50": alarm_mtf50, "flags": alarm_flags},
    }  # fmt: skip
    rows: list[dict[str, Any]] = []  # kept for --json only
    set_aside: list[str] = []
    with contextlib.ExitStack() as stack:
        results = stack.enter_context(HealthFiles(out, [*files, *sharp_files], about)) if out is not None else None
        monitor = ConditionMonitor(blur_name, noise_name, blur_options={"answer": "added"} if added else None)
        about["weights_released"] = monitor.weights_released
        sharp_sizes = _calibrate(monitor, sharp_files, fitted, every) if sharp else set()
        inspector = FrameInspector()
        failed = alarmed = 0
        if not (as_json or as_lines):
            for quantity, released in monitor.weights_released.items():
                if not released:
                    click.echo(f"weights not released: {quantity}")
            click.echo(HEADER)
        for name, image, problem in tqdm(readable(files, every), delay=2, leave=False, unit=" frames"):
            try:
                if image is None:
                    raise InputError(problem)
                condition = monitor.frame(image)
            except InputError as error:
                failed += 1
                reason = named(name, error)
                set_aside.append(reason)
                if results is not None:
                    results.set_aside.append(reason)
                click.echo(f"set aside: {reason}", err=True)
                continue
            if sharp_sizes and image.shape not in sharp_sizes:
                _warn_of_size(name, image.shape, sharp_sizes)
                sharp_sizes = set()  # once is enough
            row = condition_row(name, condition, inspector.inspect(image, stream_of(name)))
            row["alarms"] = ", ".join(alarms(row, alarm_sigma_dn, alarm_mtf50, alarm_flags))
            alarmed += bool(row["alarms"])
            if results is not None:
                results.add(row, image, condition)
            if as_json:
                rows.append(row)
            else:
                click.echo(json.dumps(plain_json(row), sort_keys=True) if as_lines else line(row))
    if as_json:
        content = run_content(about, rows, set_aside, complete=True)
        click.echo(json.dumps(plain_json(content), indent=2, sort_keys=True))
    if out is not None:
        click.echo(f"written to {out}", err=as_json or as_lines)
    if alarmed:
        click.echo(f"alarm: {alarmed} frames violate a threshold", err=True)
        raise SystemExit(ALARM)
    if failed:
        raise InputError(f"{failed} of the pictures given could not be used; see above")


def _calibrate(
    monitor: ConditionMonitor, files: Sequence[Path], fitted: bool, every: int
) -> set[tuple[int, ...]]:  # sizes (H, W) of the sharp frames
    """Calibrate a monitor to sharp frames; warns of those that do not look sharp."""
    import numpy as np

    from pipeline.cli.pictures import read
    from pipeline.condition.summary import half_contrast

    images: list[NDArray[np.float32]] = []
    for file in files:
        for name, image in read(file, every):
            mtf50 = half_contrast(monitor.frame(image).mtf.value)
            if np.isfinite(mtf50).any() and np.nanmin(mtf50) < SHARP_MTF50:
                click.echo(
                    f"warning: --sharp {name} does not look sharp: contrast falls to half at "
                    f"{np.nanmin(mtf50):.2f} of Nyquist; blur relative to it will be underestimated",
                    err=True,
                )
            images.append(image)
    monitor.calibrate(images, fitted=fitted)
    return {image.shape for image in images}


def _warn_of_size(name: str, shape: tuple[int, ...], sharp: set[Any]) -> None:
    sizes = ", ".join(f"{width}x{height}" for height, width in sorted(sharp))
    click.echo(
        f"warning: {name} is {shape[1]}x{shape[0]} px, the pictures given by --sharp are {sizes} px; "
        "another size means another camera, mode or scaling, whose sharpness differs",
        err=True,
    )
