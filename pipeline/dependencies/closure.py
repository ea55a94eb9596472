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

import ast
import functools
import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from pipeline.errors import InputError, did_you_mean

PACKAGE = "pipeline"
ROOT = Path(__file__).resolve().parents[2]

Chosen = Mapping[str, frozenset[str]]
"""Registry group -> names that are chosen of it; a group that is absent means all of its names."""

_DATA = re.compile(r"^(data/weights|data/paper|benchmarks/results)/[\w./-]+\.[a-z0-9]+$")


@dataclass(frozen=True)
class Source:
    """What one source file refers to.

    Attributes:
        imports: dotted names of modules that it imports.
        froms: (module, name) of its ``from module import name``.
        registries: group -> name -> dotted module.
        folders: group -> package whose modules are the entries (`pipeline.registry.Registry.of_folder`).
        data: data files that it names, relative to the project.
        whole_folder: whether it opens files of its folder (`importlib.resources.files`).
        computed: lines that import a module by a computed name.
    """

    imports: frozenset[str]
    froms: frozenset[tuple[str, str]]
    registries: Mapping[str, Mapping[str, str]]
    folders: Mapping[str, str]
    data: frozenset[str]
    whole_folder: bool
    computed: tuple[int, ...]


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
        if "." in module:
            waiting.append((module.rpartition(".")[0], False))
        files.add(path)
        package = path.endswith("__init__.py")
        source = _source(root / path, module, package)
        if source.computed:
            raise InputError(
                f"{path}:{source.computed[0]} imports a module by a computed name, which the closure cannot follow; "
                "look it up in a pipeline.registry.Registry"
            )
        waiting += [(name, True) for name in source.imports]
        for base, name in source.froms:
            submodule = f"{base}.{name}"
            known = _file(submodule, root) is not None
            waiting += [(submodule, True), (base, False)] if known else [(base, True)]
        if used or not package:
            waiting += [(target, True) for target in _registered(source, chosen or {}, starts, root)]
        files |= source.data
        if source.whole_folder:
            files |= _beside(root / path, root)
    return frozenset(files)


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
    source = parse((root / path).read_text(encoding="utf-8"), module, True) if path else None
    return frozenset(name for names in (source.registries.values() if source else ()) for name in names)


def _registered(source: Source, chosen: Chosen, starts: frozenset[str], root: Path) -> Iterator[str]:
    entries = dict(source.registries)
    for group, package in source.folders.items():
        modules = (path.stem for path in (root / package.replace(".", "/")).glob("*.py"))
        entries[group] = {name: f"{package}.{name}" for name in modules if name != "__init__"}
    for group, names in entries.items():
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


def _source(path: Path, module: str, package: bool) -> Source:
    status = path.stat()
    return _parsed(path, module, package, status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=2048)
def _parsed(path: Path, module: str, package: bool, _changed_ns: int, _size: int) -> Source:
    return parse(path.read_text(encoding="utf-8"), module, package)


def parse(text: str, module: str, package: bool = False) -> Source:
    """What a source text refers to.

    Args:
        text: Python source.
        module: its dotted name.
        package: whether it is a package's ``__init__``.
    """
    tree = ast.parse(text)
    imports: set[str] = set()
    froms: set[tuple[str, str]] = set()
    values: dict[str, dict[str, str]] = {}
    folders: dict[str, str] = {}
    data: set[str] = set()
    computed: list[int] = []
    whole_folder = False
    for node in _executed(tree):
        if isinstance(node, ast.Import):
            imports.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = _absolute(node, module, package)
            froms.update((base, alias.name) for alias in node.names)
        elif isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            if called in ("importlib.import_module", "import_module", "__import__"):
                target = node.args[0] if node.args else None
                if isinstance(target, ast.Constant) and isinstance(target.value, str):
                    imports.add(target.value)
                elif module != f"{PACKAGE}.registry":
                    computed.append(node.lineno)
            elif called.rpartition(".")[2] == "Registry":
                group, names = _registry(node)
                values.setdefault(group, {}).update(names)
            elif called.endswith("Registry.of_folder"):
                _, group, package_name, _ = (ast.literal_eval(argument) for argument in node.args)
                folders[group] = package_name
            elif called in ("resources.files", "importlib.resources.files"):
                whole_folder = True
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and _DATA.match(node.value):
            data.add(node.value)
    return Source(frozenset(imports), frozenset(froms), values, folders, frozenset(data), whole_folder, tuple(computed))


def _executed(tree: ast.Module) -> Iterator[ast.AST]:
    """All nodes but the bodies of ``if TYPE_CHECKING``."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        if isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING"):
            waiting.extend(node.orelse)
        else:
            waiting.extend(ast.iter_child_nodes(node))


def _absolute(node: ast.ImportFrom, module: str, package: bool) -> str:
    if not node.level:
        return node.module or ""
    parts = module.split(".")
    up = node.level - 1 if package else node.level
    base = parts[: len(parts) - up]
    return ".".join([*base, *([node.module] if node.module else [])])


def _registry(call: ast.Call) -> tuple[str, dict[str, str]]:
    """Group and modules of a ``Registry(kind, group, builtin)`` call with literal arguments."""
    given = dict(zip(("kind", "group", "builtin"), call.args, strict=False))
    given |= {keyword.arg: keyword.value for keyword in call.keywords if keyword.arg}
    try:
        group, builtin = ast.literal_eval(given["group"]), ast.literal_eval(given["builtin"])
    except (KeyError, ValueError):
        raise InputError(f"line {call.lineno}: expected Registry(kind, group, {{name: 'module:attribute'}})") from None
    return str(group), {str(name): str(target).partition(":")[0] for name, target in builtin.items()}
