"""Published data from a server on this machine: single files, archives, what was there, what is damaged."""

from __future__ import annotations

import hashlib
import io
import tarfile
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest
from data_makers import picture
from download_server import Server, serving

from pipeline import datasets
from pipeline.camera.psf import paper_kernels
from pipeline.config.compose import compose
from pipeline.datasets import published
from pipeline.datasets.published import TABLE, Archive, PublishedData
from pipeline.downloads import LOCK, PublishedFile
from pipeline.errors import InputError
from pipeline.store import file_sha256

LABELS = "Car 0.00 0 1.55 10.00 20.00 60.00 50.00 1.5 1.6 3.9 1.0 1.5 10.0 1.6\n"


@pytest.fixture
def server() -> Iterator[Server]:
    with serving() as made:
        yield made


def zipped(members: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


def tarred(members: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w:gz") as archive:
        for name, content in members.items():
            header = tarfile.TarInfo(name)
            header.size = len(content)
            archive.addfile(header, io.BytesIO(content))
    return stream.getvalue()


def png(number: int) -> bytes:
    return cv2.imencode(".png", picture(f"kitti {number}", 96, 64))[1].tobytes()


def in_archives(server: Server, archives: dict[str, tuple[bytes, str]], *, pinned: bool = True) -> PublishedData:
    made = []
    for name, (content, folder) in archives.items():
        server.files[f"/{name}"] = content
        file = PublishedFile(file=name, urls=(f"{server.base}/{name}",))
        if pinned:
            file = replace(file, size_bytes=len(content), sha256=hashlib.sha256(content).hexdigest())
        made.append(Archive(file, folder))
    return PublishedData(holds="frames", licence="MIT", next_step="go FOLDER", archives=tuple(made))


@pytest.fixture
def kitti(server: Server, monkeypatch: pytest.MonkeyPatch) -> Server:
    """KITTI's two archives with two frames, and folders that are not wanted."""
    frames = {f"training/image_2/{i:06d}.png": png(i) for i in range(2)}
    labels = {f"training/label_2/{i:06d}.txt": LABELS.encode() for i in range(2)}
    data = in_archives(
        server,
        {
            "labels.zip": (zipped(labels), "training/label_2"),
            "images.zip": (zipped(frames | {"testing/image_2/000000.png": b"x"}), "training/image_2"),
        },
    )
    monkeypatch.setitem(TABLE, "kitti", data)
    return server


def names(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def test_archives_become_a_dataset_that_its_reader_opens(kitti: Server, tmp_path: Path) -> None:
    folder, seen = tmp_path / "raw" / "kitti", []
    brought = published.get("kitti", folder, progress=lambda *state: seen.append(state))
    assert (brought.files, brought.downloaded, brought.kept, brought.first_use) == (4, 2, (), ())
    frames = datasets.open_dataset("kitti", "kitti", folder).frames()
    assert [len(frame.boxes) for frame in frames] == [1, 1]
    assert names(folder) == [f"training/{part}/{i:06d}.{end}" for part, end in (("image_2", "png"), ("label_2", "txt"))
                             for i in range(2)]  # fmt: skip
    assert {label for label, *_ in seen} == {
        "labels.zip", "images.zip", "unpacking training/label_2", "unpacking training/image_2",
    }  # fmt: skip
    assert published.is_there("kitti", folder)


def test_what_is_there_is_left_and_only_the_rest_is_fetched(kitti: Server, tmp_path: Path) -> None:
    mine = tmp_path / "kitti" / "training" / "label_2" / "000000.txt"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine", encoding="utf-8")
    brought = published.get("kitti", tmp_path / "kitti", keep_archives=True)
    assert brought.kept == (mine.parent,) and mine.read_text(encoding="utf-8") == "mine"
    assert [path for path, _ in kitti.asked] == ["/images.zip"]
    assert "images.zip" in names(tmp_path / "kitti")
    again = published.get("kitti", tmp_path / "kitti")
    assert (again.files, again.downloaded, len(again.kept)) == (0, 0, 2) and len(kitti.asked) == 1


def test_an_archive_put_there_by_hand_is_verified_and_unpacked(kitti: Server, tmp_path: Path) -> None:
    folder = tmp_path / "kitti"
    folder.mkdir()
    for name in ("labels.zip", "images.zip"):
        (folder / name).write_bytes(kitti.files.pop(f"/{name}"))
    assert published.get("kitti", folder).files == 4
    assert kitti.asked == []


def test_tar_files_are_trusted_at_first_use_and_stay_in_their_folder(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    members = {"./object-dataset/1.jpg": b"a", "object-dataset/../../outside.jpg": b"b", "other/2.jpg": b"c"}
    data = in_archives(server, {"object-dataset.tar.gz": (tarred(members), "object-dataset")}, pinned=False)
    monkeypatch.setitem(TABLE, "udacity", data)
    folder = tmp_path / "raw" / "udacity"
    assert published.size_bytes("udacity") is None
    assert published.get("udacity", folder).first_use == ("object-dataset.tar.gz",)
    assert names(tmp_path) == [f"raw/udacity/{LOCK}", "raw/udacity/object-dataset/1.jpg"]
    (folder / "object-dataset" / "1.jpg").unlink()
    (folder / "object-dataset").rmdir()
    server.files["/object-dataset.tar.gz"] = tarred({"object-dataset/1.jpg": b"another"})
    with pytest.raises(InputError, match="SHA-256 is .*, expected"):
        published.get("udacity", folder)


def test_damaged_and_foreign_archives_leave_no_folder(tmp_path: Path) -> None:
    whole = zipped({"a/1.txt": bytes(5000), "a/2.txt": bytes(range(256)) * 20})
    damaged = bytearray(whole)
    damaged[-3000] ^= 255  # in the content of the second file
    path, cut = tmp_path / "damaged.zip", tmp_path / "cut.tar.gz"
    path.write_bytes(bytes(damaged))
    cut.write_bytes(tarred({"a/1.txt": np.random.Generator(np.random.Philox(3)).bytes(50_000)})[:20_000])
    for archive in (path, cut):
        with pytest.raises(InputError, match=rf"{archive.name}: cannot be unpacked .*delete it"):
            published.unpack(archive, "a", tmp_path / "to")
    path.write_bytes(whole)
    with pytest.raises(InputError, match="no folder b in this archive"):
        published.unpack(path, "b", tmp_path / "to")
    assert names(tmp_path) == ["cut.tar.gz", "damaged.zip"] and not (tmp_path / "to").exists()
    assert published.unpack(path, "a", tmp_path / "to") == 2


def test_too_little_room_is_said_before_anything_is_fetched(
    kitti: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = [archive.file.size_bytes for archive in TABLE["kitti"].archives]
    needed = 2 * sum(size for size in sizes if size is not None)
    monkeypatch.setattr(published.shutil, "disk_usage", lambda path: SimpleNamespace(free=needed - 1))
    with pytest.raises(InputError, match="GB are needed, with room to unpack"):
        published.get("kitti", tmp_path / "kitti")
    assert kitti.asked == [] and not (tmp_path / "kitti").exists()
    monkeypatch.setattr(published.shutil, "disk_usage", lambda path: SimpleNamespace(free=needed))
    assert published.get("kitti", tmp_path / "kitti").files == 4


def test_the_table_is_pinned_and_its_next_steps_compose() -> None:
    for name, data in TABLE.items():
        files = [*published.single_files(name), *(archive.file for archive in data.archives)]
        assert files and bool(data.bases) != bool(data.archives)
        assert len({file.file for file in files}) == len(files)
        for file in files:
            assert all(urlsplit(url).scheme == "https" for url in file.urls) and file.urls
            assert "/main/" not in " ".join(file.urls) and "/master/" not in " ".join(file.urls), "not a fixed revision"
            assert (file.sha256 is None) == (name == "udacity")
            assert file.sha256 is None or (len(file.sha256) == 64 and int(file.sha256, 16))
        words = data.next_step.split()
        overrides = [after for before, after in pairwise(words) if before == "-S"]
        assert words[:3] == ["dvc", "exp", "run"] and any("FOLDER" in override for override in overrides)
        compose([override.replace("FOLDER", f"data/raw/{name}") for override in overrides])


REFERENCE = {
    "paper_kernels": "vectors/kernels",
    "cc": "realdata/cc_noise",
    "polyu": "realdata/polyu",
    "flea3": "realdata/flea3_raw",
}


@pytest.mark.shared
@pytest.mark.parametrize("name", REFERENCE)
def test_single_files_are_those_of_the_records(
    server: Server, shared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Each comes from the second address where the first lacks it, and all are what was measured here."""
    source = shared / REFERENCE[name]
    if not source.is_dir():
        pytest.skip(f"reference data absent: ../shared/{REFERENCE[name]}")
    monkeypatch.setitem(TABLE, name, replace(TABLE[name], bases=(f"{server.base}/moved away", f"{server.base}/at")))
    files = published.single_files(name)
    server.files |= {f"/at/{file.file}": (source / file.file).read_bytes() for file in files}
    brought = published.get(name, tmp_path / name)
    assert brought.downloaded == brought.files == len(files)
    assert names(tmp_path / name) == sorted(file.file for file in files)
    assert all(file_sha256(tmp_path / name / file.file) == file.sha256 for file in files)
    if name == "paper_kernels":
        assert len(paper_kernels.load(tmp_path / name)) == len(files)
    changed = tmp_path / name / files[0].file
    changed.write_bytes(b"another")
    with pytest.raises(InputError, match="move it away and run again"):
        published.get(name, tmp_path / name)
