"""A bank of kernels as files: ``kernels.npz`` holds the arrays, ``kernels.parquet`` what they are and their MTF."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline import store, tables
from pipeline.camera import mtf
from pipeline.camera.psf.kernel import Kernel
from pipeline.errors import InputError

if TYPE_CHECKING:
    import pandas as pd


def table(kernels: Sequence[Kernel], source: str) -> pd.DataFrame:
    """What each kernel is, and its MTF: schema `pipeline.tables.KERNELS`.

    Args:
        kernels: the bank.
        source: ``"generated"`` or ``"paper"``.
    """
    import pandas as pd

    rows = []
    for kernel in kernels:
        columns = {"kernel": kernel.name, "blur_kind": kernel.kind, "kernel_size_px": kernel.size_px}
        columns |= {"angle_deg": float(kernel.angle_deg), "source": source}
        for axis, values in zip("HV", mtf.sample(kernel.psf), strict=True):
            for frequency, value in zip(mtf.FREQUENCIES, values, strict=True):
                rows.append({**columns, "axis": axis, "frequency": float(frequency), "mtf": float(value)})
    return tables.KERNELS.conform(pd.DataFrame(rows))


def write(folder: Path, kernels: Sequence[Kernel], source: str) -> pd.DataFrame:
    """Write a bank into a folder and return its table."""
    rows = table(kernels, source)
    store.write_table(folder / "kernels.parquet", rows, tables.KERNELS)
    store.write_arrays(folder / "kernels.npz", **{k.name: k.psf.astype(np.float32) for k in kernels})
    return rows


def as_stored(kernels: Sequence[Kernel]) -> list[Kernel]:
    """The kernels as `read` gives them after `write`, without a file between: single precision."""
    return [Kernel(k.name, k.kind, float(k.size_px), float(k.angle_deg), k.psf.astype(np.float32)) for k in kernels]


def read(folder: Path) -> list[Kernel]:
    """Read a bank from the folder `write` filled, in its order.

    Raises:
        InputError: a file is missing or broken, or the two do not name the same kernels.
    """
    arrays = store.read_arrays(folder / "kernels.npz")
    rows = store.read_table(folder / "kernels.parquet", tables.KERNELS).drop_duplicates("kernel")
    if set(arrays) != set(rows["kernel"]):
        raise InputError(f"{folder}: kernels.npz and kernels.parquet name different kernels; run dvc repro psf_bank")
    results = []
    for row in rows.to_dict("records"):
        name, size_px, angle_deg = str(row["kernel"]), float(row["kernel_size_px"]), float(row["angle_deg"])
        results.append(Kernel(name, str(row["blur_kind"]), size_px, angle_deg, arrays[name]))
    return results
