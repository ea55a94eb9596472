"""The gallery of image formation: one patch after each step of the chain, and every noise effect at every level."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.errors import InputError, did_you_mean
from pipeline.report import style
from pipeline.report.style import Drawing
from pipeline.report.wording import EFFECTS, in_order, listing, word

CHAIN_PX, EFFECTS_PX = 144, 96  # side of the square shown from a picture's middle, pixel for pixel


def _array(arrays: Mapping[str, np.ndarray], entry: Mapping[str, Any], side_px: int) -> np.ndarray:
    """The middle of the picture an entry names, in DN. Shrinking it instead would average the noise away."""
    name = str(entry["array"])
    if name not in arrays:
        raise InputError(f"gallery.json names array '{name}', which gallery.npz lacks; {did_you_mean(name, arrays)}")
    picture = np.asarray(arrays[name])
    top, left = (max(0, (side - side_px) // 2) for side in picture.shape)
    picture = picture[top : top + side_px, left : left + side_px]
    return picture.astype(float) * (255.0 if picture.dtype.kind == "f" else 1.0)


def _spread(picture: np.ndarray, reference: np.ndarray) -> float:
    """Standard deviation of the change against the reference, DN; NaN where the shapes differ."""
    return float((picture - reference).std()) if picture.shape == reference.shape else float("nan")


@style.styled
def draw_chain(arrays: Mapping[str, np.ndarray], entries: Sequence[Mapping[str, Any]]) -> Drawing:
    """The chain in the order light meets it, each step with what it changed against the step before.

    Args:
        arrays: name -> (H, W), uint8 or float in [0, 1].
        entries: ``{"array", "title", "caption"}`` in order; the first is the input.

    Raises:
        InputError: an entry names an absent array.
    """
    import pandas as pd

    pictures = [_array(arrays, entry, CHAIN_PX) for entry in entries]
    cell_in = style.sheet_cell_in(len(entries))
    figure, axes = style.sheet(len(entries), [cell_in, cell_in], bottom_in=0.2, row_gaps_in=[0.08])
    rows = []
    changes = [after - before for before, after in itertools.pairwise(pictures)]
    span = max([float(np.percentile(np.abs(change), 99.5)) for change in changes if change.size] + [1.0])
    for number, (entry, picture) in enumerate(zip(entries, pictures, strict=True)):
        upper, lower = axes[0, number], axes[1, number]
        upper.imshow(picture, cmap="gray", vmin=0, vmax=255)
        style.bare(upper)
        title = str(entry["title"])[:1].upper() + str(entry["title"])[1:]
        upper.set_title(f"{number}  {title}" if number else title, pad=3)
        row = {"step": number, "title": title, "mean_dn": picture.mean(), "change_std_dn": float("nan")}
        if number == 0:
            lower.set_axis_off()
            lower.text(
                0.5, 0.5, f"change against\nthe step before,\ngrey = none,\n±{span:.3g} DN", ha="center", va="center",
                transform=lower.transAxes, fontsize=6.2, color=style.MUTED,
            )  # fmt: skip
        else:
            lower.imshow(changes[number - 1], cmap="gray", vmin=-span, vmax=span)
            style.bare(lower)
            row["change_std_dn"] = float(changes[number - 1].std())
            lower.set_xlabel(f"std {row['change_std_dn']:.2f} DN", fontsize=6.2, labelpad=2)
        rows.append(row)
    steps = [f"{row['title']} ({row['change_std_dn']:.2f} DN)" for row in rows[1:]]
    alt = f"One patch through the chain of image formation, the standard deviation of each change: {listing(steps)}."
    return Drawing(figure, alt, pd.DataFrame(rows))


@style.styled
def draw_effects(arrays: Mapping[str, np.ndarray], entries: Sequence[Mapping[str, Any]]) -> Drawing:
    """Effects down, levels across; beneath each patch the standard deviation of what it received itself.

    Args:
        arrays: name -> (H, W), uint8 or float in [0, 1].
        entries: ``{"array", "effect", "level_dn"}``.

    Raises:
        InputError: an entry names an absent array.
    """
    import pandas as pd

    effects = in_order((str(entry["effect"]) for entry in entries), EFFECTS)
    levels = sorted({float(entry["level_dn"]) for entry in entries})
    placed = {(str(entry["effect"]), float(entry["level_dn"])): _array(arrays, entry, EFFECTS_PX) for entry in entries}
    cell_in = style.sheet_cell_in(len(levels), margins_in=0.24)
    figure, axes = style.sheet(
        len(levels), [cell_in] * len(effects), left_in=0.22, bottom_in=0.16, row_gaps_in=[0.19] * (len(effects) - 1)
    )
    rows = []
    for across, level in enumerate(levels):
        axes[0, across].set_title(f"σ = {level:g} DN", pad=3)
        for down, effect in enumerate(effects):
            spot = axes[down, across]
            picture = placed.get((effect, level))
            style.bare(spot)
            if picture is None:
                spot.text(0.5, 0.5, "not run", ha="center", va="center", transform=spot.transAxes, color=style.MUTED)
                continue
            spot.imshow(picture, cmap="gray", vmin=0, vmax=255)
            clean = placed.get((effect, 0.0))
            added = _spread(picture, clean) if clean is not None else float("nan")
            rows.append({"effect": effect, "level_dn": level, "mean_dn": picture.mean(), "added_std_dn": added})
            if level > 0 and np.isfinite(added):
                spot.set_xlabel(f"{added:.1f} DN added", fontsize=5.8, labelpad=1.5)
    for down, effect in enumerate(effects):
        axes[down, 0].set_ylabel(word(effect), fontweight="bold", color=style.INK)
    alt = (
        f"The same patch under {listing(word(effect) for effect in effects)} noise at "
        f"{listing(f'{level:g}' for level in levels)} DN."
    )
    return Drawing(figure, alt, pd.DataFrame(rows))
