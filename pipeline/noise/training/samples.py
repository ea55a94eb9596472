"""Labelled samples for the noise networks: a clean procedural view, a sensor's noise, 8 bit; the label is sigma.

    D = round_or_floor(clip(clip(255 I + n) + m)),   var(n) = g^2 (p I + d),   var(m) = g^2 r,
    sigma^2 = mean(var(n) + var(m))

I is a clean 8-bit image; n is the noise of the charge, photons p and dark current d, which the full well cuts; m is
that of readout r, which comes after. All are normal (the counts behind them are large). **The label is the deviation
before anything cuts the noise**: that of the sensor, locally, which photon noise makes larger where it is bright. In a
white sky half of the noise is cut away and the sensor's sigma follows from the other half.

Of a share of the samples I is what a tone curve made of linear light, I = x^(1 / gamma), as of a monochrome camera with
a gamma. Noise then came to x, and is strongest in the shadows, where the curve is steep (`noise_by_level`):

    D = round_or_floor(clip(255 (x + n)^(1 / gamma))),    var(n) = g^2 (p x + d + r)

There black cuts the noise before the curve, which would make any noise below it large: the label is the deviation
behind the curve, of noise that black has cut and white has not.

What the networks must not take for noise is in I: fine texture with the falling spectrum of natural surfaces,
everywhere or by material; noise that a lens or a motion has blurred; what interpolation and compression leave.

Samples come in chunks; chunk i is a pure function of (seed, purpose, i).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import tone_curve
from pipeline.learning import images
from pipeline.learning.textures import power_law, smooth_field
from pipeline.noise.maps import CELL_PX
from pipeline.noise.settings import Recipe
from pipeline.streams import stream

MARGIN_PX = 16
FULL_WELL_SHARE = 0.85
"""How often the full well lies at white, as in the paper's sensor, so that charge cannot exceed it."""
_GAIN_ROUNDS = 8
_MOST_NOISE_AT_WHITE = 0.5
"""In linear light, as a share of white: a dark patch's photon noise does not grow beyond reason."""

Plane = NDArray[np.float32]


@dataclass(frozen=True)
class Chunk:
    """A batch of labelled samples.

    Attributes:
        patches_dn: (N, S, S) uint8.
        sigma_dn: (N,) float32, root mean square over the patch, before clipping.
        map_dn: (N, S / 8, S / 8) float32, the same per cell.
    """

    patches_dn: NDArray[np.uint8]
    sigma_dn: Plane
    map_dn: Plane


def chunk(tiles: NDArray[np.uint8], recipe: Recipe, seed: int, purpose: str, index: int) -> Chunk:
    """One chunk of samples.

    Args:
        tiles: (M, T, T) bank of pictures (`pipeline.learning.images`).
        recipe: shares and ranges.
        seed: root of the streams.
        purpose: of the streams; training and validation differ by it.
        index: number of the chunk.
    """
    generator = stream(seed, purpose, index)
    picked = generator.integers(len(tiles), size=recipe.views)
    clean = [clean_view(tiles[int(number)], recipe, generator) for number in picked]
    made = [noisy(view, recipe, generator) for view in clean for _ in range(recipe.noises)]
    patches, sigma, maps = zip(*made, strict=True)
    return Chunk(np.stack(patches), np.array(sigma, np.float32), np.stack(maps))


def clean_view(tile: NDArray[np.uint8], recipe: Recipe, generator: np.random.Generator) -> Plane:
    """A clean image: (S, S) float32, whole numbers 0..255."""
    size_px = recipe.size_px + 2 * MARGIN_PX
    image = images.view(tile, generator, min(size_px, len(tile))) * np.float32(255)
    if generator.random() < recipe.texture_fraction:
        image = textured(image, generator)
    if generator.random() < recipe.interpolated_fraction:
        image = _interpolated(image, generator)
    image = exposed(image, generator)
    if generator.random() < recipe.blurred_noise_fraction:
        image = _with_blurred_noise(image, generator)
    else:
        image = _sharpness(image, generator)
    inside = slice(MARGIN_PX, MARGIN_PX + recipe.size_px)
    whole = np.rint(np.clip(image, 0, 255)).astype(np.uint8)
    if generator.random() < recipe.compressed_fraction:
        whole = _compressed(whole, generator)
    return whole[inside, inside].astype(np.float32)


def noisy(clean: Plane, recipe: Recipe, generator: np.random.Generator) -> tuple[NDArray[np.uint8], float, Plane]:
    """Sensor noise on a clean image: the 8-bit patch, its sigma, and the sigma of its cells.

    Args:
        clean: (S, S) whole numbers 0..255.
        recipe: range of the noise.
        generator: source of randomness.
    """
    low, high = recipe.sigma_dn
    kind = generator.random()
    if kind < recipe.clean_fraction:
        return clean.astype(np.uint8), 0.0, _of_cells(np.zeros_like(clean))
    if kind < recipe.clean_fraction + recipe.low_fraction:
        sigma = float(np.exp(generator.uniform(np.log(max(low, 0.3)), np.log(8.0))))
    else:
        sigma = float(generator.uniform(low, high))
    signal = clean / np.float32(255)
    photon, dark, readout = _source(generator, recipe.sources)
    if recipe.tone_curve_fraction and generator.random() < recipe.tone_curve_fraction:
        gamma = float(generator.uniform(*recipe.gamma))
        image, sigma_at = _behind_tone_curve(clean, sigma, (photon, dark, readout), gamma, generator)
        power = _of_cells((sigma_at**2)[clean.astype(np.intp)])
        return _rounded(image, generator), float(np.sqrt(power.mean())), np.sqrt(power)
    charge = photon * signal + np.float32(dark)
    # A patch in the dark of a frame whose noise is that of its bright parts: photon noise does not grow beyond reason.
    gain = np.float32(sigma / np.sqrt(max(float(charge.mean()) + readout, 0.02 * photon)))
    image = clean + np.sqrt(charge) * gain * generator.standard_normal(clean.shape, dtype=np.float32)
    if generator.random() < FULL_WELL_SHARE:
        np.clip(image, 0, 255, out=image)
    if readout:
        image += gain * np.float32(np.sqrt(readout)) * generator.standard_normal(clean.shape, dtype=np.float32)
    patch = _rounded(image, generator)
    power = _of_cells(charge + np.float32(readout)) * gain**2
    return patch, float(np.sqrt(power.mean())), np.sqrt(power)


def _of_cells(power: Plane) -> Plane:
    """Means over the cells of a patch: (S / 8, S / 8)."""
    cells = len(power) // CELL_PX
    return np.asarray(power.reshape(cells, CELL_PX, cells, CELL_PX).mean(axis=(1, 3)))


def _rounded(image: Plane, generator: np.random.Generator) -> NDArray[np.uint8]:
    """8 bit: rounded, or cut as by many cameras."""
    rounded = np.floor(image + 0.5) if generator.random() < 0.5 else np.floor(image)
    return np.clip(rounded, 0, 255).astype(np.uint8)


def _behind_tone_curve(
    clean: Plane, sigma_dn: float, source: tuple[float, float, float], gamma: float, generator: np.random.Generator
) -> tuple[Plane, Plane]:
    """Noise that came in linear light, behind the tone curve of a camera: strongest in the shadows.

    Args:
        clean: (S, S) whole numbers 0..255.
        sigma_dn: wanted root mean square over the patch.
        source: natural variances, see `_source`.
        gamma: of the curve.
        generator: source of randomness.

    Returns:
        (S, S) the picture, DN, not cut, and (256,) the noise of each grey level, DN.
    """
    level = clean.astype(np.intp)
    before, after_dn = noise_by_level(np.bincount(level.ravel(), minlength=256), sigma_dn, source, gamma)
    light = tone_curve.decode(np.arange(256) / 255, gamma)
    image = 255 * tone_curve.encode(light[level] + before[level] * generator.standard_normal(clean.shape), gamma)
    return image.astype(np.float32), after_dn.astype(np.float32)


def noise_by_level(
    pixels: NDArray[np.integer], sigma_dn: float, source: tuple[float, float, float], gamma: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Noise in linear light at each grey level, of a strength that is wanted behind the tone curve.

        var(x) = g^2 (p x + d + r),    x linear light,    g such that the root mean square over the pixels is sigma

    Args:
        pixels: (256,) of a picture with each grey level.
        sigma_dn: wanted. It is not reached where noise at white would be more than half of white.
        source: natural variances of photon noise at white, dark current and readout: p, d, r.
        gamma: of the curve.

    Returns:
        (256,) standard deviation before the curve, full scale 1; (256,) behind it, cut at black alone, DN.
    """
    photon, dark, readout = source
    light = tone_curve.decode(np.arange(256) / 255, gamma)
    natural = np.sqrt(photon * light + dark + readout)
    share = pixels / pixels.sum()

    def after_dn(gain: float) -> NDArray[np.float64]:
        return 255 * tone_curve.noise_after_curve(light, gain * natural, gamma, clip_white=False)

    gain = 1e-3
    for _ in range(_GAIN_ROUNDS):
        gain *= sigma_dn / np.sqrt(max(float(share @ after_dn(gain) ** 2), 1e-6))
        gain = min(gain, _MOST_NOISE_AT_WHITE / float(natural[-1]))
    return gain * natural, after_dn(gain)


def _source(generator: np.random.Generator, sources: str) -> tuple[float, float, float]:
    """Natural variances of photon noise at white, dark current and readout, as shares of the full well: p, d, r."""
    kind = generator.integers(7) if sources == "any" else 4
    if kind <= 1:
        return 1.0, 0.0, 0.0
    if kind == 2:
        return 0.0, 1.0, 0.0
    if kind == 3:
        return 0.0, 0.0, 1.0
    # The paper's sensor: readout 0.29, dark current 0.0002 (cool, short) to 0.7 (hot, long).
    dark, readout = np.exp(generator.uniform((np.log(2e-4), np.log(0.05)), (np.log(1.0), np.log(1.5))))
    return 1.0, float(dark), float(readout)


def textured(image: Plane, generator: np.random.Generator) -> Plane:
    """Fine texture over all, over some materials (ranges of grey), or in patches."""
    import cv2

    size = len(image)
    field = power_law(generator, size, generator.uniform(0.6, 2.0))
    if generator.random() < 0.3:  # grain of wood, grass, streaks
        long = int(size * generator.uniform(1.2, 5))
        sides = (long, size) if generator.random() < 0.5 else (size, long)
        field = np.asarray(cv2.resize(field, sides, interpolation=cv2.INTER_LINEAR)[:size, :size], dtype=np.float32)
    if generator.random() < 0.3:
        field = np.maximum(field, np.float32(generator.uniform(-0.5, 0.5))) * np.float32(1.5)
    strength = np.full_like(image, np.exp(generator.uniform(np.log(3), np.log(60))))
    where = generator.integers(3)
    if where == 1:
        levels = generator.uniform(0, 1.5, 8).astype(np.float32)
        strength = strength * levels[np.minimum(image // 32, 7).astype(int)]
    elif where == 2:
        strength = strength * np.clip(smooth_field(generator, size, 1.5) * 2 + generator.uniform(-1, 1), 0, 1.5)
    if generator.random() < 0.4:  # as of a surface, in proportion to its light
        strength = strength * image / np.float32(128)
    return (image + field * strength).astype(np.float32)


def _interpolated(image: Plane, generator: np.random.Generator) -> Plane:
    """Enlarged by a random factor from its middle, as a renderer's near textures or a resized frame."""
    import cv2

    size = len(image)
    inner = max(int(size / generator.uniform(1.1, 3.0)), 16)
    start = (size - inner) // 2
    method = cv2.INTER_CUBIC if generator.random() < 0.4 else cv2.INTER_LINEAR
    crop = np.ascontiguousarray(image[start : start + inner, start : start + inner])
    return np.asarray(cv2.resize(crop, (size, size), interpolation=method), dtype=np.float32)


def exposed(image: Plane, generator: np.random.Generator) -> Plane:
    """Of much contrast, of little, or so bright or dark that a part of it or all is clipped; DN.

    Outdoor frames span the whole range within a patch, from shadow to sky; how noise goes with brightness shows there.
    """
    if generator.random() < 0.35:
        image = image * _light(len(image), generator)
    kind = generator.random()
    if kind < 0.35:
        low, high = np.percentile(image, (generator.uniform(0, 25), generator.uniform(75, 100)))
        stretch = generator.uniform(150, 330) / max(high - low, 16)
        image = (image - np.float32(low)) * np.float32(stretch) + np.float32(generator.uniform(-15, 40))
    elif kind < 0.5:
        mean = image.mean()
        image = (image - mean) * np.float32(np.exp(-generator.uniform(0, 4))) + mean
    elif kind < 0.7:
        image = image + np.float32(255 * generator.uniform(0, 0.95))
    elif kind < 0.8:
        image = (image - np.float32(generator.uniform(0, 100))) * np.float32(np.exp(generator.uniform(-2.5, 0)))
    return np.clip(image, 0, 255)


def _light(size_px: int, generator: np.random.Generator) -> Plane:
    """Sun and shadow: a factor per pixel, (size, size), with edges from hard to very soft."""
    field = smooth_field(generator, size_px, generator.uniform(1.2, 2.2)) + np.float32(generator.uniform(-1, 1))
    sharpness = np.float32(np.exp(generator.uniform(0, np.log(30))))
    shadow = np.float32(np.exp(generator.uniform(np.log(0.08), np.log(0.7))))
    share = (1 + np.tanh(sharpness * field)) / 2
    return np.asarray(shadow + (1 - shadow) * share, dtype=np.float32)


def _sharpness(image: Plane, generator: np.random.Generator) -> Plane:
    """What every lens does, and now and then more: a Gaussian of up to 0.6 px, or up to 1.5."""
    import cv2

    spread_px = generator.uniform(0, 1.5) if generator.random() < 0.3 else generator.uniform(0, 0.6)
    return np.asarray(cv2.GaussianBlur(image, (0, 0), max(spread_px, 0.05)), dtype=np.float32)


def _with_blurred_noise(image: Plane, generator: np.random.Generator) -> Plane:
    """Noise of the scene's light, then a blur that is wide enough to leave its mark on it."""
    import cv2

    from pipeline.camera import psf

    sigma_dn = np.float32(np.exp(generator.uniform(np.log(2), np.log(30))))
    light = np.sqrt(np.maximum(image, 1) / 128) if generator.random() < 0.6 else np.float32(1)
    image = image + light * sigma_dn * generator.standard_normal(image.shape, dtype=np.float32)
    kind = str(generator.choice(["defocus", "linear_motion", "gaussian"]))
    size_px = float(generator.uniform(2.5, 9)) if kind == "gaussian" else float(generator.uniform(3, 21))
    angle = float(generator.uniform(0, 360)) if generator.random() < 0.5 else float(90 * generator.integers(2))
    kernel = psf.create(kind, size_px, 0.0 if kind == "gaussian" else angle)
    return np.asarray(cv2.filter2D(image, -1, kernel, borderType=cv2.BORDER_REFLECT), dtype=np.float32)


def _compressed(image: NDArray[np.uint8], generator: np.random.Generator) -> NDArray[np.uint8]:
    """Stored and read again as JPEG of a random quality, with its 8 px blocks anywhere."""
    import cv2

    corner = generator.integers(8, size=2)
    kept = image[corner[0] :, corner[1] :]
    coded = cv2.imencode(".jpg", kept, [cv2.IMWRITE_JPEG_QUALITY, int(generator.integers(60, 98))])[1]
    result = image.copy()
    result[corner[0] :, corner[1] :] = np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE))
    return result
