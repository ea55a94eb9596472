"""Datasets: sharp frames with labelled boxes, from renderings, photographs and recorded drives.

::

    from pipeline import datasets
    kitti = datasets.open_dataset("kitti", "kitti", "data/raw/kitti", whitelist="kitti.txt")
    for frame in kitti.frames():
        frame.image(), frame.boxes
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError
from pipeline.registry import Registry

if TYPE_CHECKING:
    from pipeline.datasets.dataset import Dataset

REGISTRY = Registry(
    "dataset",
    "pipeline.datasets",
    {
        "sim": "pipeline.datasets.sim:Sim",
        "photos": "pipeline.datasets.photos:Photos",
        "kitti": "pipeline.datasets.kitti:Kitti",
        "udacity": "pipeline.datasets.udacity:Udacity",
        "folder": "pipeline.datasets.folder:Folder",
    },
)


def open_dataset(kind: str, name: str, root: str | Path | None = None, **options: Any) -> Dataset:
    """Open a dataset.

    Args:
        kind: its layout: ``"sim"``, ``"photos"``, ``"kitti"``, ``"udacity"``, ``"folder"``, or a third party's.
        name: how tables call it.
        root: its folder; may be None for ``"photos"``, which come with scikit-image.
        options: the layout's own options; see the class.

    Returns:
        the dataset; nothing is decoded yet.

    Raises:
        DataAbsent: (an InputError) the folder or a part of it is not there; with where to get it.
        InputError: unknown kind or option.
    """
    import inspect

    made = REGISTRY.get(kind)
    known = [parameter for parameter in inspect.signature(made).parameters if parameter not in ("name", "root")]
    for option in options:
        if option not in known:
            raise InputError(f"datasets.{name}.{option}: unknown option of '{kind}'; known: {', '.join(sorted(known))}")
    if root is None and inspect.signature(made).parameters["root"].default is inspect.Parameter.empty:
        raise InputError(
            f"datasets.{name}.root is not set; a dataset of kind '{kind}' needs its folder "
            f"(camera-monitor dataset {kind} FOLDER)"
        )
    return made(name, root, **options)
