"""A drone as far as its file server goes, on a real socket."""

import socket
import threading
import time
from pathlib import Path

import made

from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.link.mavlink.services.ftp_files import FileTree
from uavrt.link.mavlink.services.ftp_server import FileServer


class FileDrone:
    """Component 191 with its file server, on a socket."""

    def __init__(self, port: int, root: Path) -> None:
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sock.connect(("127.0.0.1", port))
        self._sock.settimeout(0.02)
        self._writer, self._parser = FrameWriter(1, 191), FrameParser()
        self._server = FileServer(FileTree(root))
        self._ending = threading.Event()
        self.silent = False
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        beat = made.heartbeat()
        next_s = 0.0
        while not self._ending.is_set():
            if time.monotonic() >= next_s:
                next_s = time.monotonic() + 0.3
                self._sock.send(self._writer.encode(beat))
            try:
                frames = self._parser.feed(self._sock.recv(4096))
            except OSError:
                continue
            for frame in frames:
                message = frame.message()
                if isinstance(message, dialect.FileTransferProtocol) and not self.silent:
                    self._server.receive(
                        message.payload, Peer(frame.system_id, frame.component_id), 0
                    )
            self._server.work()
            while self._server.wait_ns(0) is not None:
                reply = self._server.take(0, 1e6)
                assert reply is not None
                self._sock.send(self._writer.encode(reply))

    def close(self) -> None:
        """Fall silent."""
        self._ending.set()
        self._thread.join(10.0)
        self._sock.close()
