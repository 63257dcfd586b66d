"""One vehicle that the ground station serves, with its link, the drone's reports and the
flight.
"""

from collections.abc import Callable, Sequence
from typing import Final

from uavrt.core.clock import Clock
from uavrt.core.commands import SystemState
from uavrt.core.errors import UsageError
from uavrt.core.messages import BurstInside, PulsePose
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.reading.noted_places import vehicle_note
from uavrt.ground.link.button_states import Busy, Situation
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.ground_connection import Connection
from uavrt.ground.link.protocol import DroneHeartbeat
from uavrt.ground.link.received.current_flight import CurrentFlight, last_beeps
from uavrt.ground.link.received.drone_reports import DroneReports
from uavrt.ground.link.received.feed import Feed
from uavrt.ground.link.vehicles.vehicle_identity import VehicleIdentity
from uavrt.ground.store.ground_settings import GroundStore
from uavrt.ground.store.stored_flights import FlightLibrary
from uavrt.ground.store.tag_table import rows_from_tags, table_version

FOREIGN_REMEDY: Final = "give each vehicle a number of its own (MAV_SYS_ID), or choose this one"
ESSENTIAL = (SystemState.DETECTING, SystemState.CAPTURING)


class ServedVehicle:
    """State of one served vehicle; `on_flight` is called when a flight has begun."""

    def __init__(
        self,
        store: GroundStore,
        clock: Clock,
        feed: Feed,
        make_link: Callable[..., GroundLink],
        *,
        companions: Callable[[], Sequence["ServedVehicle"]],
        on_flight: Callable[[], None],
        also: Callable[[PulsePose | BurstInside], object],
    ) -> None:
        number, uid = store.vehicle
        self.store, self.clock, self.feed = store, clock, feed
        self.identity = VehicleIdentity(store.system_id or number, uid)
        self.drone = DroneReports(clock.now_ns())
        self.flight = CurrentFlight(store, clock, feed, also)
        self.connection = Connection(store, feed, self.identity, make_link)
        self.busy: Busy | None = None
        self._companions, self._on_flight = companions, on_flight
        self._named: set[int] = set()
        self._foreign_reported = False

    @property
    def companions(self) -> Sequence["ServedVehicle"]:
        """The other vehicles that this ground station serves."""
        return self._companions()

    @property
    def name(self) -> str:
        """Name that distinguishes this vehicle from other vehicles of the station."""
        number, name = self.identity.system_id, self.store.settings.vehicle_name
        return "this vehicle" if number is None else vehicle_note(number, name)

    def situation(self) -> Situation:
        """State of drone and link that decides which buttons are enabled."""
        now_ns, drone, tags = self.clock.now_ns(), self.drone, self.store.chosen_tags
        return Situation(
            link_open=self.connection.is_open,
            drone_present=self.connection.present(now_ns),
            state=drone.state,
            tags=len(tags),
            tags_sent=drone.sent_tags == tags,
            busy=self.busy,
            flight_open=self.flight.keeper.flight_id is not None,
            foreign=self.identity.foreign(now_ns),
            silent_s=(now_ns - drone.contact_ns) / NANOSECONDS_PER_SECOND,
        )

    def set_busy(self, busy: Busy | None) -> None:
        """Show the command in progress on the pages; None after its end."""
        self.busy = busy
        self.feed.send_state()

    def show_tags(self) -> None:
        """Send the tag table to all pages."""
        self.feed.send("tags_version", table_version(self.store.tags))
        self.feed.send("tags", rows_from_tags(self.store.tags))
        self.feed.send_state()

    async def connect(self) -> None:
        """Close the link if one is open, then open the configured link; raises `LinkError`."""
        await self.disconnect()
        await self.connection.open(lambda: self.drone.sent_tags)

    async def disconnect(self) -> None:
        """Close the link to the vehicle."""
        await self.connection.close()
        self.drone.disconnected()

    async def resume(self, library: FlightLibrary) -> bool:
        """Continue with the flight that a restart interrupted; False if there is none."""
        store = self.store
        self.drone.recall(
            await store.disk.run(last_beeps, store.directory, store.current_flight, store.tags)
        )
        tags = await self.flight.resume(library)
        if tags is not None:
            self.drone.set_tags(tags)
        return tags is not None

    def begin_flight(self) -> None:
        """Begin a flight recording on the ground."""
        flight_id = self.flight.begin(self.drone.sent_tags or self.store.chosen_tags)
        self._on_flight()
        self.drone.begin_flight()
        if self.identity.system_id is not None:
            self.flight.keeper.add_note(self.name, self.clock.now_ns())
        self.feed.send("flight", {"flight_id": flight_id})
        self.feed.send_state()

    def receive_heartbeat(self, heartbeat: DroneHeartbeat) -> None:
        """Handle the drone's state; the ground's recording begins and ends with detection."""
        before, state = self.drone.receive_heartbeat(heartbeat), heartbeat.state
        if before is state:
            return
        self.feed.note(6, f"the drone is {state.words if state else 'in an unknown state'}")
        # The drone may have stopped before a resumed flight was; the states of before a start
        # may come after its acknowledgement.
        unseen = before is None and state is not None
        over = before in ESSENTIAL or (unseen and self.flight.resumed)
        if state in ESSENTIAL and self.flight.keeper.ended:
            self.begin_flight()
        elif state not in ESSENTIAL and not self.flight.keeper.ended and over:
            self.flight.end()
        self.feed.send_state()

    def once_a_second(self, now_ns: int) -> bool:
        """Send due requests to the vehicle and record changes; False if no link is open."""
        watch = self.connection.serve(now_ns)
        if watch is None:
            return False
        self._report_others(now_ns)
        self.flight.note_home(watch.home, now_ns)
        self.flight.note_battery(watch.battery_percent, now_ns)
        present = self.connection.present(now_ns)
        if self.drone.set_presence(present, now_ns):
            self.feed.note(6 if present else 3, "drone found" if present else "drone lost")
        self.connection.report_faults()
        return True

    def _report_others(self, now_ns: int) -> None:
        """Log once each other vehicle on this link, and a second vehicle with our vehicle's
        number.
        """
        ours = self.identity.system_id
        self._named |= {one.identity.system_id or 0 for one in self.companions}
        for system_id in sorted(set(self.identity.others) - self._named):
            self._named.add(system_id)
            text = (
                f"messages of another vehicle, {system_id}, also arrive; this page still "
                f"serves vehicle {ours}"
            )
            self.feed.note(4, text)
        foreign = self.identity.foreign(now_ns)
        if foreign and not self._foreign_reported:
            who = "autopilot" if self.connection.flies else "station"
            text = f"another {who} uses the vehicle number {ours}: {FOREIGN_REMEDY}"
            self.feed.note(2, text)
        self._foreign_reported = foreign

    def choose(self, system_id: int) -> None:
        """Serve another vehicle; the previous vehicle's flight ends on the ground only."""
        if self.store.system_id is not None:
            raise UsageError(f"this page belongs to vehicle {self.store.system_id}")
        if any(one.identity.system_id == system_id for one in self.companions):
            raise UsageError(f"vehicle {system_id} already has a page of its own")
        if not self.flight.keeper.ended:
            self.flight.end()
        self.identity.choose(system_id)
        self._named.clear()
        self._foreign_reported = False
        self.drone.forget()
        self.connection.forget_vehicle()
