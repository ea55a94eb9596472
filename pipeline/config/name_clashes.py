"""Names that stand for more than one class: built-in names that an installed package registers, and names of two.

`pipeline.registry.Registry` takes the built-in class of such a name, and of two third parties' the last listed. So the
configuration check refuses the name, and ``camera-monitor doctor`` lists it.
"""

from __future__ import annotations

from collections.abc import Collection
from importlib.metadata import EntryPoint, entry_points

from pipeline.registry import Registry


def name_clashes(registry: Registry, names: Collection[str] | None = None) -> dict[str, str]:
    """Names of a registry that stand for more than one class.

    Args:
        registry: to look at.
        names: that matter; None for all.

    Returns:
        name -> a sentence with both classes, and how to mend it.
    """
    points: dict[str, dict[str, EntryPoint]] = {}
    for point in entry_points(group=registry.group):  # reads a file of every installed package
        if names is None or point.name in names:
            points.setdefault(point.name, {})[point.value] = point
    return {
        name: _sentence(registry, name, list(by_value.values()))
        for name, by_value in sorted(points.items())
        if registry.is_builtin(name) or len(by_value) > 1
    }


def _sentence(registry: Registry, name: str, points: list[EntryPoint]) -> str:
    """A clash in words."""
    registered = " and ".join(f"{point.value} of {_distribution(point)}" for point in points)
    if registry.is_builtin(name):
        builtin = registry.get(name)
        return (
            f"{registry.kind} '{name}' is {builtin.__module__}:{builtin.__qualname__} of this package, and "
            f"{registered} is never used; rename its entry point of {registry.group}, or uninstall it"
        )
    return (
        f"{registry.kind} '{name}' is registered twice, as {registered}; rename one entry point of {registry.group}, "
        "or uninstall one of them"
    )


def _distribution(point: EntryPoint) -> str:
    """The installed package that an entry point is of."""
    return "an unnamed package" if point.dist is None else str(point.dist.name)
