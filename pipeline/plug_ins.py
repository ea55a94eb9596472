"""Estimators and policies of registries, which may be third parties': a class that is not whole is refused by name."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

from pipeline.errors import InputError
from pipeline.registry import Registry


def created(registry: Registry, name: str, method: str, options: Mapping[str, Any]) -> Any:
    """Make an estimator or a policy of a registry.

    Args:
        registry: that holds its class.
        name: in the registry.
        method: that it is asked by, as ``"estimate"``.
        options: keyword arguments of the class.

    Raises:
        InputError: unknown name or option, or the class lacks a method.
    """
    cls = registry.get(name)
    missing = sorted(cls.__abstractmethods__) if inspect.isabstract(cls) else []
    if not missing:
        made = registry.create(name, **options)
        if callable(getattr(made, method, None)):
            return made
        missing = [method]
    raise InputError(
        f"{registry.kind} '{name}': {getattr(cls, '__name__', cls)} lacks {' and '.join(missing)}(); "
        "docs/extend.md shows a whole one"
    )
