"""How networks are run outside of trainings, whatever the settings of the program that calls them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def inference() -> Iterator[None]:
    """Without gradients, and in the precision of the network: also inside of a caller's ``torch.autocast``."""
    import torch

    with (
        torch.inference_mode(),
        torch.autocast("cpu", enabled=False),
        torch.autocast("cuda", enabled=False),
        single_precision(),
    ):
        yield


@contextmanager
def single_precision() -> Iterator[None]:
    """With float32 as the type of new tensors: also in a program that has set another (``torch.set_default_dtype``)."""
    import torch

    before = torch.get_default_dtype()
    if before == torch.float32:  # what holds for all threads is set only where it must be
        yield
        return
    torch.set_default_dtype(torch.float32)
    try:
        yield
    finally:
        torch.set_default_dtype(before)
