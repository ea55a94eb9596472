"""Random cameras and coloured scenes: what networks for delivered pictures are trained on.

`draw` draws the settings of a whole camera (`pipeline.camera.processing`): most are colour cameras with demosaicing,
denoising, sharpening and a codec; some record the sensor's white noise through a codec alone. Ranges were set by the
spectra of real camera noise: lag-1 correlations of 0 to 0.8, denoising in half of the cameras (more would make texture
and noise alike), JPEG in most.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import tone_curve
from pipeline.camera.processing.codec import Codec
from pipeline.camera.processing.denoise import Denoising
from pipeline.camera.processing.develop import CameraPipeline
from pipeline.camera.processing.raw_noise import RawNoise
from pipeline.camera.processing.sharpen import Sharpening
from pipeline.learning.settings import CameraRecipe
from pipeline.learning.textures import smooth_field

Plane = NDArray[np.float32]

_MID_GREY = 0.2  # linear light at which a noise level in DN is turned into the raw noise's variance
_TONE_SLOPE = 1.1  # of the tone curve there: grey levels per unit of linear light, about
_CHROMA_LEVELS = 12


def draw(generator: np.random.Generator, recipe: CameraRecipe) -> CameraPipeline:
    """A random camera."""
    sigma = 0.0
    if generator.random() >= recipe.noise_free_fraction:
        sigma = _log_uniform(generator, *recipe.sigma_dn)
    if generator.random() < recipe.codec_only_fraction:
        return _recorder(generator, sigma, recipe)
    read = _log_uniform(generator, 3e-4, 6e-2)
    shot = (sigma / 255 / _TONE_SLOPE) ** 2 / (_MID_GREY + read)
    row = float(generator.uniform(0, 0.25)) if generator.random() < 0.15 else 0.0
    diagonal, split = generator.uniform(1.1, 1.9, 3), generator.uniform(0.2, 0.8, 3)
    codec, earlier, before = _codecs(generator, recipe)
    scaling, method = _scaling(generator, recipe)
    return CameraPipeline(
        noise=RawNoise(shot, read, row),
        balance=(float(generator.uniform(1.3, 2.6)), float(generator.uniform(1.2, 2.4))),
        demosaicing=str(generator.choice(["edge_aware", "malvar", "bilinear"], p=[0.45, 0.3, 0.25])),
        colour_diagonal=(float(diagonal[0]), float(diagonal[1]), float(diagonal[2])),
        colour_split=(float(split[0]), float(split[1]), float(split[2])),
        gamma=float(generator.uniform(1.8, 2.5)),
        s_curve=float(generator.uniform(0, 0.6)),
        denoising=_denoising(generator, recipe),
        sharpening=_sharpening(generator),
        scaling=scaling,
        scaling_method=method,
        earlier_codec=earlier,
        codec=codec,
        frames_before=before,
    )


def _denoising(generator: np.random.Generator, recipe: CameraRecipe) -> Denoising:
    method = "none"
    if generator.random() < recipe.denoising_fraction:
        methods = ("gaussian", "shrinkage", "bilateral", "nlm", "median")
        method = str(generator.choice(methods, p=[0.22, 0.5, 0.18, 0.05, 0.05]))
    return Denoising(
        method=method,
        blend=float(generator.uniform(0.3, 1.0)),
        strength=_log_uniform(generator, 0.5, 3.5),
        radius_px=float(generator.uniform(0.5, 1.5)),
        coarse=float(generator.uniform(0, 0.9)),
        softness_px=float(generator.uniform(0.35, 0.95)) if generator.random() < 0.6 else 0.0,
        chroma_px=float(generator.uniform(0.6, 4.0)) if generator.random() < 0.85 else 0.0,
    )


def _sharpening(generator: np.random.Generator) -> Sharpening:
    if generator.random() < 0.35:
        return Sharpening()
    coring = float(generator.uniform(0, 1.5)) if generator.random() < 0.3 else 0.0
    return Sharpening(float(generator.uniform(0.15, 1.3)), float(generator.uniform(0.7, 2.2)), coring)


def _scaling(generator: np.random.Generator, recipe: CameraRecipe) -> tuple[float, str]:
    method = str(generator.choice(["area", "linear", "cubic"]))
    if generator.random() >= recipe.scaling_fraction:
        return 1.0, method
    if generator.random() < 0.8:
        return float(generator.uniform(0.5, 1.0)), method
    return float(generator.uniform(1.0, 1.4)), "cubic" if method == "area" else method


def _codecs(generator: np.random.Generator, recipe: CameraRecipe) -> tuple[Codec, Codec, int]:
    """The last codec, an earlier one, and how many video frames come before."""
    corners = generator.integers(8, size=4)
    earlier = Codec()
    if generator.random() < 0.35:
        earlier = Codec("jpeg", int(generator.integers(85, 99)), corner=(int(corners[0]), int(corners[1])))
    corner = (int(corners[2]), int(corners[3]))
    if generator.random() < recipe.video_fraction:
        return _video(generator, corner), earlier, int(generator.integers(2))
    kind = generator.random()
    if kind < 0.2:
        return Codec(), earlier, 0
    low, high = (60, 92) if kind < 0.68 else (85, 100)
    full = bool(generator.random() < 0.25)
    return Codec("jpeg", int(generator.integers(low, high)), full, corner), earlier, 0


def _video(generator: np.random.Generator, corner: tuple[int, int]) -> Codec:
    name = str(generator.choice(["h264", "mpeg4", "mjpeg"], p=[0.5, 0.3, 0.2]))
    low, high = (16, 32) if name == "h264" else (1, 9)
    return Codec(name, int(generator.integers(low, high)), corner=corner)


def _recorder(generator: np.random.Generator, sigma_dn: float, recipe: CameraRecipe) -> CameraPipeline:
    """White noise on grey levels, and a codec: a machine-vision camera behind a recorder."""
    read = float(np.exp(generator.uniform(np.log(0.02), np.log(30.0))))
    shot = (sigma_dn / 255) ** 2 / (0.45 + read)
    corner = generator.integers(8, size=2)
    position = (int(corner[0]), int(corner[1]))
    if generator.random() < 2 * recipe.video_fraction:
        codec, before = _video(generator, position), int(generator.integers(2))
    else:
        codec, before = Codec("jpeg", int(generator.integers(55, 99)), bool(generator.random() < 0.25), position), 0
    scaling, method = (1.0, "area") if generator.random() < 0.9 else _scaling(generator, recipe)
    return CameraPipeline(
        noise=RawNoise(shot, read), demosaicing=None, gamma=1.0, scaling=scaling, scaling_method=method, codec=codec,
        frames_before=before,
    )  # fmt: skip


def coloured(grey: Plane, generator: np.random.Generator, *, linear: bool = True) -> Plane:
    """A colour scene whose green is a given grey picture.

    Red and blue differ from green by grey level (materials) and by smooth fields (light); one scene in five is grey.

    Args:
        grey: (S, S) encoded grey levels, [0, 1].
        generator: source of randomness.
        linear: decode to linear light (power 2.2) first.

    Returns:
        (S, S, 3) float32 in [0, 1].
    """
    green = tone_curve.linearise(grey) if linear else grey
    if generator.random() < 0.2:
        return np.repeat(green[..., None], 3, axis=2)
    saturation = float(generator.uniform(0.05, 0.6))
    levels = np.linspace(0, 1, _CHROMA_LEVELS)
    channels = [green, green, green]
    for index in (0, 2):
        by_level = np.interp(grey, levels, generator.normal(0, saturation, _CHROMA_LEVELS)).astype(np.float32)
        field = smooth_field(generator, len(grey), 1.8) * np.float32(0.5 * saturation)
        channels[index] = green * np.exp(np.clip(by_level + field, -1.5, 1.2))
    return np.clip(np.stack(channels, axis=-1), 0, 1).astype(np.float32)


def _log_uniform(generator: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))
