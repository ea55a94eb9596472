"""A camera as it delivers pictures: settings of every step, and the steps in order.

    raw = mosaic(M^-1 scene) / balance
    raw + noise -> balance -> demosaic -> M -> tone -> denoise -> sharpen -> scale -> 8 bit -> codec

The scene is linear light in sRGB primaries. `CameraPipeline.shoot` takes one shot; two shots of one scene differ by
their noise alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import tone_curve
from pipeline.camera.processing import colour, demosaic, gaussian, scale, sharpen, white_balance
from pipeline.camera.processing.codec import Codec, Picture, store
from pipeline.camera.processing.denoise import Denoising, denoise_chroma, denoise_luma
from pipeline.camera.processing.mosaic import mosaic, per_pixel
from pipeline.camera.processing.raw_noise import RawNoise
from pipeline.camera.processing.sharpen import Sharpening
from pipeline.errors import InputError

Float = NDArray[np.float32]
LUMA = (0.299, 0.587, 0.114)  # BT.601 weights of encoded red, green, blue
_BLACK_SLOPE = 0.02  # linear light at which the tone curve's slope stands for that of the shadows


@dataclass(frozen=True)
class CameraPipeline:
    """Settings of a camera, step by step; the defaults leave every step out but the colour filter array.

    Attributes:
        noise: of the raw mosaic.
        balance: white-balance gains of red and blue.
        demosaicing: method (`demosaic.METHODS`), or None for a camera without colour filters.
        colour_diagonal, colour_split: of the colour matrix, see `colour.matrix`.
        gamma, s_curve: of the tone curve, see `pipeline.camera.tone_curve.render`.
        denoising, sharpening: settings of these steps.
        scaling, scaling_method: see `scale.resize`.
        earlier_codec: a JPEG generation before the last one (an edited or re-shared picture).
        codec: of the delivered picture.
        frames_before: shots of the same scene that come before in a video.
    """

    noise: RawNoise = field(default_factory=RawNoise)
    balance: tuple[float, float] = (1.0, 1.0)
    demosaicing: str | None = "malvar"
    colour_diagonal: tuple[float, float, float] = (1.0, 1.0, 1.0)
    colour_split: tuple[float, float, float] = (0.5, 0.5, 0.5)
    gamma: float = 2.2
    s_curve: float = 0.0
    denoising: Denoising = field(default_factory=Denoising)
    sharpening: Sharpening = field(default_factory=Sharpening)
    scaling: float = 1.0
    scaling_method: str = "area"
    earlier_codec: Codec = field(default_factory=Codec)
    codec: Codec = field(default_factory=Codec)
    frames_before: int = 0

    @property
    def colour_matrix(self) -> Float:
        """(3, 3) from the sensor's colours to sRGB primaries."""
        return colour.matrix(self.colour_diagonal, self.colour_split)

    def expose(self, scene: Float) -> Float:
        """The noise-free raw mosaic of a scene.

        Args:
            scene: (H, W, 3) linear light, sRGB primaries, [0, 1]; even sides.

        Returns:
            (H, W) float32 mosaic, fraction of white before white balance; of a camera without colour filters the
            scene's green.

        Raises:
            InputError: another shape, or odd sides.
        """
        if scene.ndim != 3 or scene.shape[2] != 3 or scene.shape[0] % 2 or scene.shape[1] % 2:
            raise InputError(f"camera pipeline: scene {scene.shape}, expected (H, W, 3) with even sides")
        if self.demosaicing is None:
            return np.ascontiguousarray(scene[..., 1])
        sensor = np.clip(colour.apply(scene, np.linalg.inv(self.colour_matrix).astype(np.float32)), 0, 1)
        return mosaic(sensor) / per_pixel((scene.shape[0], scene.shape[1]), *self.balance)

    def develop(self, raw: Float) -> Picture:
        """The delivered picture of a raw mosaic, up to the codec.

        Args:
            raw: (H, W) mosaic with noise.

        Returns:
            (h, w, 3) uint8 RGB.
        """
        if self.demosaicing is None:
            linear = np.repeat(raw[..., None], 3, axis=2)
        else:
            balanced = white_balance.balance(raw, *self.balance)
            linear = colour.apply(demosaic.demosaic(balanced, self.demosaicing), self.colour_matrix)
        planes = colour.to_luma_chroma(tone_curve.render(linear, self.gamma, self.s_curve))
        sigma = self.encoded_sigma(float(planes[..., 0].mean()))
        luma = denoise_luma(np.ascontiguousarray(planes[..., 0]), self.denoising, sigma)
        luma = sharpen.sharpen(luma, self.sharpening, sigma)
        chroma = [denoise_chroma(planes[..., index], self.denoising) for index in (1, 2)]
        planes = scale.resize(np.stack([luma, *chroma], axis=-1), self.scaling, self.scaling_method)
        return np.clip(np.rint(colour.to_rgb(planes) * 255), 0, 255).astype(np.uint8)

    def shoot(self, scene: Float, generator: np.random.Generator) -> Picture:
        """One shot: raw noise, processing and codec.

        Args:
            scene: (H, W, 3) linear light, [0, 1]; even sides.
            generator: source of the noise.

        Returns:
            (h, w, 3) uint8 RGB.
        """
        raw = self.expose(scene)
        pictures = [self.develop(self.noise.add(raw, generator)) for _ in range(1 + self.frames_before)]
        if self.earlier_codec.name != "none":
            pictures = [store(picture, self.earlier_codec) for picture in pictures]
        return store(pictures[-1], self.codec, pictures[:-1])

    def encoded_sigma(self, luma: float) -> float:
        """Standard deviation of the luma noise behind the tone curve, in first order, as the camera would know it.

        Noise of the raw pixel at that grey level, through the slope of the tone curve, the white-balance gains and the
        mean over neighbours that demosaicing takes; the correlation between colours is neglected, so it can be low by
        up to a half for colour cameras. So is the slope of the S-curve: in mid grey, behind the curve of the
        preset phone (0.35) without colour filters, it gives 1.27 DN where 1.74 DN are measured. Denoising and coring of
        training samples follow it, and so it stays.

        Args:
            luma: grey level, [0, 1].
        """
        light = max(luma**self.gamma, _BLACK_SLOPE)
        slope = light ** (1 / self.gamma - 1) / self.gamma
        gains = np.array([self.balance[0], 1.0, self.balance[1]]) if self.demosaicing else np.ones(3)
        variance = self.noise.shot * (light / gains + self.noise.read) * gains**2
        if self.demosaicing is None:
            return float(slope * np.sqrt(variance[1]))
        weights = np.asarray(LUMA) @ self.colour_matrix
        return float(slope * np.sqrt((weights**2 * variance * (0.6, 0.75, 0.6)).sum()))

    def with_noise(self, noise: RawNoise) -> CameraPipeline:
        """The same camera with another raw noise; `RawNoise()` makes it noise-free."""
        return replace(self, noise=noise)

    def transfer(self, frequencies: NDArray[np.floating]) -> NDArray[np.floating]:
        """Contrast that the linear steps keep, as delivered: demosaicing, softness, linear denoising, sharpening.

        Non-linear denoising, coring and codecs depend on the scene and are left out. Sharpening can lift the product
        above 1.

        Args:
            frequencies: cycles per pixel of the delivered picture, any shape; scaling must be 1.

        Returns:
            float64, same shape.

        Raises:
            InputError: a camera that scales its pictures.
        """
        if self.scaling != 1.0:
            raise InputError(f"camera pipeline: transfer of a camera with scaling={self.scaling}, expected 1")
        f = np.asarray(frequencies, dtype=np.float64)
        result = np.ones_like(f)
        if self.demosaicing is not None:
            curve = demosaic.transfer(self.demosaicing, tuple(float(value) for value in f.ravel()))
            result = result * np.reshape(curve, f.shape)
        denoising = self.denoising
        result = result * gaussian.transfer(denoising.softness_px, f)
        if denoising.method == "gaussian" and self.noise.shot:
            blurred = gaussian.transfer(denoising.radius_px, f)
            result = result * (1 - denoising.blend + denoising.blend * blurred)
        return result * sharpen.gain(self.sharpening, f)


def grey(picture: Picture) -> NDArray[np.uint8]:
    """Luma (BT.601) of a delivered RGB picture (H, W, 3): (H, W) uint8, as image readers compute it."""
    import cv2

    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
