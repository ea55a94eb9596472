"""Named cameras: typical settings of the processing in four kinds of camera.

They stand for kinds, not for models; but for the linear one for machine vision, which has no tone curve and no colour
matrix, their values are within the ranges that `pipeline.learning.cameras` draws from.
"""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.camera.processing.codec import Codec
from pipeline.camera.processing.denoise import Denoising
from pipeline.camera.processing.develop import CameraPipeline
from pipeline.camera.processing.raw_noise import RawNoise
from pipeline.camera.processing.sharpen import Sharpening
from pipeline.errors import InputError, did_you_mean


@dataclass(frozen=True)
class Preset:
    """A kind of camera.

    Attributes:
        processing: everything but the noise.
        full_well_e, read_e: of its sensor at base ISO 100.
        description: for people.
    """

    processing: CameraPipeline
    full_well_e: float
    read_e: float
    description: str

    def at_iso(self, iso: float) -> CameraPipeline:
        """The camera at an ISO setting; 0 switches the noise off."""
        if iso == 0:
            return self.processing.with_noise(RawNoise())
        return self.processing.with_noise(RawNoise.at_iso(iso, full_well_e=self.full_well_e, read_e=self.read_e))


PRESETS = {
    "phone": Preset(
        CameraPipeline(
            balance=(1.9, 1.7),
            demosaicing="edge_aware",
            colour_diagonal=(1.6, 1.5, 1.5),
            s_curve=0.35,
            denoising=Denoising("shrinkage", blend=0.7, strength=1.6, coarse=0.6, softness_px=0.5, chroma_px=2.5),
            sharpening=Sharpening(0.8, 1.0, 0.6),
            codec=Codec("jpeg", 88),
        ),
        full_well_e=6000,
        read_e=2.5,
        description="small pixels, strong denoising and sharpening, JPEG",
    ),
    "reflex": Preset(
        CameraPipeline(
            balance=(2.1, 1.5),
            demosaicing="edge_aware",
            colour_diagonal=(1.7, 1.4, 1.5),
            s_curve=0.3,
            denoising=Denoising("shrinkage", blend=0.5, strength=0.9, coarse=0.3, softness_px=0.45, chroma_px=1.5),
            sharpening=Sharpening(0.4, 1.0),
            codec=Codec("jpeg", 96, full_chroma=True),
        ),
        full_well_e=60_000,
        read_e=5.0,
        description="large pixels, mild denoising, fine JPEG",
    ),
    "dashcam": Preset(
        CameraPipeline(
            balance=(1.8, 1.8),
            demosaicing="bilinear",
            colour_diagonal=(1.5, 1.4, 1.4),
            s_curve=0.2,
            denoising=Denoising("bilateral", blend=0.8, strength=1.2, chroma_px=2.0),
            sharpening=Sharpening(0.6, 1.2, 0.3),
            codec=Codec("h264", 26),
            frames_before=1,
        ),
        full_well_e=10_000,
        read_e=4.0,
        description="denoising, sharpening and H.264 video",
    ),
    "machine_vision": Preset(
        CameraPipeline(balance=(1.7, 1.6), demosaicing="malvar", gamma=1.0),
        full_well_e=10_500,
        read_e=7.0,
        description="demosaicing and linear grey levels, nothing else",
    ),
}


def named(name: str) -> Preset:
    """A preset by its name.

    Raises:
        InputError: no such preset; names the nearest.
    """
    if name not in PRESETS:
        raise InputError(f"camera pipeline: no preset {name!r}; {did_you_mean(name, tuple(PRESETS))}")
    return PRESETS[name]
