"""Store: nothing half-written, the same bytes for the same content, schemas that refuse by name."""

import errno
import json
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from pipeline import store
from pipeline.errors import InputError

ROOT = Path(__file__).resolve().parents[1]
SCHEMA = store.Schema("points", {"name": "string", "x": "float64"})
TABLE = pd.DataFrame({"x": [1.0, np.nan], "name": ["a", "b"]})


def test_a_failing_writer_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    store.write_text(path, "old")
    with pytest.raises(RuntimeError), store.replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_a_failing_folder_writer_leaves_the_old_folder(tmp_path):
    path = tmp_path / "folder"
    with store.replacing_folder(path) as temporary:
        (temporary / "one").write_text("1")
    with pytest.raises(RuntimeError), store.replacing_folder(path) as temporary:
        (temporary / "two").write_text("2")
        raise RuntimeError
    assert [p.name for p in path.iterdir()] == ["one"]
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]


def contents(folder):
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def replaced(path, **files):
    with store.replacing_folder(path) as folder:
        (folder / "inner").mkdir()
        for name, text in files.items():
            (folder / "inner" / name).write_text(text)


def test_a_folder_is_replaced_as_a_whole_and_nothing_else_stays(tmp_path):
    path = tmp_path / "folder"
    replaced(path, a="1", b="2")
    replaced(path, a="3")
    assert contents(tmp_path) == {"folder/inner/a": "3"} and [p.name for p in tmp_path.iterdir()] == ["folder"]


def test_a_folder_that_cannot_be_renamed_into_its_place_leaves_the_earlier_one(tmp_path, monkeypatch):
    path, rename = tmp_path / "folder", Path.rename
    replaced(path, a="1", b="2")

    def refused(self, target):
        if self.name.startswith(".writing-"):
            raise OSError(errno.EIO, "Input/output error", str(self))
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", refused)
    monkeypatch.setattr(Path, "replace", refused)
    with pytest.raises(OSError, match="Input/output error"):
        replaced(path, a="3")
    assert contents(tmp_path) == {"folder/inner/a": "1", "folder/inner/b": "2"}
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]
    monkeypatch.undo()
    replaced(path, a="3")
    assert contents(tmp_path) == {"folder/inner/a": "3"}


KILLED = """
import os, shutil, sys
from pathlib import Path
from pipeline import store
rename = Path.rename
def killed_rename(self, target):
    return os._exit(9) if self.name.startswith(".writing-") else rename(self, target)
def killed_rmtree(folder, **options):
    return os._exit(9) if folder.name.startswith(".replaced-") else None
if sys.argv[1] == "rename":
    Path.rename = killed_rename
else:
    shutil.rmtree = killed_rmtree
with store.replacing_folder(sys.argv[2]) as folder:
    (folder / "a").write_text("3")
"""


@pytest.mark.parametrize("step", ["rename", "rmtree"])
def test_a_killed_exchange_loses_nothing_and_is_tidied_up_later(tmp_path, step):
    """Killed before the new folder is in its place, or before the earlier one is deleted."""
    path, other = tmp_path / "folder", tmp_path / "folder-b"
    replaced(path, a="1")
    replaced(other, a="2")
    died = subprocess.run([sys.executable, "-c", KILLED, step, str(path)], check=False)
    assert died.returncode == 9
    assert sorted(contents(tmp_path).values()) == ["1", "2", "3"]  # the earlier one and the new one are whole
    replaced(other, a="4")
    assert sorted(contents(tmp_path).values()) == ["1", "3", "4"]
    replaced(path, a="5")
    assert contents(path) == {"inner/a": "5"} and contents(other) == {"inner/a": "4"}
    assert not list(tmp_path.glob(".replaced-*"))


def test_what_was_moved_aside_for_a_folder_of_a_longer_name_stays(tmp_path):
    kept = tmp_path / ".replaced-data-2-xyz"
    kept.mkdir()
    for number in "12":
        replaced(tmp_path / "data", a=number)
    assert kept.is_dir()


def test_a_file_is_not_replaced_by_a_folder(tmp_path):
    (tmp_path / "folder").write_text("a file")
    with pytest.raises(NotADirectoryError):
        replaced(tmp_path / "folder", a="1")
    assert contents(tmp_path) == {"folder": "a file"}


@pytest.mark.parametrize("suffix", [".json", ".parquet", ".npz", ".png"])
def test_same_content_same_bytes(tmp_path, suffix):
    def write(name):
        path = tmp_path / f"{name}{suffix}"
        match suffix:
            case ".json":
                store.write_json(path, {"b": 1, "a": [1.5, float("nan")]})
            case ".parquet":
                store.write_table(path, TABLE, SCHEMA)
            case ".npz":
                store.write_arrays(path, a=np.arange(5), b=np.ones((2, 2), np.float32))
            case ".png":
                store.write_image(path, np.linspace(0, 1, 64).reshape(8, 8))
        return path.read_bytes()

    assert write("first") == write("second")


def test_json_has_no_nan_and_sorted_keys(tmp_path):
    store.write_json(tmp_path / "a.json", {"b": np.float64("nan"), "a": np.array([1, 2])})
    text = (tmp_path / "a.json").read_text()
    assert json.loads(text) == {"a": [1, 2], "b": None}
    assert text.index('"a"') < text.index('"b"')


def test_table_round_trip_orders_columns_and_keeps_nan(tmp_path):
    store.write_table(tmp_path / "t.parquet", TABLE, SCHEMA)
    back = store.read_table(tmp_path / "t.parquet", SCHEMA)
    assert list(back.columns) == ["name", "x"]
    assert back["x"].isna().tolist() == [False, True]


@pytest.mark.parametrize(
    ("table", "word"),
    [
        (TABLE.drop(columns="x"), "missing \\['x'\\]"),
        (TABLE.assign(y=1), "unknown \\['y'\\]"),
        (TABLE.assign(x=["one", "two"]), "could not convert"),
    ],
)
def test_schema_refuses_by_name(tmp_path, table, word):
    with pytest.raises(InputError, match=word):
        store.write_table(tmp_path / "t.parquet", table, SCHEMA)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("read", [lambda p: store.read_table(p, SCHEMA), store.read_json, store.read_arrays])
def test_missing_and_broken_files_are_named(tmp_path, read):
    path = tmp_path / "x.bin"
    with pytest.raises(InputError, match="x.bin"):
        read(path)
    path.write_bytes(b"not what it should be")
    with pytest.raises(InputError, match="x.bin"):
        read(path)


def test_pickled_arrays_are_refused(tmp_path):
    np.savez(tmp_path / "a.npz", a=np.array([{"x": 1}], dtype=object))
    with pytest.raises(InputError, match="a.npz"):
        store.read_arrays(tmp_path / "a.npz")


def test_images_are_rounded_not_truncated(tmp_path):
    import cv2

    store.write_image(tmp_path / "a.png", np.full((4, 4), 99.6 / 255))
    assert (cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED) == 100).all()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,b\n1,x\n", "line 2: b is 'x', expected a number"),
        ("a\n1\n", "column 'b' is missing"),
        ('a,"c\nd\x1b[2J"\n1,2\n', r"column 'b' is missing; there are a, c\nd\x1b[2J;"),
        ("", "not a CSV table"),
        ('a,b\n"1,2\n', "not a CSV table"),
    ],
)
def test_edited_published_numbers_are_one_line(tmp_path, text, words):
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        store.read_published(path, {"a": str, "b": float})
    assert words in str(caught.value) and "git checkout data/paper" in str(caught.value)
    assert str(caught.value).isprintable()
    path.write_text("a,b,c\n1,2.5,z\n1,,z\n")
    table = store.read_published(path, {"a": str, "b": float})
    assert table["b"][0] == 2.5 and table["b"].isna()[1] and list(table.columns) == ["a", "b", "c"]


@pytest.mark.parametrize("content", [b"", b'a,b\n"1,2\n', b"a\n\xff\xfe\n"])
def test_a_csv_table_that_is_broken_or_absent_is_one_line(tmp_path, content):
    path = tmp_path / "t.csv"
    with pytest.raises(InputError, match=r"t\.csv: no such table; restore it from git"):
        store.read_csv(path, "restore it from git")
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"t\.csv: not a CSV table \(.*\); restore it from git"):
        store.read_csv(path, "restore it from git")
    path.write_text("frame,b\n001,2\n")
    assert store.read_csv(path, "", {"frame": "str"}).iloc[0].tolist() == ["001", 2]


def test_deep_json_is_one_line(tmp_path):
    path = tmp_path / "deep.json"
    path.write_text("[" * 200_000 + "]" * 200_000)
    with pytest.raises(InputError, match=r"deep\.json: not valid JSON"):
        store.read_json(path)


@pytest.mark.parametrize("writing", [store.replacing, store.replacing_folder])
@pytest.mark.parametrize(("named", "expected"), [(None, "result"), ("elsewhere", "elsewhere")])
def test_a_full_disk_names_what_was_being_written(tmp_path, writing, named, expected):
    with pytest.raises(OSError, match=f"No space left on device: '.*{expected}'"), writing(tmp_path / "result"):
        raise OSError(errno.ENOSPC, "No space left on device", *([named] if named else []))
    assert list(tmp_path.iterdir()) == []


def test_writing_an_image_names_the_reason_of_the_system(tmp_path, monkeypatch):
    def full(self, content):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space left on device"):
        store.write_image(tmp_path / "a.png", np.zeros((8, 8), np.uint8))
    with pytest.raises(InputError, match="suffix of a picture format"):
        store.write_image(tmp_path / "a.txt", np.zeros((8, 8), np.uint8))


def test_estimates_are_rounded_once_and_truths_are_not(tmp_path):
    columns = {"estimator": "string", "sigma_dn": "float64", "true_sigma_dn": "float64"}
    schema = store.Schema("estimates", columns)
    table = pd.DataFrame(
        {"estimator": ["a", "b"], "sigma_dn": [1.23456789, np.nan], "true_sigma_dn": [1.23456789, 2.0]}
    )
    again = table.assign(sigma_dn=table["sigma_dn"] + 1e-7)  # another processor's last digits
    for name, content in (("one", table), ("two", again)):
        store.write_table(tmp_path / f"{name}.parquet", content, schema)
    assert (tmp_path / "one.parquet").read_bytes() == (tmp_path / "two.parquet").read_bytes()
    written = store.read_table(tmp_path / "one.parquet", schema)
    assert written["sigma_dn"][0] == 1.2346 and np.isnan(written["sigma_dn"][1])
    assert written["true_sigma_dn"][0] == 1.23456789
    plain = store.Schema("settings", {name: kind for name, kind in columns.items() if name != "estimator"})
    assert plain.conform(table.drop(columns="estimator"))["sigma_dn"][0] == 1.23456789


def test_a_picture_is_written_in_the_colours_given_and_its_range_is_kept(tmp_path):
    """Red comes first, as in NumPy's pictures; OpenCV's have blue first. Beyond the range is its end."""
    red = np.zeros((4, 6, 3), np.uint8)
    red[..., 0] = 200
    store.write_image(tmp_path / "red.png", red)
    assert np.array_equal(np.asarray(Image.open(tmp_path / "red.png")), red)
    store.write_image(tmp_path / "bright.png", np.array([[-0.1, 0.5, 1.0, 1.2]]))
    assert np.asarray(Image.open(tmp_path / "bright.png")).tolist() == [[0, 128, 255, 255]]


@pytest.mark.parametrize(
    ("umask", "file", "folder"), [(0o022, 0o644, 0o755), (0o002, 0o664, 0o775), (0o077, 0o600, 0o700)]
)
def test_permissions_follow_the_umask(umask, file, folder, tmp_path):
    program = """
import sys
from pathlib import Path
from pipeline import store
with store.replacing_folder(Path(sys.argv[1]) / "folder") as out:
    store.write_text(out / "a.txt", "a")
"""
    subprocess.run([sys.executable, "-c", program, str(tmp_path)], umask=umask, cwd=ROOT, check=True)
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("folder/a.txt", "folder")]
    assert modes == [file, folder]
