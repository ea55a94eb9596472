"""Names that registries of this package have themselves, which win over third parties' of the same name.

They are read from the source of the registries, ``Registry(kind, group, {name: "module:attribute"})``: DVC loads the
files of this folder as a Hydra plugin, so they import nothing of the package.
"""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[3]


@cache
def builtin_names(group: str) -> frozenset[str]:
    """Names in the registry of a group.

    Args:
        group: entry point group, which is the name of the package that holds the registry, e.g. ``"pipeline.noise"``.

    Returns:
        the names; none where the package has no registry of the group.
    """
    source = PROJECT.joinpath(*group.split("."), "__init__.py")
    calls = (node for node in ast.walk(ast.parse(source.read_bytes())) if isinstance(node, ast.Call))
    for call in calls:
        if isinstance(call.func, ast.Name) and call.func.id == "Registry":
            given = dict(zip(("kind", "group", "builtin"), call.args, strict=False))
            given |= {keyword.arg: keyword.value for keyword in call.keywords if keyword.arg}
            if ast.literal_eval(given["group"]) == group:
                return frozenset(ast.literal_eval(given["builtin"]))
    return frozenset()
