"""Unix socket that gives local programs the system's records, and accepts their commands.

The terminal view, the demo and the command line on the same computer use it. Each line is a
record. A client that reads too slowly is disconnected. The socket is open to its owner and to
the owner's own group: members of the service's group ``uavrt`` may watch and command.
"""

import asyncio
import contextlib
import errno
import grp
import os
import pwd
import socket
from collections.abc import Iterator

from uavrt.core.errors import ConfigError
from uavrt.core.log import get_logger
from uavrt.core.messages import Command
from uavrt.drone.ipc.topics import decode_record, encode_record
from uavrt.drone.supervisor.core import Supervisor

log = get_logger()

GATHER_S = 0.1
"""Time over which records are collected before they are sent to local programs together [s]."""
VIEWER_BUFFER_BYTES = 1_000_000
UNWRITABLE_CARD = (errno.EROFS, errno.ENOSPC, errno.EDQUOT, errno.EIO)
"""Error numbers that show a read-only, full or failing card."""


class Viewers:
    """Sends records to all connected local programs (viewers), and accepts their commands."""

    def __init__(self) -> None:
        self._writers: set[asyncio.StreamWriter] = set()
        self._lines: list[bytes] = []
        self.supervisor: Supervisor | None = None

    def show(self, line: bytes) -> None:
        """Send a record to every connected program."""
        if self._writers:
            if not self._lines:
                asyncio.get_running_loop().call_later(GATHER_S, self._show_all)
            self._lines.append(line)

    def _show_all(self) -> None:
        data = b"".join(self._lines)
        self._lines.clear()
        for writer in list(self._writers):
            if writer.transport.get_write_buffer_size() > VIEWER_BUFFER_BYTES:
                log.warning("viewer disconnected because it reads too slowly")
                self._writers.discard(writer)
                writer.transport.abort()
            else:
                writer.write(data)

    async def serve(self, path: str) -> asyncio.Server | None:
        """Open the socket.

        Returns None if the card cannot be written; the system then runs without it.
        """
        require_unserved(path)
        try:
            os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
            with contextlib.suppress(FileNotFoundError):
                os.unlink(path)
            with _restrict_access():
                return await asyncio.start_unix_server(self._serve_one, path, limit=262144)
        except OSError as error:
            if error.errno in UNWRITABLE_CARD:
                log.error(
                    "uavrt monitor is unavailable, because the status socket cannot be opened",
                    reason=error.strerror,
                )
                return None
            raise ConfigError(
                f"cannot open the status socket {path}: {error.strerror}",
                remedy="Set status_socket to a path of at most 99 bytes in a writable "
                "directory",
            ) from error

    async def _serve_one(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self._writers.add(writer)
        try:
            while line := await reader.readline():
                self._take(line.rstrip(b"\n"), writer)
        except (ConnectionError, ValueError):
            log.info("viewer disconnected")
        finally:
            self._writers.discard(writer)
            writer.close()

    def _take(self, line: bytes, writer: asyncio.StreamWriter) -> None:
        _, record = decode_record(line)
        if isinstance(record, Command) and self.supervisor is not None:
            reply = self.supervisor.command(record)
            writer.write(encode_record("command_reply", reply))


def require_unserved(path: str) -> None:
    """Raise `ConfigError` if a running system serves the socket, not for a leftover file."""
    with socket.socket(socket.AF_UNIX) as asking:
        asking.settimeout(1.0)
        if asking.connect_ex(path):
            return
    raise ConfigError(
        f"another uavrt is already using {path}",
        remedy="Stop it first (uavrt monitor shows it), or set another status_socket",
    )


@contextlib.contextmanager
def _restrict_access() -> Iterator[None]:
    """Context in which only the owner, and the owner's private group, may access new files."""
    old_mask = os.umask(0o117 if _has_own_group() else 0o177)
    try:
        yield
    finally:
        os.umask(old_mask)


def _has_own_group() -> bool:
    """True if the present user has a private group (useradd(8), USERGROUPS_ENAB)."""
    try:
        return grp.getgrgid(os.getegid()).gr_name == pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return False
