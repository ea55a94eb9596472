"""The set of kernels behind the paper's blur table: kinds x sizes x rotations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from pipeline import streams
from pipeline.camera.psf.kernel import Kernel, kernel_name
from pipeline.errors import InputError, did_you_mean

KINDS = ("defocus", "linear_motion", "nonlinear_motion")
SIZES_PX = (3, 7, 11, 15, 21)
ANGLES_DEG = (0, 45, 90, 135)
ROUND = frozenset({"defocus", "gaussian"})
"""Kinds that look the same in every rotation, and so appear once."""

MATCHES: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "nominal": {},
    "paper": {
        "defocus": {"diameter": "effective"},
        "linear_motion": {"match": "paper"},
        "nonlinear_motion": {"match": "paper"},
    },
}
"""Options that each rule passes to each kind."""


def bank(
    kinds: Iterable[str] = KINDS,
    sizes_px: Iterable[float] = SIZES_PX,
    angles_deg: Iterable[float] = ANGLES_DEG,
    seed: int = 0,
    *,
    match: str = "nominal",
    camera: str = "physical",
    options: Mapping[str, Mapping[str, Any]] | None = None,
) -> list[Kernel]:
    """Kernels for every kind, size and rotation; with the defaults the 15 of the paper's Table I, 45 with rotations.

    A random kind draws from ``stream(seed, "psf", kind, size)``: the same motion for all rotations of a size, and
    the same kernel whatever else is in the bank.

    Args:
        kinds: names for `pipeline.camera.psf.create`.
        sizes_px: nominal sizes, pixels.
        angles_deg: rotations, degrees, counter-clockwise; round kinds take none.
        seed: root seed of the experiment.
        match: ``"nominal"``: a disc of diameter d, horizontal motion over d pixels at rotation 0. ``"paper"``: centred
            kernels that follow what the paper's own pictures hold: discs about one pixel wider
            (`defocus.effective_diameter_px`), straight motion in their directions and lengths
            (`linear_motion.PAPER_LINES`), the random motions nearest in strength (`nonlinear_motion.PAPER_MTF`).
        camera: see `pipeline.camera.psf.create`; with ``"authors"`` discs are the program's own.
        options: kind -> keyword options, winning over those of `match`.

    Returns:
        kernels in the order kind, size, angle.

    Raises:
        InputError: an unknown kind, match or option.
    """
    from pipeline.camera.psf import create

    if match not in MATCHES:
        raise InputError(f"unknown match '{match}' for a bank of kernels; {did_you_mean(match, MATCHES)}")
    kinds, sizes_px, angles_deg = list(kinds), list(sizes_px), list(angles_deg)
    kernels = []
    for kind in kinds:
        chosen = {**MATCHES[match].get(kind, {}), **(options or {}).get(kind, {})}
        for size_px in sizes_px:
            for angle_deg in [0.0] if kind in ROUND else angles_deg:
                generator = streams.stream(seed, "psf", kind, float(size_px))
                psf = create(kind, size_px, angle_deg, generator, camera=camera, **chosen)
                name = kernel_name(kind, size_px, None if kind in ROUND else angle_deg)
                kernels.append(Kernel(name, kind, size_px, angle_deg, psf))
    return kernels
