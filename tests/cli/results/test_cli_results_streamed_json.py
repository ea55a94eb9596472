"""JSON that is written item by item: the bytes of `pipeline.store.write_json`, without its memory."""

from __future__ import annotations

import json
import tracemalloc

import numpy as np
import pytest

from pipeline.cli.results import streamed_json
from pipeline.store import plain_json, write_json

ROW = {"mtf": np.full((2, 8), 0.1), "b": float("nan"), "a": ["ä", "two\nlines", []], "empty": {}}
CONTENTS = [
    {},
    {"pictures": []},
    {"pictures": [ROW, ROW], "about": {"z": np.float32(0.5), "a": {"nested": [1, [2, {}]]}}, "ä": "\u2028", "n": None},
    {"mixed": [1, "a", None, True, float("inf"), {}, [], [[0]]], "tuple": (1, 2), "array": np.arange(3)},
]


@pytest.mark.parametrize("content", CONTENTS)
def test_it_has_the_bytes_of_json_written_at_once(tmp_path, content):
    write_json(tmp_path / "once.json", content)
    streamed_json.write(tmp_path / "streamed.json", content)
    assert (tmp_path / "streamed.json").read_bytes() == (tmp_path / "once.json").read_bytes()
    escaped = "".join(streamed_json.pieces(content, ensure_ascii=True))
    assert escaped == json.dumps(plain_json(content), indent=2, sort_keys=True)


def test_an_earlier_file_stays_whole_where_writing_fails(tmp_path):
    path = tmp_path / "a.json"
    streamed_json.write(path, {"rows": [1]})
    before = path.read_bytes()
    with pytest.raises(TypeError):
        streamed_json.write(path, {"rows": [1, object()]})
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def test_it_takes_a_small_part_of_the_memory_of_json_written_at_once(tmp_path):
    content = {"rows": [ROW] * 2000}

    def peak(write):
        tracemalloc.start()
        write(tmp_path / "a.json", content)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    assert peak(streamed_json.write) < 0.1 * peak(write_json)
