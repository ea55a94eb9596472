"""Frame, patches and measurements of the small combined experiment, for all its tests."""

import pytest
from combined_cases import measured
from data_makers import make_folder

from pipeline import datasets
from pipeline.datasets.patches import Patch


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    root = make_folder(tmp_path_factory.mktemp("frames"), 1)
    return datasets.open_dataset("folder", "mine", root).frames()[0]


@pytest.fixture(scope="module")
def patches():
    return [Patch(40, 128, 192), Patch(200, 60, 192), Patch(10, 10, 192)]


@pytest.fixture(scope="module")
def measurements(frame, patches):
    return measured(frame, patches)
