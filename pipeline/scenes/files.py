"""A rendered frame as files: the 8-bit picture, its boxes, and the linear radiance for exposure simulation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline import store

if TYPE_CHECKING:
    from pipeline.scenes.dataset import SimFrame


def write(frame: SimFrame, folder: Path, *, radiance: bool = True) -> Path:
    """Write ``NAME.png``, ``NAME.json`` and, where wanted, ``NAME.radiance.npz``.

    Args:
        frame: a rendered frame.
        folder: where to; made if absent.
        radiance: also the linear image, (H, W) float16 under the key ``radiance``; half precision keeps eleven bits,
            three more than the picture.

    Returns:
        path of the picture.
    """
    picture = folder / f"{frame.name}.png"
    store.write_image(picture, frame.eight_bit())
    described = {"boxes": [box.row() for box in frame.boxes], "exposure": frame.exposure, "gamma": frame.gamma}
    store.write_json(folder / f"{frame.name}.json", described)
    if radiance:
        store.write_arrays(folder / f"{frame.name}.radiance.npz", radiance=frame.radiance.astype(np.float16))
    return picture
