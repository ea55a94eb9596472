"""Labelled samples: a sharp view, blurred by a kernel, with noise, in 8 bit; the label is the MTF.

    D = round_or_floor(clip(255 (I * h * G_a) + n)),    label(f) = |H(f)| exp(-2 pi^2 a^2 f^2)

I is a procedural view, h a training kernel, G_a the intrinsic blur that any lens and sensor have: a Gaussian of a px, a
uniform in its range. The label is the *total* MTF, as a real sharp frame is not perfectly sharp either; what was added
to it is found by dividing by the camera's own. Noise n is added after the blur (dark current, readout, photon-like,
mixed), or enters before it (photon noise of the scene, which the blur then smooths); sigma counts what came after.

A fraction of the samples is delivered by a random camera (`pipeline.learning.cameras`) instead: mosaic, raw noise,
demosaicing, denoising, sharpening and a codec act on the blurred scene. Their label is multiplied by the contrast that
the camera's linear steps keep, and limited to 1 where sharpening lifts it above: the MTF of the picture as delivered.
Half of these scenes are blurred in linear light. Their sigma is how the picture deviates from that of the same camera
without noise, which neither denoises nor codes: an error that is known and kept, since the released weights follow
from it. What denoising smooths and a codec changes counts as noise, 1.08 times that from shot to shot by the median of
39 random cameras, 2.6 times in one of ten.

Samples come in chunks; chunk c is a pure function of (seed, purpose, c), so it may be made ahead, by any process.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from dataclasses import replace as replaced
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import mtf, tone_curve
from pipeline.camera.constants import PAPER_FULL_WELL_E, PAPER_HOT_DARK_E, PAPER_HOT_READOUT_E
from pipeline.camera.processing.develop import grey
from pipeline.camera.processing.raw_noise import RawNoise
from pipeline.learning import cameras, images, kernels
from pipeline.learning.settings import Recipe
from pipeline.streams import stream, torch_stream

if TYPE_CHECKING:
    import torch

PATCH_PX = 192
MARGIN_PX = 24  # the blur wraps round within it; it is cut away
FIELD_PX = PATCH_PX + 2 * MARGIN_PX
CAMERA_MARGIN_PX = 8  # of the field that a camera sees beside the patch; its filters and block grid reach into it
CAMERA_GAMMA = 2.2  # of the views, undone before they are blurred in linear light
LINEAR_FRACTION = 0.5  # of the views that a camera delivers
KINDS = ("photon", "dcsn", "readout", "combined")


@dataclass(frozen=True)
class Chunk:
    """A batch of labelled samples.

    Attributes:
        patches_dn: (N, 192, 192) uint8.
        mtf: (N, 2, 8) float32 in [0, 1]: total MTF, horizontal then vertical.
        sigma_dn: (N,) float32, noise added after the blur, DN before clipping.
    """

    patches_dn: NDArray[np.uint8]
    mtf: NDArray[np.float32]
    sigma_dn: NDArray[np.float32]


@dataclass(frozen=True)
class _Origin:
    """How each view of a chunk comes about, (V,) bool each.

    Attributes:
        noisy: noise enters before the blur.
        delivered: by a random camera.
        linear: blurred in linear light; such views are delivered.
    """

    noisy: NDArray[np.bool_]
    delivered: NDArray[np.bool_]
    linear: NDArray[np.bool_]


@dataclass
class Samples:
    """Makes chunks.

    Attributes:
        tiles: (M, T, T) uint8 bank of pictures.
        kernels: (K, 49, 49) bank of kernels.
        recipe: shares and ranges.
        seed, purpose: of the random streams.
    """

    tiles: NDArray[np.uint8]
    kernels: NDArray[np.floating]
    recipe: Recipe
    seed: int
    purpose: str = "training samples"
    _waves: tuple[torch.Tensor, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        import torch

        position = torch.arange(kernels.CANVAS_PX) - kernels.CANVAS_PX // 2
        rows, columns = torch.fft.fftfreq(FIELD_PX), torch.fft.rfftfreq(FIELD_PX)
        bins = torch.from_numpy(mtf.FREQUENCIES / 2).float()  # cycles per pixel
        wave = [torch.exp(-2j * torch.pi * torch.outer(axis, position)) for axis in (rows, columns, bins)]
        self._waves = (*wave, rows[:, None] ** 2, columns[:, None] ** 2, bins**2)

    def chunk(self, index: int) -> Chunk:
        """Chunk `index`."""
        import torch

        generator = stream(self.seed, self.purpose, index)
        torch_generator = torch_stream(self.seed, self.purpose, index)
        scene = torch.from_numpy(self._views(generator))
        origin = self._origin(generator)
        scene[origin.linear] = scene[origin.linear] ** CAMERA_GAMMA
        if origin.noisy.any():
            sigma = self._levels(generator, int(origin.noisy.sum()))
            noise = noise_e(scene[origin.noisy], torch.zeros(len(sigma), dtype=torch.long), torch_generator)
            scene[origin.noisy] = (scene[origin.noisy] + scaled(noise, sigma) / 255).clamp(0, 1)
        field, label = self._blurred(scene, generator)
        inside = slice(MARGIN_PX, MARGIN_PX + PATCH_PX)
        image_dn, sigma = self._with_noise(field[:, inside, inside].clamp(0, 1), origin, generator, torch_generator)
        half = torch.from_numpy(
            np.where(generator.random((self.recipe.chunk, 1, 1)) < 0.5, 0.5, 0.0).astype(np.float32)
        )
        whole = (image_dn.clamp(0, 255) + half).floor().clamp(0, 255).to(torch.uint8)  # rounded, or cut as by many
        chunk = Chunk(whole.numpy(), label.numpy(), sigma.float().numpy())
        for number in np.flatnonzero(np.tile(origin.delivered, self.recipe.kernels_per_view)):
            linear = bool(origin.linear[number % self.recipe.views])
            self._deliver(chunk, int(number), field[number].numpy(), linear, generator)
        return chunk

    def _views(self, generator: np.random.Generator) -> NDArray[np.float32]:
        """Sharp views (V, 240, 240) in [0, 1]."""
        return np.stack(
            [
                images.view(
                    self.tiles[int(generator.integers(len(self.tiles)))], generator, FIELD_PX, self.recipe.anisotropy
                )
                for _ in range(self.recipe.views)
            ]
        )

    def _origin(self, generator: np.random.Generator) -> _Origin:
        """Of each view, whether noise enters before the blur, whether a camera delivers it, and from which light."""
        recipe = self.recipe
        noisy = generator.random(recipe.views) < recipe.pre_blur_noise_fraction
        if not recipe.camera_fraction:
            return _Origin(noisy, np.zeros(recipe.views, bool), np.zeros(recipe.views, bool))
        delivered = generator.random(recipe.views) < recipe.camera_fraction
        linear = delivered & (generator.random(recipe.views) < LINEAR_FRACTION)
        return _Origin(noisy & ~delivered, delivered, linear)

    def _with_noise(
        self, blurred: torch.Tensor, origin: _Origin, generator: np.random.Generator, torch_generator: torch.Generator
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Blurred patches with noise of their own, DN, and its level: 0 where they have noise from elsewhere.

        Args:
            blurred: (N, 192, 192) in [0, 1]; N = kernels_per_view V, view by view for each kernel.
            origin: of the V views.
            generator: source of randomness.
            torch_generator: that of the noise.
        """
        import torch

        recipe = self.recipe
        kind = torch.from_numpy(generator.integers(len(KINDS), size=recipe.chunk))
        clean_share = recipe.clean_fraction / max(1 - recipe.pre_blur_noise_fraction, 1e-9)
        noisy = generator.random(recipe.chunk) >= clean_share
        noisy &= ~np.tile(origin.noisy | origin.delivered, recipe.kernels_per_view)
        after = torch.from_numpy(noisy)
        sigma = self._levels(generator, recipe.chunk) * after
        image_dn = blurred * 255
        if after.any():
            image_dn[after] += scaled(noise_e(blurred[after], kind[after], torch_generator), sigma[after])
        return image_dn, sigma

    def _deliver(
        self, chunk: Chunk, number: int, blurred: NDArray[np.float32], linear: bool, generator: np.random.Generator
    ) -> None:
        """Replace a sample of the chunk by what a random camera delivers of the blurred scene.

        Args:
            chunk: its arrays are written to.
            number: of the sample.
            blurred: (FIELD_PX, FIELD_PX), encoded grey levels or linear light.
            linear: whether it is linear light.
            generator: source of randomness.
        """
        camera = cameras.draw(generator, self.recipe.cameras)
        margin = slice(MARGIN_PX - CAMERA_MARGIN_PX, MARGIN_PX + PATCH_PX + CAMERA_MARGIN_PX)
        light = np.clip(blurred[margin, margin], 0, 1)
        colours = camera.demosaicing is not None
        encoded = tone_curve.render(light) if linear else light
        rgb = cameras.coloured(encoded, generator, linear=colours)
        inside = slice(CAMERA_MARGIN_PX, CAMERA_MARGIN_PX + PATCH_PX)
        patch = grey(camera.shoot(rgb, generator))[inside, inside]
        chunk.patches_dn[number] = patch
        chunk.mtf[number] = np.clip(chunk.mtf[number] * camera.transfer(mtf.FREQUENCIES / 2), 0, 1)
        chunk.sigma_dn[number] = 0.0
        if camera.noise.shot:
            clean = grey(replaced(camera, noise=RawNoise()).develop(camera.expose(rgb)))[inside, inside]
            chunk.sigma_dn[number] = np.std(patch.astype(np.float32) - clean)

    def _levels(self, generator: np.random.Generator, count: int) -> torch.Tensor:
        """Noise levels, DN: half even, half logarithmic."""
        import torch

        largest = self.recipe.largest_sigma_dn
        even, logarithmic = generator.uniform(0, largest, count), np.exp(generator.uniform(0, np.log(largest), count))
        return torch.from_numpy(np.where(generator.random(count) < 0.5, even, logarithmic).astype(np.float32))

    def _blurred(self, scene: torch.Tensor, generator: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor]:
        """Every view under its kernels and intrinsic blur: (N, 240, 240), and the total MTF (N, 2, 8)."""
        import torch

        kernel = self._kernels(generator)
        low, high = self.recipe.intrinsic_px
        variance = torch.from_numpy(generator.uniform(low, high, (len(kernel), 1, 1)).astype(np.float32)) ** 2

        def gaussian(frequencies_squared: torch.Tensor) -> torch.Tensor:
            """Transfer of the intrinsic blur, which is separable."""
            return torch.exp(-2 * torch.pi**2 * variance * frequencies_squared)

        rows, columns, bins, rows_squared, columns_squared, bins_squared = self._waves
        transfer = (rows * gaussian(rows_squared) @ kernel.to(torch.complex64)) @ (
            columns * gaussian(columns_squared)
        ).mT
        spectrum = torch.fft.rfft2(scene).repeat(self.recipe.kernels_per_view, 1, 1)
        image = torch.fft.irfft2(spectrum * transfer, s=(FIELD_PX, FIELD_PX))
        curves = torch.stack([(kernel.sum(axis).to(torch.complex64) @ bins.T).abs() for axis in (1, 2)], dim=1)
        return image, curves * gaussian(bins_squared)

    def _kernels(self, generator: np.random.Generator) -> torch.Tensor:
        """Kernels (N, 49, 49) of the bank in random order, each one mirrored and transposed at random."""
        import torch

        count = self.recipe.chunk
        picked = self.kernels[np.sort(generator.integers(len(self.kernels), size=count))[generator.permutation(count)]]
        kernel = torch.from_numpy(np.asarray(picked, dtype=np.float32))
        for turned in (lambda values: values.flip(1), lambda values: values.flip(2), lambda values: values.mT):
            kernel = torch.where(torch.from_numpy(generator.random((count, 1, 1)) < 0.5), turned(kernel), kernel)
        return kernel


def noise_e(image: torch.Tensor, kind: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    """Electrons of noise, natural size, in the normal approximation (counts here are large).

    Photon noise has the variance of the signal; all charge saturates at the full well, so bright parts get one-sided
    noise; readout comes after that.

    Args:
        image: (N, H, W) in [0, 1].
        kind: (N,) index into `KINDS`.
        generator: source of randomness.

    Returns:
        (N, H, W) electrons.
    """
    import torch

    from pipeline.learning.elementwise import square_root

    kind = kind.view(-1, 1, 1)
    signal = image * PAPER_FULL_WELL_E
    photon, dark, readout = (kind == 0) | (kind == 3), (kind == 1) | (kind == 3), kind >= 2
    variance = signal * photon + PAPER_HOT_DARK_E * dark
    charge = signal + torch.randn(image.shape, generator=generator) * square_root(variance)
    noise = charge.clamp(0, PAPER_FULL_WELL_E) - signal
    if readout.any():
        noise = noise + torch.randn(image.shape, generator=generator) * (PAPER_HOT_READOUT_E * readout)
    return noise


def scaled(noise: torch.Tensor, sigma_dn: torch.Tensor) -> torch.Tensor:
    """Noise maps (N, H, W) brought to a root mean square (N,), DN; a map without noise stays as it is.

    It is the standard deviation, but for photon and dark noise of nearly white patches, which the full well clips from
    above: at 10 DN the mean of a white patch's noise is -5.7 DN and its standard deviation 8.2 DN.
    """
    deviation = noise.flatten(1).norm(dim=1) / noise[0].numel() ** 0.5
    return noise * (sigma_dn / deviation.clamp_min(1e-3)).view(-1, 1, 1)
