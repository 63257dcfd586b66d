"""Base class of links over UDP, TCP and serial ports; `uavrt.link.mavlink.links.transport`
opens them.

A link that cannot be opened raises a `LinkError` with its remedy. An open link recovers by
itself: a lost serial adapter or TCP peer is tried again every second. Meanwhile, frames to send
are dropped and counted. Received frames go to one callback, at once, in the loop's thread.
Links use no thread and no blocking call.

No input ends the reading: a frame whose handler fails is counted and logged.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Protocol

from uavrt.core.log import get_logger
from uavrt.link.mavlink.frame import FrameParser
from uavrt.link.mavlink.links.address import Address

log = get_logger()


class Parser(Protocol):
    """Protocol of a parser that splits bytes into frames and counts bytes outside of frames."""

    received: int
    bad_crc: int
    skipped_bytes: int

    def feed(self, data: bytes) -> list[Any]:
        """Add bytes; return the frames they complete, each with its bytes as ``raw``."""
        ...

    def reset(self) -> None:
        """Drop the bytes of an incomplete frame."""
        ...


RETRY_S = 1.0
MAX_PENDING = 16_384
"""Number of bytes in a TCP link's send buffer above which further frames are dropped."""


@dataclass(slots=True)
class LinkCounters:
    """Counts of frames and bytes since a link was opened."""

    received: int = 0
    bad_crc: int = 0
    skipped_bytes: int = 0
    sent: int = 0
    dropped: int = 0
    """Number of frames not sent: no known peer, link down, or full send buffer."""
    reconnects: int = 0
    faults: int = 0
    """Number of received frames whose handler failed, by a defect or a full disk."""


class Link:
    """Base of the links over UDP, TCP and serial ports."""

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
        """Time since the frame being handled arrived [ns]."""

    async def open(self) -> None:
        """Open the link; raises `LinkError`."""
        raise NotImplementedError

    def send(self, frame: bytes) -> bool:
        """Send one frame without waiting; False, and counted, if it could not be sent."""
        sent = self._write(frame)
        if sent:
            self._sent += 1
        else:
            self._dropped += 1
        return sent

    async def close(self) -> None:
        """Close the link for good."""
        raise NotImplementedError

    @property
    def delay_s(self) -> float:
        """Time that a new frame would wait in this computer's buffers [s]."""
        return 0.0

    @property
    def counters(self) -> LinkCounters:
        """Counts of frames and bytes since the link was opened."""
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
        """Counts of frames and bytes by name, for a health record."""
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
                        "a received frame was skipped after an unexpected error",
                        address=str(self.address),
                        frame=frame.raw.hex(),
                        faults=self._faults,
                    )
