"""Structure: shading and noise have none, pictures have some however blurred they are."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from skimage import data

from pipeline.condition import ConditionMonitor
from pipeline.condition.structure import striped, structureless
from pipeline.streams import stream


def noisy(image: np.ndarray, sigma_dn: float) -> np.ndarray:
    """Whole grey levels with white noise, (1, 1, H, W) in [0, 1]."""
    levels = image * 255 + sigma_dn * stream(1, "structure", sigma_dn).standard_normal(image.shape)
    return (np.rint(np.clip(levels, 0, 255)) / 255).astype(np.float32)[None, None]


def shading() -> np.ndarray:
    """A wall lit from one corner, with a lens's fall-off."""
    y, x = np.mgrid[-1:1:192j, -1:1:192j]
    return 0.5 + 0.15 * x + 0.1 * y - 0.1 * (x * x + y * y)


@pytest.mark.parametrize("sigma_dn", [0.0, 1.0, 5.0, 10.0, 25.0])
def test_shading_and_noise_are_no_structure(sigma_dn):
    assert structureless(noisy(shading(), sigma_dn)).all()
    assert structureless(noisy(np.full((192, 192), 0.55), sigma_dn)).all()


@pytest.mark.parametrize("blur_px", [0.0, 2.0, 8.0])
@pytest.mark.parametrize("sigma_dn", [0.0, 10.0, 25.0])
def test_a_picture_keeps_its_structure_under_blur_and_noise(blur_px, sigma_dn):
    image = data.camera()[100:292, 150:342] / 255
    if blur_px:
        image = cv2.GaussianBlur(image, (0, 0), blur_px)
    assert not structureless(noisy(image, sigma_dn)).any()


@pytest.mark.parametrize(("contrast_dn", "shows"), [(1.0, False), (3.4, True)])
def test_weak_structure_in_strong_noise_counts_from_what_block_means_resolve(contrast_dn, shows):
    """Means of 16 x 16 px hold a sixteenth of 25 DN of noise, 1.6 DN; half as much again is needed."""
    squares = np.kron(np.where(np.indices((12, 12)).sum(axis=0) % 2, 1, -1), np.ones((16, 16)))
    assert structureless(noisy(0.5 + contrast_dn / 255 * squares, 25.0)).all() == (not shows)


def bars(turned_deg: float, size=(192, 192), width_px=(8, 50)) -> np.ndarray:
    """A fence: upright bars of random width and grey level, turned, seen by a sharp lens."""
    generator = stream(1, "bars", turned_deg)
    widths = generator.integers(*width_px, 100)
    line = np.repeat(generator.integers(50, 200, 100), widths)[: size[1]].astype(np.float32)
    centre = (size[1] / 2, size[0] / 2)
    turn = cv2.getRotationMatrix2D(centre, turned_deg, 1.5)
    turned = cv2.warpAffine(np.tile(line, (size[0], 1)), turn, size[::-1], borderMode=cv2.BORDER_REFLECT)
    return cv2.GaussianBlur(turned, (0, 0), 0.6) / 255


@pytest.mark.parametrize("turned_deg", [0.0, 8.0, 45.0, 90.0])
@pytest.mark.parametrize("sigma_dn", [0.0, 2.0, 8.0])
def test_a_fence_is_striped_however_it_is_turned(turned_deg, sigma_dn):
    fence = noisy(bars(turned_deg), sigma_dn)
    assert striped(fence).all() and not structureless(fence).any()
    _, coded = cv2.imencode(".jpg", np.rint(fence[0, 0] * 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 85])
    assert striped(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE)[None, None].astype(np.float32) / 255).all()


def test_a_straight_edge_is_striped_and_a_corner_is_not():
    y, x = np.mgrid[-96:96, -96:96]
    assert striped(noisy(0.3 + 0.4 * (x + 0.1 * y > 0), 2.0)).all()
    assert not striped(noisy(0.3 + 0.4 * ((x > 0) & (y > 0)), 2.0)).any()


@pytest.mark.parametrize("moved", [(1, 41), (41, 1)])
@pytest.mark.parametrize("sigma_dn", [0.0, 5.0])
def test_motion_leaves_a_picture_structure_along_itself(moved, sigma_dn):
    image = cv2.blur(data.camera()[100:292, 150:342] / 255, moved)
    assert not striped(noisy(image, sigma_dn)).any()


def test_the_monitor_takes_no_blur_from_a_fence():
    """Estimators take the straightness of its bars for motion along them."""
    frame = noisy(bars(8.0, (400, 600)), 2.0)[0, 0]
    read = ConditionMonitor(noise_name="pca").frame(frame)
    assert read.abstained["blur"] and set(read.reasons["blur"]) == {"striped"}


def test_a_frame_of_shading_has_no_blur():
    y, x = np.mgrid[0:400, 0:600]
    frame = noisy(0.2 + 0.5 * x / 600 + 0.1 * y / 400, 3.0)[0, 0]
    read = ConditionMonitor(noise_name="pca").frame(frame)
    assert read.abstained["blur"] and set(read.reasons["blur"]) == {"structureless"}
    assert np.isnan(read.blur.estimate.half).all()
    assert np.isnan(read.mtf.value).all() and np.isnan(read.blur.estimate.low).all()
    assert float(read.sigma_dn.value) == pytest.approx(3.0, abs=0.5)


def test_nothing_is_left_of_what_an_estimator_said_of_a_patch_without_structure():
    """Neither its kernel nor what the networks of an ensemble answered one by one."""
    picture = data.camera()[100:292, 150:342] / 255
    patches = np.concatenate([noisy(np.full((192, 192), 0.55), 5.0), noisy(picture, 5.0)])
    for name in ("gbb", "spectral"):
        estimate = ConditionMonitor(name).patches(patches).blur.estimate
        assert estimate.abstained.tolist() == [True, False]
        parts = [part for part in (estimate.kernel, estimate.members) if part is not None]
        assert parts and all(np.isnan(part[0]).all() and not np.isnan(part[1]).any() for part in parts)
        assert estimate.hidden is None
