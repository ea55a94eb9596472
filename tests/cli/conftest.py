"""What pages and files of `health` show of frames, for tests of something else."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.cli.health import files


@pytest.fixture
def drawn() -> None:
    """Frames are drawn with their maps, though the module uses `plain_pictures`."""


@pytest.fixture
def plain_pictures(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames are shown without their maps, whose plots take half of the time of a run on a few frames."""
    if "drawn" not in request.fixturenames:
        monkeypatch.setattr(files, "_draw", lambda image, condition: np.dstack([np.uint8(255 * image)] * 3))
