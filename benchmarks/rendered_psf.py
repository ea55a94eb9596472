"""Point-spread functions of real optics that no estimator was trained on, rendered by wave optics.

Training draws its lenses at random (`pipeline.learning.kernels`); these named ones are no draws of it, and none is
shared with the kernels of the study. A clear round pupil out of focus would approach a uniform disc, so none is in
`BANK`.
"""

from __future__ import annotations

from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.psf.wave_optics import (  # noqa: F401  re-exported for the benchmark's tests
    EDGE_SAMPLES,
    KEPT,
    LARGEST_PX,
    PIXEL_UM,
    REFERENCE_UM,
    SHARES,
    WAVELENGTHS_UM,
    Lens,
    Light,
    Optics,
    Shake,
    diffraction_mtf,
    render,
    shake_path,
    wavefront_um,
)  # fmt: skip

GROUPS = FOCUS, ABERRATED, SHAKEN = ("out of focus", "aberrated", "shaken")

_CORNER = Lens(2.0, defocus_px=1.5, colour_px=0.5, astigmatism=0.12, astigmatism_deg=20, coma=0.15, coma_deg=70,
               spherical=0.06, vignetting=0.3, vignetting_deg=70)  # fmt: skip
_IRIS = Lens(2.8, blades=5, iris_deg=11, defocus_px=4.0, colour_px=0.5)
_MIRROR = Lens(5.6, obstruction=0.45, defocus_px=8.0)

BANK = (
    Optics("pentagon", FOCUS, Lens(2.8, blades=5, iris_deg=11, defocus_px=6.0, colour_px=0.5)),
    Optics("large pentagon", FOCUS, Lens(2.8, blades=5, iris_deg=40, defocus_px=14.0, colour_px=0.8, spherical=0.3)),
    Optics("heptagon", FOCUS, Lens(4.0, blades=7, iris_deg=5, defocus_px=-9.0, astigmatism=0.35, astigmatism_deg=70)),
    Optics("large heptagon", FOCUS, Lens(2.8, blades=7, iris_deg=20, defocus_px=20.0, colour_px=1.0, spherical=-0.5)),
    Optics("mirror lens", FOCUS, _MIRROR),
    Optics("large mirror lens", FOCUS, Lens(5.6, obstruction=0.4, defocus_px=16.0, coma=0.4, coma_deg=120)),
    Optics("cat's eye", FOCUS, Lens(2.0, vignetting=0.8, vignetting_deg=25, defocus_px=11.0, colour_px=0.6)),
    Optics(
        "large cat's eye",
        FOCUS,
        Lens(2.0, vignetting=0.6, vignetting_deg=115, defocus_px=-19.0, coma=0.5, coma_deg=115),
    ),
    Optics("stopped down", ABERRATED, Lens(11.0)),
    Optics("corner", ABERRATED, _CORNER),
    Optics("coma", ABERRATED, Lens(2.0, coma=0.45, coma_deg=35, defocus_px=1.0)),
    Optics("strong coma", ABERRATED, Lens(2.0, coma=1.3, coma_deg=200, defocus_px=2.0, colour_px=0.6, astigmatism=0.3)),
    Optics("spherical", ABERRATED, Lens(2.0, spherical=0.35)),
    Optics("strong spherical", ABERRATED, Lens(2.0, spherical=0.9, defocus_px=5.0, colour_px=1.0)),
    Optics("astigmatic line", ABERRATED, Lens(2.8, astigmatism=0.9, astigmatism_deg=30, defocus_px=8.0, colour_px=0.5)),
    Optics("shaken corner", SHAKEN, _CORNER, Shake(5.0, 0.06)),
    Optics("shaken pentagon", SHAKEN, _IRIS, Shake(9.0, 0.25)),
    Optics("shaken mirror", SHAKEN, _MIRROR, Shake(13.0, 0.12)),
    Optics("shaken long", SHAKEN, Lens(4.0, colour_px=0.3, spherical=0.1), Shake(17.0, 0.4)),
)


def bank(seed: int, optics: tuple[Optics, ...] = BANK) -> list[Kernel]:
    """Kernels of optics: name is that of the optics, kind their group, size the diameter with 90 % of the light."""
    kernels = []
    for one in optics:
        psf, size_px = render(one, seed)
        kernels.append(Kernel(one.name, one.group, round(size_px, 1), 0.0, psf))
    return kernels
