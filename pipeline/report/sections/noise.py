"""Noise estimation: the paper's figure, medians, local maps, errors of single patches, and abstentions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.errors import InputError
from pipeline.experiments.patch_errors import SATURATED, agreement, patch_errors, saturated_patches
from pipeline.report import style
from pipeline.report.descriptions import Cells, Descriptions
from pipeline.report.display_names import DATASETS, EFFECTS, ESTIMATORS, in_order, listing, word
from pipeline.report.figures import Facet, abstentions, lines, small_multiples
from pipeline.report.frame_records import NOISE_FILE, joined
from pipeline.report.inputs import ReportInputs, described, members, noise_tables, optional, paper_table
from pipeline.report.ledger import LedgerRow
from pipeline.report.spec import Block, Section, missing, overview
from pipeline.report.style import Drawing
from pipeline.report.tables import Cell, Estimate, Row, Table, estimate, ordered, pivot, records

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

STAGE = "noise@{dataset}-{estimator}"
PAGE = Descriptions("noise")
PAPER_EFFECTS = ("photon", "dcsn", "readout", "combined")
PRESENT: style.Look = {"color": style.INK, "linewidth": 0.9, "linestyle": (0, (4, 2))}
DIAGONAL: style.Look = {"color": style.MUTED, "linewidth": 0.6}
SHOWN_PX = 260  # longest side of a map's frame inside the figure
OPACITY = 0.6  # of the map over the frame
TOP_PERCENTILE = 99.0  # of the noise added, shown in the last colour


@style.styled
def curves(summary: pd.DataFrame, datasets: Sequence[str]) -> Drawing:
    """The paper's figure: median and range of the inliers over the target level; datasets down, noise sources across.

    Args:
        summary: `pipeline.tables.NOISE_SUMMARY`.
        datasets: rows of the figure; one without numbers is shown as not run.
    """
    effects = in_order([*PAPER_EFFECTS, *summary["noise_source"]], EFFECTS)
    looks = style.series_looks(in_order(summary["estimator"], ESTIMATORS))
    # The bands are shown up to 40 DN; a single outlier must not flatten every panel.
    tops = [25.0, summary["target_sigma_dn"].max(), summary["median_dn"].max(), min(40.0, summary["maximum_dn"].max())]
    top = 5.0 * np.ceil(float(np.nanmax(tops)) / 5.0)
    right = max(25.0, summary["target_sigma_dn"].max())

    def panel(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        axes.plot([0, top], [0, top], zorder=1, **DIAGONAL)
        if rows.empty:
            return
        present = rows.groupby("target_sigma_dn")["clipped_median_dn"].median()
        axes.plot(present.index, present.to_numpy(), zorder=2, **PRESENT)
        band = ("minimum_dn", "maximum_dn")
        lines(axes, rows, "estimator", looks, "target_sigma_dn", "median_dn", band=band, part="median", key=key)
        counts = rows.groupby("estimator")[["abstained", "count"]].sum().to_dict("index")
        pairs = {name: (int(one["abstained"]), int(one["abstained"] + one["count"])) for name, one in counts.items()}
        abstentions(axes, {name: pairs[name] for name in looks if name in pairs}, key)

    columns = [
        "dataset",
        "noise_source",
        "estimator",
        "target_sigma_dn",
        "clipped_median_dn",
        "median_dn",
        "minimum_dn",
        "maximum_dn",
    ]
    columns += ["unclipped_median_dn", "low_dn", "high_dn", "count", "rejected", "abstained"]
    return small_multiples(
        summary, Facet("dataset", datasets), Facet("noise_source", effects), panel,
        x="noise level σ [DN]", y="estimated σ [DN]", alt=_curves_alt(summary, list(looks)),
        axes={"xlim": (0, right), "ylim": (0, top + 3), "yticks": np.arange(0, top + 1, 5),
              "xticks": np.arange(0, right + 1, 5)},
        legend=[*((word(name), look) for name, look in looks.items()), ("noise present", PRESENT),
                ("target level", DIAGONAL)],
        values=summary[columns].sort_values(columns[:4]), series=style.switches(looks),
        panel_in=style.TWO_COLUMNS_IN / len(effects) * 0.98, margin_in=0.45,
    )  # fmt: skip


def _curves_alt(summary: pd.DataFrame, estimators: Sequence[str]) -> str:
    if summary.empty:
        return "Noise estimation: not run."
    highest = summary[summary["target_sigma_dn"] == summary["target_sigma_dn"].max()]
    medians = highest.groupby("estimator")["median_dn"].agg(["min", "max"])
    words = [f"{word(name)} {medians['min'][name]:.1f} to {medians['max'][name]:.1f}" for name in estimators]
    present = f"{highest['clipped_median_dn'].min():.1f} to {highest['clipped_median_dn'].max():.1f}"
    return (
        f"Estimated noise over the target level, for {listing(word(name) for name in summary['dataset'].unique())}. "
        f"At {highest['target_sigma_dn'].iloc[0]:g} DN, where {present} DN are present, the medians over the panels "
        f"are "
        f"{listing(words)} DN; {int(summary['abstained'].sum()):,} estimates were abstained from."
    )


@dataclass(frozen=True)
class NoiseMaps:
    """Maps of one frame by one estimator.

    Attributes:
        estimator: its name.
        arrays: ``<noise_source>_seen`` (H, W) uint8, ``<noise_source>_added`` and ``<noise_source>_found`` (h, w) DN.
        effects: in the order shown.
        target_sigma_dn: target standard deviation over the frame.
    """

    estimator: str
    arrays: Mapping[str, np.ndarray]
    effects: Sequence[str]
    target_sigma_dn: float

    def of(self, noise_source: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Frame, noise added and noise estimated under one noise source.

        Raises:
            InputError: an array is missing.
        """
        names = [f"{noise_source}_{part}" for part in ("seen", "added", "found")]
        absent = [name for name in names if name not in self.arrays]
        if absent:
            raise InputError(f"noise maps by {self.estimator}: missing {', '.join(absent)}; run the stage noise again")
        frame, added, estimated = (self.arrays[name] for name in names)
        return frame, added, estimated


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


@style.styled
def maps(galleries: Sequence[NoiseMaps]) -> Drawing:
    """Rows: noise sources. Columns: the frame, the noise added, the noise estimated by each estimator.

    Args:
        galleries: of one frame, at least one; all with the same effects.

    Raises:
        InputError: an array is missing.
    """
    import pandas as pd

    effects, columns = list(galleries[0].effects), 2 + len(galleries)
    height, width = galleries[0].of(effects[0])[0].shape
    tall = style.TWO_COLUMNS_IN / (columns + 0.25) * height / width
    figure = style.new_figure(style.TWO_COLUMNS_IN, len(effects) * (tall + 0.14) + 0.2)
    panels = figure.subplots(len(effects), columns, squeeze=False)
    rows: list[dict[str, Any]] = []
    for down, noise_source in enumerate(effects):
        frame, added, _ = galleries[0].of(noise_source)
        known = added[np.isfinite(added)]
        top = float(np.percentile(known, TOP_PERCENTILE)) if known.size else 1.0
        _map_panel(panels[down, 0], frame, None, top)
        panels[down, 0].set_ylabel(f"{word(noise_source)}, {galleries[0].target_sigma_dn:g} DN")
        image = _map_panel(panels[down, 1], frame, added, top)
        for across, one in enumerate(galleries):
            estimated = one.of(noise_source)[2]
            _map_panel(panels[down, 2 + across], frame, estimated, top)
            rows.append({"noise_source": noise_source, "estimator": one.estimator, **agreement(added, estimated)})
        figure.colorbar(image, ax=list(panels[down]), label="σ [DN]", fraction=0.03, pad=0.01)
    titles = ["Frame", "Noise added", *(f"Estimated by {word(one.estimator)}" for one in galleries)]
    for axes, title in zip(panels[0], titles, strict=True):
        axes.set_title(title, loc="left")
    words = []
    for row in rows:
        pattern = f", correlation {row['correlation']:.2f}" if np.isfinite(row["correlation"]) else ""
        words.append(
            f"{word(row['noise_source'])} by {word(row['estimator'])}: mean error {row['mean_error_dn']:.2f} DN about "
            f"a "
            f"median of {row['unclipped_median_dn']:.1f} DN{pattern}"
        )
    alt = f"Local noise over one frame, added and estimated cell by cell. {'; '.join(words)}."
    return Drawing(figure, alt, pd.DataFrame(rows))


def _maps(inputs: ReportInputs) -> list[Block]:
    """Local noise over a frame, of every dataset whose stage stored maps."""
    galleries: dict[str, list[tuple[NoiseMaps, str]]] = {}
    for folder in members(inputs.noise, inputs.noise_members):
        about = described(folder, "maps.json", ("dataset", "estimator", "frame", "effects", "target_sigma_dn"))
        if about is not None:
            one = NoiseMaps(
                about["estimator"], optional(folder, "maps.npz") or {}, about["effects"], about["target_sigma_dn"]
            )
            galleries.setdefault(about["dataset"], []).append((one, about["frame"]))
    blocks: list[Block] = []
    for dataset in in_order(galleries, inputs.datasets):
        pairs = sorted(galleries[dataset], key=lambda pair: pair[0].estimator)
        if len({(frame, tuple(one.effects), one.target_sigma_dn) for one, frame in pairs}) > 1:
            raise InputError(f"noise maps of '{dataset}' show different frames; run the stage noise again for all")
        stages = [STAGE.format(dataset=dataset, estimator=one.estimator) for one, _ in pairs]
        drawing = maps([one for one, _ in pairs])
        blocks.append(PAGE.figure("noise_maps", drawing, stages, name="noise_maps_{dataset}", dataset=dataset))
    return blocks


def medians(dataset: str, summary: pd.DataFrame, reference: pd.DataFrame | None) -> Table:
    """Median estimates of one dataset: a row for each noise source and level, a column for each estimator.

    Args:
        dataset: name.
        summary: `pipeline.tables.NOISE_SUMMARY`.
        reference: columns dataset, noise_source, target_sigma_dn, estimator, sigma_dn: by the authors' program.
    """
    keys = ["dataset", "noise_source", "target_sigma_dn", "estimator"]
    selected = ordered(summary[summary["dataset"] == dataset], noise_source=EFFECTS, target_sigma_dn=())
    selected = selected.assign(inliers=selected["count"] - selected["rejected"])
    if reference is not None:
        selected = selected.merge(reference.drop_duplicates(keys)[[*keys, "sigma_dn"]], how="left", on=keys)
    levels = selected.groupby(keys[1:3])[["unclipped_median_dn", "clipped_median_dn"]].transform("median")
    selected = selected.assign(added_dn=levels["unclipped_median_dn"], present_dn=levels["clipped_median_dn"])
    cell = estimate("median_dn", "low_dn", "high_dn", "inliers", "sigma_dn")
    rows = pivot(selected, ["noise_source", "target_sigma_dn", "added_dn", "present_dn"], "estimator", cell)
    cells = [cell for row in rows for cell in row.values()]
    known = any(isinstance(cell, Estimate) and cell.reference is not None for cell in cells)
    across = {name: word(name) for name in in_order(selected["estimator"], ESTIMATORS)}
    return PAGE.table("noise", rows, across=across, also=["code"] if known else [], dataset=dataset)


def single_patches(estimates: pd.DataFrame, seed: int) -> Table:
    """Error of single patches against both ground truths, coverage of the intervals, abstentions.

    Args:
        estimates: `pipeline.tables.NOISE_ESTIMATES`.
        seed: root of the bootstrap's random streams.
    """
    errors = ordered(patch_errors(estimates, seed), dataset=DATASETS, estimator=ESTIMATORS, noise_source=EFFECTS)
    has_interval = "coverage_percent" in errors

    def quantity(name: str) -> Callable[[Row], Cell]:
        whole = estimate(name, f"{name}_low", f"{name}_high", f"{name}_count")
        return lambda row: whole(row) if np.isfinite(row.get(f"{name}_count", np.nan)) else None

    def width(row: Row) -> Cell:
        return row["width_dn"] if has_interval and np.isfinite(row["coverage_percent_count"]) else None

    quantities = ("present_dn", "added_dn", "coverage_percent", "clean_percent")
    cells = {name: quantity(name) for name in quantities} | {"width_dn": width}
    return PAGE.table("noise_patches", errors, cells=cells)


def saturated(estimates: pd.DataFrame, seed: int) -> Table | None:
    """Estimates at the highest level in patches that are nearly all black or white; None without such patches.

    Args:
        estimates: `pipeline.tables.NOISE_ESTIMATES`.
        seed: root of the bootstrap's random streams.
    """
    cells = saturated_patches(estimates, seed)
    if cells.empty:
        return None
    index = ["dataset", "noise_source", "patches", "added_dn", "present_dn"]
    rows = pivot(
        ordered(cells, dataset=DATASETS, noise_source=EFFECTS), index, "estimator",
        estimate("median_dn", "low_dn", "high_dn", "count"),
    )  # fmt: skip
    across = {name: word(name) for name in in_order(cells["estimator"], ESTIMATORS)}
    level = float(cells["target_sigma_dn"].iloc[0])
    return PAGE.table("noise_saturated", rows, across=across, level=level, percent=100 * SATURATED)


def _abstentions(summary: pd.DataFrame, estimates: pd.DataFrame) -> Table:
    def reasons(row: Row) -> str:
        selected = (estimates["dataset"] == row["dataset"]) & (estimates["estimator"] == row["estimator"])
        counts = estimates.loc[selected & estimates["abstained"], "reason"].value_counts().sort_index()
        return ", ".join(f"{reason}: {count:,}" for reason, count in counts.items())

    sums = summary.groupby(["dataset", "estimator"], sort=False, as_index=False)[["count", "rejected", "abstained"]]
    cells: Cells = {"asked": lambda row: int(row["count"] + row["abstained"]), "reasons": reasons}
    return PAGE.table("noise_abstentions", sums.sum(), cells=cells)


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section:
    """Noise estimation on every dataset."""
    summary, estimates = noise_tables(inputs)
    recorded = joined(inputs, NOISE_FILE)
    ran = {(row["dataset"], row["estimator"]) for row in records(summary[["dataset", "estimator"]])}
    estimators = in_order([*(estimator for _, estimator in ran), *recorded["estimator"]], ESTIMATORS)
    runs = [
        run
        for estimator in estimators or ["<estimator>"]
        for run in overview(
            f"Noise by {word(estimator)}", f"noise@{{dataset}}-{estimator}",
            [dataset for dataset, name in ran if name == estimator], inputs,
            recorded=recorded.loc[recorded["estimator"] == estimator, "dataset"].unique(),
        )
    ]  # fmt: skip
    blocks: list[Block] = []
    if not summary.empty:
        stages = sorted(STAGE.format(dataset=dataset, estimator=estimator) for dataset, estimator in ran)
        datasets = in_order(summary["dataset"], inputs.datasets)
        blocks.append(PAGE.figure("noise", curves(summary, datasets), stages))
        reference = paper_table(inputs, "noise_reference.csv")
        blocks += [medians(name, summary, reference) for name in datasets]
        blocks += _maps(inputs)
        blocks.append(single_patches(estimates, inputs.seed))
        clipped = saturated(estimates, inputs.seed)
        blocks += [] if clipped is None else [clipped]
        blocks.append(_abstentions(summary, estimates))
    return Section("noise", "Noise estimation", (), [*blocks, *missing("Noise estimation", runs)], runs)
