"""``camera-monitor budget``: the noise that a sensor explains in one's own pictures, by source, and what departs."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipeline.cli.exit_codes import ALARM
from pipeline.cli.options.given_paths import GivenPath
from pipeline.cli.options.numbers import FiniteRange
from pipeline.cli.options.video_codec import codec_option
from pipeline.cli.results.numbers import json_number
from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.condition.noise_budget import Explanation, FrameBudget

ZERO_CELSIUS_K = 273.15
REMEDIES = {
    "photon": "more light and less gain lower it, by the root of the light",
    "dark": "cool the sensor or expose for a shorter time",
    "readout": "more light and less gain lower it, in proportion to the light",
    "pattern": "correct the pixels by a flat field, or take less light",
    "rounding": "noise is below the steps of the numbers",
}
NAMES = {
    "photon": "photon noise",
    "dark": "dark current",
    "readout": "readout noise",
    "pattern": "fixed pattern",
    "rounding": "rounding",
}
CHANGES = {
    "gain": "the gain were {:.2g} times that assumed",
    "dark or readout": "dark and readout noise were {:.2g} times as strong",
    "pattern": "pixels differed by {:.1%} of the light in every frame",
    "added": "{:.2g} DN were added behind the tone curve",
}


@click.command("budget")
@click.argument("paths", nargs=-1, required=True, type=GivenPath())
@click.option("--sensor", required=True, help="preset, or a folder that camera-monitor record sensor has written")
@click.option("--exposure", help="exposure time of the pictures, e.g. 4ms or 1/250s; from EXIF if left out")
@click.option("--iso", type=FiniteRange(1, 1_000_000), help="their ISO; from EXIF if left out")
@click.option(
    "--base-iso", default=100.0, show_default=True, type=FiniteRange(1, 1_000_000),
    help="ISO at which the sensor's constants hold: the lowest, or that of the recorded raw frames",
)  # fmt: skip
@click.option(
    "--gamma", default=2.2, show_default=True, type=FiniteRange(1, 10), help="of the tone curve; 1 for linear pictures"
)
@click.option("--bits", default=12, show_default=True, type=click.IntRange(8, 24), help="of the sensor's converter")
@click.option(
    "--temperature", type=FiniteRange(-60, 150),
    help="of the sensor, degrees Celsius; 27 if left out. A recorded sensor has that of its recording",
)  # fmt: skip
@click.option(
    "--prnu", "prnu_percent", type=FiniteRange(0, 99),
    help="fixed pattern, percent of the light (EMVA 1288); that of a recorded sensor, else 0, if left out",
)  # fmt: skip
@click.option(
    "--black-dn", type=FiniteRange(0, 254),
    help="grey level without light, 0 to 254; that of a recorded sensor for linear pictures, else 0, if left out",
)  # fmt: skip
@click.option(
    "--alarm-frames", type=click.IntRange(1),
    help="exit code 3 where as many frames in a row have more, or less, noise than the sensor explains",
)  # fmt: skip
@codec_option
def command(
    paths: tuple[Path, ...], sensor: str, exposure: str | None, iso: float | None, base_iso: float, gamma: float,
    bits: int, temperature: float | None, prnu_percent: float | None, black_dn: float | None,
    alarm_frames: int | None, codec: str | None,
) -> None:  # fmt: skip
    """Compare the noise of PATHS with what their sensor explains: pictures, videos, or folders of them.

    Prints one JSON object per frame: estimated and expected noise, their ratio with its interval, the fractions of
    photon noise, dark current, readout, fixed pattern and rounding in the expected variance, and in words what
    dominates, what lowers it, and, where noise departs from the sensor, what would explain that. Noise that the camera
    has demosaiced or denoised, or that a codec hides, is not compared: give pictures of a monochrome camera, or single
    planes of a raw mosaic, before any processing but a tone curve.

    Exit codes: 0 done; 2 if a file could not be used; 3 an alarm; 130 interrupted.
    """
    from collections import Counter

    from pipeline import noise
    from pipeline.camera.exposure import Camera
    from pipeline.cli.frames.given_files import expand
    from pipeline.cli.frames.pictures import least_side_px, readable
    from pipeline.cli.frames.set_aside import SetAside
    from pipeline.cli.frames.shot_settings import seconds, with_settings
    from pipeline.condition.estimate import noise_of_frame
    from pipeline.condition.noise_budget import noise_budget
    from pipeline.executor import one_thread
    from pipeline.recording.measured_sensor import RECORDED_K, is_record, sensor_of

    one_thread()
    if exposure is not None:
        seconds(exposure, "--exposure")
    if temperature is not None and is_record(sensor):
        raise InputError(
            f"--temperature {temperature:g}: {sensor} holds the dark current at the temperature of its recording; "
            "leave it out"
        )
    kelvin = RECORDED_K if temperature is None else temperature + ZERO_CELSIUS_K
    known_sensor = sensor_of(sensor)
    pattern = known_sensor.pattern_fraction if prnu_percent is None else prnu_percent / 100.0
    if black_dn is None:  # what a camera puts a tone curve on has no black level left
        black_dn = known_sensor.black_dn if gamma == 1.0 else 0.0
    camera = Camera(known_sensor.sensor, gamma=gamma, temperature_k=kelvin, adc_bits=bits)
    files, estimator = expand(paths), noise.create(noise.DEFAULT)
    hinted, set_aside, verdicts = Counter[int](), SetAside(), list[str]()
    for path, exposure_s, known_iso in with_settings(files, exposure, iso, set_aside):
        gain = known_iso / base_iso
        for name, image, problem, coding in readable([path], 1, hinted, least_side_px(estimator)):
            try:
                if image is None:
                    raise InputError(problem)
                known = coding.or_by(codec or "")
                state = noise_of_frame(estimator, image, codec=known.codec, quantiser=known.quantiser)
                budget = noise_budget(image, state, camera, exposure_s, gain, pattern, black_dn)
            except InputError as error:
                set_aside.add(name, error)
                continue
            verdicts.append(budget.verdict)
            click.echo(json.dumps({"picture": name, "exposure_ms": 1e3 * exposure_s, "gain": gain, **row(budget)}))
    if alarm_frames is not None and longest_run(verdicts) >= alarm_frames:
        click.echo(f"alarm: noise departs from the sensor in {longest_run(verdicts)} frames in a row", err=True)
        raise SystemExit(ALARM)
    set_aside.refuse()


def row(budget: FrameBudget) -> dict[str, Any]:
    """What is printed of a budget; numbers with four digits, null where unknown."""
    numbers = {
        "sigma_dn": budget.sigma_dn,
        "expected_dn": budget.expected_dn,
        "ratio": budget.ratio,
        "ratio_low": budget.ratio_low,
        "ratio_high": budget.ratio_high,
        **{f"{name}_fraction": budget.shares.get(name, math.nan) for name in NAMES},
    }
    explanations = [{"kind": item.kind, "amount": float(f"{item.amount:.3g}")} for item in budget.explanations]
    about = {"tiles": budget.tiles, "verdict": budget.verdict, "explanations": explanations, "words": words(budget)}
    return {name: json_number(value) for name, value in numbers.items()} | about


def words(budget: FrameBudget) -> str:
    """A budget in one or two sentences."""
    if budget.verdict == "unknown":
        return f"Not compared with the sensor: {budget.reason}."
    share = budget.shares[budget.dominant]
    level = f"{budget.sigma_dn:.1f} DN, {budget.expected_dn:.1f} expected"
    if budget.verdict == "agrees":
        condition = f"As the sensor explains ({level})."
    elif budget.verdict == "undecided":
        ends = f"{budget.ratio_low * budget.expected_dn:.1f} to {budget.ratio_high * budget.expected_dn:.1f} DN"
        condition = f"Undecided: the noise is too uncertain to be compared with the sensor ({level}, interval {ends})."
    else:
        changes = " or ".join(_change(item) for item in budget.explanations)
        cause = f"as if {changes}" if changes else "no single change explains it; it may have been denoised"
        condition = f"{budget.verdict.capitalize()} noise than the sensor explains ({level}): {cause}."
    source = NAMES[budget.dominant].capitalize()
    return f"{condition} {source} is {share:.0%} of the expected variance: {REMEDIES[budget.dominant]}."


def _change(explanation: Explanation) -> str:
    return CHANGES[explanation.kind].format(explanation.amount)


def longest_run(verdicts: list[str]) -> int:
    """Most frames in a row that depart to the same side; undecided and unknown ones are passed over."""
    from itertools import groupby

    decided = [verdict for verdict in verdicts if verdict not in ("undecided", "unknown")]
    return max((len(list(run)) for verdict, run in groupby(decided) if verdict != "agrees"), default=0)
