"""From the configuration's section of a dataset to the dataset itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline.datasets import open_dataset
from pipeline.datasets.dataset import Dataset

if TYPE_CHECKING:
    from pipeline.datasets.settings import DatasetSettings


def open_section(name: str, section: DatasetSettings) -> Dataset:
    """Open a dataset as ``datasets.<name>`` of the configuration describes it.

    Args:
        name: what the dataset is called.
        section: ``datasets.<name>`` of the configuration.

    Raises:
        InputError: unknown kind, absent data, or an option this kind does not take.
    """
    return open_dataset(
        section.kind, name, section.root, whitelist=section.whitelist, limit=section.limit, **section.options
    )
