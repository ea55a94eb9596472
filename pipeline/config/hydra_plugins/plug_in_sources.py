"""Hash of the source of a third party's package, so that stages and kept work notice an edit of it.

The import closure of `pipeline.dependencies` ends where this package ends. Of what an entry point registers, all Python
files of its top-level package count, helper modules among them; data files do not.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Collection, Iterator, Sequence
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path


def digest(group: str, kind: str) -> str | None:
    """SHA-256 of the source behind a registry name; None where no installed third party registers it."""
    return digests(group, [kind]).get(kind)


def digests(group: str, kinds: Collection[str]) -> dict[str, str]:
    """SHA-256 of the source behind registry names.

    Args:
        group: entry point group, e.g. ``"pipeline.noise"``.
        kinds: registry names.

    Returns:
        name -> hexadecimal digits, of those that an installed third party registers.
    """
    points = entry_points(group=group)  # reads a file of every installed package
    listed = {kind: sorted({(each.value, each.module) for each in points if each.name == kind}) for kind in kinds}
    return {kind: _digest(modules) for kind, modules in listed.items() if modules}


def _digest(points: Sequence[tuple[str, str]]) -> str:
    result = hashlib.sha256()
    for value, module in points:
        result.update(value.encode() + b"\0")
        for name, path in _files(module.partition(".")[0]):
            result.update(name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return result.hexdigest()


def _files(package: str) -> list[tuple[str, Path]]:
    """Python files of a top-level package or module, each with its name in it, in the order of these names."""
    with contextlib.suppress(ImportError, ValueError):  # not there, or no module: refused where it is imported
        spec = find_spec(package)  # of a top-level name, which imports nothing
        if spec is not None and spec.submodule_search_locations is not None:
            folders = [Path(folder) for folder in spec.submodule_search_locations]
            return sorted(
                (path.relative_to(folder).as_posix(), path) for folder in folders for path in _python_files(folder)
            )
        if spec is not None and spec.has_location and spec.origin:
            return [(Path(spec.origin).name, Path(spec.origin))]
    return []


def _python_files(folder: Path) -> Iterator[Path]:
    """Python files below a folder, those behind links to folders among them; no folder is entered twice."""
    entered: set[str] = set()
    for parent, below, files in os.walk(folder, followlinks=True):
        entered.add(os.path.realpath(parent))
        below[:] = [name for name in sorted(below) if os.path.realpath(Path(parent, name)) not in entered]
        yield from (Path(parent, name) for name in files if name.endswith(".py"))
