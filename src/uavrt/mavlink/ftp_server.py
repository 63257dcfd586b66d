"""A read-only MAVLink FTP server: flights from the drone over whatever link there is.

It gives replies one by one to the paced queue, after pulses, so that a download takes only what
they leave. How clients differ, and what follows from it (reference/mavlink.md §2):

- Some choose a random session id and take only replies that echo it (MAVProxy), others use 0
  (QGroundControl, MAVSDK): a file is opened under the id that the client sent, for each client
  apart.
- Some first ask for opcode 16, the listing with times: unknown opcodes get a NAK at once.
- A request that comes again with the same sequence number gets the same reply again.
"""

from collections import OrderedDict, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import BinaryIO

from uavrt.mavlink.dialect import FileTransferProtocol
from uavrt.mavlink.discovery import Peer
from uavrt.mavlink.ftp_files import CRC_PART, FileRefused, FileTree, close, read_at
from uavrt.mavlink.ftp_wire import DATA_SIZE, FtpError, FtpPacket, Opcode, checksum
from uavrt.mavlink.message import Message
from uavrt.units import NANOSECONDS_PER_SECOND, ns_from_s

MAX_SESSIONS = 8
IDLE_NS = ns_from_s(300.0)
"""A session that its client has forgotten is given up."""
MAX_CLIENTS = 16
BURST_S = 0.5
MOST_BURST_BYTES = 32 * DATA_SIZE
"""After so much a client says whether it has lost anything, and so how fast the link is."""
WAITING = 32
READ_ONLY = frozenset(
    {
        Opcode.CREATE_FILE,
        Opcode.WRITE_FILE,
        Opcode.REMOVE_FILE,
        Opcode.CREATE_DIRECTORY,
        Opcode.REMOVE_DIRECTORY,
        Opcode.OPEN_FILE_WO,
        Opcode.TRUNCATE_FILE,
        Opcode.RENAME,
    }
)


@dataclass(slots=True)
class _Session:
    file: BinaryIO | bytes
    size: int
    used_ns: int


@dataclass(slots=True)
class _Burst:
    peer: Peer
    session: int
    sequence: int
    offset: int
    end: int | None
    chunk: int


@dataclass(slots=True)
class _Client:
    """The last request of a client, and what it was answered."""

    request: FtpPacket
    reply: FtpPacket | None = None
    data_sent_ns: int | None = None
    """When the last data went to it, for the round trip."""


@dataclass(slots=True)
class _Crc:
    peer: Peer
    request: FtpPacket
    file: BinaryIO | bytes
    offset: int = 0
    value: int = 0


class FileServer:
    """Serves a `FileTree`; a source of the paced queue.

    Parameters
    ----------
    tree : FileTree
        What is served.
    wake : callable
        Called when there is a new reply to send.
    """

    def __init__(self, tree: FileTree, wake: Callable[[], None] = lambda: None) -> None:
        self.tree = tree
        self._wake = wake
        self._sessions: dict[tuple[Peer, int], _Session] = {}
        self._clients: OrderedDict[Peer, _Client] = OrderedDict()
        self._replies: deque[tuple[Peer, FtpPacket]] = deque()
        self._burst: dict[Peer, _Burst] = {}
        self._crcs: deque[_Crc] = deque()
        self.requests = 0
        self.refused = 0
        self.repeated = 0
        self.bytes_sent = 0

    def receive(self, payload: bytes, peer: Peer, now_ns: int) -> float | None:
        """Take a request; give the round trip since the last data, if it shows one [s]."""
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
            if client.data_sent_ns is not None and peer not in self._burst:
                trip_s = (now_ns - client.data_sent_ns) / NANOSECONDS_PER_SECOND
        self._clients[peer] = _Client(request)
        self._clients.move_to_end(peer)
        while len(self._clients) > MAX_CLIENTS:
            self._clients.popitem(last=False)
        self._forget_idle(now_ns)
        try:
            self._serve(request, peer, now_ns)
        except FileRefused as refusal:
            self._refuse(request, peer, refusal)
        self._wake()
        return trip_s

    def wait_ns(self, now_ns: int) -> int | None:
        """A source's: time until a reply may go, None when there is none."""
        return 0 if self._replies or self._burst else None

    def take(self, now_ns: int, rate_bytes_s: float) -> Message | None:
        """A source's: the next reply."""
        if self._replies:
            peer, packet = self._replies.popleft()
        else:
            peer, packet = self._burst_part(now_ns, rate_bytes_s)
        if packet.request_opcode in (Opcode.READ_FILE, Opcode.BURST_READ_FILE):
            self.bytes_sent += len(packet.data)
            client = self._clients.get(peer)
            if client is not None:
                client.data_sent_ns = now_ns
        return FileTransferProtocol(
            target_network=0,
            target_system=peer.system_id,
            target_component=peer.component_id,
            payload=packet.encode(),
        )

    def work(self) -> None:
        """Go on with a checksum: a megabyte at a time, about a millisecond."""
        if not self._crcs:
            return
        job = self._crcs[0]
        try:
            part = read_at(job.file, job.offset, CRC_PART)
        except FileRefused as refusal:
            self._crcs.popleft()
            close(job.file)
            self._refuse(job.request, job.peer, refusal)
            return
        if part:
            job.value = checksum(part, job.value)
            job.offset += len(part)
            return
        self._crcs.popleft()
        close(job.file)
        self._accept(job.request, job.peer, job.value.to_bytes(4, "little"))
        self._wake()

    def close(self) -> None:
        """Close all files."""
        for key in list(self._sessions):
            self._end(key)
        while self._crcs:
            close(self._crcs.popleft().file)

    def counters(self) -> dict[str, float]:
        """Counts with names for a health record."""
        return {
            "ftp_requests": self.requests,
            "ftp_refused": self.refused,
            "ftp_repeated": self.repeated,
            "ftp_sessions": len(self._sessions),
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
            case Opcode.CALC_FILE_CRC32:
                file, _ = self.tree.open(_path_of(request))
                self._crcs.append(_Crc(peer, request, file))
            case _ if request.opcode in READ_ONLY:
                raise FileRefused(FtpError.FILE_PROTECTED)
            case _:
                raise FileRefused(FtpError.UNKNOWN_COMMAND)

    def _list(self, request: FtpPacket, peer: Peer) -> None:
        entries = self.tree.entries(_path_of(request))[request.offset :]
        if not entries:
            raise FileRefused(FtpError.END_OF_FILE)
        self._accept(request, peer, b"".join(_fitting(entries)))

    def _open(self, request: FtpPacket, peer: Peer, now_ns: int) -> None:
        key = (peer, request.session)
        if key not in self._sessions and len(self._sessions) >= MAX_SESSIONS:
            raise FileRefused(FtpError.NO_SESSIONS_AVAILABLE)
        file, size = self.tree.open(_path_of(request))
        if size >= 2**32:
            close(file)
            raise FileRefused(FtpError.FAIL)  # offsets have 32 bits
        self._end(key)  # a client that uses the id again has forgotten the file before
        self._sessions[key] = _Session(file, size, now_ns)
        self._accept(request, peer, size.to_bytes(4, "little"))

    def _read(self, request: FtpPacket, peer: Peer, now_ns: int) -> None:
        session = self._session(request, peer, now_ns)
        data = read_at(session.file, request.offset, min(request.size or DATA_SIZE, DATA_SIZE))
        if not data:
            raise FileRefused(FtpError.END_OF_FILE)
        self._accept(request, peer, data, offset=request.offset)

    def _start_burst(self, request: FtpPacket, peer: Peer, now_ns: int) -> None:
        session = self._session(request, peer, now_ns)
        if request.offset >= session.size:
            raise FileRefused(FtpError.END_OF_FILE)
        self._burst[peer] = _Burst(
            peer=peer,
            session=request.session,
            sequence=request.sequence,
            offset=request.offset,
            end=None,
            chunk=min(request.size or DATA_SIZE, DATA_SIZE),
        )

    def _burst_part(self, now_ns: int, rate_bytes_s: float) -> tuple[Peer, FtpPacket]:
        """The next part of a burst; several clients take turns."""
        peer, burst = next(iter(self._burst.items()))
        del self._burst[peer]
        if burst.end is None:
            # Whole parts only: pymavlink takes a shorter one for the end of the file.
            size = min(MOST_BURST_BYTES, rate_bytes_s * BURST_S)
            burst.end = burst.offset + max(1, int(size / burst.chunk)) * burst.chunk
        burst.sequence += 1
        part = FtpPacket(
            sequence=burst.sequence,
            session=burst.session,
            opcode=Opcode.NAK,
            request_opcode=Opcode.BURST_READ_FILE,
            offset=burst.offset,
            data=bytes((FtpError.END_OF_FILE,)),
        )
        session = self._sessions.get((peer, burst.session))
        data = b""
        if session is not None:
            session.used_ns = now_ns
            try:
                data = read_at(session.file, burst.offset, burst.chunk)
            except FileRefused:
                self.refused += 1
        if not data:
            return peer, part
        after = burst.offset + len(data)
        part = FtpPacket(
            sequence=burst.sequence,
            session=burst.session,
            opcode=Opcode.ACK,
            request_opcode=Opcode.BURST_READ_FILE,
            burst_complete=after >= burst.end,
            offset=burst.offset,
            data=data,
        )
        burst.offset = after
        if not part.burst_complete:
            self._burst[peer] = burst
        return peer, part

    # ------------------------------------------------------------------- replies

    def _accept(
        self, request: FtpPacket, peer: Peer, data: bytes = b"", *, offset: int = 0
    ) -> None:
        self._reply(
            request,
            peer,
            FtpPacket(
                sequence=request.sequence + 1,
                session=request.session,
                opcode=Opcode.ACK,
                request_opcode=request.opcode,
                offset=offset,
                data=data,
            ),
        )

    def _refuse(self, request: FtpPacket, peer: Peer, refusal: FileRefused) -> None:
        if refusal.error is not FtpError.END_OF_FILE:
            self.refused += 1
        number = (refusal.number,) if refusal.error is FtpError.FAIL_ERRNO else ()
        self._reply(
            request,
            peer,
            FtpPacket(
                sequence=request.sequence + 1,
                session=request.session,
                opcode=Opcode.NAK,
                request_opcode=request.opcode,
                offset=request.offset,
                data=bytes((refusal.error, *number)),
            ),
        )

    def _reply(self, request: FtpPacket, peer: Peer, reply: FtpPacket) -> None:
        client = self._clients.get(peer)
        if client is not None and client.request == request:
            client.reply = reply
        self._put(peer, reply)

    def _put(self, peer: Peer, reply: FtpPacket) -> None:
        self._replies.append((peer, reply))
        while len(self._replies) > WAITING:
            self._replies.popleft()  # its client asks again

    def _repeat(self, peer: Peer, client: _Client) -> None:
        """The reply was lost, or has not been sent yet: never do the request twice."""
        self.repeated += 1
        reply = client.reply
        if reply is not None and (peer, reply) not in self._replies:
            self._put(peer, reply)
        elif client.request.opcode == Opcode.BURST_READ_FILE and peer not in self._burst:
            session = self._sessions.get((peer, client.request.session))
            if session is not None:
                self._start_burst(client.request, peer, session.used_ns)
        self._wake()

    # ------------------------------------------------------------------ sessions

    def _session(self, request: FtpPacket, peer: Peer, now_ns: int) -> _Session:
        session = self._sessions.get((peer, request.session))
        if session is None:
            raise FileRefused(FtpError.INVALID_SESSION)
        session.used_ns = now_ns
        return session

    def _end(self, key: tuple[Peer, int]) -> None:
        session = self._sessions.pop(key, None)
        if session is not None:
            close(session.file)

    def _forget_idle(self, now_ns: int) -> None:
        idle = [key for key, s in self._sessions.items() if now_ns - s.used_ns > IDLE_NS]
        for key in idle:
            self._end(key)


def _path_of(request: FtpPacket) -> str:
    """Path in a request: up to a NUL that some clients send along."""
    try:
        return request.data.split(b"\0", 1)[0].decode()
    except UnicodeDecodeError as error:
        raise FileRefused(FtpError.FILE_NOT_FOUND) from error


def _fitting(entries: list[bytes]) -> Iterator[bytes]:
    """As many whole entries as a reply holds, each ended by NUL."""
    room = DATA_SIZE
    for entry in entries:
        room -= len(entry) + 1
        if room < 0:
            return
        yield entry + b"\0"
