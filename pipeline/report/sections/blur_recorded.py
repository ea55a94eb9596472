"""Blur estimation on recorded pictures: the paper's own datasets with its own kernels, measured by hand.

`camera-monitor blur record` measures and stores (`pipeline.report.recorded_blur`); the figures and tables are those of
the section of blur.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from pipeline.report import blur_records
from pipeline.report.blur_records import BlurRecord
from pipeline.report.display_names import ESTIMATORS, counted, in_order, listing, word
from pipeline.report.inputs import ReportInputs, mode_note, mode_of, published, relative_mtf
from pipeline.report.ledger import LedgerRow
from pipeline.report.sections import blur, blur_amae
from pipeline.report.spec import Block, Figure, Section
from pipeline.report.tables import Column, Table, named, table

if TYPE_CHECKING:
    import pandas as pd

TITLE = "Blur estimation on recorded pictures"
TEXT = (
    "Table I as above, on frames of the paper's own datasets and with the kernels its authors publish. These pictures "
    "are not part of the project: the numbers were measured earlier and are kept in reports/recorded with the SHA-256 "
    "of every picture, kernel and weight file. Whoever has the pictures repeats them by camera-monitor blur record."
)
FRAMES = "Frames are a few of each dataset; the paper takes 150."


def _recorded(shown: Table, notes: tuple[str, ...]) -> Table:
    """A table of the section of blur as one of recorded pictures, which no stage makes."""
    caption = f"{shown.caption.rstrip('.')} (recorded)."
    return replace(shown, name=f"recorded_{shown.name}", caption=caption, footnotes=notes, stage="")


def beside_exact(paper: pd.DataFrame | None, recordings: Sequence[BlurRecord]) -> pd.DataFrame | None:
    """The paper's Table I with PMP and GBB under the names of our exact programs, on datasets where these were run.

    Args:
        paper: columns dataset, estimator, and others.
        recordings: of blur.
    """
    if paper is None:
        return None
    names = {(one.dataset, theirs): name for one in recordings for theirs, name in one.exact.items()}
    pairs = zip(paper["dataset"], paper["estimator"], strict=True)
    return paper.assign(estimator=[names.get(pair, pair[1]) for pair in pairs])


def subsets(record: BlurRecord) -> list[str]:
    """A note on estimators that were run on fewer patches than the others, slow ones; none without them."""
    whole = record.measured_on("")
    fewer = {name: own for name in record.estimators if (own := record.measured_on(name)) != whole}
    words = [
        f"{word(name)} on {counted(patches, 'patch', 'patches')} of {counted(frames, 'frame')}"
        for name, (frames, patches) in fewer.items()
    ]
    return [f"{listing(words)}, the others on {whole[1]} of {whole[0]} frames."] if words else []


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section | None:
    """Blur estimation on every recorded dataset, or None where nothing was recorded."""
    import pandas as pd

    recordings = blur_records.read(inputs)
    if not recordings:
        return None
    datasets = [one.dataset for one in recordings]
    settings = {name: own for one in recordings for name, own in one.said["blur"]["estimators"].items()}
    modes = {name: mode for name, own in settings.items() if (mode := mode_of(own))}
    sources = [
        {
            "dataset": one.dataset,
            "frames": len(one.said["frames"]),
            "patches": one.patches,
            "kernels": len(one.said["kernels"]),
            "estimators": "; ".join(map(word, in_order(one.estimators, ESTIMATORS))),
            "source": one.said["source"],
        }
        for one in recordings
    ]
    columns = [
        named("dataset", "Dataset"),
        Column("frames", "Frames"),
        Column("patches", "Patches"),
        Column("kernels", "Kernels"),
        Column("estimators", "Estimators", wide=True),
        Column("source", "Source", wide=True),
    ]
    blocks: list[Block] = [
        table("recorded_blur_sources", "Recorded: pictures and kernels with their source.", sources, columns)
    ]
    curves = [one.sharp for one in recordings if len(one.sharp)]
    if curves:
        paper, slow = published(inputs, "uncorrupted_mtf.csv"), mode_note(modes, settings)
        caption = (
            "Recorded: uncorrupted datasets. Median (line) and range of the inliers (band) of the MTF over patches of "
            f"sharp frames. Dashed: the paper's medians, which it publishes for the horizontal direction. {slow}"
        ).rstrip()
        drawing = blur.uncorrupted(pd.concat(curves, ignore_index=True), datasets, paper)
        blocks.append(Figure("recorded_uncorrupted_mtf", drawing, caption))
    summary = pd.concat([one.summary for one in recordings], ignore_index=True)
    theirs = published(inputs, "blur_amae.csv")
    paper = beside_exact(theirs, recordings)
    relative = relative_mtf(summary)
    blocks += blur_amae.figures(summary, datasets, paper, lambda _: (), relative, "recorded", modes)
    for one in recordings:
        for is_calibrated in (False, True):
            if (one.summary["calibrated"] == is_calibrated).any():
                blurred = blur_amae.without_unknown_lenses(one.summary)
                shown = blur_amae.table_one(one.dataset, blurred, paper, is_calibrated, relative, modes)
                blocks.append(_recorded(shown, (*shown.footnotes, *subsets(one), FRAMES)))
    own = summary[~summary["estimator"].isin({name for one in recordings for name in one.exact.values()})]
    beside = blur_amae.beside_the_best(own, theirs)
    if beside is not None:
        blocks.append(_recorded(beside, (blur_amae.NOT_COUNTED, FRAMES)))
    return Section("blur_recorded", TITLE, (TEXT,), blocks)
