"""The ground's own flight of one vehicle: begun, resumed, written, shown, ended."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from uavrt.clock import Clock, monotonic_s
from uavrt.config.tag_corrections import still_holds
from uavrt.errors import ConfigError, UavrtError
from uavrt.ground.link.feed import Feed
from uavrt.ground.store.beside_drone import flight_under_way
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.ground.store.flights import FlightLibrary
from uavrt.ground.store.settings import GroundStore
from uavrt.log import get_logger
from uavrt.mavlink.address import parse_address
from uavrt.messages import Beep, BurstInside, PulsePose, Tag
from uavrt.recording.flight_reader import read_beeps
from uavrt.recording.outline import battery_note
from uavrt.recording.places import Mark, home_note
from uavrt.units import NANOSECONDS_PER_SECOND

log = get_logger()

LATE_PULSES_NS = 5 * NANOSECONDS_PER_SECOND
"""Delay after a stop beyond which a pulse belongs to the next flight, unless sent before it
[ns]."""
COMMIT_S = 0.15
"""Interval in which pulses are collected for one write [s]; receipts follow each write."""
BATTERY_STEP_PERCENT = 5
"""Battery charge is written at the start of a flight and after each step of this size [%]."""
ENDS_WITHIN_S = 10.0
"""How long a session that ends waits for a slow disk."""
_LOOKS_BACK = 10
"""Number of past flights searched for measurements to show at the start of the next."""


class CurrentFlight:
    """The flight in progress, or the one that ended last."""

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
        """True if a restart interrupted it."""
        self._store, self._clock, self._feed = store, clock, feed
        self._stopped_ns: int | None = None
        self._home_kept: tuple[str | None, tuple[float, float] | None] = (None, None)
        self._battery_kept: tuple[str | None, int] = (None, 0)
        self._commit_due = False
        self._committed_s = 0.0
        self._unshown: list[tuple[PulsePose | BurstInside, dict[str, Any]]] = []

    def begin(self, tags: tuple[Tag, ...]) -> str:
        """Begin a flight; return its name."""
        flight_id = self.keeper.begin(tags, self._drones_own())
        self._store.set_flight(flight_id)
        self._stopped_ns, self.resumed = None, False
        self.marks = []
        return flight_id

    def _drones_own(self) -> Path | None:
        """Get the drone's own recording of its flight, if it is in our directory.

        Only packets from this computer can come from the drone side that runs on it.
        """
        if self._store.system_id is not None:
            return None
        with suppress(ConfigError):
            addresses = map(parse_address, self._store.settings.address.split())
            if all(address.is_loopback for address in addresses):
                return flight_under_way(self._store.directory)
        return None

    async def resume(self, library: FlightLibrary) -> tuple[Tag, ...] | None:
        """Continue with the flight that a restart interrupted; return its tags."""
        kept, disk = self._store.current_flight, self._store.disk
        if kept is None:
            return None
        try:
            columns, summary, places = await disk.run(
                lambda: (library.columns(kept), library.summary(kept), library.places(kept))
            )
        except UavrtError as error:
            self._feed.note(4, f"flight {kept} does not go on: {error}")
            return None
        if not await disk.run(self.keeper.resume, kept):
            return None
        self.keeper.load(columns)
        self.resumed, self.marks = True, list(places.marks)
        self._feed.note(6, f"flight {kept} goes on")
        return summary.tags

    def end(self) -> None:
        """End the flight; late pulses of it are still accepted."""
        self.keeper.queue.commit()
        self.keeper.end()
        self._stopped_ns = self._clock.now_ns()
        self._store.set_flight(None)

    def is_of_next(self, event: PulsePose, skew_ns: int) -> bool:
        """Whether a pulse was sent after the end: another station has started again."""
        if not self.keeper.ended or self._stopped_ns is None:
            return False
        return event.pulse.start_time_ns + skew_ns > self._stopped_ns + LATE_PULSES_NS

    def add_mark(self, mark: Mark) -> None:
        """Add a mark of the operator to those that are shown."""
        self.marks.append(mark)

    def note_home(self, home: tuple[float, float] | None, now_ns: int) -> None:
        """Write the home position into the flight, once and when it changes."""
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
        """Show a received record after the next write, at most a second later."""
        self._unshown.append((event, record))
        self.commit_soon()

    def commit_soon(self) -> None:
        """Request a write of what was received, with what arrives within `COMMIT_S`."""
        if not self._commit_due:
            self._commit_due = True
            wait_s = max(0.0, self._committed_s + COMMIT_S - monotonic_s())
            asyncio.get_running_loop().call_later(wait_s, self.commit)

    def commit(self) -> None:
        """Queue what was received for the disk."""
        self._commit_due = False
        self._committed_s = monotonic_s()
        self.keeper.queue.commit()

    def _written(self) -> None:
        """Show what is on the disk, or why it was refused."""
        if text := self.keeper.queue.mended():
            self._feed.note(3, text)
        self.show_received()

    def show_received(self) -> None:
        """Show what was received since the last time."""
        unshown, self._unshown = self._unshown, []
        for event, record in unshown:
            self._feed.emit(event)
            if record["flight_id"] is not None:
                self._feed.send("pulse" if isinstance(event, PulsePose) else "burst", record)

    async def put_away(self) -> None:
        """Write everything received to the disk; log an error if not all could be written."""
        self.keeper.close()
        await self.keeper.queue.settle(ENDS_WITHIN_S)
        self.show_received()
        taken, durable = self.keeper.queue.progress
        if taken > durable:
            reason = self.keeper.queue.fault or "the disk does not answer"
            log.error(
                "pulses not stored: the drone keeps them", pulses=taken - durable, reason=reason
            )


def last_beeps(directory: Path, flight_id: str | None, tags: tuple[Tag, ...]) -> list[Beep]:
    """Read the measured senders of a flight; without one, of the last flight that has any."""
    paths = directory.glob(f"{flight_id or '*'}/flight.sqlite")
    with suppress(OSError):
        for path in sorted(paths, key=lambda one: -one.stat().st_mtime)[:_LOOKS_BACK]:
            with suppress(UavrtError):
                if beeps := read_beeps(path.parent):
                    return [one for one in beeps if still_holds(one, tags)]
    return []
