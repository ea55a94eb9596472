"""A frame's condition as one row: of a table, of JSON, and of the text printed."""

from __future__ import annotations

from math import isinf, isnan
from typing import TYPE_CHECKING, Any

from pipeline.cli.analysis.flag_words import IMPULSES, flag_names, flag_words, line_noise_dn
from pipeline.cli.results.numbers import text_number
from pipeline.errors import printable

if TYPE_CHECKING:
    from pipeline.condition import Condition
    from pipeline.condition.frame_flags import FrameFlags

AXES = ("horizontal", "vertical")
COLUMNS = (
    "picture", "sigma_dn", "sigma_low_dn", "sigma_high_dn", "sigma_at_most_dn", "noise_patches", "noise_abstained",
    "mtf50_horizontal", "mtf50_vertical", "mtf50_horizontal_status", "mtf50_vertical_status", "blur_patches",
    "blur_abstained", "blurred_fraction", "milliseconds", "bright_dn", "median_dn", "saturated_fraction",
    "obstructed_fraction", "row_noise_dn", "column_noise_dn", "dead_lines", "impulse_fraction", "repeats", "flags",
    "alarms", "undecided", "drawn",
)  # fmt: skip
NOISE = ("sigma_dn", "sigma_high_dn", "sigma_at_most_dn")
"""Columns that the noise is put into words from."""
NOISE_PARTS = ("white_sigma_dn", "noise_correlation")
"""Columns of the part of the noise that is white, and of its correlation between neighbours."""
WRITTEN = (
    *COLUMNS, "blur", "blur_direction", "blur_range", "noise", "causes", "ap_percent", "ap_low_percent",
    "ap_high_percent", "best_exposure_ms", "best_iso", "best_ap_percent", "gain_percent", "trend", "codec",
    "quantiser", *NOISE_PARTS,
)  # fmt: skip
"""Columns of the table of a run: those of `condition_row` and what is inferred from them."""
HEADER = f"{'sigma DN':>9} {'95 % interval':>15} {'MTF50 H':>8} {'MTF50 V':>8} {'answered':>11} {'ms':>6}  picture"

MEASURED, ABOVE_RANGE, UNKNOWN = "measured", "above_range", "unknown"


def condition_row(name: str, condition: Condition, flags: FrameFlags) -> dict[str, Any]:
    """The numbers of one frame.

    Args:
        name: of the frame.
        condition: its blur and noise.
        flags: its exposure, its noise of rows, columns and single pixels, and its repetition.

    Returns:
        `COLUMNS` (``alarms``, ``undecided`` and ``drawn`` empty), `NOISE_PARTS`, the MTF (2, 8) with its interval, and
        the reasons of abstentions.
        MTF50 is a fraction of Nyquist; its status distinguishes a value that is ``measured`` from one ``above_range``
        (contrast stays above half up to the last frequency; the number is infinite) and one that is ``unknown`` (NaN).
    """
    from pipeline.blur.base import PATCH_PX
    from pipeline.condition.summary import half_contrast
    from pipeline.condition.verdict import blurred_fraction

    horizontal, vertical = (float(value) for value in half_contrast(condition.mtf.value))
    noise, blur = condition.noise.estimate, condition.blur.estimate
    numbers = (
        name, float(condition.sigma_dn.value), float(condition.sigma_dn.low), float(condition.sigma_dn.high),
        condition.noise.at_most_dn, len(noise), int(noise.abstained.sum()), horizontal, vertical, status(horizontal),
        status(vertical), len(blur), int(blur.abstained.sum()), blurred_fraction(blur.mtf, blur.high),
        round(condition.milliseconds, 1), flags.bright_dn, flags.median_dn, flags.saturated_fraction,
        flags.obstructed_fraction, flags.row_noise_dn, flags.column_noise_dn, flags.dead_lines, flags.impulse_fraction,
        flags.repeats, ", ".join(flags.names), "", "", "",
    )  # fmt: skip
    reasons = condition.reasons
    if not len(blur):
        reasons["blur"] = {f"a side is shorter than {PATCH_PX} px, bars not counted": 1}
    curves = {"mtf": condition.mtf.value, "mtf_low": condition.mtf.low, "mtf_high": condition.mtf.high}
    parts = dict(zip(NOISE_PARTS, (condition.noise.white_sigma_dn, condition.noise.correlation), strict=True))
    return dict(zip(COLUMNS, numbers, strict=True)) | parts | curves | {"abstained": reasons}


def alarms(
    row: dict[str, Any], most_sigma_dn: float | None, least_mtf50: float | None, flagged: bool = False
) -> list[str]:
    """Thresholds that a frame violates; what is unknown violates none, but may be `undecided`.

    Noise of whole rows or columns, which the estimate of noise leaves out, violates its threshold too, and so does
    noise that is unknown because most tiles hold more than estimators know.

    Args:
        row: of `condition_row`.
        most_sigma_dn: noise above it is an alarm, DN; None for no threshold.
        least_mtf50: an MTF50 below it, on either axis, is an alarm, fraction of Nyquist; None for no threshold.
        flagged: whether the flags of the frame are alarms too.

    Returns:
        ``noise``, ``blur horizontal``, ``blur vertical`` and names of flags, those that apply.
    """
    result = ["noise"] if most_sigma_dn is not None and _noisier(row, most_sigma_dn) else []
    if least_mtf50 is not None:
        result += [f"blur {axis}" for axis in AXES if row[f"mtf50_{axis}"] < least_mtf50]
    return result + (flag_names(row) if flagged else [])


def undecided(row: dict[str, Any], most_sigma_dn: float | None, least_mtf50: float | None) -> list[str]:
    """Thresholds of which a frame does not show whether it violates them.

    Noise that is unknown but for a bound, not detected, or perhaps half as much again as estimated, keeps a threshold
    that is no lower than what there may be.
    Of impulses, which the estimate leaves out, the fraction is measured, but not the noise that they amount to.

    Args:
        row: of `condition_row`.
        most_sigma_dn: see `alarms`.
        least_mtf50: see `alarms`.

    Returns:
        ``noise``, ``blur horizontal`` and ``blur vertical``, those that apply.
    """
    from pipeline.condition.verdict import may_be_much_more
    from pipeline.noise.abstentions import UNDETECTED_LOW_DN

    result = []
    if most_sigma_dn is not None and not _noisier(row, most_sigma_dn):
        unsure = isnan(row["sigma_dn"]) or row["sigma_low_dn"] < UNDETECTED_LOW_DN
        unsure |= may_be_much_more(row["sigma_dn"], row["sigma_high_dn"])
        may_exceed = unsure and not row["sigma_at_most_dn"] <= most_sigma_dn
        result += ["noise"] if may_exceed or IMPULSES in flag_names(row) else []
    if least_mtf50 is not None:
        result += [f"blur {axis}" for axis in AXES if isnan(row[f"mtf50_{axis}"])]
    return result


def is_beyond(row: dict[str, Any]) -> bool:
    """Whether most tiles of a frame are abstained from as noisier than what is measured (`BEYOND`)."""
    from pipeline.noise.base import BEYOND

    return bool(row["abstained"].get("noise", {}).get(BEYOND, 0) > row["noise_patches"] / 2)


def _noisier(row: dict[str, Any], most_sigma_dn: float) -> bool:
    """Whether the noise of a frame, or that of its rows or columns, is above a threshold; see `is_beyond`."""
    from pipeline.noise.abstentions import LARGEST_DN

    beyond = is_beyond(row) and most_sigma_dn < LARGEST_DN
    return bool(row["sigma_dn"] > most_sigma_dn or line_noise_dn(row) > most_sigma_dn or beyond)


def status(mtf50: float) -> str:
    """Whether an MTF50 is ``measured``, ``above_range`` (infinite) or ``unknown`` (NaN)."""
    if isnan(mtf50):
        return UNKNOWN
    return ABOVE_RANGE if isinf(mtf50) else MEASURED


def line(row: dict[str, Any]) -> str:
    """A row as text under `HEADER`."""
    patches = row["noise_patches"] + row["blur_patches"]
    answered = f"{patches - row['noise_abstained'] - row['blur_abstained']}/{patches}"
    interval = f"{text_number(row['sigma_low_dn'], 2)} .. {text_number(row['sigma_at_most_dn'], 2)}"
    halves = " ".join(f"{text_number(row[f'mtf50_{axis}'], 2):>8}" for axis in AXES)
    reasons = [f"{part} {reason} {n}" for part, counts in row["abstained"].items() for reason, n in counts.items()]
    note = f"  ({', '.join(reasons)})" if reasons else ""
    note += f"  [{'; '.join(flag_words(row))}]" if row["flags"] else ""
    note += f"  ALARM: {row['alarms']}" if row["alarms"] else ""
    note += f"  undecided: {row['undecided']}" if row["undecided"] else ""
    return (
        f"{text_number(row['sigma_dn'], 2):>9} {interval:>15} {halves} {answered:>11} {row['milliseconds']:>6.0f}"
        f"  {printable(row['picture'])}{note}"
    )
