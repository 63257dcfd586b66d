"""A ground station: sessions of its vehicles, and actions without an operator.

Without a page, it serves scripts and a first bench test: it uploads tags, starts and stops
detection, and prints each pulse as a line. `uavrt.ground.web.page_program` adds the page.
"""

import asyncio
import json
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.commands import SystemState
from uavrt.core.errors import CommandRefused, LinkError
from uavrt.core.messages import BurstInside, PulsePose, SearchReport, StatusText, Tag
from uavrt.flight.database.plain_database import queries_ended
from uavrt.flight.logs.pulse_files import inside_record, pulse_record
from uavrt.ground.fleet import Fleet
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.keys import NO_KEYS, LinkKeys
from uavrt.ground.link.protocol import Acknowledged, DroneHeartbeat, GroundEvent
from uavrt.ground.link.received.feed import StationNote
from uavrt.ground.link.served_vehicle import ESSENTIAL, ServedVehicle
from uavrt.ground.session import GroundSession
from uavrt.ground.store.ground_settings import GroundStore
from uavrt.ground.store.stored import PULSES_NAME, PulseLines
from uavrt.link.tunnel.generations.wire import command_name
from uavrt.link.tunnel.tag_lists import digest_in, tag_list_digest

START_RETRY_S = 2.0
LAST_PULSES_WAIT_S = 1.0
"""Time without a pulse after which a stopped drone counts as having sent all pulses [s]."""
STOP_TIMEOUT_S = 12.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StationSettings:
    """Options of ``uavrt ground``."""

    directory: Path
    address: str | None = None
    """MAVLink addresses separated by spaces, the preferred one first; None: the last used."""
    my_place: str | None = None
    """Address of a GPS receiver; None: the address used in the last run."""
    dem: str | None = None
    """Elevation file or folder; None: the one used in the last run."""
    archive: str | None = None
    """Directory that `uavrt batch` wrote; None: the one used in the last run."""
    tags: tuple[Tag, ...] | None = None
    """Tags to search for; None: those of the last run."""
    start: bool = False
    further_vehicles: tuple[int, ...] = ()
    """MAVLink system ids of vehicles to serve besides the first and those of the last run."""
    keys: LinkKeys = NO_KEYS


class Station:
    """A ground station without a page; `show` is called with each event as a dictionary."""

    def __init__(
        self, settings: StationSettings, show: Callable[[dict[str, Any]], None]
    ) -> None:
        self._settings = settings
        self._show = show
        self._stopping = asyncio.Event()
        self._started: set[GroundSession] = set()
        self._lines: PulseLines | None = None
        self._state: SystemState | None = None
        self._made = not settings.directory.exists()
        self.pulses = 0
        """Number of different pulses received so far."""
        store = GroundStore(settings.directory)
        for name in ("address", "my_place", "dem", "archive"):
            if (value := getattr(settings, name)) is not None:
                store.set_settings(store.settings.changed({name: value}))
        if settings.tags is not None:
            store.set_tags(settings.tags)
        self.fleet = Fleet(store, Clock.start(), self._take, settings.keys, self._list)
        self.session = self.fleet.first

    def stop(self) -> None:
        """Stop detection if this station has started it, receive the last pulses, then end."""
        self._stopping.set()

    async def run(self) -> None:
        """Serve until `stop`; raises `LinkError`, `CommandRefused` or `RecordingError`."""
        directory = self._settings.directory
        self._lines = PulseLines(directory / PULSES_NAME)
        try:
            await self._serve(self._work(uploads=bool(self._settings.tags)))
        except LinkError:
            # A port that does not open leaves no directory for a flight that never was.
            if self._made and not self.pulses:
                shutil.rmtree(directory, ignore_errors=True)
            raise
        finally:
            self._lines.close()

    async def _serve(self, work: Any, *others: "asyncio.Task[None]") -> None:
        """Serve the vehicles until `work`, or one of the other tasks, has ended."""
        vehicles = asyncio.create_task(self.fleet.run())
        for number in self._settings.further_vehicles:
            await self.fleet.serve(number)
        working = asyncio.create_task(work)
        tasks = (vehicles, working, *others)
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in tasks:
                if task.done():
                    task.result()
        finally:
            queries_ended.set()
            working.cancel()
            vehicles.cancel()
            with suppress(asyncio.CancelledError, LinkError):
                await vehicles
            queries_ended.clear()  # for whoever goes on in this program

    async def _work(self, *, uploads: bool = False, page: str | None = None) -> None:
        if self._settings.address is not None:
            await self._link_opened()
        if page is not None:
            self._show({"event": "page", "address": page})
        if uploads or self._settings.start:
            await asyncio.gather(*(self._begin(one) for one in self.fleet.sessions))
        await self._stopping.wait()
        await asyncio.gather(*(self._end(one) for one in self._started))

    async def _link_opened(self) -> None:
        """Wait until the requested link is open; if it fails, the station ends."""
        connection = self.session.vehicle.connection
        while connection.link is None:
            if connection.error is not None:
                raise LinkError(connection.error)
            await asyncio.sleep(0.02)

    async def _begin(self, session: GroundSession) -> None:
        """Send the tags to a vehicle and start detection; repeat until the vehicle answers."""
        said = ""
        while not self._stopping.is_set():
            try:
                if (link := session.vehicle.connection.link) is not None:
                    drone = await link.wait_for_drone(START_RETRY_S)
                    refuse_two_vehicles(session.vehicle)
                    self._show({"event": "drone", "system": drone.system_id})
                    if await self._upload(session, link) and self._settings.start:
                        refuse_two_vehicles(session.vehicle)
                        # Not by the state, which is as old as the last heartbeat.
                        directory = await session.commands.start_by(link)
                        self._started.add(session)
                        self._show({"event": "started", "directory": directory})
                    return
            except LinkError as error:
                if str(error) != said:
                    said = str(error)
                    self._show({"event": "waiting", "reason": said})
            await asyncio.sleep(START_RETRY_S / 10)

    async def _upload(self, session: GroundSession, link: GroundLink) -> bool:
        """Send the tags; False if the drone already detects and needs no start.

        A restarted station that finds its own tags on the drone continues as if it had started
        detection. If another station has started detection, it continues and its pulses are
        received.
        """
        tags = session.vehicle.store.chosen_tags
        try:
            await session.commands.send_tags_by(link)
        except CommandRefused as error:
            searched = digest_in(str(error))
            if searched is None:
                raise
            if searched == tag_list_digest(tags):
                if self._settings.start:
                    self._started.add(session)
                session.vehicle.drone.set_tags(tags)
                link.protocol.set_tags(tags)
                self._show({"event": "already detecting", "tags": [t.tag_id for t in tags]})
            else:
                self._show({"event": "others detected", "reason": str(error)})
            return False
        self._show({"event": "tags", "count": len(tags)})
        return True

    async def _end(self, session: GroundSession) -> None:
        """Stop detection; wait until the drone has stopped and no more pulses arrive."""
        try:
            if (link := session.vehicle.connection.link) is not None:
                await link.stop_detection()
        except (LinkError, CommandRefused) as error:
            self._show({"event": "stop failed", "reason": str(error)})
            return
        self._show({"event": "stopping"})
        deadline_s = monotonic_s() + STOP_TIMEOUT_S
        # The state on the way when the command arrived may still say "has tags".
        await asyncio.sleep(LAST_PULSES_WAIT_S)
        while monotonic_s() < deadline_s:
            quiet = monotonic_s() - session.vehicle.drone.last_pulse_s > LAST_PULSES_WAIT_S
            if session.vehicle.drone.state not in ESSENTIAL and quiet:
                break
            await asyncio.sleep(0.1)
        self._show({"event": "stopped", "pulses": session.vehicle.flight.keeper.pulses})

    def _list(self, item: PulsePose | BurstInside) -> None:
        """Print a stored pulse or burst as one line; called in the disk thread."""
        if self._lines is not None:
            self._lines.write(item)

    def _take(self, event: GroundEvent | StationNote) -> None:
        """Print a received event, as text or as a JSON line."""
        match event:
            case PulsePose():
                self.pulses += 1
                self._show({"event": "pulse", **pulse_record(event)})
            case _ if self._lines is None:
                return  # the page shows it
            case BurstInside():
                self._show({"event": "burst", **inside_record(event)})
            case SearchReport():
                self._show({"event": "searched", "tag_id": event.tag_id})
            case DroneHeartbeat():
                if event.state is not self._state:
                    self._show({"event": "state", "state": event.state and event.state.value})
                self._state = event.state
            case StatusText():
                self._show({"event": "text", "severity": event.severity, "text": event.text})
            case StationNote():
                self._show({"event": "note", "severity": event.severity, "text": event.text})
            case Acknowledged():
                self._show(
                    {
                        "event": "acknowledged",
                        "command": command_name(event.command).upper().replace(" ", "_"),
                        "accepted": event.accepted,
                        "message": event.message,
                    }
                )


def refuse_two_vehicles(vehicle: ServedVehicle) -> None:
    """Raise `LinkError` while two vehicles use one system id: both would get our commands."""
    if vehicle.identity.foreign(vehicle.clock.now_ns()):
        raise LinkError(
            f"two vehicles use the system ID {vehicle.identity.system_id}",
            remedy="Give each vehicle its own system ID (MAV_SYS_ID)",
        )


def json_line(event: dict[str, Any]) -> str:
    """Encode an event as one line of JSON."""
    return json.dumps(event, allow_nan=False)
