"""Strategies of damaged content: bytes of a sound file with edits, JSON of any shape, arrays of any type and shape."""

from __future__ import annotations

import io
import json
import struct
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

NUMBERS = st.one_of(
    st.integers(-(10**30), 10**30), st.floats(allow_nan=True, allow_infinity=True), st.sampled_from([0, 1, -1, 0.5])
)
LEAVES = st.one_of(st.none(), st.booleans(), NUMBERS, st.text(max_size=12))
JSON = st.recursive(
    LEAVES,
    lambda inner: st.one_of(st.lists(inner, max_size=5), st.dictionaries(st.text(max_size=8), inner, max_size=5)),
    max_leaves=20,
)
WORDS = st.one_of(
    st.sampled_from(
        ["car", "Car", "1", "0", "-1", "1e9", "nan", "inf", "1_0", "0x1", "0.5", "difficult", '"', "'", ",", "\t", "٣"]
    ),
    st.integers(-(10**12), 10**12).map(str),
    st.floats().map(str),
    st.text(max_size=6),
)
LINES = st.lists(st.lists(WORDS, max_size=17).map(" ".join), max_size=4).map("\n".join)
ARRAYS = arrays.arrays(
    st.sampled_from(["f8", "f4", "f2", "i8", "u1", "?", "U3", "c8", "M8[s]"]).map(np.dtype),
    arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=9),
)


@st.composite
def damaged(draw: st.DrawFn, content: bytes, edits: int = 6) -> bytes:
    """A file's bytes after some edits: bytes overwritten, cut out, doubled or put in, or the end cut off."""
    result = bytearray(content)
    for _ in range(draw(st.integers(1, edits))):
        # edits are frequent near the begin, where headers are
        start = draw(st.one_of(st.integers(0, 64), st.integers(0, max(len(result), 1))))
        match draw(st.sampled_from(["overwrite", "number", "cut", "double", "insert", "end"])):
            case "overwrite":
                new = draw(st.binary(min_size=1, max_size=8))
                result[start : start + len(new)] = new
            case "number":
                number = draw(st.sampled_from([0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 65536]))
                result[start : start + 4] = struct.pack(draw(st.sampled_from("<>")) + "I", number)
            case "cut":
                del result[start : start + draw(st.integers(1, 200))]
            case "double":
                result[start:start] = result[start : start + draw(st.integers(1, 200))]
            case "insert":
                result[start:start] = draw(st.binary(max_size=16))
            case "end":
                del result[start:]
    return bytes(result)


@st.composite
def replaced(draw: st.DrawFn, content: Any) -> Any:
    """JSON content one or more of whose parts are left out or become something else."""
    result = json.loads(json.dumps(content))
    for _ in range(draw(st.integers(1, 3))):
        parent, part = None, result
        key: Any = None
        while isinstance(part, (dict, list)) and part and (parent is None or draw(st.booleans())):
            parent, key = (
                part,
                draw(st.sampled_from(sorted(part) if isinstance(part, dict) else list(range(len(part))))),
            )
            part = part[key]
        if parent is None:
            result = draw(JSON)
        elif isinstance(parent, dict) and draw(st.booleans()):
            del parent[key]
            if draw(st.booleans()):
                parent[draw(st.text(max_size=8))] = part
        else:
            parent[key] = draw(JSON)
    return result


def archive(content: dict[str, np.ndarray]) -> bytes:
    """The bytes of an ``.npz`` file."""
    stream = io.BytesIO()
    np.savez(stream, **content)
    return stream.getvalue()
