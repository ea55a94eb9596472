"""Makers of training samples from a bank of procedural pictures: chunk number -> arrays, in any process."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from pipeline.learning.chunk_loader import Arrays
from pipeline.learning.settings import PictureTraining

Chosen = TypeVar("Chosen", bound=PictureTraining)


@dataclass
class PictureMaker(ABC, Generic[Chosen]):
    """Makes chunks of samples. Opens its bank on first use, in whichever process that is.

    Attributes:
        settings: of the training.
        cache: folder of the bank.
        validation: pictures and draws that are never trained on.
    """

    settings: Chosen
    cache: Path
    validation: bool = False
    _tiles: np.ndarray | None = None

    @property
    def tiles(self) -> np.ndarray:
        """(M, T, T) uint8 pictures."""
        if self._tiles is None:
            self._tiles = self.bank()
        return self._tiles

    @property
    def part(self) -> str:
        """``"training"`` or ``"validation"``: the first word of its streams' purposes."""
        return "validation" if self.validation else "training"

    def bank(self, executor: Mapping[str, Any] | None = None) -> np.ndarray:
        """The pictures, drawn if they are not in the cache."""
        from pipeline.learning import images

        count = self.settings.validation_images if self.validation else self.settings.images
        purpose, folder = f"{self.part} image", self.cache / "images"
        return images.bank(count, self.settings.seed, purpose=purpose, folder=folder, executor=executor)

    @abstractmethod
    def __call__(self, number: int) -> Arrays:
        """Chunk `number`."""
