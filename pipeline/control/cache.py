"""Keys of kept work: settings, data, weights and the source that is executed on them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from typing import Any

from pipeline.dependencies import closure
from pipeline.weight_files import active

WEIGHTS = "data/weights/"


def fingerprint(module: str, settings: Mapping[str, Any]) -> str:
    """Hash of settings, of the source that a module can execute, and of the weights that it can load.

    Args:
        module: dotted name.
        settings: numbers, words, dataclasses of them, lists, and bytes.
    """
    named = sorted(path for path in closure.closure(module) if path.startswith(WEIGHTS))
    files = {path: active(closure.ROOT / path) for path in named}
    weights = {path: file.read_bytes() for path, file in files.items() if file.is_file()}
    return closure.fingerprint((module,), _plain({"settings": settings, "weights": weights}))


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return hashlib.blake2b(value, digest_size=16).hexdigest()
    if is_dataclass(value) and not isinstance(value, type):
        return _plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): _plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    return value
