"""Files that options name, and files of weights that such a file names: their content decides what stages depend on.

Options may hold names in lists and mappings. A network in ONNX format may keep its weights in files beside it, as
PyTorch writes ``net.onnx.data`` to ``net.onnx``: trained anew, only these change.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

_LOCATION = re.compile(rb"\n\x08location\x12([\x01-\x7f])", re.DOTALL)
"""How ONNX (protocol buffers) names a tensor's file: the key ``location``, then the length of the name."""


def hashes(options: Mapping[str, Any]) -> dict[str, str]:
    """SHA-256 of the files that options name; of several of one option, of their hashes.

    Args:
        options: of an estimator, a detector, a policy or a dataset.

    Returns:
        option -> hexadecimal digits; options that name no file are left out.
    """
    named = {str(option): [Path(word) for word in _words(value)] for option, value in sorted(options.items())}
    return {option: _hash(paths) for option, paths in named.items() if paths}


def with_files(source: str, options: Mapping[str, Any]) -> str:
    """The hash of a source, or where options name files one of it and of them.

    Args:
        source: hexadecimal digits.
        options: as of `hashes`.
    """
    files = hashes(options)
    return hashlib.sha256(str((source, files)).encode()).hexdigest() if files else source


def _words(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        with suppress(OSError):  # a text that is too long for the name of a file
            yield from [value] if Path(value).is_file() else []
    elif isinstance(value, (Mapping, list)):
        for part in value.values() if isinstance(value, Mapping) else value:
            yield from _words(part)


def _hash(paths: list[Path]) -> str:
    files = [file for path in paths for file in (path, *weights_beside(path)) if file.is_file()]
    parts = [hashlib.sha256(file.read_bytes()) for file in files]
    return (parts[0] if len(parts) == 1 else hashlib.sha256(b"".join(part.digest() for part in parts))).hexdigest()


def weights_beside(path: Path) -> list[Path]:
    """The files that an ONNX network keeps its weights in; none where they are in its own, or of other formats."""
    if path.suffix.lower() != ".onnx":
        return []
    content = path.read_bytes()
    names = {content[match.end() : match.end() + match[1][0]] for match in _LOCATION.finditer(content)}
    return [path.parent / os.fsdecode(name) for name in sorted(names)]


def in_one_file(key: str, path: Path) -> str:
    """Why a detector's file of weights cannot be depended on; empty where it can.

    Args:
        key: of the configuration.
        path: the file.
    """
    beside = ", ".join(file.name for file in weights_beside(path))
    return beside and (
        f"{key}={path}: keeps its weights in {beside}, of which a change would go unnoticed; write one file: "
        "torch.onnx.export(..., external_data=False), or onnx.save(onnx.load(FILE), OTHER_FILE)"
    )
