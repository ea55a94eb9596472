"""Dead leaves: opaque shapes of power-law sizes falling on each other, with textures and shading.

The model has the edges, occlusions and scale invariance of natural images (Lee, Mumford and Huang, "Occlusion models
for natural images", IJCV 2001; radii with density r^-a, a about 3). A leaf's grey comes from one of three palettes: all
greys, a few greys, or a beta distribution.
"""

from __future__ import annotations

import numpy as np

from pipeline.learning.textures import OUTLINES, Plane, fill, outline, shading, texture


def draw(generator: np.random.Generator, size_px: int, supersampling: int = 2) -> Plane:
    """One picture of dead leaves.

    Args:
        generator: source of randomness.
        size_px: side of the picture, pixels.
        supersampling: it is drawn that much finer and averaged, so edges are those of square pixels.

    Returns:
        (size, size) float32, 0..255.
    """
    import cv2

    fine_px = size_px * supersampling
    count = int(np.exp(generator.uniform(np.log(150), np.log(4500))))
    radii = _radii(generator, count, supersampling)
    greys = _greys(generator, count)
    kinds = generator.choice(OUTLINES, count, p=generator.dirichlet(np.ones(3)))
    centres = generator.uniform(-20, fine_px + 20, (count, 2))
    textures = [texture(generator, fine_px) for _ in range(2)]
    textured = (radii > 12 * supersampling) & (generator.random(count) < generator.uniform(0, 0.5))
    image = np.full((fine_px, fine_px), generator.uniform(0, 255), np.float32)
    for index in range(count):
        centre = (float(centres[index, 0]), float(centres[index, 1]))
        corners = outline(generator, str(kinds[index]), centre, float(radii[index]))
        if not textured[index]:
            fill(image, corners, float(greys[index]))
            continue
        low = np.clip(np.floor(corners.min(axis=0)).astype(int), 0, fine_px)
        high = np.clip(np.ceil(corners.max(axis=0)).astype(int) + 1, 0, fine_px)
        if (high <= low).any():
            continue
        mask = np.zeros((high[1] - low[1], high[0] - low[0]), np.uint8)
        fill(mask, corners - low, 255)
        contrast_dn = np.float32(np.exp(generator.uniform(np.log(1.5), np.log(45))))
        part = (slice(low[1], high[1]), slice(low[0], high[0]))
        surface = textures[int(generator.integers(2))][part] * contrast_dn + np.float32(greys[index])
        image[part] = np.where(mask > 0, surface, image[part])
    if generator.random() < 0.6:
        image += shading(generator, fine_px)
    return cv2.resize(np.clip(image, 0, 255), (size_px, size_px), interpolation=cv2.INTER_AREA)


def _radii(generator: np.random.Generator, count: int, supersampling: int) -> np.ndarray:
    """Radii from a power law, mostly with the large leaves lying lower: (count,) fine pixels."""
    smallest = generator.uniform(1.5, 8) * supersampling
    largest = generator.uniform(30, 150) * supersampling
    exponent = generator.uniform(1.4, 2.2)  # of the distribution function: density r^-(exponent + 1)
    ends = smallest**-exponent, largest**-exponent
    radii = (ends[0] - generator.random(count) * (ends[0] - ends[1])) ** (-1 / exponent)
    if generator.random() < 0.6:
        disorder = radii.std() * generator.uniform(0, 2)
        radii = radii[np.argsort(generator.normal(0, disorder, count) - radii)]
    return radii


def _greys(generator: np.random.Generator, count: int) -> np.ndarray:
    """Greys of the leaves from a random palette: (count,) DN."""
    palette = generator.integers(3)
    if palette == 0:
        greys = generator.uniform(0, 255, count)
    elif palette == 1:
        greys = generator.choice(generator.uniform(0, 255, 6), count) + generator.normal(0, 12, count)
    else:
        greys = 255 * generator.beta(generator.uniform(0.5, 3), generator.uniform(0.5, 3), count)
    return np.clip(greys, 0, 255)
