"""Blur kernels for training: every shape that defocus, motion and shake may take, 1 to 29 px.

Families and their shares, ``paper_like`` and ``with_optics``::

    disc .17 .14         uniform disc of any diameter, at any sub-pixel place, sometimes squeezed or softened
    drawn disc .08 .07   the integer circles of the paper's program
    Gaussian .06 .05
    straight .23 .19     straight motion, with even or varying speed
    bent .37 .30         bent motion: smooth walks of varied persistence, straight pieces with corners, curved pieces
                         with stops, jitter along the way
    both .05 .04         motion and defocus together
    sharp .04 .04        hardly any blur
    iris 0 .07           defocus through an iris of flat blades, an obstructed pupil or two overlapping discs
    halo 0 .07           a compact core in a wide halo: spherical aberration, diffusion, a dirty lens
    optics 0 .03         random lenses by wave optics (`pipeline.camera.psf.wave_optics`), some of them shaken

Paths of light are spread bilinearly over pixels; some are softened, some cut at a greatest value (light drawn as an
even line does not pile up where it crosses itself).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.psf.defocus import authors_disc
from pipeline.camera.psf.nonlinear_motion import walk
from pipeline.camera.psf.raster import splat
from pipeline.errors import InputError, did_you_mean
from pipeline.streams import stream

CANVAS_PX = 49
LARGEST_PX = 29.0
POINTS = 512  # of light on a path
BLOCK = 250  # kernels drawn from one stream

Kernel = NDArray[np.float32]
Path = NDArray[Any]
Light = NDArray[Any]

_FAMILIES = ("disc", "drawn disc", "gaussian", "straight", "bent", "both", "sharp", "iris", "halo", "optics")
_SHARES = {
    "paper_like": (0.17, 0.08, 0.06, 0.23, 0.37, 0.05, 0.04),
    "with_optics": (0.14, 0.07, 0.05, 0.19, 0.30, 0.04, 0.04, 0.07, 0.07, 0.03),
}
DISTRIBUTIONS = tuple(_SHARES)


def draw(generator: np.random.Generator, distribution: str = "paper_like") -> Kernel:
    """One random kernel.

    Args:
        generator: source of randomness.
        distribution: one of `DISTRIBUTIONS`.

    Returns:
        (49, 49) float32, non-negative, sum 1, centred to about a pixel.

    Raises:
        InputError: another distribution.
    """
    if distribution not in _SHARES:
        raise InputError(
            f"training kernels: no distribution {distribution!r}; {did_you_mean(distribution, DISTRIBUTIONS)}"
        )
    shares = _SHARES[distribution]
    family = generator.choice(_FAMILIES[: len(shares)], p=shares)
    if family == "disc":
        kernel = _disc(generator, generator.uniform(1, 25))
    elif family == "drawn disc":
        kernel = authors_disc(generator.uniform(0, 25), CANVAS_PX).astype(np.float64)
    elif family == "gaussian":
        kernel = _gaussian(np.exp(generator.uniform(np.log(0.2), np.log(6))))
    elif family == "straight":
        kernel = _along(generator, *straight(generator), _size_px(generator))
    elif family == "bent":
        kernel = _along(generator, *bent(generator), _size_px(generator))
    elif family == "both":
        path = bent(generator) if generator.random() < 0.5 else straight(generator)
        kernel = _convolved(
            _along(generator, *path, generator.uniform(1, 18)), _disc(generator, generator.uniform(1, 12))
        )
    elif family == "iris":
        kernel = _iris(generator, generator.uniform(2, 24))
    elif family == "halo":
        kernel = _with_halo(generator)
    elif family == "optics":
        kernel = _rendered(generator)
    else:
        kernel = _gaussian(generator.uniform(0.05, 0.35))
    kernel = np.where(kernel < kernel.max() / 255, 0.0, kernel)
    return (kernel / kernel.sum()).astype(np.float32)


def block(
    index: int,
    seed: int,
    purpose: str = "training kernels",
    count: int = BLOCK,
    distribution: str = "paper_like",
) -> Kernel:
    """Kernels of block `index`, a pure function of the arguments: (count, 49, 49) float32."""
    generator = stream(seed, purpose, index)
    return np.stack([draw(generator, distribution) for _ in range(count)])


def bank(
    count: int,
    seed: int,
    *,
    purpose: str = "training kernels",
    distribution: str = "paper_like",
    folder: FilePath | None = None,
    executor: Mapping[str, Any] | None = None,
) -> NDArray[np.float16]:
    """Kernels 0 .. count - 1, drawn once and kept in a cache.

    Args:
        count: how many.
        seed: root of the streams.
        purpose: of the streams; training and validation kernels differ by it.
        distribution: one of `DISTRIBUTIONS`.
        folder: of the cache; None keeps nothing.
        executor: arguments of `pipeline.executor.run_map`.

    Returns:
        (count, 49, 49) float16; mapped from the file where there is a cache.
    """
    from pipeline.executor import run_map
    from pipeline.learning.bank import kept

    def draw_all() -> NDArray[np.float16]:
        blocks = range(-(-count // BLOCK))
        draw_block = partial(block, seed=seed, purpose=purpose, distribution=distribution)
        made = run_map(draw_block, blocks, label=purpose, **(executor or {}))
        return np.concatenate(made)[:count].astype(np.float16)

    name = purpose if distribution == "paper_like" else f"{purpose} {distribution}"
    return kept(folder, name, seed, count, __name__, draw_all)


def _size_px(generator: np.random.Generator) -> float:
    """Longer side of a motion's bounding box, pixels: even over the range, with more of the small ones."""
    largest = LARGEST_PX if generator.random() < 0.7 else LARGEST_PX / 3
    return float(generator.uniform(1, largest))


def straight(generator: np.random.Generator) -> tuple[Path, Light]:
    """Straight motion in a random direction: (POINTS,) complex positions and light."""
    path = np.linspace(0, 1, POINTS) * np.exp(2j * np.pi * generator.random())
    return path, _speed(generator) if generator.random() < 0.35 else np.ones(POINTS)


def bent(generator: np.random.Generator) -> tuple[Path, Light]:
    """Bent motion of a random sort: (POINTS,) complex positions and light."""
    sort = generator.choice(["smooth", "corners", "curves"], p=[0.35, 0.4, 0.25])
    if sort == "smooth":
        steps, light = walk(
            generator,
            intensity=1.0,
            bend=float(np.exp(generator.uniform(np.log(0.05), np.log(1.2)))),
            smoothness=float(np.exp(generator.uniform(np.log(0.015), np.log(0.5)))),
            dwell=float(generator.uniform(0, 0.8)),
        )
        path = steps[:: len(steps) // POINTS]
        light = light[:: len(light) // POINTS] if generator.random() < 0.5 else np.ones(POINTS)
    else:
        path = _pieces(generator, curved=sort == "curves")
        light = _speed(generator) if generator.random() < 0.4 else np.ones(POINTS)
    if generator.random() < 0.3:
        path = path + _jitter(generator) * np.ptp(np.abs(path - path[0]))
    return path, light


def _pieces(generator: np.random.Generator, curved: bool) -> Path:
    """Pieces with corners between them; pieces are straight, or arcs of random curvature.

    Corners either turn the heading by a random angle, or throw it to either side of a main direction (a zigzag).
    """
    count = int(np.round(np.exp(generator.uniform(np.log(2), np.log(14)))))
    lengths = generator.dirichlet(np.full(count, generator.uniform(0.5, 3)))
    widest = generator.uniform(0.15, 1) * np.pi
    if generator.random() < 0.5:
        headings = np.cumsum(generator.uniform(-widest, widest, count))
    else:
        side = np.where(generator.random(count) < generator.uniform(0.05, 0.5), -1, 1).cumprod()
        headings = side * generator.triangular(0, 0.8 * widest, widest, count)
    position = np.linspace(0, 1, POINTS, endpoint=False)
    piece = np.minimum(np.searchsorted(np.cumsum(lengths), position, side="right"), count - 1)
    heading = headings[piece]
    if curved:
        begin = np.concatenate([[0], np.cumsum(lengths)[:-1]])
        heading = heading + (generator.normal(0, 6, count)[piece]) * (position - begin[piece])
    return np.cumsum(np.exp(1j * (heading + 2 * np.pi * generator.random()))) / POINTS


def _speed(generator: np.random.Generator) -> Light:
    """Light along a path of varying speed: slow waves, or a few stops where it gathers: (POINTS,)."""
    position = np.linspace(0, 1, POINTS)
    if generator.random() < 0.5:
        wave = np.sin(position * generator.uniform(1, 12) + generator.uniform(0, 2 * np.pi))
        return np.maximum(1 + generator.uniform(0.1, 0.9) * wave, 0.05)
    light = np.ones(POINTS)
    for _ in range(int(generator.integers(1, 5))):
        centre, width = generator.uniform(-0.05, 1.05), generator.uniform(0.01, 0.12)
        light += generator.uniform(0.5, 8) * np.exp(-0.5 * ((position - centre) / width) ** 2)
    return light


def _jitter(generator: np.random.Generator) -> Path:
    """Trembling beside the path, a share of its extent: first-order noise of random pace, (POINTS,) complex."""
    from scipy.signal import lfilter

    memory = 1 - np.exp(generator.uniform(np.log(0.005), np.log(0.2)))
    white = generator.standard_normal(POINTS) + 1j * generator.standard_normal(POINTS)
    noise = lfilter([np.sqrt(1 - memory**2)], [1, -memory], white)
    return noise * generator.uniform(0.01, 0.12)


def _along(generator: np.random.Generator, path: Path, light: Light, size_px: float) -> NDArray[Any]:
    """A path as a kernel whose bounding box has a longer side of `size_px`, at a random sub-pixel place."""
    import cv2

    extent = max(np.ptp(path.real), np.ptp(path.imag))
    path = path * (max(size_px - 1, 0) / extent)
    path = path - np.average(path, weights=light) + complex(*generator.uniform(-0.5, 0.5, 2))
    kernel = _on_canvas(splat(path.real, path.imag, light))
    if generator.random() < 0.25:
        kernel = np.minimum(kernel, 1.5 * np.median(kernel[kernel > 0.05 * kernel.max()]))
    if generator.random() < 0.55:
        kernel = cv2.GaussianBlur(kernel, (0, 0), generator.uniform(0.15, 1.1), borderType=cv2.BORDER_CONSTANT)
    return kernel


def _disc(generator: np.random.Generator, diameter_px: float) -> NDArray[Any]:
    """A disc at a random sub-pixel place, 5 x 5 samples a pixel; some are squeezed, some softened."""
    import cv2

    fine = 5
    position = (np.arange(CANVAS_PX * fine) + 0.5) / fine - CANVAS_PX / 2
    squeeze = generator.uniform(0.9, 1.0) if generator.random() < 0.3 else 1.0
    x, y = (position - shift for shift in generator.uniform(-0.5, 0.5, 2))
    inside = (x[None] ** 2 + (y[:, None] / squeeze) ** 2 <= (diameter_px / 2) ** 2).astype(np.float64)
    kernel = inside.reshape(CANVAS_PX, fine, CANVAS_PX, fine).mean(axis=(1, 3))
    if generator.random() < 0.3:
        kernel = cv2.GaussianBlur(kernel, (0, 0), generator.uniform(0.2, 1.0), borderType=cv2.BORDER_CONSTANT)
    return kernel


def _iris(generator: np.random.Generator, diameter_px: float) -> NDArray[Any]:
    """Defocus through a pupil that is no clear disc, at a random sub-pixel place, 5 x 5 samples a pixel."""
    import cv2

    fine = 5
    position = (np.arange(CANVAS_PX * fine) + 0.5) / fine - CANVAS_PX / 2
    shift = generator.uniform(-0.5, 0.5, 2)
    x, y = (position[None] - shift[0]) * 2 / diameter_px, (position[:, None] - shift[1]) * 2 / diameter_px
    inside = (x**2 + y**2 <= 1).astype(np.float64)
    shape = generator.random()
    if shape < 0.5:  # flat blades
        blades, turn = int(generator.integers(5, 10)), generator.uniform(0, 2 * np.pi)
        for normal in turn + 2 * np.pi * np.arange(blades) / blades:
            inside *= x * np.cos(normal) + y * np.sin(normal) <= np.cos(np.pi / blades)
    elif shape < 0.75:  # central obstruction
        inside *= x**2 + y**2 >= generator.uniform(0.2, 0.6) ** 2
    else:  # vignetted
        angle, reach = generator.uniform(0, 2 * np.pi), generator.uniform(0.3, 1.1)
        inside *= (x - reach * np.cos(angle)) ** 2 + (y - reach * np.sin(angle)) ** 2 <= 1
    if generator.random() < 0.5:  # spherical aberration lights the rim or the middle
        inside *= np.maximum(1 + generator.uniform(-1, 2) * (x**2 + y**2), 0.05)
    kernel = inside.reshape(CANVAS_PX, fine, CANVAS_PX, fine).mean(axis=(1, 3))
    if generator.random() < 0.4:
        kernel = cv2.GaussianBlur(kernel, (0, 0), generator.uniform(0.2, 1.0), borderType=cv2.BORDER_CONSTANT)
    return kernel


def _with_halo(generator: np.random.Generator) -> NDArray[Any]:
    """A compact core that holds 15 to 90 % of the light, and the rest spread widely around it."""
    kind = generator.random()
    if kind < 0.5:
        core = _gaussian(np.exp(generator.uniform(np.log(0.2), np.log(2.0))))
    elif kind < 0.75:
        core = _disc(generator, generator.uniform(1, 6))
    else:
        core = _along(generator, *straight(generator), generator.uniform(1, 9))
    position = np.arange(CANVAS_PX) - CANVAS_PX // 2
    radius = np.hypot(position[:, None] - generator.uniform(-0.5, 0.5), position[None] - generator.uniform(-0.5, 0.5))
    extent_px = np.exp(generator.uniform(np.log(2.0), np.log(10.0)))
    shape = generator.random()
    if shape < 0.3:
        halo = np.exp(-0.5 * (radius / extent_px) ** 2)
    elif shape < 0.55:
        halo = np.exp(-radius / (0.6 * extent_px))
    elif shape < 0.8:
        halo = (1 + (radius / extent_px) ** 2) ** -generator.uniform(1.2, 3)  # Moffat
    else:
        halo = np.clip(1.2 * extent_px - radius + 0.5, 0, 1)  # a disc
    halo = np.where(radius < CANVAS_PX / 2, halo, 0.0)
    fraction = generator.uniform(0.15, 0.9)
    return fraction * core / core.sum() + (1 - fraction) * halo / halo.sum()


def _rendered(generator: np.random.Generator) -> NDArray[Any]:
    """A random lens by wave optics, a third of them shaken by a hand."""
    from pipeline.camera.psf.wave_optics import Lens, Optics, Shake, render

    blades = int(generator.choice([0, 0, 5, 6, 7, 8, 9]))
    degrees = generator.uniform(0, 360, 4)
    aberrations = generator.exponential((0.25, 0.25, 0.2)) * (generator.random(3) < 0.6)
    lens = Lens(
        f_number=float(generator.choice([1.8, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0])),
        blades=blades,
        iris_deg=float(degrees[0]),
        obstruction=float(generator.uniform(0.25, 0.5)) if blades == 0 and generator.random() < 0.3 else 0.0,
        vignetting=float(generator.uniform(0.2, 0.9)) if generator.random() < 0.3 else 0.0,
        vignetting_deg=float(degrees[1]),
        defocus_px=float(generator.uniform(-22, 22)) if generator.random() < 0.6 else float(generator.uniform(-3, 3)),
        colour_px=float(generator.uniform(0, 1.2)),
        astigmatism=float(min(aberrations[0], 1.2)),
        astigmatism_deg=float(degrees[2]),
        coma=float(min(aberrations[1], 1.5)),
        coma_deg=float(degrees[3]),
        spherical=float(min(aberrations[2], 1.0) * generator.choice([-1, 1])),
    )
    shake = None
    if generator.random() < 0.33:
        shake = Shake(float(generator.uniform(2, 18)), float(np.exp(generator.uniform(np.log(0.03), np.log(0.5)))))
    name = f"training {int(generator.integers(1 << 31))}"  # names the stream of the shake
    return _on_canvas(render(Optics(name, "training", lens, shake), 0)[0].astype(np.float64))


def _gaussian(sigma_px: float) -> NDArray[Any]:
    """A sampled Gaussian."""
    position = np.arange(CANVAS_PX) - CANVAS_PX // 2
    profile = np.exp(-0.5 * (position / sigma_px) ** 2)
    return np.outer(profile, profile)


def _convolved(first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any]:
    """Two kernels in sequence, cut to the canvas."""
    from scipy.signal import fftconvolve

    return np.maximum(fftconvolve(first, second, mode="same"), 0.0)


def _on_canvas(kernel: NDArray[Any]) -> NDArray[Any]:
    """A square kernel of odd side in the middle of the canvas, cut where it is larger."""
    add = (CANVAS_PX - len(kernel)) // 2
    if add >= 0:
        return np.pad(kernel, add)
    return np.ascontiguousarray(kernel[-add:add, -add:add])
