"""The paper's own blur kernels, read from the pictures that its authors publish.

Layout (folder ``data/kernels`` of the authors' repository), 8-bit grey PNG::

    defocusBlur/<size>/<size>.png
    motionBlur/linear/<intensity>+<size>_<angle>/<size>.png
    motionBlur/nonLinear/<intensity>+<size>_<angle>/<size>.png

and beside each picture ``MTF/*.npz``, the curves sampled by the authors. The kernels are up to 1.3 px off centre,
so they also shift the picture against its labels.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pipeline.camera.psf.kernel import Kernel, kernel_name, recentred
from pipeline.errors import DECODER_ERRORS, InputError

LARGEST_PX = 999
"""Side of a kernel; a header may state gigabytes."""

_MOTION = re.compile(r"(?P<intensity>[0-9.]+)\+(?P<size>[0-9]+)_(?P<angle>[0-9]+)")
_FOLDERS = (
    ("defocus", "defocusBlur"),
    ("linear_motion", "motionBlur/linear"),
    ("nonlinear_motion", "motionBlur/nonLinear"),
)


@dataclass(frozen=True)
class PaperKernel(Kernel):
    """A kernel of the paper.

    Attributes:
        path: the picture it was read from.
    """

    path: Path = field(default=Path(), compare=False)


def load(
    folder: Path | str,
    *,
    kinds: Collection[str] | None = None,
    sizes_px: Collection[float] | None = None,
    angles_deg: Collection[float] | None = None,
    centred: bool = False,
) -> list[PaperKernel]:
    """Read the authors' tree of kernels.

    Args:
        folder: holds ``defocusBlur`` and ``motionBlur``.
        kinds: which of ``"defocus"``, ``"linear_motion"``, ``"nonlinear_motion"``; None for all.
        sizes_px: which sizes, pixels; None for all.
        angles_deg: which rotations, degrees; None for all. A disc is never left out for its angle, which is 0.
        centred: move each kernel by whole pixels so that its centroid is within half a pixel of the centre; its MTF
            stays the same.

    Returns:
        kernels ordered by kind, size, angle; (h, w) float32, sum 1.

    Raises:
        InputError: no such folder; a kind or size without a kernel in it, or two of one kind, size and angle; or a
            picture that cannot be read as a kernel.
    """
    folder = Path(folder)
    if not any((folder / name).is_dir() for _, name in _FOLDERS):
        raise InputError(
            f"no kernels of the paper in '{folder}': expected the folders defocusBlur and motionBlur of the authors' "
            "data/kernels there (github.com/MaikWischow/Camera-Condition-Monitoring); or use the generated kernels"
        )
    kernels = []
    for kind, name in _FOLDERS:
        if kinds is not None and kind not in kinds:
            continue
        results = []
        for path in (folder / name).glob("*/*.png"):
            match = _MOTION.fullmatch(path.parent.name)
            if match is None and kind == "defocus" and path.parent.name.isdigit():
                size_px, angle_deg = int(path.parent.name), 0
            elif match is not None:
                size_px, angle_deg = int(match["size"]), int(match["angle"])
            else:
                continue
            wanted = angles_deg is None or kind == "defocus" or angle_deg in angles_deg
            if wanted and (sizes_px is None or size_px in sizes_px):
                results.append((size_px, angle_deg, path))
        for size_px, angle_deg, path in sorted(results):
            psf = read_psf(path)
            full_name = kernel_name(kind, size_px, None if kind == "defocus" else angle_deg)
            kernels.append(
                PaperKernel(full_name, kind, size_px, angle_deg, recentred(psf) if centred else psf, path=path)
            )
    if not kernels:
        raise InputError(
            f"no kernel in '{folder}' of kinds {_words(kinds)}, sizes {_words(sizes_px)}, angles {_words(angles_deg)}"
        )
    _check_all_there(kernels, kinds, sizes_px, str(folder))
    return kernels


def _check_all_there(
    kernels: list[PaperKernel], kinds: Collection[str] | None, sizes_px: Collection[float] | None, folder: str
) -> None:
    """Refuse kinds or sizes that have no kernel, and kernels that share a name: the later would replace the earlier."""
    by_name: dict[str, PaperKernel] = {}
    for kernel in kernels:
        twin = by_name.setdefault(kernel.name, kernel)
        if twin is not kernel:
            raise InputError(
                f"two kernels in '{folder}' are called {kernel.name}: {twin.path.parent.name} and "
                f"{kernel.path.parent.name}; keep one intensity of each size and angle"
            )
    absent = set(kinds or ()) - {kernel.kind for kernel in kernels}
    if absent:
        raise InputError(f"no kernel in '{folder}' of kind {_words(sorted(absent))} (sizes {_words(sizes_px)})")
    unknown = set(sizes_px or ()) - {kernel.size_px for kernel in kernels}
    if unknown:
        raise InputError(f"no kernel in '{folder}' of size {_words(sorted(unknown))} px; psf.sizes_px names the sizes")


def _words(wanted: Collection[object] | None) -> str:
    return "any" if wanted is None else ", ".join(map(str, wanted))


def read_psf(path: Path | str) -> np.ndarray:
    """A picture as a PSF: first channel over its sum.

    Returns:
        (h, w) float32, sum 1.

    Raises:
        InputError: not a readable picture, all black, or of an even or large size.
    """
    import io
    import warnings

    import cv2
    from PIL import Image

    try:
        data = np.fromfile(path, np.uint8)
    except OSError as error:
        raise InputError(f"cannot read the kernel '{path}': {error.strerror}") from error
    try:
        with warnings.catch_warnings(action="ignore"), Image.open(io.BytesIO(data.tobytes())) as header:
            width, height = header.size  # before gigabytes are decoded
        picture = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if max(width, height) <= LARGEST_PX else None
    except (cv2.error, Image.DecompressionBombError, *DECODER_ERRORS):
        raise InputError(f"'{path}' is not a readable picture; expected an 8-bit grey PNG of a kernel") from None
    if picture is None:
        raise InputError(f"'{path}' is {height} x {width} pixels; expected a kernel with sides up to {LARGEST_PX}")
    grey = picture if picture.ndim == 2 else picture[:, :, 0]
    if 0 in (grey.shape[0] % 2, grey.shape[1] % 2):
        raise InputError(f"'{path}' is {grey.shape[0]} x {grey.shape[1]} pixels; expected a kernel with odd sides")
    total = grey.sum(dtype=np.float64)
    if not total > 0:
        raise InputError(f"'{path}' is all black; expected a kernel")
    return (grey / total).astype(np.float32)
