"""Training frames for detectors: sharp pictures of *Sim* places that no evaluation frame shows.

Frame i is moment 0 to 3 (in turn) of viewpoint i of the split "train"; its streets, cars and people come from streams
with that name, so nothing in it occurs in the evaluation frames. Rendering costs about six seconds a frame on one
core, so frames are kept in a cache and a run that was stopped goes on with the missing ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.dependencies import closure
from pipeline.errors import InputError

MOMENTS = 4


@dataclass(frozen=True)
class SimFrames:
    """Frames and what is on them.

    Attributes:
        images: (N, H, W) uint8.
        boxes: per frame (M, 4) float32, x1 y1 x2 y2 of the visible part, pixels.
        labels: per frame (M,) str.
        visible: per frame (M,) float32, visible share of each object.
    """

    images: NDArray[np.uint8]
    boxes: list[NDArray[np.float32]]
    labels: list[NDArray[np.str_]]
    visible: list[NDArray[np.float32]]

    def __len__(self) -> int:
        return len(self.images)


def fingerprint() -> str:
    """Hash that changes with the code that renders the frames."""
    return closure.fingerprint(__name__)


def sim_frames(
    count: int,
    seed: int,
    cache: Path,
    *,
    first: int = 0,
    samples: int = 2,
    width_px: int = 896,
    height_px: int = 768,
    executor: Mapping[str, Any] | None = None,
) -> SimFrames:
    """Frames `first` .. `first` + `count` - 1, from the cache or rendered.

    Args:
        count: how many.
        seed: root of the streams.
        cache: folder outside of any stage's outputs.
        first: number of the first; validation frames follow the training frames.
        samples: N of N x N rays a pixel.
        width_px: width of a frame.
        height_px: height of a frame.
        executor: arguments of `pipeline.executor.run_map`.

    Raises:
        InputError: a picture in the cache is broken.
    """
    import cv2

    from pipeline import store
    from pipeline.executor import run_map

    folder = Path(cache) / f"sim-{fingerprint()}-{seed}-{samples}-{width_px}x{height_px}"
    numbers = range(first, first + count)
    missing = [
        number for number in numbers if not all((folder / f"{number:05d}.{kind}").is_file() for kind in ("json", "png"))
    ]
    size = {"width_px": width_px, "height_px": height_px}
    run_map(
        partial(_render, seed=seed, folder=folder, samples=samples, **size),
        missing,
        label="render Sim for training",
        **(executor or {}),
    )
    images, boxes, labels, visible = [], [], [], []
    for number in numbers:
        image = cv2.imread(str(folder / f"{number:05d}.png"), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise InputError(f"{folder / f'{number:05d}.png'}: not a readable picture; delete it to render it anew")
        images.append(image)
        rows = store.read_json(folder / f"{number:05d}.json")["boxes"]
        boxes.append(np.array([row["box"] for row in rows], np.float32).reshape(-1, 4))
        labels.append(np.array([row["label"] for row in rows], np.str_))
        visible.append(np.array([row["visible_fraction"] for row in rows], np.float32))
    return SimFrames(np.stack(images), boxes, labels, visible)


def _render(number: int, *, seed: int, folder: Path, samples: int, width_px: int, height_px: int) -> None:
    """Render one frame; the picture is written last, so it is there only with its boxes."""
    from pipeline import store
    from pipeline.scenes.dataset import Viewpoint, render

    frame = render(
        Viewpoint("train", number), number % MOMENTS, seed, samples=samples, width_px=width_px, height_px=height_px
    )
    store.write_json(folder / f"{number:05d}.json", {"boxes": [box.row() for box in frame.boxes]})
    store.write_image(folder / f"{number:05d}.png", frame.eight_bit())
