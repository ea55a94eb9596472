"""NumPy arrays of what callers hand in: arrays, or torch tensors, told apart without importing torch."""

from __future__ import annotations

from typing import Any

from pipeline.errors import InputError

HALF_BYTES = 2
"""Size of a half-precision float. NumPy has no bfloat16, and estimators compute in no less than single precision."""


def as_array(values: Any) -> Any:
    """A torch tensor as a NumPy array; anything else as it is.

    Args:
        values: a tensor of any device, with a gradient or without, or anything else.

    Returns:
        the array of a tensor, which shares its memory where it can; floats of half precision become float32.
    """
    if not hasattr(values, "detach"):
        return values
    tensor = values.detach().cpu().resolve_conj().resolve_neg()
    if tensor.is_floating_point() and tensor.element_size() <= HALF_BYTES:
        tensor = tensor.float()
    return tensor.numpy()


def refuse_masked(values: Any, name: str) -> None:
    """Refuse an image with masked pixels.

    Args:
        values: the image.
        name: in the message, as ``"image"``.

    Raises:
        InputError: it has some.
    """
    import numpy as np

    if np.ma.is_masked(values):
        raise InputError(f"{name}: masked pixels have no grey level; cut it to a rectangle without them")
