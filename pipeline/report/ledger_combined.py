"""Where the ledger's numbers of blur and noise at once come from; all that the paper prints of it is on Udacity."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline.report.inputs import ReportInputs, any_table, combined_tables, denoised_cells
from pipeline.report.ledger_sources import NOMINAL_FREQUENCIES

if TYPE_CHECKING:
    import pandas as pd

DATASET, OURS = "udacity", "spectral"
EXAMPLE_PX = 11.0


def photon_defocus(inputs: ReportInputs) -> pd.DataFrame | None:
    """AMAE of defocus in the presence of photon noise, raw as the paper's: sigma_dn, size_px, amae_percent."""
    cells = combined_tables(inputs)[0]
    own = cells[_ours(cells) & (cells["experiment"] == "photon_defocus") & (cells["filter_px"] == 0)]
    found = own.rename(columns={"level_dn": "sigma_dn"})[["sigma_dn", "size_px", "amae_percent"]]
    return found if len(found) else None


def photon_linear(inputs: ReportInputs) -> pd.DataFrame | None:
    """Curves of linear motion of 11 px in the presence of photon noise: series, sigma_dn, frequency, mtf.

    The paper's curves are means of horizontal and vertical of its diagonal kernel: their truth tells.
    """
    import pandas as pd

    curves = combined_tables(inputs)[2]
    own = curves[
        _ours(curves)
        & (curves["experiment"] == "photon_linear")
        & (curves["filter_px"] == 0)
        & (curves["axis"] == "HV")
        & (curves["size_px"] == EXAMPLE_PX)
        & (curves["angle_deg"] == 45)
    ]
    if own.empty:
        return None
    own = own.assign(frequency=[NOMINAL_FREQUENCIES[place] for place in own["place"]], sigma_dn=own["level_dn"])
    truth = own[own["level_dn"] == own["level_dn"].min()].assign(series="ground_truth", sigma_dn=float("nan"))
    parts = [truth.assign(mtf=truth["true_mtf"]), own.assign(series="cnn", mtf=own["median"])]
    return pd.concat(parts, ignore_index=True)[["series", "sigma_dn", "frequency", "mtf"]]


def improved(inputs: ReportInputs) -> pd.DataFrame | None:
    """Errors after smoothing by a disc: d2_px, d1_px, sigma_dn, and the errors in percent."""
    cells = denoised_cells(inputs)
    own = cells[_ours(cells) & (cells["filter_px"] > 0) & (cells["level_dn"] > 0)]
    names = {"filter_px": "d2_px", "size_px": "d1_px", "level_dn": "sigma_dn"}
    errors = ["mae_h_percent", "mae_v_percent", "amae_percent", "expected_amae_percent"]
    return own.rename(columns=names)[[*names.values(), *errors]] if len(own) else None


def _ours(table: pd.DataFrame) -> pd.Series:
    return (table["dataset"] == DATASET) & (table["estimator"] == OURS) & ~table["calibrated"]


def published(file: str, inputs: ReportInputs) -> pd.DataFrame:
    """The paper's side of an item, with the dataset it was measured on.

    Args:
        file: in the folder of published numbers.
        inputs: of the report.

    Raises:
        InputError: no such file.
    """
    from pipeline.errors import InputError

    path = inputs.paper / file
    if not path.exists():
        raise InputError(f"{path}: no such file of published numbers; restore data/paper from git")
    return any_table(path).assign(dataset=DATASET)
