"""Frames and the patches of them that an experiment measures, from a dataset or from its stored index."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.datasets.frame import Frame
from pipeline.datasets.patches import BLUR_PX, NOISE_PX, Patch
from pipeline.errors import InputError
from pipeline.experiments.condition import QUANTITIES, Quantity

if TYPE_CHECKING:
    from pipeline.datasets.dataset import Dataset
    from pipeline.datasets.settings import DatasetSettings

PURPOSES: Mapping[Quantity, str] = {"mtf": "blur", "sigma_dn": "noise"}
"""Quantity -> purpose of its patches in the index: 192 px on objects, or 128 px tiles."""

WITHOUT: Mapping[Quantity, str] = {
    "mtf": f"no frame has a patch for blur, {BLUR_PX} px around a labelled object; see its labels",
    "sigma_dn": "no frame has a tile for noise; set noise.tile_px smaller",
}


@dataclass(frozen=True)
class TestFrame:
    """A frame and where it is measured.

    Attributes:
        frame: of a dataset.
        patches: quantity -> patches it is estimated on; a quantity that is missing is not estimated.
        fold: of the frame, for methods with calibrations.
    """

    frame: Frame
    patches: Mapping[Quantity, Sequence[Patch]]
    fold: int = 0

    __test__ = False  # no test case of pytest


def of_dataset(
    dataset: Dataset,
    quantity: Quantity = "mtf",
    per_frame: int | None = None,
    *,
    patch_px: int = BLUR_PX,
    tile_px: int = NOISE_PX,
) -> list[TestFrame]:
    """The usable frames of a dataset with their patches.

    Args:
        dataset: an opened dataset.
        quantity: to be estimated.
        per_frame: patches of each frame at most, evenly spread; None takes all.
        patch_px: side of a patch for the MTF.
        tile_px: side of a tile for noise.

    Raises:
        InputError: no frame has a patch, too many frames are bad (`pipeline.datasets.index.index`), or an argument is
            out of range.
    """
    from pipeline.datasets.index import index

    check_quantity(quantity)
    if per_frame is not None and per_frame < 1:
        raise InputError(f"per_frame={per_frame}: expected at least 1, or None for every patch")
    result = index(dataset, patch_px=patch_px, tile_px=tile_px)
    patches = result.patches_for(PURPOSES[quantity], per_frame)
    return with_patches(result.usable, {quantity: patches}, f"dataset '{dataset.name}'")


def of_index(
    folder: Path, name: str, section: DatasetSettings, per_frame: Mapping[Quantity, int | None]
) -> list[TestFrame]:
    """The frames of a stored index with their patches.

    Args:
        folder: where the stage `index` wrote.
        name: the dataset's name.
        section: its section of the configuration.
        per_frame: quantity to be estimated -> patches of each frame at most, evenly spread; None takes all. Frames
            without a patch of the first quantity are left out.

    Raises:
        InputError: no frame has a patch, or an unknown quantity.
    """
    from pipeline.datasets.index import indexed_frames, indexed_patches

    for quantity in per_frame:
        check_quantity(quantity)
    patches = {quantity: indexed_patches(folder, PURPOSES[quantity], count) for quantity, count in per_frame.items()}
    return with_patches(indexed_frames(folder, name, section), patches, str(folder))


def with_patches(
    frames: Sequence[Frame], patches: Mapping[Quantity, Mapping[str, Sequence[Patch]]], where: str
) -> list[TestFrame]:
    """Frames with their patches; those without any of the first quantity are left out.

    Args:
        frames: of one dataset, in order.
        patches: quantity -> frame name -> patches.
        where: named in the error.

    Raises:
        InputError: no frame has a patch, or an unknown quantity or none.
    """
    for quantity in patches:
        check_quantity(quantity)
    if not patches:
        raise InputError(f"{where}: no quantity to be estimated; expected {' or '.join(QUANTITIES)}")
    first = next(iter(patches))
    chosen = [
        TestFrame(frame, {quantity: named.get(frame.name, []) for quantity, named in patches.items()})
        for frame in frames
        if frame.name in patches[first]
    ]
    if not chosen:
        raise InputError(f"{where}: {WITHOUT[first]}")
    return chosen


def check_quantity(quantity: str) -> None:
    """Check the name of a quantity.

    Raises:
        InputError: there is no such.
    """
    if quantity not in QUANTITIES:
        raise InputError(f"quantity {quantity!r}: expected {' or '.join(map(repr, QUANTITIES))}")
