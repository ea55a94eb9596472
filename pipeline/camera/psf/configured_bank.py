"""The blur kernels that the configuration asks for: the paper's own pictures from a folder, or a generated bank."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.camera.psf.kernel import Kernel

if TYPE_CHECKING:
    from pipeline.camera.settings import PsfSettings


def configured(psf: PsfSettings, camera: str, seed: int) -> Sequence[Kernel]:
    """The kernels of the section ``psf``.

    Args:
        psf: the section; of the paper's kernels, those of its kinds, sizes and angles are taken.
        camera: kind of the camera, ``"physical"`` or ``"authors"``; a generated bank follows its program.
        seed: root of the random streams, for random motions of a generated bank.

    Returns:
        kernels in the order kind, size, angle; see `pipeline.camera.psf.bank.bank` and
        `pipeline.camera.psf.paper_kernels.load`.

    Raises:
        InputError: no kernels of the paper in ``psf.folder``, or none of those kinds and sizes.
    """
    from pipeline.camera.psf.bank import bank
    from pipeline.camera.psf.paper_kernels import load

    if psf.source == "paper":
        return load(Path(str(psf.folder)), kinds=psf.kinds, sizes_px=psf.sizes_px, angles_deg=psf.angles_deg)
    program = "physical" if camera == "physical" else "authors"
    return bank(psf.kinds, psf.sizes_px, psf.angles_deg, seed, match=psf.match, camera=program)
