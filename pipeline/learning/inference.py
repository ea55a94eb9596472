"""How networks are run outside of trainings, whatever the settings of the program that calls them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def inference() -> Iterator[None]:
    """Without gradients, and in the precision of the network: also inside of a caller's ``torch.autocast``."""
    import torch

    with torch.inference_mode(), torch.autocast("cpu", enabled=False), torch.autocast("cuda", enabled=False):
        yield
