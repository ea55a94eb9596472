"""The library of textures: each is drawn when first asked for and then kept for the process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache

import numpy as np

from pipeline.errors import InputError, did_you_mean
from pipeline.scenes.textures import cloth, fields, ground, walls
from pipeline.scenes.textures.texture import Texture
from pipeline.streams import stream

Draw = Callable[[str], np.random.Generator]

RECIPES: dict[str, Callable[[Draw, int], Texture]] = {
    "asphalt": ground.asphalt,
    "grass": ground.grass,
    "litter": ground.litter,
    "dirt": ground.dirt,
    "paver": ground.paver,
    "cobble": ground.cobble,
    "concrete": ground.concrete,
    "brick": walls.brick,
    "stone": walls.stone,
    "plank": walls.plank,
    "tile": walls.tile,
    "shingle": walls.shingle,
    "plaster": walls.plaster,
    "bark": walls.bark,
    "fabric": cloth.fabric,
    "stripe": cloth.stripe,
    "hair": cloth.hair,
    "leaf": fields.leaf,
    "fbm": fields.fbm,
    "cloud": fields.cloud,
}


class Library(Mapping[str, Texture]):
    """Textures by name, drawn lazily; a texture depends only on seed, size and its own name."""

    def __init__(self, seed: int, size_px: int) -> None:
        self.seed = seed
        self.size_px = size_px
        self._drawn: dict[str, Texture] = {}

    def __getitem__(self, name: str) -> Texture:
        """The texture of that name.

        Raises:
            InputError: there is none.
        """
        if name not in self._drawn:
            if name not in RECIPES:
                raise InputError(f"texture '{name}' is not in the library; {did_you_mean(name, RECIPES)}")
            self._drawn[name] = RECIPES[name](
                lambda layer: stream(self.seed, "texture", name, layer, self.size_px), self.size_px
            )
        return self._drawn[name]

    def __iter__(self) -> Iterator[str]:
        return iter(RECIPES)

    def __len__(self) -> int:
        return len(RECIPES)

    def __contains__(self, name: object) -> bool:
        return name in RECIPES


@lru_cache(maxsize=2)
def library(seed: int = 0, size_px: int = 1024) -> Library:
    """The textures of one seed, shared by all scenes of a process.

    Args:
        seed: root of the random streams.
        size_px: texels along a side, a power of two; 1024 is about 2-5 mm a texel.
    """
    return Library(seed, size_px)
