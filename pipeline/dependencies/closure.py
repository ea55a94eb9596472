"""Import closure of a module by static analysis, and fingerprints made from it.

The closure of a module is the set of files of this package that importing it and calling anything in it can execute,
plus the data files that these modules name. An import counts wherever it stands, inside functions too; only those
under ``if TYPE_CHECKING`` do not. Importing ``pipeline.a.b`` executes ``pipeline/__init__.py`` and
``pipeline/a/__init__.py`` as well. A `pipeline.registry.Registry` leads to the modules of the names that are chosen of
it, and to all of its built-in modules where nothing is chosen; one in a package's ``__init__`` only where that package
is imported for more than a submodule. A registry that lists a module the closure starts from leads to no other. A
string constant such as ``"data/weights/mtf_cnn.safetensors"`` names a data file; `importlib.resources.files` stands for
the module's folder.

Packages outside of this one, and estimators that third parties add by entry point, are not followed.
"""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Set
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from pipeline.dependencies.source_file import PACKAGE, Source, read_source
from pipeline.errors import InputError, did_you_mean

ROOT = Path(__file__).resolve().parents[2]

Chosen = Mapping[str, frozenset[str]]
"""Registry group -> names that are chosen of it; a group that is absent means all of its names."""


def closure(modules: str | Iterable[str], chosen: Chosen | None = None, root: Path = ROOT) -> frozenset[str]:
    """Files that a module can execute or open.

    Args:
        modules: dotted names, e.g. ``"pipeline.stages.noise"``; a package stands for its ``__init__`` only.
        chosen: names of registries; see `Chosen`.
        root: folder that holds the package.

    Returns:
        paths relative to ``root``, with ``/``.

    Raises:
        InputError: a module that does not exist, an import by a computed name, or a chosen name of a registry that is
            reached which is neither one of its own nor an entry point of an installed package.
    """
    starts = frozenset([modules] if isinstance(modules, str) else modules)
    for module in starts:
        if _file(module, root) is None:
            raise InputError(f"{module}: no such module below {root}")
    files: set[str] = set()
    waiting = [(module, True) for module in starts]
    seen: set[tuple[str, bool]] = set()
    while waiting:
        module, used = waiting.pop()
        path = _file(module, root)
        if path is None or (module, used) in seen:
            continue
        seen.add((module, used))
        source, package = _source(root / path, module), path.endswith("__init__.py")
        if source.computed:
            raise InputError(
                f"{path}:{source.computed[0]} imports a module by a computed name, which the closure cannot follow; "
                "look it up in a pipeline.registry.Registry"
            )
        files |= {path} | source.data
        if source.whole_folder:
            files |= _beside(root / path, root)
        waiting += _imported(source, module, root)
        if used or not package:
            waiting += [(target, True) for target in _registered(source, chosen or {}, starts)]
    return frozenset(files)


def _imported(source: Source, module: str, root: Path) -> Iterator[tuple[str, bool]]:
    """Modules that importing a module executes, each with whether more of it is used than a submodule."""
    if "." in module:
        yield module.rpartition(".")[0], False
    for name in source.imports:
        yield name, True
    for base, name in source.froms:
        submodule = f"{base}.{name}"
        if _file(submodule, root) is None:
            yield base, True
        else:
            yield from ((submodule, True), (base, False))


def _beside(path: Path, root: Path) -> set[str]:
    """Files beside a source file that are no source."""
    others = (each for each in path.parent.iterdir() if each.is_file() and each.suffix not in (".py", ".pyc"))
    return {each.relative_to(root).as_posix() for each in others}


def fingerprint(
    modules: str | Iterable[str], settings: Any = None, *, chosen: Chosen | None = None, root: Path = ROOT
) -> str:
    """Hash of the source of modules' closure and of settings: the key of a cache that they fill.

    Args:
        modules: dotted names, usually ``__name__``.
        settings: anything JSON can hold; other objects enter by their ``repr``.
        chosen: names of registries; see `Chosen`.
        root: folder that holds the package.

    Returns:
        16 hexadecimal digits. Data files (``data/...``) do not enter, source files do.
    """
    digest = hashlib.blake2b(json.dumps(settings, sort_keys=True, default=repr).encode(), digest_size=8)
    starts = (modules,) if isinstance(modules, str) else tuple(modules)
    digest.update(_source_digest(starts, tuple(sorted((chosen or {}).items())), root))
    return digest.hexdigest()


@functools.lru_cache(maxsize=64)
def _source_digest(modules: tuple[str, ...], chosen: tuple[tuple[str, frozenset[str]], ...], root: Path) -> bytes:
    digest = hashlib.blake2b(digest_size=16)
    for path in sorted(closure(modules, dict(chosen), root)):
        if path.startswith(f"{PACKAGE}/"):
            digest.update(path.encode() + b"\0" + (root / path).read_bytes())
    return digest.digest()


def registered(module: str, root: Path = ROOT) -> frozenset[str]:
    """Names in the registries that a module defines.

    Args:
        module: dotted name.
        root: folder that holds the package.
    """
    path = _file(module, root)
    source = read_source((root / path).read_text(encoding="utf-8"), module, True) if path else None
    return frozenset(name for names in (source.registries.values() if source else ()) for name in names)


def _registered(source: Source, chosen: Chosen, starts: frozenset[str]) -> Iterator[str]:
    for group, names in source.registries.items():
        wanted = chosen.get(group, frozenset(names))
        _refuse_unknown(group, wanted - names.keys(), names)
        targets = {names[name] for name in wanted if name in names}
        started = starts & set(names.values())
        yield from started or targets


def _refuse_unknown(group: str, names: Set[str], builtin: Iterable[str]) -> None:
    """Raises InputError where a name is neither built in nor that of an installed third party's entry point."""
    unknown = sorted(names - {point.name for point in entry_points(group=group)}) if names else []
    if unknown:
        raise InputError(f"{group}: '{unknown[0]}' is not registered; {did_you_mean(unknown[0], sorted(builtin))}")


def _file(module: str, root: Path) -> str | None:
    """The source file of a dotted name, or None where it is no module of the package."""
    if module.split(".")[0] != PACKAGE:
        return None
    base = module.replace(".", "/")
    return next((path for path in (f"{base}/__init__.py", f"{base}.py") if (root / path).is_file()), None)


def _source(path: Path, module: str) -> Source:
    status = path.stat()
    return _parsed(path, module, status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=2048)
def _parsed(path: Path, module: str, _changed_ns: int, _size: int) -> Source:
    """Kept until the file changes."""
    return read_source(path.read_text(encoding="utf-8"), module, path.name == "__init__.py")
