"""Banks: drawn once, kept under the name of all they depend on, mapped from there."""

import numpy as np
import pytest

from pipeline.learning.bank import kept


def test_it_is_drawn_once_and_mapped(tmp_path):
    drawn = np.arange(6, dtype=np.float16).reshape(2, 3)
    first = kept(tmp_path / "deep", "some things", 4, 2, lambda: drawn)
    again = kept(tmp_path / "deep", "some things", 4, 2, lambda: pytest.fail("drawn anew"))
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["some-things-4-2.npy"]
    for one in (first, again):
        assert isinstance(one, np.memmap) and not one.flags.writeable
        assert one.dtype == np.float16 and np.array_equal(one, drawn)


@pytest.mark.parametrize("other", [("others", 4, 2), ("some things", 5, 2), ("some things", 4, 3)])
def test_another_bank_is_another_file(tmp_path, other):
    kept(tmp_path, "some things", 4, 2, lambda: np.zeros(2))
    assert kept(tmp_path, *other, lambda: np.ones(2)).tolist() == [1, 1]


def test_without_a_cache_nothing_is_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert kept(None, "some things", 4, 2, lambda: np.ones(2)).tolist() == [1, 1]
    assert not list(tmp_path.iterdir())


def test_a_bank_that_failed_leaves_no_file(tmp_path):
    def broken():
        raise ValueError("no picture")

    with pytest.raises(ValueError, match="no picture"):
        kept(tmp_path, "some things", 4, 2, broken)
    assert not list(tmp_path.iterdir())
