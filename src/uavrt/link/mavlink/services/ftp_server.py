"""A read-only MAVLink FTP server: serves flights from the drone over any link.

Replies go one by one to the paced queue, after pulses, so that a download uses only the
capacity that pulses leave. The server allows for differences between clients:

- Some choose a random session id and accept only replies that return it (MAVProxy); others use
  0 (QGroundControl, MAVSDK). So each client's files are opened under the id that it sent.
- Some first request opcode 16, the listing with times. Unknown opcodes get a NAK at once.
- A repeated request, with the same sequence number, gets the same reply again.

A disk that stalls must not silence the link. So all disk work is a job for `Disk`, and the
reply is made when the job is done.

More than two replies sent at once would overrun the autopilot's buffer. In the queue a transfer
reaches at most 12 kB/s, even over a faster network.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import BinaryIO, TypeVar

from uavrt.core.newest import Newest
from uavrt.core.runtime.disk_thread import Disk, at_once
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.link.mavlink.dialect import FileTransferProtocol
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.message import Message
from uavrt.link.mavlink.services.ftp_files import (
    CRC_PART,
    FileRefused,
    FileTree,
    close,
    read_at,
)
from uavrt.link.mavlink.services.ftp_wire import (
    DATA_SIZE,
    WRITING,
    FtpError,
    FtpPacket,
    Opcode,
    checksum,
)

T = TypeVar("T")

BURST_S = 0.5
MOST_BURST_BYTES = 32 * DATA_SIZE
"""Longest burst of file data [bytes]. The losses that the client then reports show which rate
the link can carry."""
MAX_SESSIONS = 8
IDLE_NS = ns_from_s(300.0)
"""Time without use after which a client's open file is closed [ns]."""
GIVES_WAY_NS = ns_from_s(10.0)
"""Time without use after which a client's open file may be closed to open one for another
client [ns]."""
MAX_CLIENTS = 16
WAITING = 32


@dataclass(slots=True)
class Session:
    """A file opened by a client of the file server."""

    file: BinaryIO | bytes
    size: int
    used_ns: int


@dataclass(slots=True)
class Burst:
    """Part of a file that was read and is being sent in pieces."""

    peer: Peer
    request: FtpPacket
    sequence: int
    offset: int
    data: bytes
    """Bytes of the file from `offset` on; fewer than requested at the end of the file."""
    chunk: int
    size: int = 0
    """Size of the whole burst [bytes]; 0 before the first piece, when the rate is unknown."""
    ended: bool = False

    def next_part(self, rate_bytes_s: float) -> FtpPacket:
        """Return the next piece of the burst."""
        if self.size == 0:
            # Full parts only: pymavlink takes a shorter one for the end of the file.
            size = min(MOST_BURST_BYTES, rate_bytes_s * BURST_S)
            self.size = max(1, int(size / self.chunk)) * self.chunk
        self.sequence += 1
        done = self.offset - self.request.offset
        data = self.data[done : done + self.chunk]
        complete = bool(data) and done + len(data) >= self.size
        part = FtpPacket(
            sequence=self.sequence,
            session=self.request.session,
            opcode=Opcode.ACK if data else Opcode.NAK,
            request_opcode=Opcode.BURST_READ_FILE,
            burst_complete=complete,
            offset=self.offset,
            data=data or bytes((FtpError.END_OF_FILE,)),
        )
        self.offset += len(data)
        self.ended = complete or not data
        return part


@dataclass(slots=True)
class Client:
    """Last request of a file client, and the reply that was sent."""

    request: FtpPacket
    reply: FtpPacket | None = None
    reading: bool = False
    """True while a disk job for this client's request is running."""
    data_sent_ns: int | None = None
    """Time of the last data sent to the client, to measure the round trip [ns]."""


@dataclass(slots=True)
class Crc:
    """A file's checksum while it is being computed, and the position reached."""

    peer: Peer
    request: FtpPacket
    file: BinaryIO | bytes
    offset: int = 0
    value: int = 0
    reading: bool = False


class FileServer:
    """Serves a `FileTree` through the paced queue, started by `wake`; `disk` reads files."""

    def __init__(
        self, tree: FileTree, wake: Callable[[], None] = lambda: None, disk: Disk = at_once
    ) -> None:
        self.tree = tree
        self._wake = wake
        self._disk = disk
        self._sessions: dict[tuple[Peer, int], Session] = {}
        self._clients: Newest[Peer, Client] = Newest(MAX_CLIENTS)
        self._replies: deque[tuple[Peer, FtpPacket]] = deque()
        self._bursts: dict[Peer, Burst] = {}
        self._crcs: deque[Crc] = deque()
        self.requests = 0
        self.refused = 0
        self.repeated = 0
        self.left = 0
        """Number of requests refused because too many disk jobs were waiting."""
        self.bytes_sent = 0
        self.given_up = 0
        """Number of open files closed to serve another client."""

    def receive(self, payload: bytes, peer: Peer, now_ns: int) -> float | None:
        """Handle a request; return the round trip since the last data [s] or None."""
        request = FtpPacket.decode(payload)
        if request.opcode in (Opcode.ACK, Opcode.NAK):
            return None
        self.requests += 1
        trip_s = None
        client = self._clients.get(peer)
        if client is not None:
            if client.request == request:
                self._repeat(peer, client)
                return None
            if client.data_sent_ns is not None and peer not in self._bursts:
                trip_s = (now_ns - client.data_sent_ns) / NANOSECONDS_PER_SECOND
        self._clients[peer] = Client(request)
        self._forget_idle(now_ns)
        try:
            self._serve(request, peer, now_ns)
        except FileRefused as refusal:
            self._refuse(request, peer, refusal)
        self._wake()
        return trip_s

    def on(self, link: int) -> "FilesOnLink":
        """Return the source of replies to clients on link number `link`."""
        return FilesOnLink(self, link)

    def wait_ns(self, now_ns: int, link: int | None = None) -> int | None:
        """Time until a reply may be sent by link number `link` [ns]; None if none waits."""
        waiting = [peer for peer, _ in self._replies]
        waiting += [burst.peer for burst in self._bursts.values()]
        return 0 if any(link in (None, peer.link) for peer in waiting) else None

    def take(self, now_ns: int, rate_bytes_s: float, link: int | None = None) -> Message | None:
        """Return the next reply for link `link` (None: any); None if no reply waits."""
        here = [reply for reply in self._replies if link in (None, reply[0].link)]
        bursts = [b for b in self._bursts.values() if link in (None, b.peer.link)]
        if here:
            peer, packet = here[0]
            self._replies.remove(here[0])
        elif bursts:  # several clients take turns
            peer, packet = bursts[0].peer, bursts[0].next_part(rate_bytes_s)
            del self._bursts[peer]
            if not bursts[0].ended:
                self._bursts[peer] = bursts[0]
        else:
            return None
        if packet.request_opcode in (Opcode.READ_FILE, Opcode.BURST_READ_FILE):
            self.bytes_sent += len(packet.data)
            client = self._clients.get(peer)
            if client is not None:
                client.data_sent_ns = now_ns
        payload = packet.encode()
        return FileTransferProtocol(target_network=0, **peer.address, payload=payload)

    def work(self) -> None:
        """Continue computing a checksum by one megabyte, which takes about a millisecond."""
        if not self._crcs or self._crcs[0].reading:
            return
        job = self._crcs[0]
        job.reading = True
        part = partial(read_at, job.file, job.offset, CRC_PART)
        if not self._on_disk(job.peer, job.request, part, partial(self._add_to_crc, job)):
            job.reading = False

    def _add_to_crc(self, job: Crc, part: bytes) -> None:
        job.reading = False
        if part:
            job.value = checksum(part, job.value)
            job.offset += len(part)
            return
        self._drop_crc(job)
        self._accept(job.request, job.peer, job.value.to_bytes(4, "little"))

    def _drop_crc(self, job: Crc) -> None:
        if job not in self._crcs:
            return  # closed meanwhile
        self._crcs.remove(job)
        self._disk(partial(close, job.file), _nothing)

    def close(self) -> None:
        """Close all files that clients have opened."""
        for key in list(self._sessions):
            self._end(key)
        while self._crcs:
            self._drop_crc(self._crcs[0])

    def counters(self) -> dict[str, float]:
        """Counts of requests, sessions and sent bytes, for a health record."""
        return {
            "ftp_requests": self.requests,
            "ftp_refused": self.refused,
            "ftp_repeated": self.repeated,
            "ftp_left": self.left,
            "ftp_sessions": len(self._sessions),
            "ftp_sessions_given_up": self.given_up,
            "ftp_bytes": self.bytes_sent,
        }

    # ------------------------------------------------------------------ requests

    def _serve(self, request: FtpPacket, peer: Peer, now_ns: int) -> None:
        match request.opcode:
            case Opcode.NONE:
                self._accept(request, peer)
            case Opcode.TERMINATE_SESSION:
                if (peer, request.session) not in self._sessions:
                    raise FileRefused(FtpError.INVALID_SESSION)
                self._end((peer, request.session))
                self._accept(request, peer)
            case Opcode.RESET_SESSIONS:
                for key in [key for key in self._sessions if key[0] == peer]:
                    self._end(key)
                self._accept(request, peer)
            case Opcode.LIST_DIRECTORY:
                self._list(request, peer)
            case Opcode.OPEN_FILE_RO:
                self._open(request, peer, now_ns)
            case Opcode.READ_FILE:
                self._read(request, peer, now_ns)
            case Opcode.BURST_READ_FILE:
                self._start_burst(request, peer, now_ns)
            case Opcode.CALC_FILE_CRC32 if len(self._crcs) >= MAX_SESSIONS:
                raise FileRefused(FtpError.NO_SESSIONS_AVAILABLE)
            case Opcode.CALC_FILE_CRC32:
                self._on_disk(
                    peer,
                    request,
                    partial(self.tree.open, path_of(request)),
                    lambda opened: self._crcs.append(Crc(peer, request, opened[0])),
                )
            case _ if request.opcode in WRITING:
                raise FileRefused(FtpError.FILE_PROTECTED)
            case _:
                raise FileRefused(FtpError.UNKNOWN_COMMAND)

    def _on_disk(
        self, peer: Peer, request: FtpPacket, job: Callable[[], T], then: Callable[[T], None]
    ) -> bool:
        """Run a disk job, then call `then` with its result; False if too many jobs wait."""
        client = self._clients.get(peer)

        def outcome() -> T | FileRefused:
            try:
                return job()
            except FileRefused as refusal:
                return refusal

        def go_on(result: T | FileRefused) -> None:
            if client is not None:
                client.reading = False
            try:
                if isinstance(result, FileRefused):
                    raise result
                then(result)
            except FileRefused as refusal:
                asked = [c for c in self._crcs if (c.peer, c.request) == (peer, request)]
                for crc in asked:
                    self._drop_crc(crc)
                self._refuse(request, peer, refusal)
            self._wake()

        if client is not None:
            client.reading = True
        if self._disk(outcome, go_on):
            return True
        self.left += 1
        self._clients.pop(peer, None)  # asked again it is a new request
        return False

    def _list(self, request: FtpPacket, peer: Peer) -> None:
        def answer(entries: list[bytes]) -> None:
            if not entries[request.offset :]:
                raise FileRefused(FtpError.END_OF_FILE)
            self._accept(request, peer, b"".join(fitting(entries[request.offset :])))

        self._on_disk(peer, request, partial(self.tree.entries, path_of(request)), answer)

    def _open(self, request: FtpPacket, peer: Peer, now_ns: int) -> None:
        key = (peer, request.session)

        def keep(opened: tuple[BinaryIO | bytes, int]) -> None:
            file, size = opened
            full = key not in self._sessions and not self._room_for(peer, now_ns)
            if full or size >= 2**32:  # offsets have 32 bits
                self._disk(partial(close, file), _nothing)
                error = FtpError.NO_SESSIONS_AVAILABLE if full else FtpError.FAIL
                raise FileRefused(error)
            self._end(key)  # a client that uses the id again has forgotten the file before
            self._sessions[key] = Session(file, size, now_ns)
            self._accept(request, peer, size.to_bytes(4, "little"))

        self._on_disk(peer, request, partial(self.tree.open, path_of(request)), keep)

    def _read(self, request: FtpPacket, peer: Peer, now_ns: int) -> None:
        session = self._session(request, peer, now_ns)
        size = min(request.size or DATA_SIZE, DATA_SIZE)

        def give(data: bytes) -> None:
            if not data:
                raise FileRefused(FtpError.END_OF_FILE)
            self._accept(request, peer, data, offset=request.offset)

        self._on_disk(peer, request, partial(read_at, session.file, request.offset, size), give)

    def _start_burst(self, request: FtpPacket, peer: Peer, now_ns: int) -> None:
        session = self._session(request, peer, now_ns)
        if request.offset >= session.size:
            raise FileRefused(FtpError.END_OF_FILE)
        chunk = min(request.size or DATA_SIZE, DATA_SIZE)

        def start(data: bytes) -> None:
            self._bursts.pop(peer, None)
            self._bursts[peer] = Burst(
                peer=peer,
                request=request,
                sequence=request.sequence,
                offset=request.offset,
                data=data,
                chunk=chunk,
            )

        most = MOST_BURST_BYTES // chunk * chunk
        self._on_disk(
            peer, request, partial(read_at, session.file, request.offset, most), start
        )

    # ------------------------------------------------------------------- replies

    def _accept(
        self, request: FtpPacket, peer: Peer, data: bytes = b"", *, offset: int = 0
    ) -> None:
        self._reply(request, peer, Opcode.ACK, offset, data)

    def _refuse(self, request: FtpPacket, peer: Peer, refusal: FileRefused) -> None:
        if refusal.error is not FtpError.END_OF_FILE:
            self.refused += 1
        number = (refusal.number,) if refusal.error is FtpError.FAIL_ERRNO else ()
        data = bytes((refusal.error, *number))
        self._reply(request, peer, Opcode.NAK, request.offset, data)

    def _reply(
        self, request: FtpPacket, peer: Peer, opcode: Opcode, offset: int, data: bytes
    ) -> None:
        reply = FtpPacket(
            sequence=request.sequence + 1,
            session=request.session,
            opcode=opcode,
            request_opcode=request.opcode,
            offset=offset,
            data=data,
        )
        client = self._clients.get(peer)
        if client is not None and client.request == request:
            client.reply = reply
        self._put(peer, reply)

    def _put(self, peer: Peer, reply: FtpPacket) -> None:
        self._replies.append((peer, reply))
        while len(self._replies) > WAITING:
            self._replies.popleft()  # its client asks again

    def _repeat(self, peer: Peer, client: Client) -> None:
        """Answer a repeated request with the same reply; the request is not run twice."""
        self.repeated += 1
        reply = client.reply
        if reply is not None and (peer, reply) not in self._replies:
            self._put(peer, reply)
        elif client.reading or client.request.opcode != Opcode.BURST_READ_FILE:
            return
        elif peer not in self._bursts:
            session = self._sessions.get((peer, client.request.session))
            if session is not None:
                self._start_burst(client.request, peer, session.used_ns)
        self._wake()

    # ------------------------------------------------------------------ sessions

    def _session(self, request: FtpPacket, peer: Peer, now_ns: int) -> Session:
        session = self._sessions.get((peer, request.session))
        if session is None:
            raise FileRefused(FtpError.INVALID_SESSION)
        session.used_ns = now_ns
        return session

    def _end(self, key: tuple[Peer, int]) -> None:
        session = self._sessions.pop(key, None)
        if session is not None:
            self._disk(partial(close, session.file), _nothing)

    def _room_for(self, peer: Peer, now_ns: int) -> bool:
        """True if a client may open another file; closes an old session if necessary.

        Idle sessions are closed first. If there are none, the client with the most sessions (at
        least two) loses the session that was unused for longest.
        """
        if len(self._sessions) < MAX_SESSIONS:
            return True
        held = Counter(holder for holder, _ in self._sessions)
        giving = [
            key
            for key, session in self._sessions.items()
            if now_ns - session.used_ns > GIVES_WAY_NS or (key[0] != peer and held[key[0]] > 1)
        ]
        if not giving:
            return False
        self._end(min(giving, key=lambda key: (-held[key[0]], self._sessions[key].used_ns)))
        self.given_up += 1
        return True

    def _forget_idle(self, now_ns: int) -> None:
        idle = [key for key, s in self._sessions.items() if now_ns - s.used_ns > IDLE_NS]
        for key in idle:
            self._end(key)


def _nothing(result: object) -> None:
    """Ignore the result of closing a file."""


class FilesOnLink:
    """Message source with a `FileServer`'s replies for one link, for the paced queue."""

    def __init__(self, files: FileServer, link: int) -> None:
        self._files, self._link = files, link

    def wait_ns(self, now_ns: int) -> int | None:
        """Time until a reply may be sent [ns]; None if none waits."""
        return self._files.wait_ns(now_ns, self._link)

    def take(self, now_ns: int, rate_bytes_s: float) -> Message | None:
        """Return the next reply for this link."""
        return self._files.take(now_ns, rate_bytes_s, self._link)


def path_of(request: FtpPacket) -> str:
    """Path in a file request; the NUL that some clients append is cut off."""
    try:
        return request.data.split(b"\0", 1)[0].decode()
    except UnicodeDecodeError as error:
        raise FileRefused(FtpError.FILE_NOT_FOUND) from error


def fitting(entries: list[bytes]) -> Iterator[bytes]:
    """Join as many whole directory entries as fit into one reply, each ended by NUL."""
    room = DATA_SIZE
    for entry in entries:
        room -= len(entry) + 1
        if room < 0:
            return
        yield entry + b"\0"
