"""Position of this computer from a GPS receiver that sends NMEA by serial port, UDP or TCP
(`uavrt.link.mavlink` reconnects); unknown once it is old.
"""

import asyncio
import contextlib
from collections.abc import Callable

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import UavrtError
from uavrt.core.log import get_logger
from uavrt.formats.nmea import BAUD, Sentence, SentenceParser
from uavrt.link.mavlink.links.address import parse_address
from uavrt.link.mavlink.links.mavlink_link import Link
from uavrt.link.mavlink.links.transport import keep_open

log = get_logger()

SILENCE_S = 10.0
"""Age after which a GPS position counts as unknown [s]; a receiver sends one each second."""


class MyPlace:
    """The position of this computer as its GPS receiver reports it."""

    def __init__(self, clock_s: Callable[[], float] = monotonic_s) -> None:
        self._clock_s = clock_s
        self._place: tuple[float, float] | None = None
        self._heard_s = 0.0
        self._task: asyncio.Task[None] | None = None
        self._link: Link | None = None
        self.address = ""
        self.error: str | None = None
        """Reason why the receiver cannot be read; None while it can."""

    @property
    def place(self) -> tuple[float, float] | None:
        """Latitude and longitude [deg]; None if unknown or too old."""
        known = self._clock_s() - self._heard_s < SILENCE_S
        return self._place if known else None

    @property
    def age_s(self) -> float:
        """Age of the last position [s]."""
        return self._clock_s() - self._heard_s

    @property
    def counters(self) -> dict[str, int]:
        """Numbers of accepted and refused sentences, and of skipped bytes."""
        if self._link is None:
            return {}
        counts = self._link.counters
        return {
            "sentences": counts.received,
            "refused": counts.bad_crc,
            "skipped_bytes": counts.skipped_bytes,
        }

    def receive(self, sentence: Sentence) -> None:
        """Store the position that an NMEA sentence contains, if any."""
        place = sentence.place
        if place is not None:
            self._place, self._heard_s = place, self._clock_s()

    async def listen(self, address: str) -> None:
        """Switch to a receiver's address; an empty address closes the receiver."""
        if address == self.address:
            return
        await self.close()
        self.address, self._place, self.error = address, None, None
        if address:
            self._task = asyncio.get_running_loop().create_task(self._run(address))

    async def close(self) -> None:
        """Close the link to the GPS receiver."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task
            self._task = None
        self.address = ""

    async def _run(self, address: str) -> None:
        where = parse_address(address, baud=BAUD)
        await keep_open(
            where, self.receive, SentenceParser(), opened=self._opened, failed=self._failed
        )

    def _opened(self, link: Link | None) -> None:
        self._link = link
        if link is not None:
            self.error = None

    def _failed(self, error: UavrtError) -> None:
        if self.error is None:
            log.warning("GPS position unavailable", reason=str(error))
        self.error = str(error)
