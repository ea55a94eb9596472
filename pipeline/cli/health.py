"""``camera-monitor health``: a verdict on one's own pictures, with blur and noise per frame, intervals and maps."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipeline.cli.frame_samples import patches_option, tiles_option
from pipeline.cli.given_paths import GivenPath
from pipeline.cli.held_signals import held
from pipeline.cli.numbers import FiniteRange, Mtf50Limit
from pipeline.errors import printable

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.cli.frame_analysis import FrameAnalysis
    from pipeline.cli.health_files import HealthRun
    from pipeline.condition import ConditionMonitor

ALARM = 3  # exit code
SHARP_MTF50 = 0.2  # fraction of Nyquist below which a frame given as sharp is doubted: about a 4 px disc of defocus


@click.command("health")
@click.argument("paths", nargs=-1, required=True, type=GivenPath())
@click.option(
    "--out", type=GivenPath(),
    help="folder for the tables and the page health.html with maps of the worst frames; the last run's results go",
)  # fmt: skip
@click.option(
    "--map", "maps", is_flag=True,
    help="with --out: write every frame with maps of its noise and blur as a picture too (half a second each)",
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
@tiles_option
@patches_option
@click.option(
    "--sharp", multiple=True, type=GivenPath(),
    help="pictures of the same camera, known to be sharp (may be repeated): blur is then relative to them",
)  # fmt: skip
@click.option(
    "--calibrate-estimator", is_flag=True,
    help="with --sharp: calibrate the estimator to the camera, by blurring its sharp pictures (a minute)",
)  # fmt: skip
@click.option(
    "--generic-lens", is_flag=True,
    help="without --sharp: MTF relative to a generic lens instead of the system's (estimator spectral)",
)  # fmt: skip
@click.option("--camera", "camera_name", help="blur relative to this camera, as camera-monitor calibrate stored it")
@click.option("--json", "as_json", is_flag=True, help="print the whole run as one JSON object instead of the table")
@click.option("--jsonl", "as_lines", is_flag=True, help="print one JSON object per frame, as it comes, instead of it")
@click.option(
    "--alarm-sigma-dn", type=FiniteRange(0, 255), help="alarm (exit code 3) when noise exceeds this, grey levels"
)
@click.option(
    "--alarm-mtf50", type=Mtf50Limit(),
    help="alarm (exit code 3) when contrast falls to half below this fraction of Nyquist, on either axis",
)  # fmt: skip
@click.option(
    "--alarm-flags", is_flag=True,
    help="alarm on flags too: black, dark, over-exposed, obstructed, banded, impulses, frozen",
)  # fmt: skip
@click.option("--every", default=1, show_default=True, type=click.IntRange(min=1), help="of a video, each n-th frame")
@click.option("--exposure", help="exposure time of the pictures, e.g. 4ms, for advice; from EXIF if left out")
@click.option("--iso", type=FiniteRange(1, 1_000_000), help="their ISO, for advice; from EXIF if left out")
@click.option(
    "--surface", type=GivenPath(),
    help="measured average precision for the verdict; by default data/control_surface/all.npz, if it is there",
)  # fmt: skip
@click.option(
    "--reference-frames", default=300, show_default=True, type=click.IntRange(100, 100_000),
    help="first frames of a video or folder that its trend is compared with",
)  # fmt: skip
@click.option("--no-trend", is_flag=True, help="no alarm where the condition of a video or folder worsens over time")
def command(
    paths: tuple[Path, ...], out: Path | None, maps: bool, blur_name: str, quality: str, noise_name: str,
    most_tiles: int, most_patches: int, sharp: tuple[Path, ...], calibrate_estimator: bool, generic_lens: bool,
    camera_name: str | None, as_json: bool, as_lines: bool,
    alarm_sigma_dn: float | None, alarm_mtf50: float | None,
    alarm_flags: bool, every: int, exposure: str | None, iso: float | None, surface: Path | None,
    reference_frames: int, no_trend: bool,
) -> None:  # fmt: skip
    """Estimate blur and noise of PATHS: pictures, videos, or folders of them.

    Prints a verdict in words, then per frame the noise in grey levels (DN, 0..255) with its 95 % interval, the
    frequency at which contrast falls to half (MTF50, fraction of Nyquist; > 0.59 where it stays above), horizontal and
    vertical, and how many patches have an estimate (flat and saturated ones do not). The verdict has the expected
    average precision where a surface was measured, and advice where exposure time and ISO are known too.

    Hold the camera upright; --sharp removes what its lens does anyway; --calibrate-estimator also corrects
    the estimator's error on this camera's pictures. Without sharp pictures, --generic-lens gives the MTF relative to
    a generic lens.

    Frames that are black, dark, over-exposed, obstructed or frozen are flagged, in brackets after their name, and so
    is noise that the estimate leaves out: of whole rows or columns (banded), and of single pixels (impulses). Where
    noise or blur of a video or folder grows over time, a trend alarm is raised: less than one false alarm an hour at
    10 frames per second.

    Where a threshold is given, but its quantity is unknown and no bound of it keeps the threshold, the frame is
    *undecided*, which the verdict counts.

    Exit codes: 0 fine; 3 alarm (threshold or trend); else 2 if a file could not be used; 130 interrupted.
    """
    import json

    from tqdm import tqdm

    from pipeline import freed_memory
    from pipeline.cli import camera_store
    from pipeline.cli.frame_ahead import estimated_ahead
    from pipeline.cli.frame_analysis import FrameAnalysis, Settings, Thresholds, find_surface
    from pipeline.cli.health_files import HealthFiles, HealthRun
    from pipeline.cli.health_verdict import undecided_alarms
    from pipeline.cli.package_version import version
    from pipeline.cli.pictures import expand, least_side_px, readable, stream_of
    from pipeline.cli.set_aside import SetAside
    from pipeline.condition import ConditionMonitor
    from pipeline.errors import InputError
    from pipeline.executor import one_thread
    from pipeline.recording.provenance import monitor_weights
    from pipeline.store import plain_json

    one_thread()
    freed_memory.keep()
    if quality == "best":
        if blur_name != "spectral":
            raise InputError(f"--quality best chooses the blur estimator; leave --blur {blur_name} out")
        blur_name = "fused"
    files = expand(paths)
    sharp_files = expand(sharp) if sharp else []
    if calibrate_estimator and not sharp:
        raise InputError("--calibrate-estimator needs sharp pictures of the same camera; give them by --sharp")
    if generic_lens and sharp:
        raise InputError("--generic-lens is instead of --sharp, which is more exact: leave --generic-lens out")
    if generic_lens and blur_name != "spectral":
        raise InputError(f"--generic-lens is for the blur estimator spectral, not {blur_name}; leave one of them out")
    if camera_name is not None and (sharp or generic_lens):
        raise InputError("--camera NAME is instead of --sharp and --generic-lens")
    if maps and out is None:
        raise InputError("--map needs --out FOLDER, where the pictures go")
    if as_json and as_lines:
        raise InputError("--json and --jsonl: choose one of the two")
    camera = camera_store.load(camera_name) if camera_name is not None else None
    performance, without_precision = find_surface(surface)
    about: dict[str, Any] = {
        "version": version(), "blur_estimator": blur_name, "noise_estimator": noise_name,
        "sharp": [printable(file) for file in sharp_files],
        "relative": bool(sharp) or generic_lens or camera is not None,
        "relative_to": (
            f"the calibration of the camera {camera_name}" if camera is not None else
            "the sharp frames" if sharp else "a generic lens" if generic_lens else ""
        ),
        "camera": camera_name,
        "thresholds": {"sigma_dn": alarm_sigma_dn, "mtf50": alarm_mtf50, "flags": alarm_flags},
        "weights_released": {}, "weights_sha256": {},  # until the monitor is created, which may fail
    }  # fmt: skip
    set_aside = SetAside()
    run = HealthRun(about, set_aside=set_aside.reasons, without_precision=without_precision)
    sequences = sequence_names(files)
    with ExitStack() as stack:
        results = (
            stack.enter_context(HealthFiles(out, [*files, *sharp_files], run, maps=maps)) if out is not None else None
        )
        monitor = ConditionMonitor(
            blur_name, noise_name, blur_options={"output": "relative"} if generic_lens else None,
            most_tiles=most_tiles, most_patches=most_patches,
        )  # fmt: skip
        about["weights_released"] = monitor.weights_released
        about["weights_sha256"] = monitor_weights(monitor)
        sharp_sizes: set[tuple[int, ...]] = (
            _calibrate(monitor, sharp_files, calibrate_estimator, every) if sharp else set()
        )
        if camera is not None:
            camera_store.apply(camera, monitor)
            sharp_sizes = set() if camera.size_px is None else {camera.size_px}
        analysis = FrameAnalysis(
            monitor, Thresholds(alarm_sigma_dn, alarm_mtf50, alarm_flags), performance, Settings(exposure, iso),
            relative=about["relative"], reference_frames=None if no_trend else reference_frames,
        )  # fmt: skip
        run.trend_alarms = analysis.trend_alarms
        if not as_lines:
            stack.callback(_print_run, run, as_json)
        pictures = readable(files, every, run.hinted, least_side_px(monitor.noise_estimator))
        frames = stack.enter_context(closing(estimated_ahead(analysis, pictures)))
        for name, image, estimate in tqdm(frames, delay=2, leave=False, unit=" frames"):
            try:
                stream, estimated = stream_of(name), estimate()
                row, condition = analysis.analyse(name, image, stream, stream or sequences.get(name, ""), estimated)
            except InputError as error:
                set_aside.add(name, error)
                continue
            if sharp_sizes and image.shape not in sharp_sizes:
                reason = camera_store.of_other_size(printable(name), image.shape, sharp_sizes)
                click.echo(f"warning: {reason}", err=True)
                sharp_sizes = set()  # once is enough
            with held():  # all files and the verdict state the same frames
                if results is not None:
                    results.add(row, image, condition)
                run.rows.append(row)
            run.without_trend = _without_trend(analysis, reference_frames)
            if as_lines:
                click.echo(json.dumps(plain_json(row), sort_keys=True))
    if results is not None:
        click.echo(f"written to {out}; page {results.page}", err=as_json or as_lines)
    if as_lines:  # which have no verdict
        for sentence in undecided_alarms(run.rows):
            click.echo(f"warning: {sentence}", err=True)
    alarmed = sum(bool(row["alarms"]) for row in run.rows)
    if alarmed:
        frames_violate, follow = ("frame violates", "follows") if alarmed == 1 else ("frames violate", "follow")
        click.echo(f"alarm: {alarmed} {frames_violate} a threshold or {follow} a trend alarm", err=True)
        raise SystemExit(ALARM)
    set_aside.refuse()


def sequence_names(files: Sequence[Path]) -> dict[str, str]:
    """Name of each picture -> the folder whose frames it is one of; pictures that are alone in theirs are left out.

    Such a series has a trend, and its frames may repeat one another (the flag ``frozen``).

    Args:
        files: pictures and videos.
    """
    folders: dict[str, list[Path]] = {}
    for file in files:
        folders.setdefault(str(file.parent), []).append(file)
    return {str(file): folder for folder, members in folders.items() if len(members) > 1 for file in members}


def _without_trend(analysis: FrameAnalysis, reference_frames: int) -> str:
    """Which quantities have no trend, or no reliable one, and why; empty where all have one or none is expected."""
    from pipeline.condition.trend import QUANTITIES

    series = [trend.learning for trend in analysis.trends.values()]
    if not series:
        return ""
    sentences = _drifted(analysis, reference_frames)
    counts = {name: max(part[name] for part in series) for name in QUANTITIES if all(name in part for part in series)}
    if counts:
        of = "" if len(counts) == len(QUANTITIES) else f" of {', '.join(counts)}"
        frames = sorted({min(counts.values()), max(counts.values())})
        known = " to ".join(str(count) for count in frames)
        have = "frame of a series has" if frames == [1] else "frames of a series have"
        sentences.append(f"No trend{of}: {known} {have} an estimate, the reference alone takes {reference_frames}.")
    return " ".join(sentences)


def _drifted(analysis: FrameAnalysis, reference_frames: int) -> list[str]:
    """That quantities changed within their reference, so that later changes may not show: a sentence per series."""
    from pipeline.condition.change_point import LEAST_REFERENCE

    sentences = []
    for name, trend in analysis.trends.items():
        drifts = trend.drifts.values()
        if not drifts:
            continue
        where = f" in {printable(name)}" if len(analysis.trends) > 1 else ""
        words = "; ".join(drift.words() for drift in drifts)
        unreliable = [drift.quantity for drift in drifts if drift.instead is None]
        if unreliable:
            fewer = "give fewer --reference-frames, or " if reference_frames > LEAST_REFERENCE else ""
            sentences.append(
                f"No reliable trend of {', '.join(unreliable)}{where}: changed within the reference ({words}); "
                f"{fewer}start from a camera in order."
            )
        else:
            sentences.append(f"Changed within the first reference of the trend{where}: {words}.")
    return sentences


def _print_run(run: HealthRun, as_json: bool) -> None:
    """The verdict, then the table; or everything as JSON."""
    import json
    import sys

    from pipeline.cli.health_rows import HEADER, line
    from pipeline.store import plain_json

    if as_json:
        content = run.content(complete=sys.exc_info()[0] is None)
        click.echo(json.dumps(plain_json(content), indent=2, sort_keys=True))
        return
    for sentence in run.verdict()["sentences"]:
        click.echo(sentence)
    for quantity, released in run.about["weights_released"].items():
        if not released:
            click.echo(f"weights not released: {quantity}")
    if run.rows:
        click.echo(f"\n{HEADER}")
    for row in run.rows:
        click.echo(line(row))


def _calibrate(
    monitor: ConditionMonitor, files: Sequence[Path], calibrate_estimator: bool, every: int
) -> set[tuple[int, ...]]:  # sizes (H, W) of the sharp frames
    """Calibrate a monitor to sharp frames; warns of those that do not look sharp."""
    from collections import Counter

    import numpy as np

    from pipeline.cli.pictures import least_side_px, read
    from pipeline.condition.summary import half_contrast

    images: list[NDArray[np.float32]] = []
    hinted = Counter[int]()
    for file in files:
        for name, image in read(file, every, hinted, least_side_px(monitor.noise_estimator)):
            mtf50 = half_contrast(monitor.frame(image).mtf.value)
            if np.isfinite(mtf50).any() and np.nanmin(mtf50) < SHARP_MTF50:
                click.echo(
                    f"warning: --sharp {name} does not look sharp: contrast falls to half at "
                    f"{np.nanmin(mtf50):.2f} of Nyquist; blur relative to it will be underestimated",
                    err=True,
                )
            images.append(image)
    monitor.calibrate(images, fitted=calibrate_estimator)
    return {image.shape for image in images}
