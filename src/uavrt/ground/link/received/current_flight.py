"""Record a vehicle's flight on the ground station: begin, resume, write, show and end it."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from uavrt.config.tags.tag_corrections import still_holds
from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.errors import ConfigError, UavrtError
from uavrt.core.log import get_logger
from uavrt.core.messages import Beep, BurstInside, PulsePose, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.reading.flight_reader import read_beeps
from uavrt.flight.reading.noted_places import Mark, home_note
from uavrt.flight.reading.outline import battery_note
from uavrt.ground.link.received.feed import Feed
from uavrt.ground.store.drone_directory import flight_under_way
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.ground.store.ground_settings import GroundStore
from uavrt.ground.store.stored_flights import FlightLibrary
from uavrt.link.mavlink.links.address import parse_address

log = get_logger()

LATE_PULSES_NS = 5 * NANOSECONDS_PER_SECOND
"""Margin after a stop of detection [ns]. Pulses that begin later belong to the next flight."""
COMMIT_S = 0.15
"""Interval between writes of received pulses to the disk [s]; each is followed by receipts."""
BATTERY_STEP_PERCENT = 5
"""Change of the battery charge that is recorded [%]; the charge at the start is, too."""
ENDS_WITHIN_S = 10.0
"""Longest wait for a slow disk to write the flight when the session ends [s]."""
_PAST_FLIGHTS = 10
"""Number of past flights that are searched for measured pulse trains to show at start-up."""


class CurrentFlight:
    """The flight now being recorded, or the last one after it has ended."""

    def __init__(
        self,
        store: GroundStore,
        clock: Clock,
        feed: Feed,
        also: Callable[[PulsePose | BurstInside], object],
    ) -> None:
        self.keeper = FlightKeeper(
            store.directory,
            clock,
            store.disk,
            also=also,
            on_written=self._written,
            begun=store.flights_begun,
        )
        self.marks: list[Mark] = []
        self.resumed = False
        """True if this flight was resumed after a restart of this program."""
        self._store, self._clock, self._feed = store, clock, feed
        self._stopped_ns: int | None = None
        self._home_kept: tuple[str | None, tuple[float, float] | None] = (None, None)
        self._battery_kept: tuple[str | None, int] = (None, 0)
        self._commit_due = False
        self._committed_s = 0.0
        self._unshown: list[tuple[PulsePose | BurstInside, dict[str, Any]]] = []

    def begin(self, tags: tuple[Tag, ...]) -> str:
        """Begin a flight; return the flight's name."""
        flight_id = self.keeper.begin(tags, self._drones_own())
        self._store.set_flight(flight_id)
        self._stopped_ns, self.resumed = None, False
        self.marks = []
        return flight_id

    def _drones_own(self) -> Path | None:
        """Recording of this flight by a drone side on this computer; None if there is none."""
        if self._store.system_id is not None:
            return None
        with suppress(ConfigError):
            addresses = map(parse_address, self._store.settings.address.split())
            if all(address.is_loopback for address in addresses):
                return flight_under_way(self._store.directory)
        return None

    async def resume(self, library: FlightLibrary) -> tuple[Tag, ...] | None:
        """Continue a flight that a restart interrupted; return its tags, None without one."""
        kept, disk = self._store.current_flight, self._store.disk
        if kept is None:
            return None
        try:
            columns, summary, places = await disk.run(
                lambda: (library.columns(kept), library.summary(kept), library.places(kept))
            )
        except UavrtError as error:
            self._feed.note(4, f"the recording of flight {kept} cannot be continued: {error}")
            return None
        if not await disk.run(self.keeper.resume, kept):
            return None
        self.keeper.load(columns)
        self.resumed, self.marks = True, list(places.marks)
        self._feed.note(6, f"flight {kept} resumed")
        return summary.tags

    def end(self) -> None:
        """End the flight; pulses of this flight that arrive later are still accepted."""
        self.keeper.queue.commit()
        self.keeper.end()
        self._stopped_ns = self._clock.now_ns()
        self._store.set_flight(None)

    def is_of_next(self, event: PulsePose, skew_ns: int) -> bool:
        """True if a pulse began after this flight: another station restarted detection."""
        if not self.keeper.ended or self._stopped_ns is None:
            return False
        return event.pulse.start_time_ns + skew_ns > self._stopped_ns + LATE_PULSES_NS

    def note_home(self, home: tuple[float, float] | None, now_ns: int) -> None:
        """Write the home position into the flight, at first and whenever it changes."""
        key = (self.keeper.flight_id, home)
        if home is not None and not self.keeper.ended and key != self._home_kept:
            self._home_kept = key
            self.keeper.add_note(home_note(*home), now_ns)

    def note_battery(self, percent: int | None, now_ns: int) -> None:
        """Write the battery charge into the flight, for the season's summary."""
        flight_id, noted = self.keeper.flight_id, self._battery_kept
        if percent is None or self.keeper.ended:
            return
        if noted[0] != flight_id or abs(noted[1] - percent) >= BATTERY_STEP_PERCENT:
            self._battery_kept = (flight_id, percent)
            self.keeper.add_note(battery_note(percent), now_ns)

    def show_soon(self, event: PulsePose | BurstInside, record: dict[str, Any]) -> None:
        """Show a pulse or burst on the pages after the next write, which follows within 1 s."""
        self._unshown.append((event, record))
        self.commit_soon()

    def commit_soon(self) -> None:
        """Schedule a write of all received data, at least `COMMIT_S` after the last write."""
        if not self._commit_due:
            self._commit_due = True
            wait_s = max(0.0, self._committed_s + COMMIT_S - monotonic_s())
            asyncio.get_running_loop().call_later(wait_s, self.commit)

    def commit(self) -> None:
        """Start to write all received data to the disk."""
        self._commit_due = False
        self._committed_s = monotonic_s()
        self.keeper.queue.commit()

    def _written(self) -> None:
        """Show the written records on the page, or the reason why the disk refused them."""
        if text := self.keeper.queue.mended():
            self._feed.note(3, text)
        self.show_received()

    def show_received(self) -> None:
        """Show the records on the page that were received since the last call."""
        unshown, self._unshown = self._unshown, []
        for event, record in unshown:
            self._feed.emit(event)
            if record["flight_id"] is not None:
                self._feed.send("pulse" if isinstance(event, PulsePose) else "burst", record)

    async def put_away(self) -> None:
        """Write all received data to the disk; log an error if that fails."""
        self.keeper.close()
        await self.keeper.queue.settle(ENDS_WITHIN_S)
        self.show_received()
        taken, durable = self.keeper.queue.progress
        if taken > durable:
            reason = self.keeper.queue.fault or "the disk does not answer"
            log.error(
                "pulses cannot be stored here; the drone keeps them and sends them again",
                pulses=taken - durable,
                reason=reason,
            )


def last_beeps(directory: Path, flight_id: str | None, tags: tuple[Tag, ...]) -> list[Beep]:
    """Read the pulse trains measured in a flight; None: in the latest flight with any."""
    paths = directory.glob(f"{flight_id or '*'}/flight.sqlite")
    with suppress(OSError):
        for path in sorted(paths, key=lambda one: -one.stat().st_mtime)[:_PAST_FLIGHTS]:
            with suppress(UavrtError):
                if beeps := read_beeps(path.parent):
                    return [one for one in beeps if still_holds(one, tags)]
    return []
