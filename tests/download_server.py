"""A server on this machine that files are downloaded from."""

from __future__ import annotations

import contextlib
import hashlib
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import unquote

import numpy as np

BYTES = np.random.Generator(np.random.Philox(5)).bytes(600_000)
SHA256 = hashlib.sha256(BYTES).hexdigest()


class Server(ThreadingHTTPServer):
    """Serves files from memory, and can be told to break off, to ignore ranges, or to change its mind."""

    tag: str | None = '"one"'
    ranges = True
    break_after: int | None = None
    breaks_left = 0

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.files = {"/net.onnx": BYTES}
        self.asked: list[tuple[str, str | None]] = []

    @property
    def url(self) -> str:
        return f"{self.base}/net.onnx"

    @property
    def base(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"


class Handler(BaseHTTPRequestHandler):
    server: Server

    def log_message(self, *words: object) -> None:
        pass

    def do_GET(self) -> None:
        server, wanted = self.server, self.headers.get("Range")
        server.asked.append((self.path, wanted))
        if self.path == "/moved.onnx":
            self.send_response(302)
            self.send_header("Location", "/net.onnx")
            self.end_headers()
            return
        body = server.files.get(unquote(self.path))
        if body is None:
            self.send_error(404)
            return
        start = 0
        if wanted and server.ranges and self.headers.get("If-Range") == server.tag:
            start = int(wanted.removeprefix("bytes=").removesuffix("-"))
            if start >= len(body):
                self.send_error(416)
                return
        self.send_response(206 if start else 200)
        if start:
            self.send_header("Content-Range", f"bytes {start}-{len(body) - 1}/{len(body)}")
        self.send_header("Content-Length", str(len(body) - start))
        if server.tag:
            self.send_header("ETag", server.tag)
        self.end_headers()
        rest = body[start:]
        if server.break_after is not None and server.breaks_left:
            server.breaks_left -= 1
            rest = rest[: server.break_after]
        self.wfile.write(rest)


@contextlib.contextmanager
def serving() -> Iterator[Server]:
    made = Server()
    thread = threading.Thread(target=made.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield made
    finally:
        made.shutdown()
        made.server_close()
        thread.join()
