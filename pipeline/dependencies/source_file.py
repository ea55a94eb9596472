"""What one source file of the package refers to: modules, registries and data files, read from its syntax tree."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from pipeline.errors import InputError

PACKAGE = "pipeline"
_DATA = re.compile(r"^(data/weights|data/paper|benchmarks/results)/[\w./-]+\.[a-z0-9]+$")


@dataclass(frozen=True)
class Source:
    """What one source file refers to.

    Attributes:
        imports: dotted names of modules that it imports.
        froms: (module, name) of its ``from module import name``.
        registries: group -> name -> dotted module.
        data: data files that it names, relative to the project.
        whole_folder: whether it opens files of its folder (`importlib.resources.files`).
        computed: lines that import a module by a computed name.
    """

    imports: frozenset[str]
    froms: frozenset[tuple[str, str]]
    registries: Mapping[str, Mapping[str, str]]
    data: frozenset[str]
    whole_folder: bool
    computed: tuple[int, ...]


def read_source(text: str, module: str, package: bool = False) -> Source:
    """What a source text refers to.

    Args:
        text: Python source.
        module: its dotted name.
        package: whether it is a package's ``__init__``.

    Raises:
        InputError: a registry whose arguments are no literals.
    """
    reader = _Reader(module, package)
    for node in _executed(ast.parse(text)):
        if isinstance(node, ast.Import):
            reader.imports.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            reader.froms.update((reader.absolute(node), alias.name) for alias in node.names)
        elif isinstance(node, ast.Call):
            reader.call(node)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and _DATA.match(node.value):
            reader.data.add(node.value)
    return Source(
        frozenset(reader.imports),
        frozenset(reader.froms),
        reader.registries,
        frozenset(reader.data),
        reader.whole_folder,
        tuple(reader.computed),
    )


@dataclass
class _Reader:
    """What was found of a `Source` so far."""

    module: str
    package: bool
    imports: set[str] = field(default_factory=set)
    froms: set[tuple[str, str]] = field(default_factory=set)
    registries: dict[str, dict[str, str]] = field(default_factory=dict)
    data: set[str] = field(default_factory=set)
    whole_folder: bool = False
    computed: list[int] = field(default_factory=list)

    def absolute(self, node: ast.ImportFrom) -> str:
        """The module of a ``from ... import``, with the leading dots of a relative one filled in."""
        if not node.level:
            return node.module or ""
        parts = self.module.split(".")
        up = node.level - 1 if self.package else node.level
        return ".".join([*parts[: len(parts) - up], *([node.module] if node.module else [])])

    def call(self, node: ast.Call) -> None:
        """Take in a call: an import by name, a registry, or files of the module's folder."""
        called = ast.unparse(node.func)
        if called in ("importlib.import_module", "import_module", "__import__"):
            self._import(node)
        elif called.rpartition(".")[2] == "Registry":
            group, names = _registry(node)
            self.registries.setdefault(group, {}).update(names)
        elif called in ("resources.files", "importlib.resources.files"):
            self.whole_folder = True

    def _import(self, node: ast.Call) -> None:
        name = node.args[0] if node.args else None
        if isinstance(name, ast.Constant) and isinstance(name.value, str):
            self.imports.add(name.value)
        elif self.module != f"{PACKAGE}.registry":
            self.computed.append(node.lineno)


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


def _registry(call: ast.Call) -> tuple[str, dict[str, str]]:
    """Group and modules of a ``Registry(kind, group, builtin)`` call with literal arguments."""
    given = dict(zip(("kind", "group", "builtin"), call.args, strict=False))
    given |= {keyword.arg: keyword.value for keyword in call.keywords if keyword.arg}
    try:
        group, builtin = ast.literal_eval(given["group"]), ast.literal_eval(given["builtin"])
    except (KeyError, ValueError):
        raise InputError(f"line {call.lineno}: expected Registry(kind, group, {{name: 'module:attribute'}})") from None
    return str(group), {str(name): str(target).partition(":")[0] for name, target in builtin.items()}
