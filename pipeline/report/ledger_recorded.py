"""What recorded measurements of blur add to the ledger: numbers on the paper's own datasets, which no stage needs.

A run of one's own on KITTI or Udacity wins over the record. The paper's Sim is the authors' own: a record of their
frames wins over the Sim rendered here, which cannot be compared.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline.blur.evaluation import SHARP
from pipeline.report import blur_records, ledger_sources
from pipeline.report.inputs import ReportInputs
from pipeline.report.wording import PAPER_NAMES

if TYPE_CHECKING:
    import pandas as pd


def _paper_name(dataset: str) -> str:
    return PAPER_NAMES.get(dataset, dataset)


def authors_frames(dataset: str, estimator: str, inputs: ReportInputs) -> bool:
    """Whether an estimator was recorded on the very frames that the paper calls by this name, ours being others."""
    found = blur_records.estimators(inputs)
    return any(estimator in found[own] for own, name in PAPER_NAMES.items() if name == dataset and own in found)


def blur_amae(inputs: ReportInputs) -> pd.DataFrame | None:
    """`pipeline.report.ledger_sources.blur_amae` and the records'."""
    parts = []
    for one in blur_records.read(inputs):
        raw = one.summary[~one.summary["calibrated"] & (one.summary["kind"] != SHARP)]
        parts.append(raw.rename(columns={"kind": "blur"}))
    columns = ["dataset", "estimator", "blur", "size_px", "amae_percent"]
    return _joined(ledger_sources.blur_amae(inputs), [part[columns] for part in parts])


def uncorrupted(inputs: ReportInputs) -> pd.DataFrame | None:
    """`pipeline.report.ledger_sources.uncorrupted` and the records'."""
    parts = [ledger_sources.horizontal(one.sharp) for one in blur_records.read(inputs)]
    return _joined(ledger_sources.uncorrupted(inputs), parts)


def _joined(own: pd.DataFrame | None, recorded: list[pd.DataFrame]) -> pd.DataFrame | None:
    """Rows of our stages and of records under the paper's names, one of the two for each dataset and estimator."""
    import pandas as pd

    if not recorded:
        return own
    found = pd.concat(recorded, ignore_index=True)
    is_authors = found["dataset"].isin(list(PAPER_NAMES)).to_numpy()
    found = found.assign(dataset=found["dataset"].map(_paper_name))
    if own is None:
        return found
    kept = found[is_authors | ~_pairs(found).isin(_pairs(own)).to_numpy()]
    return pd.concat([own[~_pairs(own).isin(_pairs(kept)).to_numpy()], kept], ignore_index=True)


def _pairs(table: pd.DataFrame) -> pd.Series:
    return table["dataset"].astype(str) + " " + table["estimator"].astype(str)
