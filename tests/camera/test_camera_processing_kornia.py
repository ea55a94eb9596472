"""Steps of the camera's processing, each beside kornia's operation on a tensor of the same values."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from pipeline.camera import tone_curve
from pipeline.camera.processing import codec, colour, demosaic, denoise, gaussian, scale, sharpen
from pipeline.camera.processing.mosaic import mosaic
from pipeline.streams import stream

kornia = pytest.importorskip("kornia")
INSIDE = np.s_[12:-12, 12:-12]  # boundaries are continued differently


def picture():
    """A smooth colour picture with some fine noise, (96, 128, 3) in [0, 1]."""
    coarse = stream(1, "kornia peer").uniform(0.2, 0.8, (12, 16, 3)).astype(np.float32)
    fine = 0.02 * stream(1, "kornia peer, noise").standard_normal((96, 128, 3), dtype=np.float32)
    return np.clip(scale.resize(coarse, 8.0, "cubic") + fine, 0, 1).astype(np.float32)


def tensor(planes):
    planes = planes[..., None] if planes.ndim == 2 else planes
    return torch.from_numpy(np.ascontiguousarray(planes.transpose(2, 0, 1)[None]))


def array(result):
    return result[0].permute(1, 2, 0).numpy().squeeze()


def test_bilinear_demosaicing():
    raw = mosaic(picture())
    peer = array(kornia.color.raw_to_rgb(tensor(raw), kornia.color.CFA.BG))
    assert np.abs(demosaic.demosaic(raw, "bilinear") - peer)[INSIDE].max() < 1e-3  # ours passes through 16 bit


def test_tone_curve():
    light = picture()
    peer = array(kornia.enhance.adjust_gamma(tensor(light), 1 / 2.2))
    assert np.abs(tone_curve.render(light, 2.2, 0.0) - peer).max() < 2e-3


def test_luma_and_chroma_and_back():
    rgb = picture()
    luma, chroma_red, chroma_blue = np.moveaxis(colour.to_luma_chroma(rgb), 2, 0)
    peer = array(kornia.color.rgb_to_ycbcr(tensor(rgb)))
    back = array(kornia.color.ycbcr_to_rgb(tensor(peer)))
    assert np.abs(np.stack([luma, chroma_blue, chroma_red], axis=-1) - peer).max() < 2e-3
    assert np.abs(colour.to_rgb(colour.to_luma_chroma(rgb)) - back).max() < 5e-3


def test_gaussian():
    luma = picture()[..., 1]
    peer = array(kornia.filters.gaussian_blur2d(tensor(luma), (13, 13), (1.3, 1.3)))
    assert np.abs(gaussian.blurred(luma, 1.3) - peer)[INSIDE].max() < 1e-3


def test_median():
    luma = picture()[..., 1]
    peer = array(kornia.filters.median_blur(tensor(luma), 3))
    ours = denoise.denoise_luma(luma, denoise.Denoising("median"), 0.02)
    assert np.abs(ours - peer)[INSIDE].max() < 1e-5


def test_bilateral_filter():
    luma, sigma = picture()[..., 1], 0.02
    settings = denoise.Denoising("bilateral", strength=2.0, radius_px=0.3)
    peer = array(kornia.filters.bilateral_blur(tensor(luma), 5, 2.0 * sigma * 1.5, (1.5, 1.5)))
    ours = denoise.denoise_luma(luma, settings, sigma)
    # OpenCV's window of 5 px is round, kornia's is square.
    assert np.abs(ours - peer)[INSIDE].mean() < 0.3 * np.abs(luma - peer)[INSIDE].mean()


def test_unsharp_mask():
    luma, settings = picture()[..., 1], sharpen.Sharpening(0.7, 1.1)
    peer = array(kornia.filters.unsharp_mask(tensor(luma), (11, 11), (1.1, 1.1)))
    assert np.abs(sharpen.sharpen(luma, settings, 0.0) - (luma + 0.7 * (peer - luma)))[INSIDE].max() < 1e-3


def test_jpeg_of_the_codec_and_of_kornias_model():
    whole = np.rint(picture() * 255).astype(np.uint8)
    model = kornia.enhance.jpeg_codec_differentiable(tensor(whole.astype(np.float32) / 255), torch.tensor([60.0]))
    stored = codec.jpeg(whole, 60).astype(np.float32)
    lost = np.abs(stored - whole).mean()
    assert 0.5 < lost < 10  # DN
    assert np.abs(stored - 255 * array(model)).mean() < 0.5 * lost
