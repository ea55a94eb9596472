"""Banks: drawn once, kept under the name of all they depend on, mapped from there."""

import errno
import resource

import numpy as np
import pytest

from pipeline.learning.bank import bank_file, kept

CODE = "pipeline.streams"


def test_it_is_drawn_once_and_mapped(tmp_path):
    drawn = np.arange(6, dtype=np.float16).reshape(2, 3)
    first = kept(tmp_path / "deep", "some things", 4, 2, CODE, lambda: drawn)
    again = kept(tmp_path / "deep", "some things", 4, 2, CODE, lambda: pytest.fail("drawn anew"))
    assert [path.name for path in (tmp_path / "deep").iterdir()] == [
        bank_file(tmp_path, "some things", 4, 2, CODE).name
    ]
    for one in (first, again):
        assert isinstance(one, np.memmap) and not one.flags.writeable
        assert one.dtype == np.float16 and np.array_equal(one, drawn)


@pytest.mark.parametrize("left", [0, 3, 50, 130, 190])
def test_a_truncated_file_is_named_and_drawn_anew(tmp_path, capsys, left):
    drawn = np.arange(32, dtype=np.float32)
    kept(tmp_path, "some things", 4, 2, CODE, lambda: drawn)
    path = bank_file(tmp_path, "some things", 4, 2, CODE)
    whole = path.read_bytes()
    path.write_bytes(whole[:left])
    assert np.array_equal(kept(tmp_path, "some things", 4, 2, CODE, lambda: drawn), drawn)
    warning = capsys.readouterr().err
    assert warning.startswith(f"warning: {path}: damaged (") and warning.endswith("); drawn anew\n")
    assert warning.count("\n") == 1
    assert path.read_bytes() == whole
    kept(tmp_path, "some things", 4, 2, CODE, lambda: pytest.fail("drawn anew"))
    assert not capsys.readouterr().err


def test_it_is_the_file_that_numpy_writes(tmp_path):
    drawn = np.arange(12, dtype=np.float16).reshape(3, 4).T
    np.save(tmp_path / "numpy.npy", np.ascontiguousarray(drawn))
    kept(tmp_path, "some things", 4, 2, CODE, lambda: drawn)
    written = bank_file(tmp_path, "some things", 4, 2, CODE).read_bytes()
    assert written == (tmp_path / "numpy.npy").read_bytes()


def test_an_error_of_a_full_disk_names_the_file_and_leaves_none(tmp_path):
    path, limits = bank_file(tmp_path, "some things", 4, 2, CODE), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            kept(tmp_path, "some things", 4, 2, CODE, lambda: np.zeros(5000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (caught.value.errno, caught.value.filename) == (errno.EFBIG, str(path))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("other", [("others", 4, 2), ("some things", 5, 2), ("some things", 4, 3)])
def test_another_bank_is_another_file(tmp_path, other):
    kept(tmp_path, "some things", 4, 2, CODE, lambda: np.zeros(2))
    assert kept(tmp_path, *other, CODE, lambda: np.ones(2)).tolist() == [1, 1]


def test_without_a_cache_nothing_is_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert kept(None, "some things", 4, 2, CODE, lambda: np.ones(2)).tolist() == [1, 1]
    assert not list(tmp_path.iterdir())


def test_a_bank_that_failed_leaves_no_file(tmp_path):
    def broken():
        raise ValueError("no picture")

    with pytest.raises(ValueError, match="no picture"):
        kept(tmp_path, "some things", 4, 2, CODE, broken)
    assert not list(tmp_path.iterdir())


def test_another_bank_is_drawn_when_its_code_changes_and_the_old_one_goes(tmp_path, monkeypatch):
    marks = iter("aabb")
    monkeypatch.setattr("pipeline.dependencies.closure.fingerprint", lambda code: next(marks))
    (tmp_path / "some-things-4-2.npy").touch()  # without a fingerprint
    kept(tmp_path, "some things", 4, 2, CODE, lambda: np.zeros(2))
    other = tmp_path / "some-things-4-21-c.npy"  # another bank
    other.touch()
    assert kept(tmp_path, "some things", 4, 2, CODE, lambda: pytest.fail("drawn anew")).tolist() == [0, 0]
    assert kept(tmp_path, "some things", 4, 2, CODE, lambda: np.ones(2)).tolist() == [1, 1]
    next(marks)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["some-things-4-2-b.npy", "some-things-4-21-c.npy"]
