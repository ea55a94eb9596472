"""How a deconvolution says that a patch has no kernel to find."""

from __future__ import annotations


class NoKernel(Exception):
    """The patch gives no kernel; the message says why, and becomes the reason of an abstention."""
