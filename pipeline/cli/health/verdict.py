"""The verdict on a run in words: condition, expected precision, cause, advice, flags, trend, and what is unknown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from math import isfinite
from types import MappingProxyType
from typing import Any

from pipeline.cli.analysis.medians import (
    bounded_median,
    directed_shares,
    known_median,
    median_mtf,
    median_noise,
    median_noise_parts,
    median_precision,
    noise_mostly_unknown,
)
from pipeline.cli.analysis.rows import is_beyond
from pipeline.cli.health.ranking import badness, is_bad
from pipeline.cli.health.row_words import noise_level_words, row_words
from pipeline.errors import printable

LEAST_GAIN_PERCENT = 2.0
"""Points of average precision that other settings must promise to be advised."""


def run_verdict(
    rows: Sequence[dict[str, Any]],
    *,
    without_precision: str,
    trend_alarms: Sequence[dict[str, Any]] = (),
    without_trend: str = "",
    set_aside: int = 0,
    hinted: Mapping[int, int] = MappingProxyType({}),
    relative_to: str = "",
) -> dict[str, Any]:
    """The verdict on the finished frames.

    Args:
        rows: of `pipeline.cli.analysis.frame.FrameAnalysis.analyse`.
        without_precision: why the expected precision is unknown, or empty.
        trend_alarms: that began in the run.
        without_trend: the sentence that states what has no trend and why, or empty.
        set_aside: files or frames that could not be used.
        hinted: pictures that seem to hold values of fewer bits in 16, by that number of bits; under
            `pipeline.cli.frames.remarks.TURNED`, those that metadata turn, and under ``TRANSPARENT`` those with
            transparent pixels.
        relative_to: what blur is relative to, in words; empty for the MTF of the whole system.

    Returns:
        ``sentence``, the verdict on the median of the frames; ``sentences``, it and whatever must be known beside it;
        the medians behind it.
    """
    if not rows:
        sentence = "No frame could be analysed."
        return {"sentence": sentence, "sentences": [sentence, *_set_aside(set_aside)], "frames": 0}
    from pipeline.cli.analysis.flag_words import left_out_words
    from pipeline.condition.verdict import grade

    sigma, high, at_most = median_noise(rows)
    white, correlation = median_noise_parts(rows)
    mtf = median_mtf(rows)
    ends = median_mtf(rows, "mtf_low"), median_mtf(rows, "mtf_high")
    grades = grade(sigma, mtf, known_median(row["median_dn"] for row in rows), ends, directed_shares(rows))
    blur, noise = grades.words()
    blur += f" (relative to {relative_to})" if relative_to and grades.blur else ""
    beside = left_out_words(rows[0]) if len(rows) == 1 else []
    condition = "; ".join([blur, f"{noise}{noise_level_words(sigma, high, at_most)}", *beside])
    start = f"Median of {len(rows)} frames: {condition}" if len(rows) > 1 else condition[:1].upper() + condition[1:]
    sentence = ". ".join([start, *_precision(rows), *_causes(grades.causes()), *_advice(rows)]) + "."
    sentences = [
        sentence, *_partly_blurred(rows), *_worst(rows), *_unknown(rows), *undecided_alarms(rows), *_flags(rows),
        *_trend(trend_alarms, without_trend), *_hinted(hinted), *_set_aside(set_aside),
    ]  # fmt: skip
    if without_precision:
        sentences.append(f"Expected average precision is unknown: {without_precision}.")
    return {
        "sentence": sentence, "sentences": sentences, "frames": len(rows), "median_sigma_dn": sigma,
        "median_sigma_at_most_dn": at_most, "median_mtf": mtf, "blur": grades.blur,
        "blur_direction": grades.direction, "blur_range": grades.blur_range, "noise": grades.noise,
        "causes": grades.causes(),
        "median_ap_percent": median_precision(rows), "median_white_sigma_dn": white,
        "median_noise_correlation": correlation,
    }  # fmt: skip


def _precision(rows: Sequence[dict[str, Any]]) -> list[str]:
    known = [] if noise_mostly_unknown(rows) else [row for row in rows if isfinite(row["ap_percent"])]
    least = bounded_median(rows, "ap_low_percent", float("-inf"))
    if isfinite(least) and not known:
        best = known_median(row["sharp_ap_percent"] for row in rows if isfinite(row["ap_low_percent"]))
        return [f"Expected AP at least {least:.0f} % of {best:.0f} %"]
    if not known:
        return [f"Expected AP unknown: {_without_precision(rows)}"] if "sharp_ap_percent" in rows[0] else []
    names = ("ap_percent", "ap_low_percent", "ap_high_percent", "sharp_ap_percent")
    here, low, high, best = (known_median(row[name] for row in known) for name in names)
    text = f"Expected AP {here:.0f} % of {best:.0f} %"
    return [text + (f" (95 % interval {low:.0f} to {high:.0f})" if isfinite(low) and isfinite(high) else "")]


def _without_precision(rows: Sequence[dict[str, Any]]) -> str:
    """Why no frame has an expected AP, though precision was measured."""
    reasons = Counter(reason for row in rows if row["blur"] and row["noise"] for reason in _outside_surface(row))
    if not reasons or noise_mostly_unknown(rows):
        return " and ".join(name for name in ("blur", "noise") if not all(row[name] for row in rows)) + " unknown"
    if len(reasons) == 1:
        return f"none was measured {next(iter(reasons))}"
    words = (f"{reason} ({count} of {len(rows)} frames)" for reason, count in reasons.most_common())
    return f"none was measured {' or '.join(words)}"


def _outside_surface(row: dict[str, Any]) -> list[str]:
    """Why the surface of average precision has no answer for a frame without an expected AP, in words."""
    from pipeline.cli.analysis.flag_words import left_out_words

    # AP of sharp frames without noise is unknown only for lack of brightness: brighter frames count as the brightest
    reasons = [] if isfinite(row["sharp_ap_percent"]) else ["at such low brightness"]
    reasons += ["with noise of rows, columns or single pixels"] if left_out_words(row) else []
    return reasons or ["at such blur and noise"]


def _causes(causes: Sequence[str]) -> list[str]:
    return [f"Cause: {'; '.join(causes)}"] if causes else []


def _advice(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Settings to try, or why there are none; empty where none were asked for.

    Advice takes any blur for motion: where that of its frame may be defocus, that is stated. The gain is that of
    `pipeline.control.advice`: AP at the best settings less AP at those taken, by noise and motion, which settings
    change. The expected AP is of noise and any blur; where the two differ, the AP that the gain counts from is stated.
    """
    from pipeline.condition.verdict import noise_ends

    with_settings = [row for row in rows if "advice" in row]
    advised = [row for row in with_settings if row["advice"] == "move" and not row["gain_percent"] < LEAST_GAIN_PERCENT]
    if not advised:
        return [Counter(map(_without_advice, with_settings)).most_common(1)[0][0]] if with_settings else []
    row = sorted(advised, key=lambda row: row["best_exposure_ms"])[len(advised) // 2]
    text = f"Try {row['best_exposure_ms']:.3g} ms at ISO {row['best_iso']:.0f}"
    least_dn, most_dn = noise_ends(row["sigma_dn"], row["sigma_low_dn"], row["sigma_high_dn"])
    exact = isfinite(row["sigma_dn"]) and least_dn == most_dn and not row["blur_range"]
    least = "" if exact else "at least "  # of all that is possible
    gain = f"{least}{row['gain_percent']:.0f} points of AP more expected"
    gain += _counted_from(row) if exact else ""
    beside = [gain] if isfinite(row["gain_percent"]) else []
    if row["blur"] not in ("", "sharp") and not row["blur_direction"]:
        beside.append("if the blur is of motion")
    if len(rows) > 1:
        name = printable(row["picture"])
        beside.append(f"as for {name}; other settings advised in {len(advised)} of {len(rows)} frames")
    return [text + (f" ({', '.join(beside)})" if beside else "")]


def _counted_from(row: dict[str, Any]) -> str:
    """The AP that an exact gain counts from, in words, where it is not the expected one; see `_advice`."""
    taken_percent = row["best_ap_percent"] - row["gain_percent"]
    differs = isfinite(taken_percent) and f"{taken_percent:.0f}" != f"{row['ap_percent']:.0f}"
    return f", from {taken_percent:.0f} % by noise and motion alone" if differs and isfinite(row["ap_percent"]) else ""


def _without_advice(row: dict[str, Any]) -> str:
    """Why a frame gives no settings to try, in words."""
    action = str(row["advice"])
    if action in ("move", "hold"):
        return f"No better settings: none within the limits is expected to gain {LEAST_GAIN_PERCENT:g} points of AP"
    if action == "undecided":
        return "No advice: what is better depends on blur or noise, which is unknown or uncertain"
    if action == "abstained":
        return "No advice: blur or noise is unknown"
    if action == "refused":
        return f"No advice: no average precision was measured {' or '.join(_outside_surface(row))}"
    return f"No advice: {action.removeprefix('none: ')}"


def _worst(rows: Sequence[dict[str, Any]]) -> list[str]:
    if len(rows) < 2:
        return []
    bad = sum(map(is_bad, rows))
    sentences = [f"{bad} of {len(rows)} frames are at least moderately blurred or highly noisy."] if bad else []
    measured = [row for row in rows if row["blur"] or row["noise"] or is_beyond(row)]
    if measured:
        row = max(measured, key=badness)
        sentences.append(f"Worst frame: {printable(row['picture'])}, {row_words(row)}.")
    without = [row for row in rows if not (row["blur"] or row["noise"] or is_beyond(row))]
    if without:
        first = ("the first " if len(without) > 1 else "") + printable(without[0]["picture"])
        sentences.append(f"Neither blur nor noise could be measured in {len(without)} of {len(rows)} frames: {first}.")
    return sentences


def _partly_blurred(rows: Sequence[dict[str, Any]]) -> list[str]:
    """That a part of frames is blurred whose grade, that of the median patch, does not say so."""
    from pipeline.condition.verdict import is_partly_blurred

    partly = [row for row in rows if is_partly_blurred(row["blur"], row["blurred_fraction"])]
    if not partly:
        return []
    row = max(partly, key=lambda row: row["blurred_fraction"])
    share = f"{100 * row['blurred_fraction']:.0f} % of the patches"
    if len(rows) > 1:
        return [f"Partly blurred: {len(partly)} of {len(rows)} frames, {printable(row['picture'])} on {share}."]
    return [f"Partly blurred: {share} are at least moderately blurred; grade and expected AP are of the median patch."]


def _unknown(rows: Sequence[dict[str, Any]]) -> list[str]:
    from pipeline.condition.verdict import REASONS

    sentences = []
    for part in ("blur", "noise"):
        without = [row for row in rows if not row[part]]
        if without:
            reasons = Counter(reason for row in without for reason in row["abstained"].get(part, {}))
            words = ", ".join(REASONS.get(reason, reason) for reason, _ in reasons.most_common(3)) or "no estimate"
            sentences.append(f"{part.capitalize()} is unknown in {len(without)} of {len(rows)} frames ({words}).")
    return sentences


def undecided_alarms(rows: Sequence[dict[str, Any]]) -> list[str]:
    """That limits of alarms could not be compared with what is unknown: one sentence, or none where all could.

    Args:
        rows: of the finished frames.
    """
    counts = Counter(name for row in rows for name in row["undecided"].split(", ") if name)
    words = ", ".join(f"{name} in {count}" for name, count in counts.most_common())
    return [f"Alarms undecided for want of an estimate: {words} of {len(rows)} frames."] if words else []


def _flags(rows: Sequence[dict[str, Any]]) -> list[str]:
    from pipeline.cli.analysis.flag_words import flag_names

    counts = Counter(name for row in rows for name in flag_names(row))
    words = ", ".join(f"{name.replace('_', '-')} {count}" for name, count in counts.most_common())
    return [f"Frames flagged: {words}."] if words else []


def _hinted(counts: Mapping[int, int]) -> list[str]:
    from pipeline.cli.frames.remarks import CURVED, TRANSPARENT, TURNED

    sentences = [
        f"16-bit pictures that look like {bits}-bit values, {1 << 16 - bits} times too dark then: {count} (a guess)."
        for bits, count in sorted(counts.items())
        if bits > 0
    ]
    if counts.get(TURNED):
        sentences.append(
            f"Pictures and videos stored turned or mirrored (by their metadata): {counts[TURNED]}; "
            "horizontal, vertical and positions are those of the stored pixels."
        )
    if counts.get(TRANSPARENT):
        sentences.append(
            f"Pictures with transparent pixels: {counts[TRANSPARENT]}; the colours stored beneath them are measured."
        )
    if counts.get(CURVED):
        sentences.append(
            f"Pictures whose transfer curve is far from those of sRGB and BT.709: {counts[CURVED]}; brightness and "
            "noise are in their code values."
        )
    return sentences


def _trend(alarms: Sequence[dict[str, Any]], without: str) -> list[str]:
    return [f"Trend alarm: {alarm['words']}." for alarm in alarms] + ([without] if without else [])


def _set_aside(count: int) -> list[str]:
    return [f"{count} {'file or frame was' if count == 1 else 'files or frames were'} set aside."] if count else []
