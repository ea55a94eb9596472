"""From the configuration's section of a dataset to the dataset itself."""

from __future__ import annotations

from typing import Any

from pipeline.datasets import open_dataset
from pipeline.datasets.dataset import Dataset


def open_section(name: str, section: Any) -> Dataset:
    """Open a dataset as ``datasets.<name>`` of the configuration describes it.

    Args:
        name: what the dataset is called.
        section: `pipeline.config.schema.DatasetSection`.

    Raises:
        InputError: unknown kind, absent data, or an option this kind does not take.
    """
    return open_dataset(
        section.kind, name, section.root, whitelist=section.whitelist, limit=section.limit, **section.options
    )
