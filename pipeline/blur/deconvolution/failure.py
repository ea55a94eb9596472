"""How a deconvolution reports that the kernel of a patch is not identifiable."""

from __future__ import annotations


class NoKernel(Exception):
    """The patch gives no kernel; the message is the cause, and becomes the reason of an abstention."""
