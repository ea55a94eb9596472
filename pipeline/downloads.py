"""Fetch published files (weights of detectors, pictures): pinned, verified, resumable, and never half there.

A file is downloaded beside its place (``.NAME.part``) and renamed into it once its SHA-256 is right. An interrupted
download goes on where it stopped (HTTP Range, with If-Range so that pieces of different files are never joined). Where
no hash is published and none is given, the first download is trusted and its hash recorded in ``downloads.lock.json``
beside it; later ones must equal it.
"""

from __future__ import annotations

import http.client
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import Literal, TypeVar
from urllib.parse import urlsplit

from pipeline.errors import InputError, did_you_mean
from pipeline.store import file_sha256, read_json, write_json

LOCK = "downloads.lock.json"
ATTEMPTS = 3
TIMEOUT_S = 30.0
_BLOCK = 1 << 18
_NO_FILE = (b"version https://git-lfs", b"<!doctype html", b"<html")

Trust = Literal["published", "given", "recorded", "first use"]
Progress = Callable[[int, int | None], None]


@dataclass(frozen=True, kw_only=True)
class PublishedFile:
    """A published file.

    Attributes:
        file: name to keep it under, in a folder given; it may have folders of its own before it.
        urls: where it lies, the most direct first; each names a fixed release or revision.
        size_bytes: length, or None where it is not published.
        sha256: hash, or None where none is published.
    """

    file: str
    urls: tuple[str, ...]
    size_bytes: int | None = None
    sha256: str | None = None


Entry = TypeVar("Entry")


@dataclass(frozen=True)
class Fetched:
    """A file that is there and verified.

    Attributes:
        path: the file.
        sha256: its hash.
        trust: what the hash was compared with; ``"first use"``: with nothing, it was recorded now.
        downloaded: False if the file was there before.
    """

    path: Path
    sha256: str
    trust: Trust
    downloaded: bool


class _Interrupted(Exception):
    """The connection ended before the file did."""


def named(name: str, table: Mapping[str, Entry], kind: str) -> Entry:
    """The entry of a name in a table of what is published.

    Args:
        name: what was asked for.
        table: by name.
        kind: what the table has, for the message.

    Raises:
        InputError: the table has no such name.
    """
    if name not in table:
        raise InputError(f"no {kind} called '{name}'; {did_you_mean(name, table)}")
    return table[name]


def get(
    entry: PublishedFile, folder: str | Path, sha256: str | None = None, progress: Progress | None = None
) -> Fetched:
    """Make sure that a file is there and right.

    Args:
        entry: what to get.
        folder: where to; made if need be.
        sha256: expected hash, for files without a published one.
        progress: called with the bytes there are and their final number (None if unknown).

    Raises:
        InputError: the given hash contradicts the published or recorded one, the file (there before or downloaded) has
            another hash, the download was interrupted, or no source can be reached; with what to do by hand.
    """
    folder = Path(folder)
    target = folder / entry.file
    expected, trust = _expected(entry, folder, sha256)
    if target.is_file():
        result = file_sha256(target)
        problem = _problem(entry, target, result, expected)
        if problem:
            raise InputError(f"{target}: {problem}; move it away and run again")
        _record(folder, entry, result, trust, "placed by hand")
        return Fetched(target, result, trust, downloaded=False)
    part = target.with_name(f".{target.name}.part")
    source = _download_any(entry, part, target, progress)
    result = file_sha256(part)
    problem = _problem(entry, part, result, expected)
    if problem:
        _forget(part)
        raise InputError(f"{source}: {problem}; the download was thrown away")
    part.replace(target)
    _forget(part)
    _record(folder, entry, result, trust, source)
    return Fetched(target, result, trust, downloaded=True)


def _by_hand(entry: PublishedFile, target: Path) -> str:
    """What to do on a machine without a network, in one line."""
    check = f"check that its SHA-256 is {entry.sha256}, " if entry.sha256 else ""
    return (
        f"without a network: get {entry.urls[0]} elsewhere, {check}put it at {target}"
        " and run the same command, which verifies it"
    )


def _expected(entry: PublishedFile, folder: Path, given: str | None) -> tuple[str | None, Trust]:
    """The hash a file must have, and its source."""
    recorded = _lock(folder).get(entry.file, {}).get("sha256")
    known: list[tuple[Trust, str]] = []
    if entry.sha256 is not None:
        known.append(("published", entry.sha256))
    if given is not None:
        given = given.strip().lower()
        if len(given) != 64 or set(given) - set("0123456789abcdef"):
            raise InputError(f"sha256: expected 64 hexadecimal digits, not {given!r}")
        known.append(("given", given))
    if recorded is not None and entry.sha256 is None:
        known.append(("recorded", recorded))
    if not known:
        return None, "first use"
    if len({value for _, value in known}) > 1:
        words = " but ".join(f"the {who} SHA-256 is {value}" for who, value in known)
        raise InputError(f"{entry.file}: {words}; leave one out (the record is {folder / LOCK})")
    return known[0][1], known[0][0]


def _problem(entry: PublishedFile, path: Path, digest: str, expected: str | None) -> str | None:
    """Why a complete file is not the published one, or None."""
    with path.open("rb") as file:
        start = file.read(32).lstrip().lower()
    if start.startswith(_NO_FILE):
        return "a web page or a Git LFS pointer instead of the file"
    if expected is not None and digest != expected:
        return f"SHA-256 is {digest}, expected {expected}"
    size = path.stat().st_size
    if entry.size_bytes is not None and size != entry.size_bytes:
        return f"{size} bytes, expected {entry.size_bytes}"
    return None


def _download_any(entry: PublishedFile, part: Path, target: Path, progress: Progress | None) -> str:
    """Download from the first source that answers; returns its address."""
    part.parent.mkdir(parents=True, exist_ok=True)
    if part.is_file() and part.stat().st_size == entry.size_bytes:
        return str(part)  # all there; only the check was cut off
    reasons = []
    for url in entry.urls:
        if urlsplit(url).scheme not in ("https", "http"):
            raise InputError(f"{url}: expected an address that begins with https://")
        for attempt in range(ATTEMPTS):
            try:
                _download(url, part, progress)
                return url
            except _Interrupted as error:
                if attempt == ATTEMPTS - 1:
                    raise InputError(
                        f"{url}: {error}, {ATTEMPTS} times; run the same command again, it goes on from there"
                    ) from error
            except (urllib.error.URLError, OSError, http.client.HTTPException) as error:
                reason = error if isinstance(error, urllib.error.HTTPError) else getattr(error, "reason", error)
                reasons.append(f"{urlsplit(url).netloc}: {reason}")
                break
    raise InputError(f"{target.name}: no source can be reached ({'; '.join(reasons)}); {_by_hand(entry, target)}")


def _download(url: str, part: Path, progress: Progress | None) -> None:
    """Download to the end, going on from what is there.

    Raises:
        _Interrupted: the connection ended early; what came is kept.
        OSError: the server cannot be reached, or refuses.
    """
    notes = _notes(part)
    mine = read_json(notes) if notes.is_file() and part.is_file() else {}
    # Without a validator the pieces could be of different files: begin anew.
    there = part.stat().st_size if mine.get("url") == url and mine.get("validator") else 0
    request = urllib.request.Request(url, headers={"User-Agent": "camera-monitor", "Accept-Encoding": "identity"})
    if there:
        request.add_header("Range", f"bytes={there}-")
        request.add_header("If-Range", mine["validator"])
    try:
        response = urllib.request.urlopen(request, timeout=TIMEOUT_S)
    except urllib.error.HTTPError as error:
        if error.code != HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE or not there:
            raise
        _forget(part)  # nothing follows what is there: it is complete or wrong, which only a new start can tell
        raise _Interrupted(f"the server has nothing after byte {there}") from error
    with response:
        resumed = response.status == HTTPStatus.PARTIAL_CONTENT and (
            response.headers.get("Content-Range", "").startswith(f"bytes {there}-")
        )
        if response.status == HTTPStatus.PARTIAL_CONTENT and not resumed:
            raise _Interrupted("the server sent another part than was asked for")
        there = there if resumed else 0
        length = response.headers.get("Content-Length")
        total = there + int(length) if length is not None else None
        write_json(notes, {"url": url, "validator": _validator(response.headers)})
        with part.open("ab" if resumed else "wb") as file:
            try:
                while block := response.read(_BLOCK):
                    file.write(block)
                    there += len(block)
                    if progress is not None:
                        progress(there, total)
            except (OSError, http.client.HTTPException) as error:
                raise _Interrupted(f"interrupted after {there} of {total or 'unknown'} bytes") from error
    if total is not None and there < total:
        raise _Interrupted(f"interrupted after {there} of {total} bytes")


def _validator(headers: http.client.HTTPMessage) -> str | None:
    """A strong ETag, or the date of the last change: what If-Range accepts."""
    tag: str | None = headers.get("ETag")
    return tag if tag and not tag.startswith("W/") else headers.get("Last-Modified")


def _notes(part: Path) -> Path:
    return part.with_name(f"{part.name}.json")


def _forget(part: Path) -> None:
    part.unlink(missing_ok=True)
    _notes(part).unlink(missing_ok=True)


def _lock(folder: Path) -> dict[str, dict[str, str]]:
    path = folder / LOCK
    return dict(read_json(path)) if path.is_file() else {}


def _record(folder: Path, entry: PublishedFile, sha256: str, trust: Trust, source: str) -> None:
    """Write the hash of a file without a published one into the lock file, once."""
    lock = _lock(folder)
    if entry.sha256 is None and entry.file not in lock:
        lock[entry.file] = {"sha256": sha256, "source": source, "trust": trust}
        write_json(folder / LOCK, lock)
