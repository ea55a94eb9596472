"""Downloading from a server on this machine: whole, interrupted, wrong, moved, absent."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from download_server import BYTES, SHA256, Server, serving

from pipeline import downloads
from pipeline.downloads import PublishedFile
from pipeline.errors import InputError


@pytest.fixture
def server() -> Iterator[Server]:
    with serving() as made:
        yield made


def entry(server: Server, **changes: object) -> PublishedFile:
    made = PublishedFile(file="net.onnx", urls=(server.url,), size_bytes=len(BYTES), sha256=SHA256)
    return replace(made, **changes)  # type: ignore[arg-type]


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_downloads_verifies_and_leaves_nothing_else(server: Server, tmp_path: Path) -> None:
    seen: list[tuple[int, int | None]] = []
    result = downloads.get(entry(server), tmp_path / "new", progress=lambda *state: seen.append(state))
    assert (result.trust, result.downloaded, result.sha256) == ("published", True, SHA256)
    assert result.path.read_bytes() == BYTES
    assert names(tmp_path / "new") == ["net.onnx"]
    assert seen[-1] == (len(BYTES), len(BYTES))
    again = downloads.get(entry(server), tmp_path / "new")
    assert not again.downloaded and len(server.asked) == 1


def test_an_interrupted_download_goes_on_where_it_stopped(server: Server, tmp_path: Path) -> None:
    server.break_after, server.breaks_left = 200_000, 2
    assert downloads.get(entry(server), tmp_path).path.read_bytes() == BYTES
    assert [wanted for _, wanted in server.asked] == [None, "bytes=200000-", "bytes=400000-"]
    assert names(tmp_path) == ["net.onnx"]


def test_after_three_interruptions_the_next_run_goes_on(server: Server, tmp_path: Path) -> None:
    server.break_after, server.breaks_left = 100_000, 3
    with pytest.raises(InputError, match="after 300000 of 600000 bytes.*goes on from there"):
        downloads.get(entry(server), tmp_path)
    assert names(tmp_path) == [".net.onnx.part", ".net.onnx.part.json"]
    assert downloads.get(entry(server), tmp_path).path.read_bytes() == BYTES
    assert server.asked[-1][1] == "bytes=300000-"


def test_pieces_of_different_files_are_never_joined(server: Server, tmp_path: Path) -> None:
    """The file changes between two attempts: the second one gets all of the new file, from its beginning."""
    server.break_after, server.breaks_left = 100_000, 3
    changed = bytes(reversed(BYTES))
    unpinned = entry(server, sha256=None, size_bytes=None)
    with pytest.raises(InputError, match="goes on"):
        downloads.get(unpinned, tmp_path)
    server.files["/net.onnx"], server.tag = changed, '"two"'
    assert downloads.get(unpinned, tmp_path).path.read_bytes() == changed


@pytest.mark.parametrize("change", [{"ranges": False}, {"tag": None}, {"tag": 'W/"weak"'}])
def test_servers_that_cannot_resume_start_again(server: Server, tmp_path: Path, change: dict[str, object]) -> None:
    server.break_after, server.breaks_left = 100_000, 1
    for name, value in change.items():
        setattr(server, name, value)
    assert downloads.get(entry(server), tmp_path).path.read_bytes() == BYTES


def test_a_complete_download_that_was_not_checked_is_not_fetched_again(server: Server, tmp_path: Path) -> None:
    (tmp_path / ".net.onnx.part").write_bytes(BYTES)
    assert downloads.get(entry(server), tmp_path).path.read_bytes() == BYTES
    assert server.asked == []


def test_more_than_the_server_has_starts_again(server: Server, tmp_path: Path) -> None:
    (tmp_path / ".net.onnx.part").write_bytes(BYTES + b"more")
    notes = {"url": server.url, "validator": server.tag}
    (tmp_path / ".net.onnx.part.json").write_text(json.dumps(notes), encoding="utf-8")
    assert downloads.get(entry(server), tmp_path).path.read_bytes() == BYTES
    assert [wanted for _, wanted in server.asked] == ["bytes=600004-", None]


def test_a_wrong_hash_is_refused_and_thrown_away(server: Server, tmp_path: Path) -> None:
    server.files["/net.onnx"] = BYTES[:-1] + b"x"
    with pytest.raises(InputError, match=f"SHA-256 is .*, expected {SHA256}; the download was thrown away"):
        downloads.get(entry(server), tmp_path)
    assert names(tmp_path) == []


def test_a_wrong_file_that_is_there_is_not_overwritten(server: Server, tmp_path: Path) -> None:
    (tmp_path / "net.onnx").write_bytes(b"mine")
    with pytest.raises(InputError, match=r"net\.onnx: SHA-256 is .*move it away"):
        downloads.get(entry(server), tmp_path)
    assert (tmp_path / "net.onnx").read_bytes() == b"mine" and server.asked == []


def test_without_a_hash_the_first_use_is_trusted_and_recorded(server: Server, tmp_path: Path) -> None:
    unpinned = entry(server, sha256=None, size_bytes=None)
    assert downloads.get(unpinned, tmp_path).trust == "first use"
    lock = json.loads((tmp_path / downloads.LOCK).read_text(encoding="utf-8"))
    assert lock == {"net.onnx": {"sha256": SHA256, "source": server.url, "trust": "first use"}}
    assert downloads.get(unpinned, tmp_path).trust == "recorded"
    (tmp_path / "net.onnx").unlink()
    server.files["/net.onnx"] = b"another" * 1000
    with pytest.raises(InputError, match=f"expected {SHA256}"):
        downloads.get(unpinned, tmp_path)


def test_a_given_hash_must_hold_and_must_not_contradict(server: Server, tmp_path: Path) -> None:
    unpinned = entry(server, sha256=None)
    assert downloads.get(unpinned, tmp_path, sha256=SHA256.upper()).trust == "given"
    with pytest.raises(InputError, match="given SHA-256 is 0.* but the recorded"):
        downloads.get(unpinned, tmp_path, sha256="0" * 64)
    with pytest.raises(InputError, match="published SHA-256 is .* but the given"):
        downloads.get(entry(server), tmp_path, sha256="0" * 64)
    with pytest.raises(InputError, match="64 hexadecimal digits"):
        downloads.get(unpinned, tmp_path, sha256="abc")


@pytest.mark.parametrize("start", [b"version https://git-lfs.github.com/spec/v1\noid", b"\n<!DOCTYPE html><html>"])
def test_pointers_and_web_pages_are_no_weights(server: Server, tmp_path: Path, start: bytes) -> None:
    server.files["/net.onnx"] = start
    with pytest.raises(InputError, match="web page or a Git LFS pointer"):
        downloads.get(entry(server, sha256=None, size_bytes=None), tmp_path)
    assert names(tmp_path) == []


def test_another_source_is_tried_and_redirects_are_followed(server: Server, tmp_path: Path) -> None:
    absent, moved = (server.url.replace("net.onnx", f"{word}.onnx") for word in ("absent", "moved"))
    assert downloads.get(entry(server, urls=(absent, moved)), tmp_path).path.read_bytes() == BYTES


def test_offline_says_what_to_do_by_hand(server: Server, tmp_path: Path) -> None:
    absent = entry(server, urls=(server.url.replace("net", "absent"), "http://127.0.0.1:9/net.onnx"))
    with pytest.raises(InputError) as raised:
        downloads.get(absent, tmp_path)
    text = str(raised.value)
    assert "404" in text and "refused" in text and "\n" not in text
    for word in (absent.urls[0], SHA256, str(tmp_path / "net.onnx"), "same command"):
        assert word in text
    (tmp_path / "net.onnx").write_bytes(BYTES)
    assert downloads.get(absent, tmp_path).trust == "published"
    with pytest.raises(InputError, match="begins with https"):
        downloads.get(entry(server, file="other.onnx", urls=("file:///etc/hostname",)), tmp_path)
