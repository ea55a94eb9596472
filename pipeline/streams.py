"""Random streams: the only place in the package where random numbers begin.

Every draw belongs to a *key*, for example ``(seed, "photon", "kitti", "000012", level)``. The key is hashed
(BLAKE2b) into the 128-bit key of a Philox counter generator (Salmon et al., "Parallel random numbers: as easy
as 1, 2, 3", SC 2011), so a frame's noise does not depend on the order of frames, on which subset is run or on
how many workers share the work. Global random state is never used.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import torch

KeyPart = str | int | float | bool | None


def digest(seed: int, *parts: KeyPart) -> bytes:
    """128-bit hash of a seed and the parts that name a draw.

    Types are part of the key: ``1``, ``1.0``, ``True`` and ``"1"`` name different draws, and
    ``("a", "bc")`` differs from ``("ab", "c")``.

    Raises:
        TypeError: a part is not a string, number, boolean or None.
    """
    text = hashlib.blake2b(digest_size=16)
    for part in (int(seed), *parts):
        if isinstance(part, np.generic):
            part = part.item()
        if not (part is None or isinstance(part, (str, int, float, bool))):
            raise TypeError(f"a stream key is made of strings, numbers, booleans and None, not {type(part).__name__}")
        word = f"{type(part).__name__}:{part!r}".encode()
        text.update(len(word).to_bytes(4, "little"))
        text.update(word)
    return text.digest()


def stream(seed: int, purpose: str, *parts: KeyPart) -> np.random.Generator:
    """A NumPy generator for one named draw.

    Args:
        seed: the experiment's root seed.
        purpose: what the numbers are for, e.g. ``"photon"``.
        parts: dataset, frame, noise source, level ... whatever distinguishes this draw from all others.

    Returns:
        an independent ``numpy.random.Generator`` (Philox), the same for the same key on every machine.
    """
    key = np.frombuffer(digest(seed, purpose, *parts), dtype=np.uint64)
    return np.random.Generator(np.random.Philox(key=key))


_TWISTER_WORDS = 624
_TWISTER_STATE = np.dtype(
    [
        ("seed", "<u8"),
        ("left", "<i4"),
        ("seeded", "<i4"),
        ("next", "<u8"),
        ("words", "<u8", _TWISTER_WORDS),
        ("rest", "V40"),
    ]
)  # the layout of torch's CPU generator


def torch_stream(seed: int, purpose: str, *parts: KeyPart) -> torch.Generator:
    """A torch CPU generator for one named draw; see `stream`.

    torch seeds its Mersenne twister with 32 bits only, so that among 65,000 streams two would likely be the same;
    here all 624 words of its state come from the draw's own Philox stream.

    Raises:
        RuntimeError: this version of torch keeps the state in another layout.
    """
    import torch

    generator = torch.Generator()
    state = np.zeros(1, _TWISTER_STATE)
    if generator.get_state().numel() != state.nbytes:
        raise RuntimeError(f"torch {torch.__version__} keeps its random state in a layout unknown here; pin torch 2.13")
    state["left"], state["seeded"] = 1, 1  # the next draw mixes the words first
    state["words"] = stream(seed, purpose, *parts).integers(0, 1 << 32, _TWISTER_WORDS, dtype=np.uint64)
    generator.set_state(torch.from_numpy(state.view(np.uint8)))
    return generator
