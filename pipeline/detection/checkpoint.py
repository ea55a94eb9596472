"""Pieces of a long run, kept until it is done: a killed run goes on, and its result is the same bytes.

A piece is one file in a folder outside of any stage's outputs, named by what it is and by a hash of all it depends on:
settings, weights, picture, kernel and the source of the detector, of the sweep and of what reads a frame. A piece that
cannot be read is made again. Each run has a folder to itself, whose key holds where its outputs go, so that runs side
by side do not meet. Once the outputs are in place the folder is removed, so nothing stale can be taken up later.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.dependencies import closure
from pipeline.errors import InputError
from pipeline.store import read_arrays, write_arrays

Arrays = Mapping[str, NDArray[Any]]

LONGEST_NAME_BYTES = 200
"""Of a piece: file systems take 255 bytes, of which its hash and its suffix need some."""


def fingerprint(code: str | Iterable[str], settings: Mapping[str, Any], kind: str) -> str:
    """Hash of settings (anything JSON can hold) and of the source that a sweep with one detector executes.

    Args:
        code: the module that executes it, or several: modules of objects that it is given need not be in its closure.
        settings: of the sweep.
        kind: the detector's registry name.
    """
    return closure.fingerprint(code, settings, chosen={"pipeline.detection": frozenset({kind})})


def load_or_compute(
    folder: Path, name: str, depends: bytes, names: frozenset[str], make: Callable[[], Arrays]
) -> Arrays:
    """A piece from its file, or made and written to it.

    Args:
        folder: of the pieces of this run.
        name: of the piece, fit for a file name but for its length.
        depends: what it depends on beside the settings of the run (picture, kernel).
        names: of the arrays it must hold.
        make: makes it.
    """
    encoded = name.encode()
    if len(encoded) > LONGEST_NAME_BYTES:  # what is cut off goes into the hash
        name, depends = encoded[:LONGEST_NAME_BYTES].decode(errors="ignore"), encoded + b"\0" + depends
    path = folder / f"{name}-{hashlib.blake2b(depends, digest_size=6).hexdigest()}.npz"
    if path.is_file():
        try:
            arrays = read_arrays(path)
            if set(arrays) == names:
                return arrays
        except InputError:
            pass  # broken: made again
    arrays = dict(make())
    write_arrays(path, **{key: np.asarray(value) for key, value in arrays.items()})
    return arrays


def clear(folder: Path) -> None:
    """Remove the pieces of a run that is done, and the folder above them if it is empty then."""
    shutil.rmtree(folder, ignore_errors=True)
    with suppress(OSError):  # it holds the pieces of another run
        folder.parent.rmdir()
