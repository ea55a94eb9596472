"""One small set of stage outputs, and the report built from it, shared by the report's tests."""

from __future__ import annotations

from pathlib import Path

import pytest
from report_makers import make_all

from pipeline.report.build import build
from pipeline.report.inputs import ReportInputs


@pytest.fixture(scope="session")
def report_inputs(tmp_path_factory: pytest.TempPathFactory) -> ReportInputs:
    """Stage outputs of one dataset and two noise estimators."""
    return make_all(tmp_path_factory.mktemp("stages"), ("sim",), ("pca", "bf"))


@pytest.fixture(scope="session")
def report_folder(report_inputs: ReportInputs, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report built from them."""
    folder = tmp_path_factory.mktemp("reports")
    build(report_inputs, folder)
    return folder
