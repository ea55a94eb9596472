"""JSON of one long object, item by item: the text of `pipeline.store.write_json` without a second copy in memory."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

INDENT = 2


def pieces(content: Mapping[str, Any], *, ensure_ascii: bool = False) -> Iterator[str]:
    """The text of an object: sorted keys, an indent of two; NaN and infinity become null.

    Args:
        content: the object; its lists are converted item by item, all else at once.
        ensure_ascii: whether characters beyond ASCII are escaped.

    Returns:
        parts of the text, without a line end after the last.
    """
    from pipeline.store import plain_json

    def text(value: Any, depth: int) -> str:
        plain = json.dumps(plain_json(value), indent=INDENT, sort_keys=True, ensure_ascii=ensure_ascii)
        return plain.replace("\n", _line_start(depth))  # line ends inside of strings are escaped

    yield "{"
    for number, (key, value) in enumerate(sorted(content.items())):
        yield f"{',' if number else ''}{_line_start(1)}{text(key, 1)}: "
        if not (isinstance(value, list) and value):
            yield text(value, 1)
            continue
        for index, item in enumerate(value):
            yield f"{',' if index else '['}{_line_start(2)}{text(item, 2)}"
        yield f"{_line_start(1)}]"
    yield "\n}" if content else "}"


def _line_start(depth: int) -> str:
    return "\n" + " " * INDENT * depth


def write(path: Path, content: Mapping[str, Any]) -> None:
    """Write what `pipeline.store.write_json` writes, and like it beside its place and renamed into it.

    Args:
        path: the file; replaced as a whole.
        content: see `pieces`.
    """
    from pipeline.store import replacing

    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(pieces(content))
        file.write("\n")
