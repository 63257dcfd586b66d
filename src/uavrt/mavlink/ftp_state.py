"""What the file server remembers of its clients, and how it reaches the disk."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, BinaryIO, Protocol, TypeVar

from uavrt.mavlink.discovery import Peer
from uavrt.mavlink.ftp_files import FileRefused
from uavrt.mavlink.ftp_wire import DATA_SIZE, FtpError, FtpPacket, Opcode
from uavrt.mavlink.message import Message

if TYPE_CHECKING:
    from uavrt.mavlink.ftp_server import FileServer

T = TypeVar("T")

BURST_S = 0.5
MOST_BURST_BYTES = 32 * DATA_SIZE
"""After so much a client says whether it has lost anything, and so how fast the link is."""


class Disk(Protocol):
    """Does what may take as long as a disk likes."""

    def __call__(self, job: Callable[[], T], then: Callable[[T], None]) -> bool:
        """Do `job` and give `then` its result; False when too much is to be done already."""


def at_once(job: Callable[[], T], then: Callable[[T], None]) -> bool:
    """A disk that is waited for."""
    then(job())
    return True


@dataclass(slots=True)
class Session:
    """An open file of a client."""

    file: BinaryIO | bytes
    size: int
    used_ns: int


@dataclass(slots=True)
class Burst:
    """A part of a file that was read and leaves piece by piece."""

    peer: Peer
    request: FtpPacket
    sequence: int
    offset: int
    data: bytes
    """From `offset` on; shorter than asked for at the end of the file."""
    chunk: int
    size: int = 0
    """Of the whole burst; 0 until the first piece leaves, for it depends on the link's rate."""
    ended: bool = False

    def next_part(self, rate_bytes_s: float) -> FtpPacket:
        """Give the next piece."""
        if self.size == 0:
            # Whole parts only: pymavlink takes a shorter one for the end of the file.
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
    """The last request of a client, and what it was answered."""

    request: FtpPacket
    reply: FtpPacket | None = None
    reading: bool = False
    """The disk has not answered yet."""
    data_sent_ns: int | None = None
    """When the last data went to it, for the round trip."""


@dataclass(slots=True)
class Crc:
    """A checksum in the making."""

    peer: Peer
    request: FtpPacket
    file: BinaryIO | bytes
    offset: int = 0
    value: int = 0
    reading: bool = False


class FilesOnLink:
    """The replies of a `FileServer` that leave by one link; a source of the paced queue."""

    def __init__(self, files: "FileServer", link: int) -> None:
        self._files, self._link = files, link

    def wait_ns(self, now_ns: int) -> int | None:
        """A source's: time until a reply may go, None when there is none."""
        return self._files.wait_ns(now_ns, self._link)

    def take(self, now_ns: int, rate_bytes_s: float) -> Message | None:
        """A source's: the next reply."""
        return self._files.take(now_ns, rate_bytes_s, self._link)


def path_of(request: FtpPacket) -> str:
    """Path in a request: up to a NUL that some clients send along."""
    try:
        return request.data.split(b"\0", 1)[0].decode()
    except UnicodeDecodeError as error:
        raise FileRefused(FtpError.FILE_NOT_FOUND) from error


def fitting(entries: list[bytes]) -> Iterator[bytes]:
    """As many whole entries as a reply holds, each ended by NUL."""
    room = DATA_SIZE
    for entry in entries:
        room -= len(entry) + 1
        if room < 0:
            return
        yield entry + b"\0"
