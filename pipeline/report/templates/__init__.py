"""The page's templates, style sheet and script, and the engine that fills templates in."""

from __future__ import annotations

import functools
from importlib import resources
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment


@functools.cache
def environment(package: str = "pipeline.report") -> Environment:
    """Jinja with every value escaped unless marked as safe; an unknown name is an error, not an empty string.

    Args:
        package: whose folder ``templates`` it reads.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader(package, "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def text(name: str) -> str:
    """The content of one template file as it is, e.g. ``"style.css"``."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
