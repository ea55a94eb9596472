"""Where a frame shows a picture: without bars, inside the circle of a fisheye lens, and squares covered in part.

Letterbox bars, and the surround of a fisheye lens, have no noise, and their edge is sharper than any lens. A square
that holds some of them is read as free of noise, and its blur as that of the edge.

    bars      lines at the border of the frame of which every pixel, but for `RIPPLE_DN` that a codec leaves, has the
              level of the outermost one
    certain   of these, bars that are not white, and are narrow (`NARROW_BAR`) or have one like them opposite: other
              areas across the frame may be over-exposed, covered or unlit
    covered   `COVERED` of a square's blocks of 4 x 4 px are exactly uniform, nearly all uniform ones have one level,
              neither black nor white, while all but a few of the others vary by more than `LEAST_DN`, as a picture with
              noise does
    circle    the convex hull of blocks of 4 x 4 px that are not dark, or not joined to the dark corners, fills `FILLED`
              of a circle through its vertices, and the means of the blocks outside deviate by `UNIFORM_DN` at most

A scene without noise has uniform blocks too, but beside them blocks that hardly vary. Of 3,844 squares of 128 px of
KITTI, Udacity, *Sim* and that of the paper's authors, Penn-Fudan, CC, PolyU and Levin none is covered in this sense as
recorded, with 5 DN, or with 2 and 10 DN behind JPEG 80 and 50; as JPEG 75 one is. No frame of them has bars.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.datasets.patches import Patch

COVERED_REASON = "covered"
"""Reason: a uniform surround covers a part of the patch."""

RIPPLE_DN = 2.0
LEAST_BAR_PX = 4
NARROW_BAR = 0.1  # of the frame's side
PAIRED = 0.5  # width of a bar to that of the one opposite, at least
LEAST_PICTURE = 0.25  # of the frame's width and height; a picture that is smaller is none
COVERED, LEAST_DN = 0.1, 1.0
ALIKE = 0.8  # of the uniform blocks; drawings have such blocks of many levels
BLOCK_PX = 4
CODEC_BLOCK_PX = 8
FLATTEST = 0.1  # of the blocks that are not uniform
DARK_DN = 18.0  # black of video, 16, and what a codec adds
FILLED = 0.95
UNIFORM_DN = 1.0  # deviation of the means of blocks of a surround; a dark scene varies more
LEAST_SURROUND, LEAST_CIRCLE = 0.02, 0.3  # of the frame, outside and inside the circle
BLACK_DN, WHITE_DN = 2.0, 253.0  # uniform by saturation, of which the estimators know
_ENDS = (slice(None, BLOCK_PX), slice(-BLOCK_PX, None))


def picture_area(frame: NDArray[np.floating], *, certain: bool = False) -> tuple[slice, slice]:
    """The part of a frame inside its bars.

    Args:
        frame: (H, W) in [0, 1].
        certain: leave out only bars that no fault of the picture looks like; see the module.

    Returns:
        rows and columns; all of them where there are no bars, or hardly anything else.
    """
    rows, columns = _inside(frame, certain), _inside(frame.T, certain)
    enough = all(
        part.stop - part.start >= LEAST_PICTURE * side for part, side in zip((rows, columns), frame.shape, strict=True)
    )
    return (rows, columns) if enough else (slice(0, frame.shape[0]), slice(0, frame.shape[1]))


def picture_circle(frame: NDArray[np.floating]) -> NDArray[np.bool_] | None:
    """The circle that a fisheye lens lights.

    Dark parts of the picture that meet the surround lie inside the hull of the rest. The circle is fitted to the hull's
    vertices by least squares, |p|^2 = 2 c p + d (Kasa 1976).

    Args:
        frame: (H, W) in [0, 1].

    Returns:
        (H, W) whether a pixel is inside; None where there is no dark surround of that form.
    """
    import cv2

    height, width = frame.shape
    corners = [frame[rows, columns].mean() for rows in _ENDS for columns in _ENDS]
    if max(corners) > DARK_DN / FULL_SCALE_DN or min(height, width) < 8 * BLOCK_PX:
        return None
    size = width // BLOCK_PX, height // BLOCK_PX
    small = cv2.resize(np.asarray(frame, np.float32), size, interpolation=cv2.INTER_AREA)
    _, parts = cv2.connectedComponents((small <= DARK_DN / FULL_SCALE_DN).astype(np.uint8), connectivity=4)
    surround = np.isin(parts, parts[[0, 0, -1, -1], [0, -1, 0, -1]]) & (parts > 0)
    if surround.all():
        return None
    hull = cv2.convexHull(np.argwhere(~surround)[:, ::-1].astype(np.float32))[:, 0].astype(np.float64)
    x, y = hull.T
    terms = np.stack([x, y, np.ones_like(x)], axis=1)
    twice_x, twice_y, rest = np.linalg.lstsq(terms, x * x + y * y)[0]
    rows, columns = np.ogrid[: size[1], : size[0]]
    distance = np.hypot(columns - twice_x / 2, rows - twice_y / 2)
    radius = np.sqrt(max(rest + (twice_x**2 + twice_y**2) / 4, 0.0))
    inside, outside = distance <= radius, distance > radius + 2  # between them blocks are covered in part
    lit = cv2.fillConvexPoly(np.zeros_like(inside, np.uint8), np.rint(hull).astype(np.int32), 1) > 0
    if not (LEAST_CIRCLE <= inside.mean() <= 1 - LEAST_SURROUND and outside.any()):
        return None
    fits = np.mean(lit & inside) >= FILLED * max(inside.mean(), lit.mean())
    if not fits or FULL_SCALE_DN * small[outside].std() > UNIFORM_DN:
        return None
    return cv2.resize(inside.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0


def shifted(squares: list[Patch], area: tuple[slice, slice]) -> list[Patch]:
    """Squares of an area, in the coordinates of the frame."""
    rows, columns = area
    return [Patch(square.x_px + columns.start, square.y_px + rows.start, square.size_px) for square in squares]


def covered(patches: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Patches that a uniform surround covers in part; see the module.

    Args:
        patches: (N, 1, H, W) in [0, 1].

    Returns:
        (N,).
    """
    equal = patches[:, 0, :-1:BLOCK_PX, :-1:BLOCK_PX] == patches[:, 0, 1::BLOCK_PX, 1::BLOCK_PX]
    possible = equal.mean(axis=(1, 2)) >= COVERED / 2  # a quick look at two pixels of every block
    return np.array(
        [bool(maybe) and _is_covered(patch[0]) for maybe, patch in zip(possible, patches, strict=True)], bool
    )


def _is_covered(patch: NDArray[np.floating]) -> bool:
    height, width = (side // BLOCK_PX for side in patch.shape)
    pixels = patch[: height * BLOCK_PX, : width * BLOCK_PX] * np.float32(FULL_SCALE_DN)
    blocks = pixels.reshape(height, BLOCK_PX, width, BLOCK_PX).swapaxes(1, 2).reshape(-1, BLOCK_PX**2)
    level = blocks[:, 0]
    uniform = np.equal(blocks, level[:, None]).all(axis=1)
    levels = np.bincount(np.rint(level[uniform]).astype(np.intp), minlength=int(FULL_SCALE_DN) + 2)
    commonest = int(levels.argmax())
    around = levels[max(commonest - 1, 0) : commonest + 2].sum()  # a codec's ripple
    if uniform.all() or around < max(COVERED * len(level), ALIKE * uniform.sum()):
        return False
    if not BLACK_DN < commonest < WHITE_DN:
        return False
    variation = np.sort(blocks[~uniform].std(axis=1))
    return bool(variation[: max(int(FLATTEST * len(variation)), 1)].mean() > LEAST_DN)


def _inside(lines: NDArray[np.floating], certain: bool) -> slice:
    """The lines (n, m) between the bars at either end; they begin where a codec's blocks do."""
    first, last = widths = (_bar(lines), _bar(lines[::-1]))
    if certain:
        first, last = _certain(lines, widths)
    first = -(-first // CODEC_BLOCK_PX) * CODEC_BLOCK_PX
    return slice(first, max(len(lines) - last, first))


def _certain(lines: NDArray[np.floating], widths: tuple[int, int]) -> list[int]:
    """Widths of the bars at either end, 0 for those that may be a fault of the picture."""
    levels = [FULL_SCALE_DN * float(np.median(line)) for line in (lines[0], lines[-1])]
    paired = abs(levels[0] - levels[1]) <= RIPPLE_DN and min(widths) >= PAIRED * max(widths)
    widest = len(lines) if paired else NARROW_BAR * len(lines)
    return [width if width <= widest and level < WHITE_DN else 0 for width, level in zip(widths, levels, strict=True)]


def _bar(lines: NDArray[np.floating]) -> int:
    """How many lines from the first on are a bar; 0 for fewer than `LEAST_BAR_PX`."""
    level = float(np.median(lines[0]))
    ripple = RIPPLE_DN / FULL_SCALE_DN
    width = 0
    for line in lines:
        if np.abs(line - level).max() > ripple:
            break
        width += 1
    return width if width >= LEAST_BAR_PX else 0
