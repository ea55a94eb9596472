"""Cases that the tests of both blind deconvolution estimators share: known blur, and the reference kernels."""

from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from scipy import signal

from pipeline import blur
from pipeline.streams import stream

MARGIN_PX = 16


def _disc(diameter_px: float, size: int) -> np.ndarray:
    fine = (np.arange(size * 8) + 0.5) / 8 - size / 2
    inside = np.hypot(*np.meshgrid(fine, fine)) <= diameter_px / 2
    return inside.reshape(size, 8, size, 8).mean(axis=(1, 3))


def _diagonal(length_px: int) -> np.ndarray:
    return cv2.GaussianBlur(np.eye(length_px), (3, 3), 0.6)


KERNELS = {
    name: kernel / kernel.sum()
    for name, kernel in {"disc": _disc(7, 9), "horizontal": np.ones((1, 9)), "diagonal": _diagonal(11)}.items()
}


@lru_cache(maxsize=4)
def _scene(index: int) -> np.ndarray:
    """(192 + margins)^2 of overlapping boxes and discs, 8-bit values."""
    numbers = stream(20, "scene", index)
    side = 192 + 2 * MARGIN_PX
    image = np.full((side, side), 0.5)
    for _ in range(120):
        shade, (x, y) = float(numbers.uniform(0.05, 0.95)), numbers.integers(0, side, 2).tolist()
        size = int(numbers.integers(8, 40))
        if numbers.random() < 0.5:
            cv2.circle(image, (x, y), size // 2, shade, -1, cv2.LINE_AA)
        else:
            corners = cv2.boxPoints(((x, y), (size, 0.6 * size), float(numbers.uniform(0, 90)))).astype(np.int32)
            cv2.fillPoly(image, [corners], shade)
    return image


def blurred_scene(kernel: np.ndarray) -> np.ndarray:
    """(2, 1, 192, 192) float32 patches of synthetic scenes, blurred and rounded to 8 bits."""
    middle = slice(MARGIN_PX, -MARGIN_PX)
    patches = [signal.fftconvolve(_scene(index), kernel, mode="same")[middle, middle] for index in range(2)]
    return (np.rint(np.clip(np.stack(patches), 0, 1) * 255) / 255).astype(np.float32)[:, None]


def check_vector(shared: Path, name: str, tolerance: float) -> np.ndarray:
    """The exact kernel of a reference patch, which must be the stored one."""
    stored = np.load(shared / "vectors/blind" / name)
    patches = (stored["patch"] / 255).astype(np.float32)[None, None]
    estimate = blur.create(name[:3], mode="exact", kernel_size=int(stored["kernel_size"])).estimate(patches)
    assert estimate.reason[0] == ""
    assert np.abs(estimate.kernel[0] - stored["kernel"]).max() < tolerance
    return estimate.kernel[0]


def check_the_authors_picture(kernel: np.ndarray, picture: Path) -> None:
    """The kernel, scaled to 8 bits and stored as the authors did, is their picture."""
    scaled = np.rint((kernel - kernel.min()) / (kernel.max() - kernel.min()) * 255).astype(np.uint8)
    _, stored = cv2.imencode(".jpg", scaled, [cv2.IMWRITE_JPEG_QUALITY, 75])
    assert np.array_equal(cv2.imdecode(stored, cv2.IMREAD_GRAYSCALE), cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE))
