"""What links of every kind share; `uavrt.mavlink.transport` opens them.

A link is opened once, loudly: what is wrong is a `LinkError` with its remedy. After that it
mends itself: a lost serial adapter or TCP peer is tried again every second, and meanwhile
frames to send are dropped and counted. Received frames go to one callback, at once, in the
loop's thread. No thread, no blocking call.

Nothing that comes by a wire may end the reading of it. A frame whose handler fails is counted
and logged, here, for links of every kind and on both sides, and the next frame is read.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Protocol

from uavrt.log import get_logger
from uavrt.mavlink.address import Address
from uavrt.mavlink.frame import FrameParser

log = get_logger()


class Parser(Protocol):
    """Cuts bytes into what its handler is called with, and counts what is none."""

    received: int
    bad_crc: int
    skipped_bytes: int

    def feed(self, data: bytes) -> list[Any]:
        """Take bytes; give what they complete, each with its bytes as ``raw``."""
        ...

    def reset(self) -> None:
        """Begin anew."""
        ...


RETRY_S = 1.0
MAX_PENDING = 16_384
"""Bytes that may wait for the system to take them; more frames are dropped."""


@dataclass(slots=True)
class LinkCounters:
    """Everything counted since the link was opened."""

    received: int = 0
    bad_crc: int = 0
    skipped_bytes: int = 0
    sent: int = 0
    dropped: int = 0
    """Frames not sent: no peer yet, link down, or the system takes no more."""
    reconnects: int = 0
    faults: int = 0
    """Frames whose handler failed: a defect of ours, or a disk that takes no more."""


class Link:
    """One link; subclasses know the transport.

    `on_frame`: called with each received frame.
    `parser`: of another protocol than MAVLink: then `on_frame` takes what it gives.
    """

    def __init__(
        self, address: Address, on_frame: Callable[[Any], None], parser: Parser | None = None
    ) -> None:
        self.address = address
        self._on_frame = on_frame
        self._parser: Parser = FrameParser() if parser is None else parser
        self._sent = 0
        self._dropped = 0
        self._reconnects = 0
        self._faults = 0
        self.frame_age_ns = 0
        """How long ago the frame that is being handed over arrived."""

    async def open(self) -> None:
        """Open it; raises `LinkError`."""
        raise NotImplementedError

    def send(self, frame: bytes) -> bool:
        """Send one frame without waiting; False (and counted) when it could not be."""
        sent = self._write(frame)
        if sent:
            self._sent += 1
        else:
            self._dropped += 1
        return sent

    async def close(self) -> None:
        """Close it for good."""
        raise NotImplementedError

    @property
    def delay_s(self) -> float:
        """How long a frame would wait on this computer before it leaves."""
        return 0.0

    @property
    def counters(self) -> LinkCounters:
        """Counts so far."""
        return LinkCounters(
            received=self._parser.received,
            bad_crc=self._parser.bad_crc,
            skipped_bytes=self._parser.skipped_bytes,
            sent=self._sent,
            dropped=self._dropped,
            reconnects=self._reconnects,
            faults=self._faults,
        )

    def health(self) -> dict[str, float]:
        """Counts with names for a health record."""
        return {f"link_{name}": value for name, value in asdict(self.counters).items()}

    def _write(self, frame: bytes) -> bool:
        raise NotImplementedError

    def _take(self, data: bytes) -> None:
        for frame in self._parser.feed(data):
            try:
                self._on_frame(frame)
            except Exception:  # whatever it is, the next frame must be read
                self._faults += 1
                if self._faults.bit_count() == 1:  # 1, 2, 4, 8 …: a flood must not fill the log
                    log.exception(
                        "frame not handled",
                        address=str(self.address),
                        frame=frame.raw.hex(),
                        faults=self._faults,
                    )
