"""A registry: short names in YAML stand for classes that are imported only when asked for.

Third parties add theirs through an entry point group, for example in their ``pyproject.toml``::

    [project.entry-points."pipeline.noise"]
    mine = "my_package.my_module:MyEstimator"

Names are looked up, never import paths, so a configuration file cannot run arbitrary code.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Mapping
from importlib.metadata import entry_points
from typing import Any

from pipeline.errors import InputError, did_you_mean


class Registry:
    """Names of one kind of thing.

    Args:
        kind: what is registered, in words (``"noise estimator"``).
        group: entry point group for third parties.
        builtin: name -> ``"module:attribute"``.
        method: that what `create` makes is asked by (``"estimate"``); None for things of other uses.
    """

    def __init__(self, kind: str, group: str, builtin: Mapping[str, str], method: str | None = None) -> None:
        self.kind, self.group, self._builtin, self.method = kind, group, dict(builtin), method

    def names(self) -> list[str]:
        """All registered names, sorted; built-in names win over third parties'."""
        return sorted({*self._builtin, *(point.name for point in entry_points(group=self.group))})

    def is_builtin(self, name: str) -> bool:
        """Whether a name is one of this package's own."""
        return name in self._builtin

    def get(self, name: str) -> Any:
        """The class or function behind a name, imported now.

        Raises:
            InputError: the name is not registered, its module cannot be imported, or lacks the class or function.
        """
        target = self._builtin.get(name)
        if target is None:
            values = {point.name: point.value for point in entry_points(group=self.group)}
            target = values.get(name)
        if target is None:
            raise InputError(f"unknown {self.kind} '{name}'; {did_you_mean(name, self.names())}")
        module, _, attribute = target.partition(":")
        try:
            imported = importlib.import_module(module)
        except ImportError as error:
            raise InputError(f"{self.kind} '{name}' needs a package that is not installed: {error}") from error
        if not hasattr(imported, attribute):
            raise InputError(
                f"{self.kind} '{name}': {module} has no '{attribute}', which its entry point names "
                f"({self.group}: {name} = {target})"
            )
        return getattr(imported, attribute)

    def create(self, name: str, **options: Any) -> Any:
        """Make one, with keyword options.

        Raises:
            InputError: unknown name, an option it does not take, or a class, perhaps a third party's, that lacks a
                method.
            Exception: whatever making it raises.
        """
        maker = self.get(name)
        if inspect.isabstract(maker):
            raise self._unfinished(name, maker, sorted(maker.__abstractmethods__))
        try:
            inspect.signature(maker).bind(**options)
        except TypeError as error:
            raise InputError(f"{self.kind} '{name}': {error}") from error
        except ValueError:  # of compiled code, without a signature to compare with
            pass
        made = maker(**options)
        if self.method is not None and not callable(getattr(made, self.method, None)):
            raise self._unfinished(name, maker, [self.method])
        return made

    def _unfinished(self, name: str, maker: Any, missing: list[str]) -> InputError:
        """The refusal of a class without these methods."""
        return InputError(
            f"{self.kind} '{name}': {getattr(maker, '__name__', maker)} lacks {' and '.join(missing)}(); "
            "docs/extend.md shows a whole one"
        )
