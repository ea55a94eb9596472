"""Calls of ``camera-monitor``, and a picture with noise for them."""

from __future__ import annotations

import cv2
import numpy as np
from click.testing import CliRunner
from data_makers import picture

from pipeline.cli import main
from pipeline.streams import stream


def call(*arguments):
    """The result of a command line."""
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def noisy(path, sigma_dn, name="a"):
    """Write a smooth picture of 448 x 320 px with white noise, DN."""
    smooth = cv2.GaussianBlur(picture(name), (0, 0), 3).astype(float)
    image = np.clip(smooth * 0.6 + 50 + stream(0, "cli test", name).normal(0, sigma_dn, smooth.shape), 0, 255)
    assert cv2.imwrite(str(path), np.rint(image).astype(np.uint8))
    return path
