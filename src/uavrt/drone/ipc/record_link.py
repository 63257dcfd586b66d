"""Client end of the socket to the supervisor, for child processes and local viewers.

The socket never blocks the program: data that cannot be written waits in memory until the next
call. A child process exits when the supervisor is gone.
"""

import os
import select
import socket
import time
from collections import deque
from typing import Any

from uavrt.drone.ipc.tag_assignment import Assignment
from uavrt.drone.ipc.topics import decode_record, encode_record

LINK_VARIABLE = "UAVRT_LINK_FD"
"""Environment variable that holds the file descriptor of the supervisor's socket."""


FLUSH_BYTES = 16_384


class LineBuffer:
    """Splits a byte stream into lines."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Add bytes; return the lines that are now complete, without their newline."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        return lines


class SupervisorGone(ConnectionError):
    """Raised when the supervisor's end of the socket is closed."""


class RecordSocket:
    """Sends and receives records over a stream socket to the supervisor."""

    def __init__(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        self._sock = sock
        self._lines = LineBuffer()
        self._received: deque[tuple[str, Any]] = deque()
        self._unsent = bytearray()
        self._gone = False
        self.refused = 0
        """Number of lines received from the supervisor that were not records."""
        self.lines = 0
        """Number of lines that `receive` has returned or refused since the start."""

    @classmethod
    def from_environment(cls) -> "RecordSocket":
        """Open the socket that the supervisor passed to this process."""
        return cls(socket.socket(fileno=int(os.environ[LINK_VARIABLE])))

    def fileno(self) -> int:
        """File descriptor of the socket, for select and asyncio."""
        return self._sock.fileno()

    def put(self, topic: str, record: object) -> None:
        """Queue a record; a later `send`, `flush` or `receive` writes it.

        Raises `SupervisorGone` if a full queue cannot be written.
        """
        self._unsent += encode_record(topic, record)
        if len(self._unsent) > FLUSH_BYTES:
            self.flush()

    def send(self, topic: str, record: object) -> None:
        """Queue a record and write as much of the queue as fits; may raise `SupervisorGone`."""
        self._unsent += encode_record(topic, record)
        self.flush()

    def flush(self, timeout_s: float = 0.0) -> bool:
        """Write queued records, for at most `timeout_s`; True once all are written."""
        deadline = time.monotonic() + timeout_s
        while self._unsent:
            try:
                written = self._sock.send(self._unsent)
                del self._unsent[:written]
            except BlockingIOError:
                rest_s = deadline - time.monotonic()
                if rest_s <= 0:
                    return False
                select.select([], [self._sock], [], rest_s)
            except (BrokenPipeError, ConnectionResetError) as error:
                raise SupervisorGone from error
        return True

    def receive(self, timeout_s: float = 0.0) -> list[tuple[str, Any]]:
        """Return the received (topic, record) pairs; wait up to `timeout_s` for the first.

        Raises `SupervisorGone` once all are read and the socket is closed.
        """
        if not self._received and timeout_s > 0 and not self._gone:
            if self._unsent:
                self.flush()
            select.select([self._sock], [], [], timeout_s)
        self._read_all()
        if self._gone and not self._received:
            raise SupervisorGone
        if self._unsent and not self._gone:
            self.flush()
        records = list(self._received)
        self._received.clear()
        self.lines += len(records)
        return records

    def wait_for_assignment(self, timeout_s: float = 10.0) -> Assignment:
        """Wait for the first record, the assignment, and return it; `receive` gets the rest."""
        deadline = time.monotonic() + timeout_s
        while not self._received and time.monotonic() < deadline:
            select.select([self._sock], [], [], deadline - time.monotonic())
            self._read_all()
            if self._gone and not self._received:
                raise SupervisorGone
        topic, record = self._received.popleft()
        if not isinstance(record, Assignment):
            raise TypeError(f"the first record received is {topic}, not an assignment")
        return record

    def _read_all(self) -> None:
        while not self._gone:
            try:
                data = self._sock.recv(65536)
            except BlockingIOError:
                return
            except ConnectionResetError:
                data = b""
            if not data:
                self._gone = True
            for line in self._lines.feed(data):
                try:
                    self._received.append(decode_record(line))
                except ValueError:
                    self.refused += 1
                    self.lines += 1
