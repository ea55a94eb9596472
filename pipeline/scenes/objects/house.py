"""Houses: one or two storeys, gabled or hipped, with wings, porches, dormers, timber frames and chimneys."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.scenes.mesh import Mesh, join
from pipeline.scenes.objects import roof
from pipeline.scenes.objects.base import SceneObject
from pipeline.scenes.objects.facade import Opening, WindowPaint, door, reveal, wall, window
from pipeline.scenes.objects.materials import MATERIALS
from pipeline.scenes.shapes import box, boxes, panel, tube

STOREY_M = 2.65
# Part of a front that a wing hides, from y to y; here none.
_NOTHING = (0.0, 0.0)


@dataclass(frozen=True)
class Block:
    """A box of walls under one roof.

    Attributes:
        width_m: along y.
        depth_m: along x.
        storeys: 1 or 2.
        plinth_m: height of the floor above the ground.
        rise_m: from the eaves to the ridge.
        walls: cladding of the lower and of the upper storey.
        cover: roofing.
        hipped: a hipped roof, else gables.
        timber: the upper storey shows its frame.
    """

    width_m: float
    depth_m: float
    storeys: int
    plinth_m: float
    rise_m: float
    walls: tuple[str, str]
    cover: str
    hipped: bool
    timber: bool

    @property
    def eaves_m(self) -> float:
        """Height of the eaves."""
        return self.plinth_m + self.storeys * STOREY_M + 0.15

    @property
    def ridge_m(self) -> float:
        """Height of the ridge."""
        return self.eaves_m + self.rise_m


def make(generator: np.random.Generator) -> SceneObject:
    """A house on z = 0 around the origin, its front door towards +x."""
    low = str(generator.choice(["brick", "plaster", "plaster", "stone", "brick", "plank"]))
    upper = str(generator.choice(["plaster", "plank", "brick"])) if generator.random() < 0.3 else low
    storeys = int(generator.choice([1, 2, 2]))
    depth = float(generator.uniform(6.0, 8.8))
    main = Block(
        width_m=float(generator.uniform(7.5, 12.5)),
        depth_m=depth,
        storeys=storeys,
        plinth_m=float(generator.uniform(0.15, 0.5)),
        rise_m=depth * float(generator.uniform(0.36, 0.58)),
        walls=(low, upper),
        cover=str(generator.choice(["tile", "tile", "shingle"])),
        hipped=bool(generator.random() < 0.25),
        timber=bool(upper == "plaster" and generator.random() < 0.45),
    )
    style = _Style.draw(generator)
    sideways = not main.hipped and generator.random() < 0.25
    wing, covered = _wing(main, style, generator) if not sideways and generator.random() < 0.3 else ([], _NOTHING)
    body = join(_block(main, style, generator, 1 if sideways else 0, covered))
    if sideways:
        body = body.placed(-np.pi / 2)
    parts = [body, *wing]
    deep = (main.width_m if sideways else main.depth_m) / 2
    if not sideways:
        parts += _dormers(main, generator, covered)
    parts += _chimneys(main, generator, sideways)
    if generator.random() < 0.4:
        front = main.depth_m if sideways else main.width_m
        y = style.middle(front, style.door_column(front))
        parts.append(_porch(deep, y, main.plinth_m, main.cover))
    tint = {name: float(generator.uniform(0.7, 1.3)) for name in ("brick", "stone", "plank", "tile", "shingle")}
    tint["plaster"] = float(generator.choice([0.45, 0.75, 0.95, 1.15, 1.25]))
    tint["trim"] = float(generator.choice([0.75, 0.65, 0.60, 0.20, 0.08])) / MATERIALS["trim"].albedo
    tint["door"] = float(generator.uniform(0.05, 0.45)) / MATERIALS["door"].albedo
    tint["shutter"] = float(generator.choice([0.06, 0.10, 0.20, 0.45])) / MATERIALS["shutter"].albedo
    tint["bench"] = float(generator.choice([0.08, 0.14])) / MATERIALS["bench"].albedo
    return SceneObject(join(parts), None, "house", tint, {"window": WindowPaint()})


@dataclass(frozen=True)
class _Style:
    """Windows and doors of one house."""

    panes: tuple[int, int]
    window_m: tuple[float, float]
    spacing_m: float
    shutters: bool
    glazed_door: bool
    door_y: float

    @classmethod
    def draw(cls, generator: np.random.Generator) -> _Style:
        return cls(
            panes=((2, 1), (2, 2), (2, 3), (1, 2))[int(generator.integers(4))],
            window_m=(float(generator.choice([0.95, 1.15, 1.35])), float(generator.uniform(1.15, 1.45))),
            spacing_m=float(generator.uniform(2.2, 3.0)),
            shutters=bool(generator.random() < 0.4),
            glazed_door=bool(generator.random() < 0.5),
            door_y=float(generator.uniform(-0.3, 0.3)),
        )

    def columns(self, length: float) -> int:
        """Columns of windows in a wall."""
        return max(1, int((length - 0.6) / self.spacing_m))

    def middle(self, length: float, column: int) -> float:
        """Position of a column's middle along a wall, from the wall's middle."""
        count = self.columns(length)
        return (column + 0.5 - count / 2) * length / count

    def door_column(self, length: float) -> int:
        """The column that the door takes."""
        count = self.columns(length)
        return int(np.clip(round((self.door_y + 0.5) * count - 0.5), 0, count - 1))


def _block(
    block: Block, style: _Style, generator: np.random.Generator, front: int, covered: tuple[float, float] = _NOTHING
) -> list[Mesh]:
    """Walls, windows and roof; the door is in wall number `front` (0 the +x eaves side, 1 the +y gable), or -1."""
    w, d = block.width_m, block.depth_m
    sides = (
        (0.0, (d / 2, 0, 0), w),
        (np.pi / 2, (0, w / 2, 0), d),
        (np.pi, (-d / 2, 0, 0), w),
        (-np.pi / 2, (0, -w / 2, 0), d),
    )
    parts = []
    for number, (yaw, index, length) in enumerate(sides):
        faces = _side(block, style, generator, length, number == front, number % 2 == 1, front < 0, covered)
        parts.append(join(faces).placed(yaw, index))
    make_roof = roof.hip if block.hipped else roof.gable
    parts += make_roof(w, d, block.eaves_m, block.rise_m, block.cover)
    parts.append(box((-d / 2 - 0.05, -w / 2 - 0.05, -0.4), (d / 2 + 0.05, w / 2 + 0.05, block.plinth_m), "stone"))
    corner = (d / 2 + 0.07, -w / 2 + 0.2)
    eaves = block.eaves_m - block.rise_m * roof.OVERHANG_M / (d / 2)
    pipe = [(*corner, 0.0), (*corner, eaves - 0.35), (d / 2 + roof.OVERHANG_M + 0.05, corner[1], eaves)]
    parts.append(tube(pipe, 0.045, "gutter", 8, round_ends=False))
    return parts


def _side(
    block: Block,
    style: _Style,
    generator: np.random.Generator,
    length: float,
    with_door: bool,
    gabled: bool,
    fronts: bool,
    covered: tuple[float, float],
) -> list[Mesh]:
    """One wall in its own coordinates; windows behind a wing are left out of the wall with the door."""
    count = style.columns(length)
    wide, tall = style.window_m
    # open shutters of neighbours must not meet
    shutter = min(wide / 2, (length / count - wide) / 2 - 0.06) if style.shutters else 0.0
    parts: list[Mesh] = []
    openings: list[Opening] = []
    door_at = style.door_column(length) if with_door else -1
    for storey in range(block.storeys):
        floor = block.plinth_m + storey * STOREY_M
        for column in range(count):
            middle = style.middle(length, column)
            chance = float(generator.random())
            if storey == 0 and column == door_at:
                openings.append(Opening(middle - 0.5, middle + 0.5, floor, floor + 2.05, door=True))
                parts.append(door(openings[-1], style.glazed_door))
            elif with_door and covered[0] - wide / 2 < middle < covered[1] + wide / 2 and covered != _NOTHING:
                continue
            elif with_door or not gabled or fronts or generator.random() < 0.75:
                openings.append(Opening(middle - wide / 2, middle + wide / 2, floor + 0.9, floor + 0.9 + tall))
                parts.append(window(openings[-1], style.panes, chance, shutter))
    parts += [reveal(opening) for opening in openings]
    u0 = float(generator.uniform(0, 5))
    split = (
        block.plinth_m + STOREY_M + 0.05 if block.storeys > 1 and block.walls[0] != block.walls[1] else block.eaves_m
    )
    parts.append(wall(length, 0.0, split, openings, block.walls[0], u0))
    if split < block.eaves_m:
        parts.append(wall(length, split, block.eaves_m, openings, block.walls[1], u0))
        parts.append(box((-0.02, -length / 2, split - 0.09), (0.035, length / 2, split + 0.07), "trim"))
    if gabled and not block.hipped:
        tip = np.array([[0, -length / 2, block.eaves_m], [0, length / 2, block.eaves_m], [0, 0, block.ridge_m]])
        parts.append(panel(tip, block.walls[1], tip[:, 1:] + np.array([u0, 0.0])))
        if block.rise_m > 2.6:
            attic = Opening(-0.4, 0.4, block.eaves_m + 0.35, block.eaves_m + 1.35)
            parts.append(window(attic, (2, 2), float(generator.random()), 0.0, -0.035))
    if block.timber:
        parts.append(_timber(block, length, openings))
    return parts


def _timber(block: Block, length: float, openings: list[Opening]) -> Mesh:
    """Posts beside the windows and rails at the floors of the upper storey."""
    base = block.plinth_m + (block.storeys - 1) * STOREY_M
    top = block.eaves_m
    upper = [o for o in openings if o.z1 > base + 0.5 and not o.door]
    half = length / 2
    posts = [-half + 0.08, half - 0.08, *(y for o in upper for y in (o.y0 - 0.07, o.y1 + 0.07))]
    low = [[0.0, y - 0.07, base] for y in posts]
    high = [[0.02, y + 0.07, top] for y in posts]
    for z in (base + 0.07, top - 0.07):
        low.append([0.0, -half, z - 0.08])
        high.append([0.024, half, z + 0.08])
    parts = [boxes(low, high, "bench")]
    for side in (1, -1):
        y = side * (half - 0.15)
        brace = [[0.018, y - side * 0.75, base + 0.1], [0.018, y, base + 1.5]]
        parts.append(tube(brace, 0.085, "bench", 4, squash=0.2, round_ends=False))
    return join(parts)


def _dormers(block: Block, generator: np.random.Generator, covered: tuple[float, float]) -> list[Mesh]:
    """None, or one to three on the front slope, beside a wing."""
    count = int(generator.choice([0, 0, 1, 2, 3]))
    pitched, chances = bool(generator.random() < 0.6), generator.random(3)
    steep = block.rise_m / (block.depth_m / 2)
    margin = block.depth_m * 0.45 if block.hipped else 0.8
    left, right = -block.width_m / 2 + margin, block.width_m / 2 - margin
    if covered[0] < covered[1]:
        left, right = (covered[1] + 0.3, right) if covered[0] < 0 else (left, covered[0] - 0.3)
    room, middle = right - left, (left + right) / 2
    count = min(count, int(room / 2.2))
    if block.rise_m < 2.5 or count < 1:
        return []
    x = block.depth_m / 2 - 0.7
    z = block.eaves_m + steep * 0.7 + roof.THICKNESS_M
    clad = "shingle" if block.cover == "shingle" else "plank"
    return [
        roof.dormer(
            x,
            z,
            middle + (number + 0.5 - count / 2) * room / count,
            steep,
            block.cover,
            clad,
            float(chances[number]),
            pitched,
        )
        for number in range(count)
    ]


def _wing(main: Block, style: _Style, generator: np.random.Generator) -> tuple[list[Mesh], tuple[float, float]]:
    """A lower block that stands forward at the end away from the door, its gable to the front; and where it is."""
    wide = main.width_m * float(generator.uniform(0.32, 0.42))
    out = float(generator.uniform(1.2, 2.6))
    side = 1 if style.door_y < 0 else -1
    depth = main.depth_m / 2 + out
    rise = min(0.55 * wide, main.rise_m - 0.4)
    block = Block(depth, wide, main.storeys, main.plinth_m, rise, main.walls, main.cover, False, main.timber)
    # its ridge runs along y; turned by a quarter its +y gable looks to +x
    built = join(_block(block, style, generator, front=-1)).placed(-np.pi / 2)
    y = side * (main.width_m / 2 - wide / 2 - 0.02)
    positions = (main.depth_m / 2 + out - depth / 2, y, 0)
    return [built.placed(0.0, positions)], (y - wide / 2 - 0.1, y + wide / 2 + 0.1)


def _chimneys(block: Block, generator: np.random.Generator, sideways: bool) -> list[Mesh]:
    """One or two, through the ridge or beside it."""
    parts = []
    for _ in range(int(generator.choice([1, 1, 2]))):
        along = float(generator.uniform(-0.3, 0.3)) * block.width_m
        aside = float(generator.uniform(-0.12, 0.12)) * block.depth_m
        x, y = (along, aside) if sideways else (aside, along)
        half, top = 0.33, block.ridge_m + float(generator.uniform(0.55, 0.95))
        parts.append(box((x - half, y - half, block.eaves_m), (x + half, y + half, top), "brick"))
        parts.append(
            box((x - half - 0.07, y - half - 0.07, top), (x + half + 0.07, y + half + 0.07, top + 0.09), "concrete")
        )
        parts += [tube([(x, y + s * 0.15, top), (x, y + s * 0.15, top + 0.32)], 0.10, "tile", 8) for s in (1, -1)]
    return parts


def _porch(front_m: float, y: float, floor_m: float, cover: str) -> Mesh:
    """A small roof on two posts before the door, whose middle is at y."""
    deep, half, top = 1.5, 1.05, floor_m + 2.35
    parts = [box((front_m, y - half, -0.3), (front_m + deep, y + half, max(floor_m - 0.02, 0.06)), "concrete")]
    for side in (1, -1):
        post = (front_m + deep - 0.12, y + side * (half - 0.1))
        parts.append(box((post[0] - 0.07, post[1] - 0.07, 0.0), (post[0] + 0.07, post[1] + 0.07, top), "trim"))
    lean = [[front_m + deep + 0.15, y - half - 0.15, top], [front_m + deep + 0.15, y + half + 0.15, top],
            [front_m, y + half + 0.15, top + 0.55], [front_m, y - half - 0.15, top + 0.55]]  # fmt: skip
    parts.append(roof.slope(lean, cover, 0.09))
    return join(parts)
