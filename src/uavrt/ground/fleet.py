"""Serve several vehicles with one ground station.

The first vehicle has the main page. The operator may add vehicles that use the same links. Each
vehicle has its own session with tags, flights and commands, and its own page below
``/vehicle/NUMBER/``. The vehicles' measurements of a tag are combined into one position.
"""

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any

from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.errors import NotFound, UavrtError, UsageError
from uavrt.core.messages import BurstInside, Course, PulsePose
from uavrt.ground.link.keys import NO_KEYS, LinkKeys
from uavrt.ground.link.motions.path_assignments import PathAssignments
from uavrt.ground.link.my_place import MyPlace
from uavrt.ground.link.protocol import GroundEvent
from uavrt.ground.link.received.feed import StationNote
from uavrt.ground.link.requests.parallel_links import Links
from uavrt.ground.session import GroundSession
from uavrt.ground.snapshots import vehicle_record
from uavrt.ground.store.ground_settings import GroundStore
from uavrt.link.mavlink.discovery import GCS_SYSTEM_ID, STATION_SYSTEM_ID
from uavrt.link.mavlink.sending.signing import Signing

MOST_VEHICLES = 16
"""Maximum number of vehicles served; heartbeats and poses of more would overload any radio."""
REPORT_S, REPORT_DELAY_S = 1.0, 0.05
"""Interval of the reports to each drone about the other drones [s], and longest delay of a
changed report [s]."""


class Fleet:
    """Sessions of all vehicles that the station serves; `run` serves them until cancelled."""

    def __init__(
        self,
        store: GroundStore,
        clock: Clock,
        on_event: Callable[[GroundEvent | StationNote], None] | None = None,
        keys: LinkKeys = NO_KEYS,
        also: Callable[[PulsePose | BurstInside], object] = lambda _item: None,
    ) -> None:
        self._also = also
        self._store, self._clock, self._keys, self._on_event = store, clock, keys, on_event
        own = (GCS_SYSTEM_ID if keys.as_gcs else STATION_SYSTEM_ID, keys.component_id)
        signing = None if keys.signing is None else Signing(keys.signing, clock.now_ns)
        self._links = Links(own, signing=signing)
        self._estimating = asyncio.Lock()
        self.first = self._session(store, None)
        self._assignments = PathAssignments()
        self._courses_due = False
        self._others: dict[int, GroundSession] = {}
        self._tasks: dict[int, asyncio.Task[None]] = {}

    @property
    def sessions(self) -> tuple[GroundSession, ...]:
        """All sessions; the main one comes first."""
        return (self.first, *self._others.values())

    def session(self, system_id: int) -> GroundSession | None:
        """Return the session of an added vehicle; None if the vehicle is not served."""
        return self._others.get(system_id)

    async def run(self) -> None:
        """Serve all vehicles until cancelled, including those added before the last restart."""
        self._store.disk.start()
        for number in self._store.further_vehicles:
            with contextlib.suppress(UavrtError):
                await self.serve(number)
        telling = asyncio.create_task(self._report_each_second())
        try:
            await self.first.run()
        finally:
            tasks = (telling, *self._tasks.values())
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def serve(self, system_id: int) -> GroundSession:
        """Add a vehicle on the same links; raises `UsageError` or `ConfigError`."""
        if system_id in self._others:
            return self._others[system_id]
        if not 1 <= system_id <= 255:
            raise UsageError("system_id must be a vehicle's number, 1 to 255")
        if system_id == self.first.vehicle.identity.system_id:
            raise UsageError(
                f"vehicle {system_id} is already shown on the main page of this station"
            )
        if len(self.sessions) >= MOST_VEHICLES:
            raise UsageError(f"this station can serve at most {MOST_VEHICLES} vehicles")
        store = await self._store.disk.run(self._store.of_vehicle, system_id)
        if system_id in self._others:  # asked for twice meanwhile
            return self._others[system_id]
        session = self._session(store, self.first.my_place)
        self._others[system_id] = session
        self.first.vehicle.identity.excluded.add(system_id)
        self._tasks[system_id] = asyncio.get_running_loop().create_task(session.run())
        self._store.set_further_vehicles(tuple(self._others))
        self.first.vehicle.feed.note(5, f"this station now also serves vehicle {system_id}")
        self._show()
        return session

    async def leave(self, system_id: int) -> None:
        """Stop serving an added vehicle; this ends the recording on the ground only."""
        if system_id not in self._others:
            raise NotFound(f"vehicle {system_id} is not served by this station")
        self.first.vehicle.identity.excluded.discard(system_id)
        task = self._tasks.pop(system_id)
        self._others.pop(system_id)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        self._store.set_further_vehicles(tuple(self._others))
        self.first.vehicle.feed.note(5, f"this station no longer serves vehicle {system_id}")
        self._show()

    def records(self) -> list[dict[str, Any]]:
        """State of all vehicles for the pages, the main vehicle first."""
        return [vehicle_record(one.vehicle) for one in self.sessions]

    def _receive_course(self, session: GroundSession, course: Course) -> None:
        """Store a drone's position and planned leg, and send changes to the other drones."""
        number = session.vehicle.identity.system_id
        if number is None or not self._assignments.receive_course(
            number, course, monotonic_s()
        ):
            return
        if not self._courses_due:
            self._courses_due = True
            asyncio.get_running_loop().call_later(REPORT_DELAY_S, self._report_courses)

    async def _report_each_second(self) -> None:
        while True:
            await asyncio.sleep(REPORT_S)
            self._report_courses()

    def _report_courses(self) -> None:
        """Send each moving drone the positions and planned legs of the other drones."""
        self._courses_due = False
        numbers = {one.vehicle.identity.system_id: one for one in self.sessions}
        flying = [
            number
            for number, one in numbers.items()
            if number is not None and one.flying.record() is not None
        ]
        for number in self._assignments.recipients(flying):
            session = numbers.get(number)
            link = None if session is None else session.vehicle.connection.link
            if link is None:
                continue
            for neighbour in self._assignments.reports_for(number, monotonic_s()):
                link.send_neighbour(neighbour)

    def _session(self, store: GroundStore, my_place: MyPlace | None) -> GroundSession:
        return GroundSession(
            store,
            self._clock,
            self._on_event,
            self._keys,
            links=self._links,
            companions=lambda own: [one for one in self.sessions if one is not own],
            my_place=my_place,
            estimating=self._estimating,
            on_course=self._receive_course,
            also=self._also,
        )

    def _show(self) -> None:
        for one in self.sessions:
            one.vehicle.feed.send_state()
