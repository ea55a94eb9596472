"""Blur an image by a point-spread function: true convolution, borders mirrored, float32 throughout.

    out(x, y) = sum over (i, j) of h(i, j) in(x - i, y - j)

with h's middle pixel as (0, 0). The image continues beyond its border as its mirror image about the border *pixel*
("reflect-101": d c b | a b c d | c b a; ``numpy.pad`` mode ``"reflect"``, SciPy mode ``"mirror"``), so brightness
near the border is kept. Since h is non-negative and of unit sum, no value may leave the range of the image; rounding
errors are cut back to it, so a constant image stays exactly constant.

Arrays: small kernels go through OpenCV's direct filter, larger ones through a real FFT, in strips that fit the
processor's cache (overlap-save) with the kernel's transform kept from call to call. Tensors: ``torch.fft`` on the
tensor's own device, the whole batch at once, differentiable.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from pipeline.arrays import refuse_masked
from pipeline.camera.psf.kernel import checked_psf, trimmed
from pipeline.errors import InputError, did_you_mean

if TYPE_CHECKING:
    import torch

BOUNDARIES = ("reflect", "zero")
DIRECT_MAX_PX = 11
"""Kernels up to this size are filtered directly: faster below about 13 px (benchmarks/blur.py)."""
STRIP_VALUES = 280_000
"""Size of one strip's transform, values: about 1 MB of float32."""

Image = TypeVar("Image", np.ndarray, "torch.Tensor")


def blur(image: Image, psf: np.ndarray, boundary: str = "reflect") -> Image:
    """Convolve an image, or a batch, with a PSF.

    Args:
        image: (H, W) or (N, 1, H, W) floating point, numpy or torch, linear light in [0, 1].
        psf: (h, w), odd sides, unit sum; or (N, h, w), one for each image of a batch.
        boundary: ``"reflect"``; or ``"zero"``, dark beyond the border, as in the paper's program.

    Returns:
        float32, same kind and shape as `image`. Under a PSF of one pixel the values are those of the image, bit for
        bit; in a batch of tensors with larger PSFs beside it, to rounding of the FFT (1e-6).

    Raises:
        InputError: an image that is not floating point, of another shape, has masked pixels or holds a value that is
            not finite, a PSF that is even, not of unit sum or not finite, or an unknown boundary.
    """
    if boundary not in BOUNDARIES:
        raise InputError(f"unknown boundary '{boundary}' for blur; {did_you_mean(boundary, BOUNDARIES)}")
    shape = tuple(image.shape)
    if not (len(shape) == 2 or (len(shape) == 4 and shape[1] == 1)) or 0 in shape:
        raise InputError(f"image has shape {shape}; expected (H, W) or a batch (N, 1, H, W)")
    count = shape[0] if len(shape) == 4 else 1
    kernels = _kernels(psf, count)
    if isinstance(image, np.ndarray):
        refuse_masked(image, "image")
        if not np.issubdtype(image.dtype, np.floating):
            raise InputError(f"image is {image.dtype}; expected floating point in [0, 1]: divide 8-bit values by 255")
        planes = np.ascontiguousarray(image, dtype=np.float32).reshape(count, *shape[-2:])
        _check_finite(float(planes.min()), float(planes.max()))
        out = np.empty_like(planes)
        for index, plane in enumerate(planes):
            _blur_plane(plane, kernels[index % len(kernels)], boundary, out[index])
        return out.reshape(shape)
    if not image.is_floating_point():
        raise InputError(f"image is {image.dtype}; expected floating point in [0, 1]: divide 8-bit values by 255")
    values = image.float()
    _check_finite(*(float(end) for end in values.detach().aminmax()))
    return _blur_tensor(values.reshape(count, *shape[-2:]), kernels, boundary).reshape(shape)


def _check_finite(lowest: float, highest: float) -> None:
    """Refuse an image with NaN or infinity, which the FFT would spread over all of it; NaN passes through min and max.

    Raises:
        InputError: an end of the image's range is not finite.
    """
    if not (math.isfinite(lowest) and math.isfinite(highest)):
        raise InputError(f"image holds values that are not finite ({lowest:g} .. {highest:g}); expected finite numbers")


def _kernels(psf: Any, count: int) -> list[np.ndarray]:
    """Checked and trimmed float32 kernels: one for all images, or one for each."""
    array = np.asarray(psf)
    if array.ndim == 2:
        return [trimmed(checked_psf(array).astype(np.float32))]
    if array.ndim != 3 or len(array) != count:
        raise InputError(f"psf has shape {array.shape}; expected (h, w), or ({count}, h, w) for this batch")
    return [trimmed(checked_psf(item, f"psf {index}").astype(np.float32)) for index, item in enumerate(array)]


def _blur_plane(plane: np.ndarray, psf: np.ndarray, boundary: str, out: np.ndarray) -> None:
    """Blur one (H, W) float32 plane into `out`."""
    import cv2

    if psf.shape == (1, 1):
        out[:] = plane
        return
    border = cv2.BORDER_REFLECT_101 if boundary == "reflect" else cv2.BORDER_CONSTANT
    low, high = -np.inf, np.inf
    if psf.min() >= 0:
        low, high = float(plane.min()), float(plane.max())
        if boundary == "zero":
            low, high = min(low, 0.0), max(high, 0.0)
    if max(psf.shape) <= DIRECT_MAX_PX and min(plane.shape) > max(psf.shape):
        # filter2D correlates: the kernel turned by half a turn makes it a convolution.
        cv2.filter2D(plane, -1, np.ascontiguousarray(psf[::-1, ::-1]), dst=out, borderType=border)
        np.clip(out, low, high, out=out)
    else:
        _blur_strips(plane, psf, border, low, high, out)


def _blur_strips(plane: np.ndarray, psf: np.ndarray, border: int, low: float, high: float, out: np.ndarray) -> None:
    """Overlap-save: strips of rows, each with the kernel's height of context, through one real FFT."""
    import cv2
    from scipy.fft import irfft2, next_fast_len, rfft2

    (height, width), (rows_psf, columns_psf) = plane.shape, psf.shape
    above, left = rows_psf // 2, columns_psf // 2
    columns = next_fast_len(width + 2 * left, real=True)
    strips = max(round(height / max(STRIP_VALUES // columns, 4 * rows_psf)), 1)
    rows = next_fast_len(-(-height // strips) + 2 * above)
    step = rows - 2 * above
    strips = -(-height // step)
    transfer = _transfer_function(psf.tobytes(), psf.shape, (rows, columns))
    # Padded far enough for whole strips of a fast length; what lies beyond the border's width is never used.
    below, right = strips * step + above - height, columns - left - width
    padded = cv2.copyMakeBorder(plane, above, below, left, right, border)
    for top in range(0, height, step):
        spectrum = rfft2(padded[top : top + rows])
        spectrum *= transfer
        result = irfft2(spectrum, (rows, columns), overwrite_x=True)
        # The first h - 1 rows and w - 1 columns of a circular convolution wrap round; the rest is exact.
        here = min(step, height - top)
        inside = result[2 * above : 2 * above + here, 2 * left : 2 * left + width]
        np.clip(inside, low, high, out=out[top : top + here])


@lru_cache(maxsize=32)
def _transfer_function(values: bytes, shape: tuple[int, int], size: tuple[int, int]) -> np.ndarray:
    """The kernel's real FFT, zero-padded to `size`: complex64. Kept, because a kernel serves many images."""
    from scipy.fft import rfft2

    transfer: np.ndarray = rfft2(np.frombuffer(values, np.float32).reshape(shape), size)
    transfer.setflags(write=False)
    return transfer


def _blur_tensor(planes: torch.Tensor, kernels: list[np.ndarray], boundary: str) -> torch.Tensor:
    """Blur (N, H, W) float32 on its own device."""
    import torch
    import torch.nn.functional as functional
    from scipy.fft import next_fast_len

    if all(kernel.shape == (1, 1) for kernel in kernels):
        return planes.clone()
    height, width = planes.shape[-2:]
    rows_psf, columns_psf = (max(kernel.shape[axis] for kernel in kernels) for axis in (0, 1))
    above, left = rows_psf // 2, columns_psf // 2
    if boundary == "zero":
        padded = functional.pad(planes, (left, left, above, above))
    elif above < height and left < width:
        padded = functional.pad(planes[:, None], (left, left, above, above), mode="reflect")[:, 0]
    else:
        raise InputError(f"a PSF of {rows_psf} x {columns_psf} px is too large for a tensor of {height} x {width} px")
    size = (next_fast_len(height + 2 * above), next_fast_len(width + 2 * left, real=True))
    stacked = np.stack([_in_middle(kernel, rows_psf, columns_psf) for kernel in kernels])
    transfer = torch.fft.rfft2(torch.from_numpy(stacked).to(planes.device), s=size)
    result = torch.fft.irfft2(torch.fft.rfft2(padded, s=size) * transfer, s=size)
    result = result[:, rows_psf - 1 : rows_psf - 1 + height, columns_psf - 1 : columns_psf - 1 + width]
    if min(float(kernel.min()) for kernel in kernels) < 0:
        return result.contiguous()
    low, high = planes.detach().amin(dim=(1, 2), keepdim=True), planes.detach().amax(dim=(1, 2), keepdim=True)
    if boundary == "zero":
        low, high = low.clamp(max=0.0), high.clamp(min=0.0)
    return result.clamp(min=low, max=high)


def _in_middle(kernel: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """A kernel in the middle of a larger odd array."""
    add_rows, add_columns = (rows - kernel.shape[0]) // 2, (columns - kernel.shape[1]) // 2
    return np.pad(kernel, ((add_rows, add_rows), (add_columns, add_columns)))
