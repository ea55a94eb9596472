"""What the frames of a dataset hold, by hashes, so that what depends on a dataset's index follows an edit of it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.store import file_sha256

if TYPE_CHECKING:
    from pipeline.datasets.frame import Frame


def content_of(frames: Sequence[Frame]) -> dict[str, dict[str, Any]]:
    """SHA-256 of all that experiments read of frames.

    Args:
        frames: of one dataset.

    Returns:
        name of a frame -> ``picture``, ``previous`` (its preceding pictures, oldest first) and ``labels`` (of its boxes
        as they are read: every field of `pipeline.datasets.frame.Box`). A file that cannot be read has the reason in
        place of its hash: what opens it refuses it.
    """
    return {
        frame.name: {
            "picture": _hash(frame.path),
            "previous": [_hash(path) for path in frame.previous],
            "labels": _labels_hash(frame),
        }
        for frame in frames
    }


def _hash(path: Path) -> str:
    try:
        return file_sha256(path)
    except OSError as error:
        return f"not readable: {error.strerror}"


def _labels_hash(frame: Frame) -> str:
    rows = [astuple(box) for box in frame.boxes]
    # Readers of third parties may give numbers of NumPy, which JSON does not know.
    return hashlib.sha256(json.dumps(rows, default=str).encode()).hexdigest()
