"""The blur kernel that the options of ``camera-monitor corrupt`` ask for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline.camera.corruption import psf_for_mtf50
from pipeline.camera.psf import create, kinds
from pipeline.errors import InputError, did_you_mean
from pipeline.streams import stream

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def blur_kernel(
    blur: str | None, size_px: float | None, mtf50: float | None, angle_deg: float, seed: int, program: str
) -> NDArray[np.floating] | None:
    """The kernel asked for, or None.

    Args:
        blur: kind of blur, or None.
        size_px: size of the kernel, pixels, or None.
        mtf50: fraction of Nyquist at which contrast falls to half, instead of the size, or None.
        angle_deg: rotation.
        seed: of kernels that are drawn at random.
        program: ``camera`` of `pipeline.camera.psf.create`.

    Returns:
        (h, w), sum 1.

    Raises:
        InputError: a size without a kind, neither or both of size and MTF50, or a disc that the program cannot draw.
    """
    if blur is None:
        if size_px is not None or mtf50 is not None:
            raise InputError("--size-px and --mtf50 need --blur KIND")
        return None
    if blur not in kinds():
        raise InputError(f"--blur {blur}: unknown; {did_you_mean(blur, kinds())}")
    if mtf50 is not None and blur == "nonlinear_motion":
        raise InputError("--blur nonlinear_motion --mtf50: its path is drawn at random, give --size-px instead")
    if program == "authors" and blur == "defocus" and mtf50 is not None:
        raise InputError(
            "--blur defocus --mtf50: the discs of the authors' program have odd whole diameters only, which meet no "
            "given MTF50; give --size-px, or --camera physical"
        )
    if mtf50 is not None and size_px is None:
        try:
            return psf_for_mtf50(blur, mtf50, angle_deg=angle_deg)[1]
        except InputError as error:
            raise InputError(f"--blur {blur} --mtf50 {mtf50:g}: {error}") from None
    if size_px is None or mtf50 is not None:
        raise InputError(f"--blur {blur} needs either --size-px or --mtf50")
    try:
        return create(blur, size_px, angle_deg, stream(seed, "psf", blur, float(size_px)), camera=program)
    except InputError as error:
        if (program, blur) != ("authors", "defocus"):
            raise
        raise InputError(
            f"--blur {blur} --size-px {size_px:g}: the authors' program draws discs on 33 x 33 px, up to a size below "
            "30; give less, or --camera physical"
        ) from error
