"""How networks are made and run outside of trainings, whatever the settings of the program that calls them.

Networks and what prepares their input state the type of every tensor they make, so that running them changes nothing
that other threads see.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

_MAKING = threading.RLock()
"""What holds for all threads is set by one at a time, else one would restore what another has set."""


@contextmanager
def inference() -> Iterator[None]:
    """Without gradients, and in the precision of the network: also inside of a caller's ``torch.autocast``."""
    import torch

    with (
        torch.inference_mode(),
        torch.autocast("cpu", enabled=False),
        torch.autocast("cuda", enabled=False),
    ):
        yield


@contextmanager
def caller_settings_kept() -> Iterator[None]:
    """For making networks: float32 as the type of new tensors, and the random numbers of PyTorch as they were after it.

    One thread at a time; threads of the calling program see float32 meanwhile.
    """
    import torch

    with _MAKING, torch.random.fork_rng(devices=[]):
        before = torch.get_default_dtype()
        torch.set_default_dtype(torch.float32)
        try:
            yield
        finally:
            torch.set_default_dtype(before)
