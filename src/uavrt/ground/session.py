"""One vehicle's session behind the page: link, state, commands, estimates and storage.

Browsers store no data. Received data is stored on disk first and then sent to every browser.
`uavrt.ground.web.server` serves the session by HTTP and WebSocket.
"""

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.errors import UavrtError
from uavrt.core.messages import BurstInside, Course, PulsePose
from uavrt.ground.commanding_page import CommandingPage
from uavrt.ground.estimate_loop import EstimateLoop
from uavrt.ground.fetch.downloads import Downloads
from uavrt.ground.link.command_sender import Commands
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.keys import NO_KEYS, LinkKeys
from uavrt.ground.link.motions.page_motions import MotionCommands
from uavrt.ground.link.my_place import MyPlace
from uavrt.ground.link.protocol import GroundEvent
from uavrt.ground.link.received.feed import Feed, StationNote
from uavrt.ground.link.requests.parallel_links import Links
from uavrt.ground.link.served_vehicle import ServedVehicle
from uavrt.ground.reception import Reception
from uavrt.ground.snapshots import my_place_record, snapshot
from uavrt.ground.store.event_log import EventLog
from uavrt.ground.store.ground_settings import GroundStore
from uavrt.ground.store.stored_flights import FlightLibrary
from uavrt.ground.store.tag_table import rows_from_tags, table_version

TICK_S = 0.25
STATE_S = 1.0


class GroundSession:
    """The session of one vehicle; `run` serves it until cancelled.

    `on_event`: called with each event from the drone before the pages get it. Pulses and the
    pulse times of bursts are written before that.
    `links`: links shared with the sessions of other vehicles; the first session opens them.
    `companions`: gets this session; returns those of the other vehicles.
    `my_place`: the first session's GPS receiver; None: this session opens its own.
    `estimating`: lock held while estimates are computed, by one session at a time.
    `on_course`: called with this session and each report of its drone's position and leg.
    `also`: called in the disk thread with each stored pulse.
    """

    vehicle: ServedVehicle
    estimates: EstimateLoop
    reception: Reception

    def __init__(
        self,
        store: GroundStore,
        clock: Clock,
        on_event: Callable[[GroundEvent | StationNote], None] | None = None,
        keys: LinkKeys = NO_KEYS,
        *,
        links: Links | None = None,
        companions: Callable[["GroundSession"], Sequence["GroundSession"]] = lambda _own: (),
        my_place: MyPlace | None = None,
        estimating: asyncio.Lock | None = None,
        on_course: Callable[["GroundSession", Course], None] = lambda _own, _course: None,
        also: Callable[[PulsePose | BurstInside], object] = lambda _item: None,
    ) -> None:
        make_link = partial(
            GroundLink,
            clock.now_ns,
            on_event=lambda event: self.reception.receive_event(event),
            on_frame=lambda frame: self.reception.receive_frame(frame),
            component_id=keys.component_id,
            as_gcs=keys.as_gcs,
            key=keys.command,
            signing_key=keys.signing,
            links=links,
            progress=lambda: self.vehicle.flight.keeper.queue.progress,
        )
        feed = Feed(EventLog(store.log_path, store.disk), clock, self.snapshot, on_event)
        self.vehicle = ServedVehicle(
            store,
            clock,
            feed,
            make_link,
            companions=lambda: [one.vehicle for one in companions(self)],
            on_flight=lambda: self.estimates.restart(),
            also=also,
        )
        self.estimates = EstimateLoop(
            self.vehicle,
            lambda: [one.estimates for one in companions(self)],
            asyncio.Lock() if estimating is None else estimating,
        )
        self._listens = my_place is None
        self.my_place = MyPlace() if my_place is None else my_place
        self.library = FlightLibrary(store.directory)
        self.commander = CommandingPage(store.commander)
        self.commands = Commands(self.vehicle)
        self.downloads = Downloads(self.vehicle)
        self.flying = MotionCommands(self.vehicle)
        self.reception = Reception(
            self.vehicle, self.estimates, self.flying, self.downloads, partial(on_course, self)
        )

    async def run(self) -> None:
        """Serve until cancelled; connect to the configured address."""
        vehicle = self.vehicle
        vehicle.store.disk.start()
        if await vehicle.resume(self.library):
            self.estimates.soon()
        try:
            with contextlib.suppress(UavrtError):
                await vehicle.connect()
            await self._listen_for_place()
            next_state_s = 0.0
            while True:
                await asyncio.sleep(TICK_S)
                now_s = monotonic_s()
                await self._listen_for_place()
                self.estimates.start_if_due()
                if now_s >= next_state_s:
                    next_state_s = now_s + STATE_S
                    self._once_a_second()
        finally:
            await self.downloads.stop()
            if self._listens:
                await self.my_place.close()
            await vehicle.disconnect()
            self.estimates.stop()
            await vehicle.flight.put_away()
            vehicle.feed.hub.close()

    async def _listen_for_place(self) -> None:
        if self._listens:
            await self.my_place.listen(self.vehicle.store.settings.my_place)

    def _once_a_second(self) -> None:
        vehicle, store = self.vehicle, self.vehicle.store
        if vehicle.once_a_second(vehicle.clock.now_ns()):
            identity = vehicle.identity
            store.set_served(identity.system_id, identity.uid, self.commander.page)
        if store.disk.failure is not None:
            raise store.disk.failure
        vehicle.flight.show_received()
        vehicle.flight.commit()
        vehicle.feed.send_state()

    def choose_vehicle(self, system_id: int) -> None:
        """Serve another vehicle; raises `UsageError` if it has a page of its own."""
        self.vehicle.choose(system_id)
        self.flying.forget()
        self.vehicle.feed.note(5, f"this page now serves vehicle {system_id}")
        self.vehicle.feed.send_state()

    def settings_changed(self) -> None:
        """Send the settings to all pages, and estimate again with them."""
        self.vehicle.feed.send("settings", asdict(self.vehicle.store.settings))
        self.estimates.soon()
        self.vehicle.feed.send_state()

    def snapshot(self) -> dict[str, Any]:
        """State of the vehicle for a page, without the pulses of the flight."""
        return snapshot(self.vehicle) | {
            "me": my_place_record(self.my_place),
            "commander": self.commander.present,
            "motion": self.flying.record(),
        }

    def hello(self) -> dict[str, Any]:
        """Make the first record for a newly connected page, which holds the complete state."""
        store = self.vehicle.store
        return {
            "state": self.snapshot(),
            "tags": rows_from_tags(store.tags),
            "tags_version": table_version(store.tags),
            "settings": asdict(store.settings),
            **self.estimates.latest.record(),
            "log": self.vehicle.feed.log.lines(),
            "download": self.downloads.record(),
        }
