"""A digest of Python values that is the same in every process: SHA-256 over types and contents.

The bytes of `pickle` are no such thing: the order of a set follows the hash seed of the process, and objects that are
shared are written once, so that they depend on which objects are identical. Here sets and mappings are sorted by the
digests of their members, and each value is a node of a tree,

    digest(value) = SHA-256(name of its type, digests of its parts or its bytes).
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterable, Mapping, Set
from functools import partial
from pathlib import PurePath
from types import BuiltinFunctionType, FunctionType
from typing import Any

import numpy as np


def stable_digest(value: Any) -> str:
    """The digest of a value.

    Args:
        value: None, a boolean, number, string, bytes or path, a NumPy array or scalar, a function or class of a module,
            or a tuple, list, set, mapping, dataclass or ``functools.partial`` of such values.

    Returns:
        64 hexadecimal digits. Types count: 1, 1.0 and True differ, and so do a list and a tuple.

    Raises:
        TypeError: a value of another type is among them, whose digest could differ from process to process.
    """
    return _digest(value).hex()


def _digest(value: Any) -> bytes:
    kind = type(value)
    if value is None or kind in (bool, int):
        return _hashed(kind.__name__, [repr(value).encode()])
    if kind is float:
        return _hashed("float", [value.hex().encode()])
    if kind is str:
        return _hashed("str", [value.encode("utf-8", "surrogatepass")])
    if kind is bytes:
        return _hashed("bytes", [value])
    if isinstance(value, PurePath):
        return _hashed("path", [value.as_posix().encode("utf-8", "surrogateescape")])
    if isinstance(value, (np.ndarray, np.generic)):
        return _of_array(np.asarray(value))
    if isinstance(value, (FunctionType, BuiltinFunctionType, type)):
        return _hashed("function", [_name(value).encode()])
    if isinstance(value, partial):
        return _hashed("partial", map(_digest, (value.func, value.args, value.keywords)))
    if dataclasses.is_dataclass(value):
        contents = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        return _hashed("dataclass", [_digest(kind), _digest(contents)])
    if isinstance(value, (tuple, list)):
        return _hashed("sequence", [_digest(kind), *map(_digest, value)])
    if isinstance(value, Set):
        return _hashed("set", sorted(map(_digest, value)))
    if isinstance(value, Mapping):
        return _hashed("mapping", sorted(_digest(key) + _digest(item) for key, item in value.items()))
    raise TypeError(f"{kind.__module__}.{kind.__qualname__}: no digest that is the same in every process: {value!r}")


def _hashed(tag: str, parts: Iterable[bytes]) -> bytes:
    """SHA-256 of a tag and of parts: either one of any length, or digests, so that their bounds are known."""
    digest = hashlib.sha256(tag.encode() + b"\0")
    for part in parts:
        digest.update(part)
    return digest.digest()


def _of_array(array: np.ndarray) -> bytes:
    if array.dtype.hasobject:
        raise TypeError("an array of objects: no digest that is the same in every process")
    about = _digest((str(array.dtype.descr), array.shape))
    return _hashed("array", [about, np.ascontiguousarray(array).tobytes()])


def _name(value: Any) -> str:
    """Module and qualified name of a function or class; only these let another process find the same one."""
    name = f"{value.__module__}.{value.__qualname__}"
    if "<" in name or not isinstance(value.__module__, str):
        raise TypeError(f"{name}: not a function or class of a module, so its name does not stand for its content")
    return name
