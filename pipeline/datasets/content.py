"""What the frames of a dataset hold, by hashes, so that what depends on a dataset's index follows an edit of it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import astuple
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
        as they are read: every field of `pipeline.datasets.frame.Box`).

    Raises:
        OSError: a picture cannot be read.
    """
    return {
        frame.name: {
            "picture": file_sha256(frame.path),
            "previous": [file_sha256(path) for path in frame.previous],
            "labels": hashlib.sha256(json.dumps([astuple(box) for box in frame.boxes]).encode()).hexdigest(),
        }
        for frame in frames
    }
