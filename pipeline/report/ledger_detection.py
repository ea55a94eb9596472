"""The ledger's own numbers of detection: AP by blur direction, and what the published regression is compared with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline.report import detection_results
from pipeline.report.inputs import ReportInputs, any_table

if TYPE_CHECKING:
    import pandas as pd

LABEL = "car"
SHARE_OF_STD_DEV = 0.2


def direction_ap(inputs: ReportInputs) -> pd.DataFrame | None:
    """AP of cars by noise, direction and length: of YOLOv7 where it has run, else of the first detector that has.

    Returns:
        sigma_dn, angle_deg, size_px, ap_percent.
    """
    found = [one for one in detection_results.read(inputs) if one.directions is not None and LABEL in one.labels]
    if not found:
        return None
    chosen = next((one for one in found if one.detector == "yolov7"), found[0])
    assert chosen.directions is not None
    table = chosen.directions[chosen.directions["label"] == LABEL]
    return table.rename(columns={"level_dn": "sigma_dn"})[["sigma_dn", "angle_deg", "size_px", "ap_percent"]]


def published_coefficients(inputs: ReportInputs) -> pd.DataFrame:
    """The published coefficients, each with a fifth of its printed standard deviation as tolerance.

    They are fitted to a grid that is printed to 0.1 points, which moves them by up to an eighth of it.
    """
    table = any_table(inputs.paper / "regression_coefficients.csv")
    return table.assign(tolerance=(SHARE_OF_STD_DEV * table["std_dev"]).fillna(0.0))
