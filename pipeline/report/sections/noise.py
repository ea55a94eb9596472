"""Noise estimation, by stages and on recorded frames: the paper's figure, medians, local maps, errors, abstentions.

Throughout, ``summary`` is a `pipeline.tables.NOISE_SUMMARY` and ``estimates`` a `NOISE_ESTIMATES`; ``seed`` is the root
of the bootstrap's random streams.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import NDArray

from pipeline.experiments.patch_errors import SATURATED, agreement, patch_errors, saturated_patches
from pipeline.experiments.recorded.frames import NOISE_FILE, records_with
from pipeline.report import style
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import EFFECTS, ESTIMATORS, counted, in_order, listing, word
from pipeline.report.figures import abstentions, legend_of
from pipeline.report.inputs import ReportInputs, published
from pipeline.report.ledger.sources import PAPER_EFFECTS
from pipeline.report.spec import Block, Figure, Section, as_recorded, pairs_of, runs_by_estimator
from pipeline.report.tables import Cell, Row, Table, estimate, ordered, reasons_of, totals, where

PAGE = Descriptions("noise")
PRESENT: style.Look = {"color": style.INK, "linewidth": 0.9, "linestyle": (0, (4, 2))}
DIAGONAL: style.Look = {"color": style.MUTED, "linewidth": 0.6}
SHOWN_PX = 260  # longest side of a map's frame inside the figure
OPACITY = 0.6  # of the map over the frame
TOP_PERCENTILE = 99.0  # of the noise added, shown in the last colour


def curves(summary: pd.DataFrame, datasets: Sequence[str]) -> style.Drawing:
    """The paper's figure: median and range of the inliers over the target level; datasets down, noise sources across.

    A dataset without numbers is shown as not run.
    """
    effects = in_order([*PAPER_EFFECTS, *summary["noise_source"]], EFFECTS)
    looks = style.series_looks(in_order(summary["estimator"], ESTIMATORS))
    # The bands are shown up to 40 DN; a single outlier must not flatten every panel.
    tops = [25.0, summary["target_sigma_dn"].max(), summary["median_dn"].max(), min(40.0, summary["maximum_dn"].max())]
    top = 5.0 * np.ceil(float(np.nanmax(tops)) / 5.0)
    right = max(25.0, summary["target_sigma_dn"].max())

    def levels(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        axes.plot([0, top], [0, top], zorder=1, **DIAGONAL)
        if len(rows):
            present = rows.groupby("target_sigma_dn")["clipped_median_dn"].median()
            axes.plot(present.index, present.to_numpy(), zorder=2, **PRESENT)

    highest = summary[summary["target_sigma_dn"] == summary["target_sigma_dn"].max()]
    present = highest["clipped_median_dn"]
    words = ordered(highest.groupby("estimator", as_index=False)["median_dn"].agg(["min", "max"]), estimator=looks)
    alt = PAGE.alt(
        "noise", words, datasets=listing(map(word, summary["dataset"].unique())), least=present.min(),
        most=present.max(), level=highest["target_sigma_dn"].iloc[0], abstained=int(summary["abstained"].sum()),
    )  # fmt: skip
    return PAGE.grid(
        "noise", summary, alt, looks,
        down=datasets, across=effects, under=levels, over=partial(abstentions, estimators=list(looks)),
        axes={"xlim": (0, right), "ylim": (0, top + 3), "yticks": np.arange(0, top + 1, 5),
              "xticks": np.arange(0, right + 1, 5)},
        legend=[*legend_of(looks), ("noise present", PRESENT), ("target level", DIAGONAL)],
        panel_in=style.TWO_COLUMNS_IN / len(effects) * 0.98,
    )  # fmt: skip


def _map_panel(axes: Axes, frame: NDArray[np.uint8], cells: NDArray[np.floating] | None, top: float) -> Any:
    picture, _ = style.shrunk(frame, SHOWN_PX)
    style.picture(axes, picture)
    height, width = picture.shape
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    if cells is None:
        return None
    return axes.imshow(
        np.ma.masked_invalid(cells), cmap="viridis", vmin=0, vmax=top, alpha=OPACITY,
        extent=(-0.5, width - 0.5, height - 0.5, -0.5),
    )  # fmt: skip


def maps(galleries: Sequence[tuple[Mapping[str, Any], Mapping[str, np.ndarray]]]) -> style.Drawing:
    """Rows: noise sources. Columns: the frame, the noise added, the noise estimated by each estimator.

    ``galleries``: estimator, effects and target standard deviation, and arrays ``<noise_source>_seen`` (H, W) uint8,
    ``_added`` and ``_found`` (h, w) DN; of one frame, with the same effects.
    """
    about, arrays = galleries[0]
    effects, columns = list(about["effects"]), 2 + len(galleries)
    height, width = arrays[f"{effects[0]}_seen"].shape
    tall = style.TWO_COLUMNS_IN / (columns + 0.25) * height / width
    figure = style.new_figure(style.TWO_COLUMNS_IN, len(effects) * (tall + 0.14) + 0.2)
    panels = figure.subplots(len(effects), columns, squeeze=False)
    rows: list[dict[str, Any]] = []
    for spots, noise_source in zip(panels, effects, strict=True):
        frame, added = arrays[f"{noise_source}_seen"], arrays[f"{noise_source}_added"]
        known = added[np.isfinite(added)]
        top = float(np.percentile(known, TOP_PERCENTILE)) if known.size else 1.0
        _map_panel(spots[0], frame, None, top)
        spots[0].set_ylabel(f"{word(noise_source)}, {about['target_sigma_dn']:g} DN")
        image = _map_panel(spots[1], frame, added, top)
        for spot, (of, maps_of) in zip(spots[2:], galleries, strict=True):
            estimated = maps_of[f"{noise_source}_found"]
            _map_panel(spot, frame, estimated, top)
            rows.append({"noise_source": noise_source, "estimator": of["estimator"], **agreement(added, estimated)})
        figure.colorbar(image, ax=list(spots), label="σ [DN]", fraction=0.03, pad=0.01)
    titles = ["Frame", "Noise added", *(f"Estimated by {word(of['estimator'])}" for of, _ in galleries)]
    for axes, title in zip(panels[0], titles, strict=True):
        axes.set_title(title, loc="left")
    patterns = [f", correlation {row['correlation']:.2f}" if np.isfinite(row["correlation"]) else "" for row in rows]
    values = pd.DataFrame(rows)
    return style.Drawing(figure, PAGE.alt("noise_maps", values.assign(pattern=patterns)), values)


def _maps(inputs: ReportInputs) -> Iterator[Figure]:
    """Local noise over a frame, of every dataset whose stage stored maps."""
    stored = inputs.galleries("noise", "maps", ("frame", "effects", "target_sigma_dn"))
    for dataset in in_order(stored, inputs.datasets):
        shown = sorted(stored[dataset], key=lambda pair: str(pair[0]["estimator"]))
        stages = [f"noise@{dataset}-{about['estimator']}" for about, _ in shown]
        yield PAGE.figure("noise_maps", maps(shown), stages, dataset=dataset)


def medians(dataset: str, summary: pd.DataFrame, reference: pd.DataFrame) -> Table:
    """Median estimates of one dataset: a row for each noise source and level, a column for each estimator.

    ``reference`` is by the authors' program.
    """
    keys = ["dataset", "noise_source", "target_sigma_dn", "estimator"]
    selected = ordered(where(summary, dataset=dataset), noise_source=EFFECTS, target_sigma_dn=())
    selected = selected.assign(inliers=selected["count"] - selected["rejected"])
    selected = selected.merge(reference.drop_duplicates(keys)[[*keys, "sigma_dn"]], how="left", on=keys)
    levels = selected.groupby(keys[1:3])[["unclipped_median_dn", "clipped_median_dn"]].transform("median")
    selected = selected.assign(added_dn=levels["unclipped_median_dn"], present_dn=levels["clipped_median_dn"])
    return PAGE.table("noise", selected, also=["code"] if selected["sigma_dn"].notna().any() else [], dataset=dataset)


def single_patches(estimates: pd.DataFrame, seed: int) -> Table:
    """Error of single patches against both ground truths, coverage of the intervals, abstentions."""

    def where_counted(cell: Callable[[Row], Cell], quantity: str) -> Callable[[Row], Cell]:
        return lambda row: cell(row) if np.isfinite(row.get(f"{quantity}_count", np.nan)) else None

    names = ("present_dn", "added_dn", "coverage_percent", "clean_percent")
    cells = {
        name: where_counted(estimate(name, f"{name}_low", f"{name}_high", f"{name}_count"), name) for name in names
    }
    cells["width_dn"] = where_counted(lambda row: row["width_dn"], "coverage_percent")
    return PAGE.table("noise_patches", patch_errors(estimates, seed), cells=cells)


def saturated(estimates: pd.DataFrame, seed: int) -> Table | None:
    """Estimates at the highest level in patches that are nearly all black or white; None without such patches."""
    cells = saturated_patches(estimates, seed)
    if cells.empty:
        return None
    return PAGE.table("noise_saturated", cells, level=float(cells["target_sigma_dn"].iloc[0]), percent=100 * SATURATED)


def section(inputs: ReportInputs) -> Section:
    """Noise estimation on every dataset."""
    summary, estimates = inputs.result("noise_summary"), inputs.result("noise_estimates")
    known = pairs_of(inputs.recorded_result("noise_summary"))
    runs = runs_by_estimator("Noise", "noise", pairs_of(summary), inputs, recorded=known)
    if summary.empty:
        return PAGE.section([], runs)
    stages = sorted(f"noise@{dataset}-{name}" for dataset, name in pairs_of(summary))
    datasets, reference = in_order(summary["dataset"], inputs.datasets), published(inputs, "noise_reference.csv")
    sums = totals(summary, ["dataset", "estimator"])
    blocks: list[Block | None] = [
        PAGE.figure("noise", curves(summary, datasets), stages),
        *(medians(name, summary, reference) for name in datasets),
        *_maps(inputs),
        single_patches(estimates, inputs.seed),
        saturated(estimates, inputs.seed),
        PAGE.table("noise_abstentions", sums, cells={"reasons": reasons_of(estimates)}),
    ]
    return PAGE.section(blocks, runs)


def recorded(inputs: ReportInputs) -> Section | None:
    """Noise estimation on frames recorded by ``camera-monitor record noise-levels``, or None without a record."""
    records = records_with(inputs.recorded, NOISE_FILE)
    if not records:
        return None
    summary, datasets = inputs.recorded_result("noise_summary"), [one.dataset for one in records]
    counts = [
        f"{word(one.dataset)}: {counted(len(one.frames), 'frame')},"
        f" {counted(int(one.frames['noise_tiles'].sum()), 'tile')} of 128 px"
        for one in records
    ]
    reference = published(inputs, "noise_reference.csv")
    blocks: list[Block | None] = [
        PAGE.table("recorded_noise_sources", [one.described("noise_tiles") for one in records]),
        as_recorded(PAGE.figure("noise", curves(summary, datasets), after=f"{'; '.join(counts)}.")),
        *(as_recorded(medians(dataset, summary, reference)) for dataset in datasets),
    ]
    return PAGE.section(blocks, key="noise_recorded")
