"""MAVLink FTP client for flights on the drone.

It requests bursts, repeats requests for lost parts, resumes an earlier download, and compares
the checksum of the whole file. `FileClient` does no I/O: its caller passes in replies and the
time, and sends the requests. `uavrt.ground.fetch.drone_files` connects it to links.

The answering system may not be the drone. So the client gives up on an answer, burst or list
after a minute without progress, and bounds memory and disk use. It replaces a local file only
with a later state of the same flight (`uavrt.ground.fetch.same_flight`).
"""

import asyncio
import shutil
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import LinkError, RecordingError, os_errors_as
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s, s_from_ns
from uavrt.ground.fetch.same_flight import others, place_for
from uavrt.link.mavlink.autopilot.waiting import within
from uavrt.link.mavlink.dialect import FileTransferProtocol
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.services.ftp_wire import (
    DATA_SIZE,
    FtpError,
    FtpPacket,
    Opcode,
    checksum,
)

REPLY_NS = ns_from_s(1.5)
"""Time without a reply after which a file request is repeated [ns]; longer than the delay in
the queue of a slow radio."""
TRIES = 10
BURST_GAP_NS = ns_from_s(2.0)
"""Silence after which a burst of file data counts as finished [ns]."""
BURST_NS = ns_from_s(20.0)
"""Longest duration of a burst of file data [ns]; the part received by then is kept."""
BURST_BYTES = 1 << 20
"""Maximum size of a burst of file data [bytes]; the rest is requested again."""
STALL_NS = ns_from_s(60.0)
LEAST_BYTES, LEAST_ENTRIES = 6000, 30
"""Minimum progress within `STALL_NS` of a file [bytes] and of a list [entries]; the slowest
radio reaches three times as much."""
MOST_REPLIES = 4096
"""Maximum number of queued replies of the file server; further replies are dropped and counted.
"""
CHECKSUM_TRIES = 30
"""Maximum number of requests for one file's checksum; for 1 GB a drone needs 10 s."""
MOST_GROWTH_BYTES = 16_000_000
"""Maximum growth of a file beyond its listed size [bytes], as the drone may still write it."""
MOST_BYTES = 2_000_000_000
"""Largest flight that is downloaded without its recorded samples [bytes]; ten hours with 100
tags need a tenth of this size."""
FREE_BYTES_LEFT = 100_000_000
"""Space that a download must leave free on this computer's disk [bytes]."""
PART_SUFFIX = ".part"
MOST_NESTED = 8
"""Maximum depth of directories that are listed. Flights have 4 levels; the limit stops a
hostile server that nests directories without end."""
MOST_ENTRIES = 20_000
"""Maximum number of files and directories in one tree; a flight with 100 tags has 1200."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RemoteEntry:
    """Path and size of a file or directory on the drone."""

    path: str
    size: int | None
    """Size of the file [bytes]; None for a directory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RemoteTree:
    """All files in a directory on the drone and in its subdirectories."""

    files: tuple[RemoteEntry, ...]
    left_out: int = 0
    """Number of files and directories skipped: too deep, too many, or paths too long."""


class FileClient:
    """Requests directories, files and checksums from the drone's file server, one at a time."""

    def __init__(
        self,
        send: Callable[[bytes], None],
        now_ns: Callable[[], int],
        session: int = 0,
        unanswered: Callable[[], None] = lambda: None,
    ) -> None:
        self._send = send
        self._unanswered = unanswered
        self._now_ns = now_ns
        self._session = session
        self._sequence = 0
        self._replies: asyncio.Queue[FtpPacket] = asyncio.Queue(MOST_REPLIES)
        self.repeats = 0
        self.dropped = 0
        """Number of file replies dropped because the queue was full."""

    def receive(self, payload: bytes) -> None:
        """Queue a reply of the drone's file server."""
        if self._replies.full():
            self.dropped += 1
        else:
            self._replies.put_nowait(FtpPacket.decode(payload))

    async def list_directory(self, path: str) -> list[RemoteEntry]:
        """List a directory; raises `LinkError` if it cannot be listed or never ends."""
        entries: list[RemoteEntry] = []
        pace = _StallWatch(LEAST_ENTRIES, f"the list of {path}")
        while len(entries) < MOST_ENTRIES:
            pace.check(len(entries))
            reply = await self._ask(
                Opcode.LIST_DIRECTORY, data=path.encode(), offset=len(entries)
            )
            if _error(reply) is FtpError.END_OF_FILE:
                return entries
            _check(reply, path)
            new = [_entry(path, line) for line in reply.data.split(b"\0") if line]
            if not new:
                return entries
            entries += new
        raise LinkError(
            f"{path} on the drone has more than {MOST_ENTRIES} files and directories",
            remedy="Name one of its folders to fetch; if the drone cannot have so many "
            "files, someone may be impersonating it",
        )

    async def tree(self, path: str) -> RemoteTree:
        """List the files below a directory, at most `MOST_NESTED` deep and `MOST_ENTRIES`."""
        files: list[RemoteEntry] = []
        waiting = [(path, 1)]
        seen = left_out = 0
        pace = _StallWatch(LEAST_ENTRIES, f"the list of what is in {path}")
        while waiting:
            pace.check(seen)
            directory, depth = waiting.pop()
            for entry in await self.list_directory(directory):
                seen += 1
                unreachable = len(entry.path.encode()) > DATA_SIZE
                too_deep = entry.size is None and depth >= MOST_NESTED
                if seen > MOST_ENTRIES or unreachable or too_deep:
                    left_out += 1
                elif entry.size is None:
                    waiting.append((entry.path, depth + 1))
                else:
                    files.append(entry)
            if seen > MOST_ENTRIES:
                left_out += len(waiting)
                break
        return RemoteTree(files=tuple(files), left_out=left_out)

    async def checksum(self, path: str) -> int:
        """Request the checksum (CRC-32) of a file, which the drone computes."""
        reply = await self._ask(
            Opcode.CALC_FILE_CRC32, data=path.encode(), tries=CHECKSUM_TRIES
        )
        _check(reply, path)
        return int.from_bytes(reply.data[:4], "little")

    async def read(
        self,
        path: str,
        write: Callable[[bytes], Awaitable[object]],
        *,
        start: int = 0,
        progress: Callable[[int, int], None] = lambda done, size: None,
        allow: Callable[[int], None] = lambda size: None,
    ) -> int:
        """Read a file from byte `start` to its end; return its size.

        `write`: gets the bytes in order; must not block.
        `progress`: gets the number of bytes received so far and the size.
        `allow`: gets the size before anything is read; raises if it is too large.
        """
        opened = await self._ask(Opcode.OPEN_FILE_RO, data=path.encode())
        _check(opened, path)
        size = int.from_bytes(opened.data[:4], "little")
        allow(size)
        done, failures = start, 0
        ahead: dict[int, bytes] = {}
        pace = _StallWatch(LEAST_BYTES, path, start)
        while done < size:
            pace.check(done)
            if ahead:  # something before it was lost: only that again
                hole = min(DATA_SIZE, min(ahead) - done)
                reply = await self._ask(Opcode.READ_FILE, offset=done, size=hole)
                _check(reply, path)
                if not reply.data:
                    raise LinkError(
                        f"{path} is shorter than the drone reported",
                        remedy="Fetch the file again",
                    )
                ahead[done] = reply.data[:hole]
            else:
                ahead = await self._burst(done, size)
                failures = 0 if ahead else failures + 1
                if failures:
                    self._unanswered()
                if failures >= TRIES:
                    raise _silent(path)
            came: list[bytes] = []
            while (data := ahead.pop(done, b"")) != b"":
                data = data[: size - done]
                came.append(data)
                done += len(data)
            await write(b"".join(came))
            ahead = {offset: data for offset, data in ahead.items() if offset > done}
            progress(done, size)
        await self._ask(Opcode.TERMINATE_SESSION)
        return size

    async def _burst(self, offset: int, end: int) -> dict[int, bytes]:
        """Request a burst of file data; return parts between `offset` and `end`, by offset."""
        self._send(self._request(Opcode.BURST_READ_FILE, offset=offset, size=DATA_SIZE))
        got: dict[int, bytes] = {}
        until_s = _soon(BURST_NS)
        while (reply := await self._reply(BURST_GAP_NS, until_s)) is not None:
            if reply.request_opcode != Opcode.BURST_READ_FILE:
                continue
            self._sequence = max(self._sequence, reply.sequence)
            if reply.opcode != Opcode.ACK:
                if _error(reply) not in (FtpError.END_OF_FILE, None):
                    _check(reply, "the file")
                break
            if reply.data and offset <= reply.offset < end:
                got[reply.offset] = reply.data
            if reply.burst_complete or len(got) * DATA_SIZE > BURST_BYTES:
                break
        return got

    async def _ask(
        self,
        opcode: Opcode,
        *,
        data: bytes = b"",
        offset: int = 0,
        size: int | None = None,
        tries: int = TRIES,
    ) -> FtpPacket:
        """Send a request, byte for byte the same, until it is answered; return the reply."""
        if len(data) > DATA_SIZE:
            raise LinkError(
                f"a file path of {len(data)} bytes is too long to be requested from the drone",
                remedy="Check with `uavrt fetch --list` which flights are on the drone",
            )
        request = self._request(opcode, data=data, offset=offset, size=size)
        wanted = (self._sequence + 1) & 0xFFFF
        for attempt in range(tries):
            self.repeats += attempt > 0
            if attempt > 0:
                self._unanswered()
            self._send(request)
            until_s = _soon(REPLY_NS)
            while (reply := await self._reply(REPLY_NS, until_s)) is not None:
                if reply.sequence == wanted and reply.request_opcode == opcode:
                    self._sequence += 1
                    return reply
        raise _silent("the drone's file server")

    async def _reply(self, wait_ns: int, until_s: float) -> FtpPacket | None:
        """Next reply to the last request; None after `wait_ns` or at the time `until_s`."""
        left_s = min(wait_ns / NANOSECONDS_PER_SECOND, until_s - monotonic_s())
        return None if left_s <= 0.0 else await within(left_s, self._replies.get())

    def _request(
        self, opcode: Opcode, *, data: bytes = b"", offset: int = 0, size: int | None = None
    ) -> bytes:
        """Encode the next request; replies to earlier requests are then ignored."""
        while not self._replies.empty():
            self._replies.get_nowait()
        self._sequence += 1
        return FtpPacket(
            sequence=self._sequence,
            session=self._session,
            opcode=opcode,
            size=size,
            offset=offset,
            data=data,
        ).encode()


class _StallWatch:
    """Aborts a transfer that gains less than `least` bytes or entries within `STALL_NS`."""

    def __init__(self, least: int, what: str, start: int = 0) -> None:
        self._least, self._what = least, what
        self._from, self._until_s = start, _soon(STALL_NS)

    def check(self, done: int) -> None:
        """Update the amount received so far; raises `LinkError` if it grows too slowly."""
        if done - self._from >= self._least:
            self._from, self._until_s = done, _soon(STALL_NS)
        elif monotonic_s() > self._until_s:
            raise LinkError(
                f"the transfer of {self._what} has stalled: {done - self._from} of at least "
                f"{self._least} received in {s_from_ns(STALL_NS):.0f} s",
                remedy="Move closer to the drone and try again; what has arrived is kept",
            )


def file_request(drone: Peer, payload: bytes) -> FileTransferProtocol:
    """Make the message that sends an FTP request to the drone's file server."""
    return FileTransferProtocol(target_network=0, **drone.address, payload=payload)


def _soon(wait_ns: int) -> float:
    return monotonic_s() + wait_ns / NANOSECONDS_PER_SECOND


def require_room(entries: Iterable[RemoteEntry], place: Path, *, samples: bool) -> None:
    """Raise `RecordingError` if a flight does not fit on the disk or, without samples, exceeds
    `MOST_BYTES`.
    """
    whole = sum(entry.size or 0 for entry in entries)
    if whole > MOST_BYTES and not samples:
        raise RecordingError(
            f"the drone lists {whole / 1e9:.1f} GB; a flight without its recorded samples has "
            f"at most {MOST_BYTES / 1e9:.0f} GB",
            remedy="Fetch the flight's files one by one; someone may be impersonating the "
            "drone",
        )
    _require_free(place, whole)


def _require_free(place: Path, size: int) -> None:
    parent = place
    while not parent.exists() and parent != parent.parent:
        parent = parent.parent
    free = shutil.disk_usage(parent).free - FREE_BYTES_LEFT
    if size > free:
        raise RecordingError(
            f"{size / 1e6:.0f} MB are needed in {parent}, but only {max(0, free) / 1e6:.0f} MB "
            "are free",
            remedy="Free disk space, or choose another directory with -o",
        )


async def fetch_file(
    client: FileClient,
    entry: RemoteEntry,
    place: Path,
    progress: Callable[[int, int], None] = lambda done, size: None,
) -> bool:
    """Download one file; return False if a complete copy is already on this computer.

    Data is written to ``NAME.part``, which is renamed once its checksum is right. An existing
    part is continued; if the checksum is wrong, the file is downloaded once more from the
    start. A different local file of the same name is kept, and the new file is stored as
    ``NAME.other-1``.
    """
    alike = [there for there in (place, *others(place)) if _size(there) == entry.size]
    if alike:
        wanted = await client.checksum(entry.path)
        for there in alike:  # recordings have gigabytes, and the loop serves the link, too
            if await asyncio.to_thread(file_checksum, there) == wanted:
                progress(entry.size or 0, entry.size or 0)
                return False
    part = place.with_name(place.name + PART_SUFFIX)
    if part.exists() and not part.is_file():
        raise RecordingError(
            f"{part} is not a file", remedy="Remove this directory, then try again"
        )

    def allow(size: int) -> None:
        listed = entry.size or 0
        if size > listed + max(listed, MOST_GROWTH_BYTES):
            raise LinkError(
                f"{entry.path} has {size} bytes, but the drone listed {listed}",
                remedy="Fetch the file again; if the fault persists, someone may be "
                "impersonating the drone",
            )
        _require_free(part, size - (_size(part) or 0))

    with os_errors_as(RecordingError, f"cannot write {place}", "Give another path with -o"):
        await asyncio.to_thread(place.parent.mkdir, parents=True, exist_ok=True)
        for _ in range(2):
            start = _size(part) or 0
            async with _Appending(part) as file:
                await client.read(
                    entry.path, file.write, start=start, progress=progress, allow=allow
                )
            wanted = await client.checksum(entry.path)
            if await asyncio.to_thread(file_checksum, part) == wanted:
                free = await asyncio.to_thread(place_for, part, place)
                await asyncio.to_thread(part.replace, free)
                return True
            part.unlink()
    raise RecordingError(
        f"{entry.path} is different each time it is read",
        remedy="The drone is still writing this file; stop the detection and fetch it again",
    )


class _Appending:
    """File to which a thread appends; written data survives the end of the program."""

    def __init__(self, path: Path) -> None:
        self._path = path

    async def __aenter__(self) -> "_Appending":
        self._file = await asyncio.to_thread(open, self._path, "ab", 0)
        return self

    async def __aexit__(self, *_: object) -> None:
        await asyncio.to_thread(self._file.close)

    async def write(self, data: bytes) -> None:
        """Append all given bytes to the file."""
        left = memoryview(data)
        while left:
            left = left[await asyncio.to_thread(self._file.write, left) :]


def file_checksum(path: Path) -> int:
    """Compute the checksum of a local file as the drone does (MAVLink FTP's CRC-32)."""
    value = 0
    with path.open("rb") as file:
        while part := file.read(1 << 20):
            value = checksum(part, value)
    return value


def _size(path: Path) -> int | None:
    """Size of a local file [bytes]; None if it does not exist."""
    try:
        return path.stat().st_size if path.is_file() else None
    except OSError:
        return None


def _entry(directory: str, line: bytes) -> RemoteEntry:
    """Parse one line of a listing; raises `LinkError` for a name outside `directory`."""
    name, _, size = line[1:].decode("utf-8", "replace").partition("\t")
    good = name not in ("", "..") and name.isprintable() and Path(name).name == name
    if not good or not (size or "0").isdecimal():
        raise LinkError(
            f"the drone sent an invalid list of files: {line[:80]!r} is not a name with a size",
            remedy="Someone may be impersonating the drone: see “Lock the link” in the manual",
        )
    path = f"{directory.rstrip('/')}/{name}"
    return RemoteEntry(path=path, size=int(size or 0) if line[:1] == b"F" else None)


def _error(reply: FtpPacket) -> FtpError | None:
    if reply.opcode == Opcode.ACK or not reply.data:
        return None
    try:
        return FtpError(reply.data[0])
    except ValueError:
        return FtpError.FAIL


def _check(reply: FtpPacket, path: str) -> None:
    error = _error(reply)
    if error is not None:
        why = error.name.lower().replace("_", " ")
        raise LinkError(
            f"{path}: {why}",
            remedy="Check with `uavrt fetch --list` which flights are on the drone",
        )


def _silent(what: str) -> LinkError:
    return LinkError(
        f"the drone did not answer a request about {what}",
        remedy="Check the radio link and try again; what has arrived is kept",
    )
