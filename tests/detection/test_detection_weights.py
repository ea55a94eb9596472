"""Fetching weights from a server on this machine: whole, interrupted, wrong, moved, absent."""

from __future__ import annotations

import hashlib
import inspect
import json
import threading
from collections.abc import Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from pipeline import detection
from pipeline.cli import main
from pipeline.cli.weights import FOLDER
from pipeline.detection import weights
from pipeline.detection.settings import DetectorSettings
from pipeline.detection.weights_table import TABLE, Published
from pipeline.errors import InputError
from pipeline.store import file_sha256

ROOT = Path(__file__).resolve().parents[2]
BYTES = np.random.Generator(np.random.Philox(5)).bytes(600_000)
SHA256 = hashlib.sha256(BYTES).hexdigest()


class Server(ThreadingHTTPServer):
    """Serves one file, and can be told to break off, to ignore ranges, or to change its mind."""

    body = BYTES
    tag: str | None = '"one"'
    ranges = True
    break_after: int | None = None
    breaks_left = 0

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.asked: list[tuple[str, str | None]] = []

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/net.onnx"


class Handler(BaseHTTPRequestHandler):
    server: Server

    def log_message(self, *words: object) -> None:
        pass

    def do_GET(self) -> None:
        server, wanted = self.server, self.headers.get("Range")
        server.asked.append((self.path, wanted))
        if self.path == "/absent.onnx":
            self.send_error(404)
            return
        if self.path == "/moved.onnx":
            self.send_response(302)
            self.send_header("Location", "/net.onnx")
            self.end_headers()
            return
        start = 0
        if wanted and server.ranges and self.headers.get("If-Range") == server.tag:
            start = int(wanted.removeprefix("bytes=").removesuffix("-"))
            if start >= len(server.body):
                self.send_error(416)
                return
        self.send_response(206 if start else 200)
        if start:
            self.send_header("Content-Range", f"bytes {start}-{len(server.body) - 1}/{len(server.body)}")
        self.send_header("Content-Length", str(len(server.body) - start))
        if server.tag:
            self.send_header("ETag", server.tag)
        self.end_headers()
        rest = server.body[start:]
        if server.break_after is not None and server.breaks_left:
            server.breaks_left -= 1
            rest = rest[: server.break_after]
        self.wfile.write(rest)


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server()
    thread = threading.Thread(target=made.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield made
    made.shutdown()
    made.server_close()
    thread.join()


def entry(server: Server, **changes: object) -> Published:
    made = Published("net.onnx", "yolox", (server.url,), "MIT", size_bytes=len(BYTES), sha256=SHA256)
    return replace(made, **changes)  # type: ignore[arg-type]


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_downloads_verifies_and_leaves_nothing_else(server: Server, tmp_path: Path) -> None:
    seen: list[tuple[int, int | None]] = []
    result = weights.get(entry(server), tmp_path / "new", progress=lambda *state: seen.append(state))
    assert (result.trust, result.downloaded, result.sha256) == ("published", True, SHA256)
    assert result.path.read_bytes() == BYTES
    assert names(tmp_path / "new") == ["net.onnx"]
    assert seen[-1] == (len(BYTES), len(BYTES))
    again = weights.get(entry(server), tmp_path / "new")
    assert not again.downloaded and len(server.asked) == 1


def test_an_interrupted_download_goes_on_where_it_stopped(server: Server, tmp_path: Path) -> None:
    server.break_after, server.breaks_left = 200_000, 2
    assert weights.get(entry(server), tmp_path).path.read_bytes() == BYTES
    assert [wanted for _, wanted in server.asked] == [None, "bytes=200000-", "bytes=400000-"]
    assert names(tmp_path) == ["net.onnx"]


def test_after_three_interruptions_the_next_run_goes_on(server: Server, tmp_path: Path) -> None:
    server.break_after, server.breaks_left = 100_000, 3
    with pytest.raises(InputError, match="after 300000 of 600000 bytes.*goes on from there"):
        weights.get(entry(server), tmp_path)
    assert names(tmp_path) == [".net.onnx.part", ".net.onnx.part.json"]
    assert weights.get(entry(server), tmp_path).path.read_bytes() == BYTES
    assert server.asked[-1][1] == "bytes=300000-"


def test_pieces_of_different_files_are_never_joined(server: Server, tmp_path: Path) -> None:
    """The file changes between two attempts: the second one gets all of the new file, from its beginning."""
    server.break_after, server.breaks_left = 100_000, 3
    changed = bytes(reversed(BYTES))
    unpinned = entry(server, sha256=None, size_bytes=None)
    with pytest.raises(InputError, match="goes on"):
        weights.get(unpinned, tmp_path)
    server.body, server.tag = changed, '"two"'
    assert weights.get(unpinned, tmp_path).path.read_bytes() == changed


@pytest.mark.parametrize("change", [{"ranges": False}, {"tag": None}, {"tag": 'W/"weak"'}])
def test_servers_that_cannot_resume_start_again(server: Server, tmp_path: Path, change: dict[str, object]) -> None:
    server.break_after, server.breaks_left = 100_000, 1
    for name, value in change.items():
        setattr(server, name, value)
    assert weights.get(entry(server), tmp_path).path.read_bytes() == BYTES


def test_a_complete_download_that_was_not_checked_is_not_fetched_again(server: Server, tmp_path: Path) -> None:
    (tmp_path / ".net.onnx.part").write_bytes(BYTES)
    assert weights.get(entry(server), tmp_path).path.read_bytes() == BYTES
    assert server.asked == []


def test_more_than_the_server_has_starts_again(server: Server, tmp_path: Path) -> None:
    (tmp_path / ".net.onnx.part").write_bytes(BYTES + b"more")
    notes = {"url": server.url, "validator": server.tag}
    (tmp_path / ".net.onnx.part.json").write_text(json.dumps(notes), encoding="utf-8")
    assert weights.get(entry(server), tmp_path).path.read_bytes() == BYTES
    assert [wanted for _, wanted in server.asked] == ["bytes=600004-", None]


def test_a_wrong_hash_is_refused_and_thrown_away(server: Server, tmp_path: Path) -> None:
    server.body = BYTES[:-1] + b"x"
    with pytest.raises(InputError, match=f"SHA-256 is .*, expected {SHA256}; the download was thrown away"):
        weights.get(entry(server), tmp_path)
    assert names(tmp_path) == []


def test_a_wrong_file_that_is_there_is_not_overwritten(server: Server, tmp_path: Path) -> None:
    (tmp_path / "net.onnx").write_bytes(b"mine")
    with pytest.raises(InputError, match=r"net\.onnx: SHA-256 is .*move it away"):
        weights.get(entry(server), tmp_path)
    assert (tmp_path / "net.onnx").read_bytes() == b"mine" and server.asked == []


def test_without_a_hash_the_first_use_is_trusted_and_recorded(server: Server, tmp_path: Path) -> None:
    unpinned = entry(server, sha256=None, size_bytes=None)
    assert weights.get(unpinned, tmp_path).trust == "first use"
    lock = json.loads((tmp_path / weights.LOCK).read_text(encoding="utf-8"))
    assert lock == {"net.onnx": {"sha256": SHA256, "source": server.url, "trust": "first use"}}
    assert weights.get(unpinned, tmp_path).trust == "recorded"
    (tmp_path / "net.onnx").unlink()
    server.body = b"another" * 1000
    with pytest.raises(InputError, match=f"expected {SHA256}"):
        weights.get(unpinned, tmp_path)


def test_a_given_hash_must_hold_and_must_not_contradict(server: Server, tmp_path: Path) -> None:
    unpinned = entry(server, sha256=None)
    assert weights.get(unpinned, tmp_path, sha256=SHA256.upper()).trust == "given"
    with pytest.raises(InputError, match="given SHA-256 is 0.* but the recorded"):
        weights.get(unpinned, tmp_path, sha256="0" * 64)
    with pytest.raises(InputError, match="published SHA-256 is .* but the given"):
        weights.get(entry(server), tmp_path, sha256="0" * 64)
    with pytest.raises(InputError, match="64 hexadecimal digits"):
        weights.get(unpinned, tmp_path, sha256="abc")


@pytest.mark.parametrize("start", [b"version https://git-lfs.github.com/spec/v1\noid", b"\n<!DOCTYPE html><html>"])
def test_pointers_and_web_pages_are_no_weights(server: Server, tmp_path: Path, start: bytes) -> None:
    server.body = start
    with pytest.raises(InputError, match="web page or a Git LFS pointer"):
        weights.get(entry(server, sha256=None, size_bytes=None), tmp_path)
    assert names(tmp_path) == []


def test_another_source_is_tried_and_redirects_are_followed(server: Server, tmp_path: Path) -> None:
    absent, moved = (server.url.replace("net.onnx", f"{word}.onnx") for word in ("absent", "moved"))
    assert weights.get(entry(server, urls=(absent, moved)), tmp_path).path.read_bytes() == BYTES


def test_offline_says_what_to_do_by_hand(server: Server, tmp_path: Path) -> None:
    absent = entry(server, urls=(server.url.replace("net", "absent"), "http://127.0.0.1:9/net.onnx"))
    with pytest.raises(InputError) as raised:
        weights.get(absent, tmp_path)
    text = str(raised.value)
    assert "404" in text and "refused" in text and "\n" not in text
    for word in (absent.urls[0], SHA256, str(tmp_path / "net.onnx"), "same command"):
        assert word in text
    (tmp_path / "net.onnx").write_bytes(BYTES)
    assert weights.get(absent, tmp_path).trust == "published"
    with pytest.raises(InputError, match="begins with https"):
        weights.get(entry(server, file="other.onnx", urls=("file:///etc/hostname",)), tmp_path)


def test_the_table_is_pinned_and_names_real_detectors() -> None:
    for name, row in TABLE.items():
        assert row.detector in detection.REGISTRY.names(), name
        assert all(urlsplit(url).scheme == "https" for url in row.urls) and row.urls
        assert "/main/" not in " ".join(row.urls) and "/master/" not in " ".join(row.urls), "not a fixed revision"
        assert row.sha256 is None or (len(row.sha256) == 64 and int(row.sha256, 16))
    assert len({row.file for row in TABLE.values()}) == len(TABLE)


@pytest.mark.parametrize("path", sorted((ROOT / "conf" / "detector").glob("*.yaml")), ids=lambda path: path.stem)
def test_configured_detectors_take_their_options(path: Path) -> None:
    """Options are the class's own; the file is one that ``weights get`` brings (or its export), or a released one."""
    # The root of the default profile is empty.
    content = yaml.safe_load(path.read_text(encoding="utf-8").replace("${root}", ""))
    section = DetectorSettings(**{**content, "dvc_dependency": content["weights"]})
    assert section.kind == path.stem
    taken = inspect.signature(detection.REGISTRY.get(section.kind)).parameters
    assert {"weights", *section.options} <= set(taken)
    file = Path(section.weights)
    if section.fetch_command.startswith("dvc repro train_detector_"):
        assert (ROOT / file).is_file()
        detection.create(section.kind, weights=ROOT / file, **section.options)
    else:
        assert file.parent == FOLDER
        row = next(row for row in TABLE.values() if row.detector == section.kind)
        assert file.stem == Path(row.file).stem and file.suffix == ".onnx"
        assert "camera-monitor weights get" in section.fetch_command
    with pytest.raises(InputError, match="no such (model|weight) file"):
        detection.create(section.kind, **{**section.options, "weights": "absent"})


@pytest.mark.shared
def test_the_reference_file_is_the_one_in_the_table(shared: Path) -> None:
    path = shared / "weights" / "yolox_nano.onnx"
    if not path.is_file():
        pytest.skip("reference data absent: ../shared/weights/yolox_nano.onnx")
    row = TABLE["yolox_nano_reexport"]
    assert (file_sha256(path), path.stat().st_size) == (row.sha256, row.size_bytes)


def test_commands(server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    unpinned = entry(server, sha256=None, size_bytes=None, note="then export it")
    monkeypatch.setattr(weights, "TABLE", {"net": unpinned})
    monkeypatch.setattr(weights.named, "__defaults__", ({"net": unpinned},))
    run = CliRunner().invoke
    got = run(main, ["weights", "get", "net", "--to", str(tmp_path)])
    assert got.exit_code == 0, got.output
    assert SHA256 in got.output and "trusted at first use" in got.output and "then export it" in got.output
    assert "recorded hash" in run(main, ["weights", "get", "net", "--to", str(tmp_path)]).output
    listed = run(main, ["weights", "list", "--to", str(tmp_path)]).output
    assert "unpublished" in listed and "yes" in listed
    wrong = run(main, ["weights", "get", "nett"])
    assert wrong.exit_code == 2 and "did you mean 'net'?" in wrong.stderr and "Traceback" not in wrong.output
