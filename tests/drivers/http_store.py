"""A web server on this computer that gives files piece by piece, as archives are given out."""

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any


class Store:
    """What is given out, and how."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.ends_at: int | None = None
        """At this byte of a file the line is cut, in the middle of an answer."""
        self.pieces = True
        """Gives parts of files; else only whole ones."""
        self.length: str | None = None
        """Told in place of a file's own; empty: none is told."""
        self.endless = False
        """Every folder has another."""
        self.given_bytes = 0


@contextmanager
def served(folder: Path) -> Iterator[tuple[Store, str]]:
    """Serve a folder on a free port; the store and its address."""
    store = Store(folder)

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, *_: Any) -> None:
            pass

        def do_HEAD(self) -> None:
            self._answer(body=False)

        def do_GET(self) -> None:
            self._answer(body=True)

        def _answer(self, *, body: bool) -> None:
            path = store.folder / self.path.strip("/")
            if store.endless and not path.is_file():
                self._send(200, b'<a href="a/">x</a><a href="b/">x</a>', "text/html", body=body)
            elif path.is_dir():
                links = "".join(f'<a href="{one.name}">x</a>\n' for one in path.iterdir())
                self._send(200, links.encode(), "text/html", body=body)
            elif path.is_file():
                self._file(path.read_bytes(), body=body)
            else:
                self._send(404, b"", "text/plain", body=body)

        def _file(self, data: bytes, *, body: bool) -> None:
            asked = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
            if asked is None or not store.pieces:
                self._send(200, data, "application/octet-stream", body=body)
                return
            start, size = int(asked[1]), len(data)
            end = min(size, int(asked[2] or size) + 1)
            if start >= size:
                self._send(416, b"", "text/plain", body=body)
                return
            about = {"Content-Range": f"bytes {start}-{end - 1}/{size}"}
            cut = None
            if store.ends_at is not None and start <= store.ends_at < end:
                cut = store.ends_at - start
            kind = "application/octet-stream"
            self._send(206, data[start:end], kind, body=body, cut=cut, **about)

        def _send(
            self,
            status: int,
            data: bytes,
            kind: str,
            *,
            body: bool,
            cut: int | None = None,
            **headers: str,
        ) -> None:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            length = str(len(data)) if store.length is None else store.length
            if length:
                self.send_header("Content-Length", length)
            self.close_connection = store.length is not None
            if store.pieces:
                self.send_header("Accept-Ranges", "bytes")
            for name, value in headers.items():
                self.send_header(name, value)
            self.end_headers()
            if not body:
                return
            with suppress(ConnectionError):  # who asked has heard enough
                self.wfile.write(data[:cut])
            store.given_bytes += len(data[:cut])
            if cut is not None and cut < len(data):
                self.close_connection = True

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield store, f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        thread.join(10.0)
        server.server_close()
