"""``camera-monitor health``: a verdict on one's own pictures, with blur and noise per frame, intervals and maps."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipeline.cli.ending_signals import held
from pipeline.cli.exit_codes import ALARM
from pipeline.cli.health.options import HealthOptions
from pipeline.cli.options.frame_samples import patches_option, tiles_option
from pipeline.cli.options.given_paths import GivenPath
from pipeline.cli.options.numbers import FiniteRange, Mtf50Limit
from pipeline.cli.options.video_codec import codec_option
from pipeline.errors import printable

if TYPE_CHECKING:
    from pipeline.cli.analysis.frame import FrameAnalysis
    from pipeline.cli.frames.set_aside import SetAside
    from pipeline.cli.health.files import HealthFiles
    from pipeline.cli.health.run import HealthRun
    from pipeline.condition import ConditionMonitor
    from pipeline.control.performance import Performance


@click.command("health")
@click.argument("paths", nargs=-1, required=True, type=GivenPath())
@click.option(
    "--out", type=GivenPath(),
    help="folder for the tables and the page health.html with maps of the worst frames; those of its last run there go",
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
@codec_option
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
    help="alarm on flags too: black, dark, over-exposed, obstructed, banded, dead lines, impulses, frozen",
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
def command(**given: Any) -> None:
    """Estimate blur and noise of PATHS: pictures, videos, or folders of them.

    Prints a verdict in words, then per frame the noise in grey levels (DN, 0..255) with its 95 % interval, the
    frequency at which contrast falls to half (MTF50, fraction of Nyquist; > 0.59 where it stays above), horizontal and
    vertical, and how many patches have an estimate (flat and saturated ones do not). The verdict has the expected
    average precision where a surface was measured, and advice where exposure time and ISO are known too.

    Hold the camera upright; --sharp removes what its lens does anyway; --calibrate-estimator also corrects
    the estimator's error on this camera's pictures. Without sharp pictures, --generic-lens gives the MTF relative to
    a generic lens.

    Frames that are black, dark, over-exposed, obstructed or frozen are flagged, in brackets after their name, and so
    is noise that the estimate leaves out: of whole rows or columns (banded, dead lines), and of single pixels
    (impulses). Where noise or blur of a video or folder grows over time, a trend alarm is raised: less than one false
    alarm an hour at 10 frames per second where the first 300 frames show how scenes vary, a few where scenery varies
    slowly.

    Where a threshold is given, but its quantity is unknown and no bound of it keeps the threshold, the frame is
    *undecided*, which the verdict counts. Noise above 60 DN (beyond) has no estimate, and is an alarm of any
    threshold below.

    Exit codes: 0 fine; 3 alarm (threshold or trend); else 2 if a file could not be used; 130 interrupted.
    """
    from pipeline import freed_memory
    from pipeline.cli.analysis.surface import find_surface
    from pipeline.cli.frames.set_aside import SetAside
    from pipeline.cli.health.files import SUFFIXES, HealthFiles
    from pipeline.cli.health.monitor import monitor_of
    from pipeline.cli.health.run import HealthRun
    from pipeline.cli.results.output_folder import OutputFolder
    from pipeline.executor import one_thread

    one_thread()
    freed_memory.keep()
    options = HealthOptions(**given)
    files, sharp_files = options.files, options.sharp_files
    about = options.about()
    performance, without_precision = find_surface(options.surface)
    set_aside = SetAside()
    run = HealthRun(about, set_aside=set_aside.reasons, without_precision=without_precision)
    with ExitStack() as stack:
        folder = results = None
        if options.out is not None:
            folder = OutputFolder(options.out, "health", "--out", [*files, *sharp_files])
            stack.push(folder)  # not entered yet: earlier results stay until no option can be refused any more
            folder.refuse_foreign_files([f"health{suffix}" for suffix in SUFFIXES])
        monitor, sharp_sizes = monitor_of(options, about)
        analysis = _analysis(options, monitor, performance)
        run.trend_alarms = analysis.trend_alarms
        if folder is not None:
            results = stack.enter_context(HealthFiles(stack.enter_context(folder), run, maps=options.maps))
        if not options.as_lines:
            stack.callback(_print_run, run, options.as_json)
        _analyse(options, analysis, run, results, set_aside, sharp_sizes)
    if results is not None:
        click.echo(f"written to {options.out}; page {results.page}", err=options.as_json or options.as_lines)
    _end(options, run, set_aside)


def _analysis(options: HealthOptions, monitor: ConditionMonitor, performance: Performance | None) -> FrameAnalysis:
    """What every frame goes through."""
    from pipeline.cli.analysis.frame import FrameAnalysis, Settings, Thresholds

    thresholds = Thresholds(options.alarm_sigma_dn, options.alarm_mtf50, options.alarm_flags)
    reference = None if options.no_trend else options.reference_frames
    settings, relative = Settings(options.exposure, options.iso), bool(options.relative_to)
    return FrameAnalysis(
        monitor, thresholds, performance, settings, relative=relative, reference_frames=reference,
        codec=options.codec or "",
    )  # fmt: skip


def _analyse(
    options: HealthOptions, analysis: FrameAnalysis, run: HealthRun, results: HealthFiles | None, set_aside: SetAside,
    sharp_sizes: set[tuple[int, ...]],
) -> None:  # fmt: skip
    """Analyse all frames, one after the other; each is in all files and in the run, or in none."""
    import json

    from tqdm import tqdm

    from pipeline.cli.analysis.ahead import estimated_ahead
    from pipeline.cli.analysis.frame import series_name
    from pipeline.cli.calibration import camera_store
    from pipeline.cli.frames.names import stream_of
    from pipeline.cli.frames.pictures import least_side_px, readable
    from pipeline.cli.health.trend_words import without_trend
    from pipeline.errors import InputError
    from pipeline.store import plain_json

    sequences = sequence_names(options.files)
    least_px = least_side_px(analysis.monitor.noise_estimator)
    pictures = readable(options.files, options.every, run.hinted, least_px)
    with closing(estimated_ahead(analysis, pictures)) as frames:
        for name, image, estimate in tqdm(frames, delay=2, leave=False, unit=" frames"):
            try:
                stream, estimated = stream_of(name), estimate()
                source = stream or sequences.get(name, "")
                sequence = series_name(source, image.shape) if source else ""
                row, condition = analysis.analyse(name, image, stream, sequence, estimated)
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
            run.without_trend = without_trend(analysis, options.reference_frames)
            if options.as_lines:
                click.echo(json.dumps(plain_json(row), sort_keys=True))
    run.complete = True


def _end(options: HealthOptions, run: HealthRun, set_aside: SetAside) -> None:
    """Last messages and the exit code."""
    from pipeline.cli.health.verdict import undecided_alarms

    if options.as_lines:  # which have no verdict
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


def _print_run(run: HealthRun, as_json: bool) -> None:
    """The verdict, then the table; or everything as JSON."""
    from pipeline.cli.analysis.rows import HEADER, line
    from pipeline.cli.results import streamed_json

    if as_json:
        for piece in streamed_json.pieces(run.content(), ensure_ascii=True):
            click.echo(piece, nl=False)
        click.echo()
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
