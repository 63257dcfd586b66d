"""The links of a drone: opened again after faults, and who is present on them."""

import asyncio
from collections.abc import Coroutine, Mapping
from typing import Any

from uavrt.errors import ConfigError, LinkError
from uavrt.log import get_logger
from uavrt.mavlink.connection import Connection

log = get_logger()

LINK_RETRY_S = 3.0
PEERS = ("autopilot", "ground station")


class LinkWatch:
    """Serves the links at `addresses`, by number; the autopilot's is number 0."""

    def __init__(self, link: Connection, addresses: Mapping[int, str]) -> None:
        self._link, self._addresses = link, addresses
        self._faults: dict[int, str] = {}
        self._heard = (False, False)
        self._stations: frozenset[tuple[int, int]] = frozenset()
        """Ground stations that were present last."""

    def tasks(self) -> list[Coroutine[Any, Any, None]]:
        """Get what serves the links until it is cancelled."""
        served = [self._serve(number, address) for number, address in self._addresses.items()]
        return [*served, self._link.keep_time()] if served else []

    async def _serve(self, number: int, address: str) -> None:
        """Open a link, again and again if need be: a missing adapter may be plugged in."""
        while True:
            try:
                await self._link.serve(number, address)
            except (LinkError, ConfigError) as error:
                fault = str(error)
                if fault != self._faults.get(number):
                    log.warning("link fault", reason=fault)
                self._faults[number] = fault
            await asyncio.sleep(LINK_RETRY_S)

    @property
    def linked(self) -> bool:
        """Whether there is any link."""
        return bool(self._addresses)

    @property
    def failed(self) -> bool:
        """Whether the autopilot's link could not be opened."""
        return 0 in self._addresses and self._link.link is None and 0 in self._faults

    def newcomer(self) -> bool:
        """Whether a ground station has appeared since the last call."""
        before, self._stations = self._stations, frozenset(self._link.stations_silent_s())
        return not self._stations <= before

    def log_presence(self) -> None:
        """Log it when the autopilot or the ground appears or falls silent."""
        heard = (self._link.autopilot_present, self._link.station_present)
        for name, before, now in zip(PEERS, self._heard, heard, strict=True):
            if before != now:
                event = f"{name} heard" if now else f"{name} lost"
                log.info(event, **self._link.peers())
        self._heard = heard
