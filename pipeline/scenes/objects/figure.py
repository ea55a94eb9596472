"""What makes a pedestrian that pedestrian: build, clothes and colours, independent of the pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Lengths of the human body as parts of its height (Drillis and Contini 1966, rounded).
HIP = 0.525
THIGH = 0.245
SHANK = 0.246
ANKLE = 0.039
UPPER_ARM = 0.170
FOREARM = 0.145
SHOULDER = 0.281  # above the hip joints
HEAD = 0.415  # centre of the head above the hip joints


@dataclass(frozen=True)
class Figure:
    """One person.

    Attributes:
        height_m: stature.
        build: factor on widths, 1 is slim.
        female: narrower shoulders and waist, wider hips.
        outfit: ``"trousers"``, ``"coat"`` (over trousers), ``"skirt"`` or ``"shorts"``.
        short_sleeves: bare forearms.
        open_front: a jacket open over a shirt.
        stripes: rings on the top.
        hair: ``"short"``, ``"long"``, ``"bun"``, ``"bald"`` or ``"cap"``.
        bag: ``"none"``, ``"backpack"`` or ``"shoulder"``.
        swing_rad: largest angle of the thighs when walking; near 0 stands.
        lean_rad: forward lean of the trunk.
        top, trousers, skin, hair_tone, shoe, bag_tone: albedos.
    """

    height_m: float
    build: float
    female: bool
    outfit: str
    short_sleeves: bool
    open_front: bool
    stripes: bool
    hair: str
    bag: str
    swing_rad: float
    lean_rad: float
    top: float
    trousers: float
    skin: float
    hair_tone: float
    shoe: float
    bag_tone: float

    @classmethod
    def draw(cls, generator: np.random.Generator) -> Figure:
        """A person; always takes the same number of draws."""
        chance = generator.random(10)
        female = bool(chance[0] < 0.5)
        outfit = "coat" if chance[1] < 0.33 else "trousers"
        if female and chance[2] < 0.3 and outfit != "coat":
            outfit = "skirt"
        elif outfit == "trousers" and chance[3] < 0.15:
            outfit = "shorts"
        styles = ("long", "long", "bun", "short") if female else ("short", "short", "short", "bald", "cap")
        top = float(generator.choice([0.035, 0.07, 0.14, 0.25, 0.40, 0.55, 0.70]))
        trousers = float(generator.choice([0.03, 0.05, 0.08, 0.12, 0.20, 0.30]))
        # top and trousers of nearly one tone hide the waist; people do wear that, but seldom
        if abs(top - trousers) < 0.04 and chance[4] < 0.7:
            top = min(0.7, 4 * top + 0.1)
        swing = generator.uniform(0.28, 0.46)
        return cls(
            height_m=float(generator.uniform(1.52, 1.78) if female else generator.uniform(1.64, 1.92)),
            build=float(generator.uniform(0.94, 1.16)),
            female=female,
            outfit=outfit,
            short_sleeves=bool(chance[5] < 0.35 and outfit != "coat") or outfit == "shorts",
            open_front=bool(chance[6] < (0.6 if outfit == "coat" else 0.2)),
            stripes=bool(chance[7] < 0.2),
            hair=styles[int(generator.integers(len(styles)))],
            bag=("backpack" if chance[8] < 0.25 else "shoulder" if chance[8] < 0.5 else "none"),
            swing_rad=float((min(swing, 0.28) if outfit == "skirt" else swing) if chance[9] < 0.83 else 0.03),
            lean_rad=float(generator.uniform(0.01, 0.07)),
            top=top,
            trousers=trousers,
            skin=float(generator.uniform(0.18, 0.48)),
            hair_tone=float(generator.choice([0.02, 0.03, 0.06, 0.16, 0.30])),
            shoe=float(generator.choice([0.03, 0.06, 0.12, 0.50])),
            bag_tone=float(generator.choice([0.03, 0.08, 0.20, 0.35])),
        )

    @property
    def cycle_m(self) -> float:
        """Distance of two steps: the feet do not slide if the phase grows by 2 pi over it."""
        return float(4 * (THIGH + SHANK) * self.height_m * np.sin(max(self.swing_rad, 0.05)))
