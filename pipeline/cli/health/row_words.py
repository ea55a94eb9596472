"""The condition of one frame in words."""

from __future__ import annotations

from math import isfinite
from typing import Any

from pipeline.cli.analysis.rows import NOISE, is_beyond


def row_words(row: dict[str, Any], *, flags: bool = True) -> str:
    """The condition of one frame in words.

    Args:
        row: of the frame.
        flags: whether all of its flags are named, not only those of noise that the estimate leaves out.
    """
    from pipeline.cli.analysis.flag_words import flag_words, left_out_words
    from pipeline.condition.verdict import blur_words
    from pipeline.noise.abstentions import LARGEST_DN

    blur = blur_words(row["blur"], row["blur_direction"], row["blur_range"])
    level = f" (beyond {LARGEST_DN:g} DN)" if is_beyond(row) else noise_level_words(*(row[name] for name in NOISE))
    noise = f"noise {row['noise'] or 'unknown'}{level}"
    return "; ".join([blur, noise, *(flag_words(row) if flags else left_out_words(row))])


def noise_level_words(sigma_dn: float, high_dn: float, at_most_dn: float) -> str:
    """Noise in DN, in brackets; where it is unknown, its bound, and nothing without one.

    Where it is very low, but moderate or more within its interval, how much texture may hide is stated too; where it is
    more, how much there may be, if that is moderate or more and at least half as much again.
    """
    from pipeline.condition.verdict import NOISE_GRADES, bound_words, may_be_much_more

    if not isfinite(sigma_dn):
        bound = bound_words(at_most_dn)
        return f" ({bound})" if bound else ""
    (very_low, _), (low, _), *_ = NOISE_GRADES
    if sigma_dn < very_low:
        more = f"; texture may hide up to {high_dn:.0f} DN" if high_dn >= low else ""
    else:
        unsure = high_dn >= low and may_be_much_more(sigma_dn, high_dn)
        more = f"; there may be up to {high_dn:.0f} DN" if unsure else ""
    return f" ({sigma_dn:.1f} DN{more})"
