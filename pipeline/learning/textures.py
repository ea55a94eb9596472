"""Grey textures and shading for procedural training images, and the outlines that are filled with them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Plane = NDArray[Any]

OUTLINES = ("ellipse", "bar", "polygon")
"""Kinds of `outline`."""

SUBPIXEL_BITS = 4  # coordinates of outlines are handed to OpenCV in sixteenths of a pixel


def power_law(generator: np.random.Generator, size_px: int, exponent: float) -> Plane:
    """Gaussian random field whose amplitude spectrum falls as 1 / f^exponent (natural images: about 1).

    Args:
        generator: source of randomness.
        size_px: side, pixels.
        exponent: of the amplitude; 0 is white noise.

    Returns:
        (size, size) float32, mean 0, standard deviation 1; periodic.
    """
    from scipy.fft import irfft2, rfft2

    white = generator.standard_normal((size_px, size_px), dtype=np.float32)
    radius = np.hypot(np.fft.fftfreq(size_px)[:, None], np.fft.rfftfreq(size_px)[None]).astype(np.float32)
    radius[0, 0] = 1.0 / size_px
    field = irfft2(rfft2(white) * radius ** np.float32(-exponent), (size_px, size_px))
    field -= field.mean()
    return (field / field.std()).astype(np.float32)


def smooth_field(generator: np.random.Generator, size_px: int, exponent: float) -> Plane:
    """A `power_law` field of 64 x 64 values, enlarged: clouds, stains, uneven light."""
    import cv2

    return cv2.resize(power_law(generator, 64, exponent), (size_px, size_px), interpolation=cv2.INTER_CUBIC)


def texture(generator: np.random.Generator, size_px: int) -> Plane:
    """One random texture: grain, stripes (square or sine), random blocks, or creases.

    Returns:
        (size, size) float32, standard deviation about 1.
    """
    kind = generator.choice(["grain", "stripes", "blocks", "creases"], p=[0.4, 0.2, 0.2, 0.2])
    if kind == "stripes":
        rows, columns = np.mgrid[:size_px, :size_px].astype(np.float32)
        angle, phase = generator.uniform(0, np.pi), generator.uniform(0, 2 * np.pi)
        period_px = np.exp(generator.uniform(np.log(6), np.log(80)))
        across = columns * np.float32(np.cos(angle)) + rows * np.float32(np.sin(angle))
        wave = np.sin(across * np.float32(2 * np.pi / period_px) + np.float32(phase))
        return np.sign(wave) if generator.random() < 0.5 else wave
    if kind == "blocks":
        side = int(generator.integers(4, 60))
        count = size_px // side + 2
        blocks = generator.standard_normal((count, count)).astype(np.float32)
        return np.kron(blocks, np.ones((side, side), np.float32))[:size_px, :size_px]
    if kind == "creases":
        return np.abs(power_law(generator, size_px, 1.0))
    return power_law(generator, size_px, generator.uniform(0.6, 2.0))


def shading(generator: np.random.Generator, size_px: int) -> Plane:
    """Uneven light over a whole picture: a ramp in a random direction and soft clouds, DN to be added."""
    rows, columns = np.mgrid[:size_px, :size_px].astype(np.float32) / size_px - 0.5
    angle = generator.uniform(0, 2 * np.pi)
    ramp = columns * np.float32(np.cos(angle)) + rows * np.float32(np.sin(angle))
    clouds = smooth_field(generator, size_px, 2.2)
    return ramp * np.float32(generator.uniform(0, 80)) + clouds * np.float32(generator.uniform(0, 15))


def fill(plane: Plane, corners: NDArray[np.float64], value: float) -> None:
    """Fill a polygon in place.

    Args:
        plane: (H, W).
        corners: (n, 2) x and y, pixels.
        value: to fill with.
    """
    import cv2

    points = np.rint(np.asarray(corners) * 2**SUBPIXEL_BITS).astype(np.int32)
    cv2.fillPoly(plane, [points], float(value), cv2.LINE_8, SUBPIXEL_BITS)


def rectangle(x: float, y: float, width: float, height: float) -> NDArray[np.float64]:
    """Corners of an upright rectangle by its upper left corner: (4, 2)."""
    return np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]])


def outline(
    generator: np.random.Generator, kind: str, centre: tuple[float, float], radius_px: float
) -> NDArray[np.float64]:
    """A random leaf's outline.

    Args:
        generator: source of randomness.
        kind: ``"ellipse"``, ``"bar"`` (seven in ten of them upright) or ``"polygon"``.
        centre: x and y, pixels.
        radius_px: size.

    Returns:
        (n, 2) corners, pixels.
    """
    if kind == "ellipse":
        count = int(np.clip(radius_px, 8, 48))
        turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
        half = np.array([radius_px, radius_px * generator.uniform(0.3, 1.0)])
        points = half * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        angle = generator.uniform(0, np.pi)
    elif kind == "bar":
        half = np.array([radius_px, radius_px * generator.uniform(0.1, 1.2)])
        points = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        angle = 0.0 if generator.random() < 0.7 else generator.uniform(0, np.pi)
    else:
        turn = np.sort(generator.uniform(0, 2 * np.pi, int(generator.integers(3, 8))))
        reach = radius_px * generator.uniform(0.4, 1.2, len(turn))
        points = np.stack([reach * np.cos(turn), reach * np.sin(turn)], axis=1)
        angle = 0.0
    cosine, sine = np.cos(angle), np.sin(angle)
    return points @ np.array([[cosine, sine], [-sine, cosine]]) + np.asarray(centre)


def fur(generator: np.random.Generator, image: Plane) -> Plane:
    """`image` ((S, S) DN) with strands of fur, hair, grass or brushed cloth along a slowly turning direction."""
    import cv2

    size = len(image)
    strands = np.zeros((size, size), np.float32)
    heading = smooth_field(generator, size, 2.0) * np.float32(generator.uniform(0.1, 1.0)) + generator.uniform(0, np.pi)
    count = int(generator.uniform(0.02, 0.12) * size * size)
    starts = generator.integers(0, size, (count, 2))
    lengths = np.exp(generator.uniform(np.log(4), np.log(24), count))
    greys = generator.normal(0, 1, count)
    for (y, x), length, value in zip(starts, lengths, greys, strict=True):
        angle = float(heading[y, x])
        end = (round((x + length * np.cos(angle)) * 16), round((y + length * np.sin(angle)) * 16))
        cv2.line(strands, (int(x) * 16, int(y) * 16), end, float(value), 1, cv2.LINE_8, 4)
    strength = np.float32(np.exp(generator.uniform(np.log(4), np.log(40))))
    where = np.clip(smooth_field(generator, size, 1.5) * 2 + generator.uniform(-0.5, 1.5), 0, 1)
    return (image + strands * strength * where).astype(np.float32)


def lettering(generator: np.random.Generator, image: Plane) -> Plane:
    """`image` ((S, S) DN) with lines of small print."""
    import cv2

    size = len(image)
    mask = np.zeros((size, size), np.uint8)
    scale, fonts = float(np.exp(generator.uniform(np.log(0.2), np.log(0.9)))), (0, 1, 2, 3, 4, 6)
    font, step = int(generator.choice(fonts)), max(int(26 * scale * generator.uniform(1.0, 2.0)), 5)
    for line in range(int(generator.integers(0, step)), size, step):
        text = "".join(chr(int(code)) for code in generator.integers(33, 126, 60))
        start = (int(generator.integers(-20, size // 3)), line)
        cv2.putText(mask, text, start, font, scale, 255, int(generator.integers(1, 3)), cv2.LINE_AA)
    share = mask.astype(np.float32) / 255
    grey = np.float32(generator.uniform(0, 255))
    return (image + share * (grey - image)).astype(np.float32)
