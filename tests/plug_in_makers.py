"""Third parties' packages: a module and the entry points that register its classes, on the import path."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline import detection
from pipeline.detection.base import Detections, each_image

SPOTS = """
import numpy as np
from pipeline.detection.base import Detections, each_image


class Spots:
    def __init__(self, side_px=30):
        self.side_px = side_px

    def detect(self, images):
        corners = [0.0, 0.0, float(self.side_px), float(self.side_px)]
        return [Detections.of([corners], [0.9], ["car"]) for _ in each_image(images)]
"""
"""A detector without weights."""


class Darkening:
    """A detector that halves the image it is given, in place, and whose score is the mean of what it was given."""

    def detect(self, images: list[NDArray[np.floating]]) -> list[Detections]:
        (picture,) = each_image(images)
        mean = float(picture.mean())
        picture /= 2
        return [Detections.of([[0, 0, 9, 9]], [mean], ["car"])]


def plug_in(folder: Path, monkeypatch: pytest.MonkeyPatch, module: str, text: str, **points: str) -> Path:
    """Install a module with entry points for the rest of a test.

    Args:
        folder: that goes onto the import path.
        monkeypatch: of the test.
        module: its name; one that an earlier test has imported under it is forgotten.
        text: its source.
        points: registry (``noise``) -> ``"name = module:Class"``.

    Returns:
        the module's file.
    """
    path = folder / f"{module}.py"
    path.write_text(text)
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("".join(f"[pipeline.{group}]\n{line}\n" for group, line in points.items()))
    sys.modules.pop(module, None)
    detection.opened.cache_clear()  # an earlier test's detector of the same name is kept open
    monkeypatch.syspath_prepend(folder)
    return path
