"""Shared test set-up: where the reference data lies, if it does, and derandomised property tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=40)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture
def shared() -> Path:
    """The folder of reference data, or a skip that says it is absent."""
    if not SHARED.is_dir():
        pytest.skip("reference data absent: ../shared is not beside the checkout")
    return SHARED
