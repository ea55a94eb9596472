"""Blur estimation on recorded pictures: the paper's own datasets with its own kernels, measured by hand.

`camera-monitor blur record` measures and stores (`pipeline.recording.blur`); the figures and tables are those of
the section of blur.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pipeline.report import blur_records
from pipeline.report.blur_records import BlurRecord
from pipeline.report.display_names import ESTIMATORS, counted, in_order, listing, word
from pipeline.report.inputs import ReportInputs, mode_note, mode_of, published, relative_mtf
from pipeline.report.ledger import LedgerRow
from pipeline.report.sections import blur, blur_amae
from pipeline.report.sections.blur_amae import PAGE
from pipeline.report.spec import Block, Section
from pipeline.report.tables import as_recorded

if TYPE_CHECKING:
    import pandas as pd

TITLE = "Blur estimation on recorded pictures"


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
    fewer = {name: selected for name in record.estimators if (selected := record.measured_on(name)) != whole}
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
    settings = {name: selected for one in recordings for name, selected in one.provenance["blur"]["estimators"].items()}
    modes = {name: mode for name, selected in settings.items() if (mode := mode_of(selected))}
    sources = [
        {
            "dataset": one.dataset,
            "frames": len(one.provenance["frames"]),
            "patches": one.patches,
            "kernels": len(one.provenance["kernels"]),
            "estimators": "; ".join(map(word, in_order(one.estimators, ESTIMATORS))),
            "source": one.provenance["source"],
        }
        for one in recordings
    ]
    blocks: list[Block] = [PAGE.table("recorded_blur_sources", sources)]
    curves = [one.sharp for one in recordings if len(one.sharp)]
    if curves:
        paper = published(inputs, "uncorrupted_mtf.csv")
        drawing = blur.uncorrupted(pd.concat(curves, ignore_index=True), datasets, paper)
        blocks.append(PAGE.figure("recorded_uncorrupted_mtf", drawing, after=mode_note(modes, settings)))
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
                few = PAGE.text("few_frames", frames=len(one.provenance["frames"]))
                blocks.append(as_recorded(shown, *subsets(one), few))
    selected = summary[~summary["estimator"].isin({name for one in recordings for name in one.exact.values()})]
    beside = blur_amae.beside_the_best(selected, theirs, "")
    if beside is not None:
        counts = listing(f"{len(one.provenance['frames'])} of {word(one.dataset)}" for one in recordings)
        blocks.append(as_recorded(beside, PAGE.text("few_frames", frames=counts)))
    return Section("blur_recorded", TITLE, (PAGE.text("recorded"),), blocks)
