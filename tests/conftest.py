"""Shared test set-up: where the reference data lies, if it does, and derandomised property tests."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # one thread per test process, as in the pipeline's workers; before NumPy loads

import parsed_once  # noqa: E402
import pytest  # noqa: E402
from hypothesis import HealthCheck, settings  # noqa: E402

import pipeline  # noqa: E402, F401  pins the numerical libraries, before anything loads them

SLOW = [HealthCheck.too_slow]  # on a busy machine drawing takes long, which is no failure
settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=40, suppress_health_check=SLOW)
settings.register_profile("fuzz", derandomize=False, deadline=None, max_examples=1000, suppress_health_check=SLOW)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

LONGEST = (
    "test_sweeps", "test_determinism", "test_package", "test_report_detection", "test_recording_blur", "test_recorded",
    "test_executor", "test_recorded_detection", "test_other_processor", "test_recorded_blur", "test_accessibility",
    "test_experiments_calibrate", "test_dvc_at_once", "test_cli_bad_inputs", "test_config_compose", "test_report_page",
    "test_blur_camera_calibration", "test_blur_camera_correction", "test_blur_blind", "test_blur_fused",
    "test_cli_commands_health", "test_blur_ablation", "test_dvc_experiment", "test_cli_commands_watch",
    "test_scenes_dataset",
)  # fmt: skip
"""The longest files: begun first, so that with several workers none of them runs alone at the end."""

SHARED = Path(__file__).resolve().parents[2] / "shared"

parsed_once.install()


def pytest_addoption(parser: pytest.Parser) -> None:
    """The option by which nothing is left out for its length."""
    parser.addoption("--full", action="store_true", help="run what takes longest as well")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what ``--full`` runs, and put the longest files first; otherwise the order stays."""
    if not config.getoption("--full"):
        for item in items:
            for marker in item.iter_markers("full"):
                item.add_marker(pytest.mark.skip(reason=f"{marker.args[0]}; run with --full"))
    rank = {name: index for index, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path.stem, len(rank)))


def pytest_collection_finish() -> None:
    """Spare the garbage collector the modules and tests that stay till the end: some three percent of the time."""
    gc.freeze()


@pytest.fixture
def shared() -> Path:
    """The folder of reference data, or a skip that says it is absent."""
    if not SHARED.is_dir():
        pytest.skip("reference data absent: ../shared is not beside the checkout")
    return SHARED


@pytest.fixture(scope="module")
def remembered_compositions() -> Iterator[None]:
    """Within a module, `composed.remembered`."""
    import composed  # which imports much that other tests need not

    with composed.remembered():
        yield
