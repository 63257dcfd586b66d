"""Our own MAVLink FTP client: flights from the drone, over the link that is there.

It asks for bursts and, after each, again for what was lost; goes on where an earlier attempt
ended; and compares the checksum of the whole file. `FileClient` is pure: give it the replies
and the time, send what it gives. `DroneFiles` puts it on a link.

It shows itself to the drone as some program of the ground's system and not as a ground station:
pulses are not meant for it.
"""

import asyncio
import secrets
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

from uavrt.errors import LinkError, RecordingError
from uavrt.mavlink import dialect
from uavrt.mavlink.discovery import Peer
from uavrt.mavlink.frame import Frame, FrameWriter
from uavrt.mavlink.ftp_wire import DATA_SIZE, FtpError, FtpPacket, Opcode, checksum
from uavrt.mavlink.link import Link
from uavrt.mavlink.transport import open_link
from uavrt.units import ns_from_s

REPLY_NS = ns_from_s(1.5)
"""Longer than a queue of a slow radio holds a reply."""
TRIES = 10
QUIET_NS = ns_from_s(2.0)
"""A burst of which nothing came for so long is over."""
PART_SUFFIX = ".part"
DRONE_COMPONENT = 191


@dataclass(frozen=True, slots=True, kw_only=True)
class RemoteEntry:
    """A file or directory on the drone."""

    path: str
    size: int | None
    """None for a directory."""


class FileClient:
    """One conversation with the drone's file server.

    Parameters
    ----------
    send : callable
        Sends a request's 251 bytes.
    now_ns : callable
        Time now.
    session : int
        Ours; any number serves.
    """

    def __init__(
        self, send: Callable[[bytes], None], now_ns: Callable[[], int], session: int = 0
    ) -> None:
        self._send = send
        self._now_ns = now_ns
        self._session = session
        self._sequence = 0
        self._replies: asyncio.Queue[FtpPacket] = asyncio.Queue()
        self.repeats = 0

    def receive(self, payload: bytes) -> None:
        """Take a reply."""
        self._replies.put_nowait(FtpPacket.decode(payload))

    async def list_directory(self, path: str) -> list[RemoteEntry]:
        """List a directory; raises `LinkError` when it cannot be."""
        entries: list[RemoteEntry] = []
        while True:
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

    async def tree(self, path: str) -> list[RemoteEntry]:
        """List all files below a directory."""
        files: list[RemoteEntry] = []
        for entry in await self.list_directory(path):
            if entry.size is None:
                files += await self.tree(entry.path)
            else:
                files.append(entry)
        return files

    async def checksum(self, path: str) -> int:
        """Checksum that the drone computes of a file."""
        reply = await self._ask(Opcode.CALC_FILE_CRC32, data=path.encode(), patience=60)
        _check(reply, path)
        return int.from_bytes(reply.data[:4], "little")

    async def read(
        self,
        path: str,
        write: Callable[[bytes], object],
        *,
        start: int = 0,
        progress: Callable[[int, int], None] = lambda done, size: None,
    ) -> int:
        """Read a file from `start` to its end; give its size.

        Parameters
        ----------
        path : str
            The file.
        write : callable
            Gets the bytes in order.
        start : int
            Bytes that are here already.
        progress : callable
            Gets the bytes that are here, and the size.

        Raises
        ------
        LinkError
            The drone refuses, or does not answer.
        """
        opened = await self._ask(Opcode.OPEN_FILE_RO, data=path.encode())
        _check(opened, path)
        size = int.from_bytes(opened.data[:4], "little")
        done, failures = start, 0
        ahead: dict[int, bytes] = {}
        while done < size:
            if ahead:  # something before it was lost: only that again
                hole = min(DATA_SIZE, min(ahead) - done)
                reply = await self._ask(Opcode.READ_FILE, offset=done, size=hole)
                _check(reply, path)
                ahead[done] = reply.data[:hole]
            else:
                parts = await self._burst(done)
                ahead = {offset: data for offset, data in parts if offset >= done}
                failures = 0 if ahead else failures + 1
                if failures >= TRIES:
                    raise _silent(path)
            while (data := ahead.pop(done, b"")) != b"":
                write(data)
                done += len(data)
            progress(done, size)
        await self._ask(Opcode.TERMINATE_SESSION)
        return size

    async def _burst(self, offset: int) -> list[tuple[int, bytes]]:
        """Ask for a burst and take what comes of it."""
        self._clear()
        self._sequence += 1
        first = self._sequence
        request = FtpPacket(
            sequence=first,
            session=self._session,
            opcode=Opcode.BURST_READ_FILE,
            size=DATA_SIZE,
            offset=offset,
        )
        self._send(request.encode())
        got: list[tuple[int, bytes]] = []
        while (reply := await self._reply(QUIET_NS)) is not None:
            if reply.request_opcode != Opcode.BURST_READ_FILE:
                continue
            self._sequence = max(self._sequence, reply.sequence)
            if reply.opcode != Opcode.ACK:
                if _error(reply) not in (FtpError.END_OF_FILE, None):
                    _check(reply, "the file")
                break
            got.append((reply.offset, reply.data))
            if reply.burst_complete:
                break
        return got

    async def _ask(
        self,
        opcode: Opcode,
        *,
        data: bytes = b"",
        offset: int = 0,
        size: int | None = None,
        patience: int = TRIES,
    ) -> FtpPacket:
        """Ask until there is an answer; the same bytes each time."""
        self._sequence += 1
        request = FtpPacket(
            sequence=self._sequence,
            session=self._session,
            opcode=opcode,
            size=size,
            offset=offset,
            data=data,
        ).encode()
        wanted = (self._sequence + 1) & 0xFFFF
        self._clear()
        for attempt in range(patience):
            self.repeats += attempt > 0
            self._send(request)
            while (reply := await self._reply(REPLY_NS)) is not None:
                if reply.sequence == wanted and reply.request_opcode == opcode:
                    self._sequence += 1
                    return reply
        raise _silent("the drone's file server")

    async def _reply(self, wait_ns: int) -> FtpPacket | None:
        try:
            async with asyncio.timeout(wait_ns / 1e9):
                return await self._replies.get()
        except TimeoutError:
            return None

    def _clear(self) -> None:
        while not self._replies.empty():
            self._replies.get_nowait()


class DroneFiles:
    """A link to the drone for files only.

    ::

        async with DroneFiles(clock.now_ns).open("udpin://127.0.0.1:14550") as client:
            for entry in await client.tree("/"):
                await fetch_file(client, entry, Path(entry.path.lstrip("/")))

    Parameters
    ----------
    now_ns : callable
        Time now.
    system_id, component_id : int
        Our own numbers, different from the ground station's.
    """

    def __init__(
        self, now_ns: Callable[[], int], *, system_id: int = 255, component_id: int = 197
    ) -> None:
        self._own = Peer(system_id, component_id)
        self._writer = FrameWriter(system_id, component_id)
        self._drone: Peer | None = None
        self._found = asyncio.Event()
        self._link: Link | None = None
        self._client = FileClient(self._send, now_ns, session=secrets.randbelow(256))

    @asynccontextmanager
    async def open(self, address: str, timeout_s: float = 20.0) -> AsyncIterator[FileClient]:
        """Open the link and find the drone; raises `LinkError`."""
        self._link = await open_link(address, self._receive)
        beat = asyncio.create_task(self._beat())
        try:
            async with asyncio.timeout(timeout_s):
                await self._found.wait()
            yield self._client
        except TimeoutError:
            raise LinkError(
                f"no component {DRONE_COMPONENT} was heard in {timeout_s:g} s",
                remedy="Check the drone's power, the radio, and that the autopilot forwards",
            ) from None
        finally:
            beat.cancel()
            await self._link.close()

    async def _beat(self) -> None:
        """Be heard once a second, so that the autopilot knows the way to us."""
        message = dialect.Heartbeat(
            type=dialect.MavType.GENERIC,
            autopilot=dialect.MavAutopilot.INVALID,
            base_mode=0,
            custom_mode=0,
            system_status=dialect.MavState.ACTIVE,
            mavlink_version=3,
        )
        while True:
            if self._link is not None:
                self._link.send(self._writer.encode(message))
            await asyncio.sleep(1.0)

    def _receive(self, frame: Frame) -> None:
        if frame.component_id != DRONE_COMPONENT:
            return
        message = frame.message()
        if isinstance(message, dialect.Heartbeat):
            self._drone = Peer(frame.system_id, frame.component_id)
            self._found.set()
        elif isinstance(message, dialect.FileTransferProtocol) and self._own == Peer(
            message.target_system, message.target_component
        ):
            self._client.receive(message.payload)

    def _send(self, payload: bytes) -> None:
        if self._link is None or self._drone is None:
            return
        message = dialect.FileTransferProtocol(
            target_network=0,
            target_system=self._drone.system_id,
            target_component=self._drone.component_id,
            payload=payload,
        )
        self._link.send(self._writer.encode(message))


async def fetch_file(
    client: FileClient,
    entry: RemoteEntry,
    place: Path,
    progress: Callable[[int, int], None] = lambda done, size: None,
) -> bool:
    """Fetch one file; False if it was here already.

    It grows as ``NAME.part`` and gets its name when its checksum is right. A part that was
    there is gone on with; if the whole is then wrong it is fetched anew, once.

    Raises
    ------
    LinkError
        The drone does not answer or refuses.
    RecordingError
        The file cannot be written, or is wrong twice.
    """
    if _size(place) == entry.size and (
        await client.checksum(entry.path) == file_checksum(place)
    ):
        progress(entry.size or 0, entry.size or 0)
        return False
    part = place.with_name(place.name + PART_SUFFIX)
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        for _ in range(2):
            start = _size(part) or 0
            with part.open("ab", buffering=0) as file:
                await client.read(entry.path, file.write, start=start, progress=progress)
            if file_checksum(part) == await client.checksum(entry.path):
                part.replace(place)
                return True
            part.unlink()
    except OSError as error:
        raise RecordingError(
            f"cannot write {place}: {error.strerror}", remedy="Give another place with -o"
        ) from error
    raise RecordingError(
        f"{entry.path} is different each time it is read",
        remedy="It is still being written; stop the detection and fetch it again",
    )


def file_checksum(path: Path) -> int:
    """Checksum of a file, as the drone computes it."""
    value = 0
    with path.open("rb") as file:
        while part := file.read(1 << 20):
            value = checksum(part, value)
    return value


def _size(path: Path) -> int | None:
    """Size of a file here, None if there is none."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return None


def _entry(directory: str, line: bytes) -> RemoteEntry:
    """Entry of one line of a listing."""
    name, _, size = line[1:].decode("utf-8", "replace").partition("\t")
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
            f"{path}: {why}", remedy="`uavrt fetch --list` shows what is on the drone"
        )


def _silent(what: str) -> LinkError:
    return LinkError(
        f"no answer about {what}",
        remedy="Check the radio link and try again; what has come is kept",
    )
