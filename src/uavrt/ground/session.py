"""The ground station behind the page: link, state, commands, estimates, storage.

Nothing is kept only in a browser: whatever is received is stored first, then shown to every
listener. `uavrt.ground.web.server` puts it on HTTP and WebSocket.
"""

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NoReturn

from uavrt.clock import Clock, monotonic_s
from uavrt.commands import SystemState
from uavrt.computer.bench import Bench, FlightFacts, first_flight
from uavrt.computer.finding import Finding
from uavrt.config.settings import RecordingSettings
from uavrt.config.tag_corrections import still_holds
from uavrt.errors import ConfigError, LinkError, RecordingError, UavrtError, UsageError
from uavrt.ground.commanding_page import Commander
from uavrt.ground.fetch.downloads import Downloads
from uavrt.ground.link.actions import Busy, Situation
from uavrt.ground.link.clock_skew import ClockSkew
from uavrt.ground.link.commands import Commands
from uavrt.ground.link.delivery_receipts import Receipts
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.flying import Flying
from uavrt.ground.link.keys import NO_KEYS, LinkKeys
from uavrt.ground.link.my_place import MyPlace
from uavrt.ground.link.parallel_links import Links
from uavrt.ground.link.protocol import Acknowledged, DetectorAlive, DroneHeartbeat, GroundEvent
from uavrt.ground.link.session_parts import StationNote
from uavrt.ground.link.stored_pulses import open_receipts
from uavrt.ground.link.vehicle import VehicleWatch
from uavrt.ground.link.vehicle_identity import VehicleIdentity
from uavrt.ground.listeners import Hub
from uavrt.ground.snapshots import hello, pose_record, snapshot
from uavrt.ground.store.beside_drone import flight_under_way
from uavrt.ground.store.estimates import Estimates, Estimator
from uavrt.ground.store.event_log import EventLog
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.ground.store.flights import FlightLibrary
from uavrt.ground.store.settings import GroundStore
from uavrt.ground.store.tag_table import rows_from_tags, table_version
from uavrt.localization.flight_estimates import HeardInTurn
from uavrt.log import get_logger
from uavrt.mavlink.address import parse_address
from uavrt.mavlink.frame import Frame
from uavrt.messages import (
    Beep,
    BurstInside,
    Course,
    LiveBearing,
    PulsePose,
    SearchReport,
    StatusText,
    Tag,
    drop_beeps,
    keep_beep,
)
from uavrt.recording.flight_reader import read_beeps
from uavrt.recording.outline import battery_note
from uavrt.recording.places import Mark, home_note, vehicle_note
from uavrt.recording.pulse_files import pulse_record
from uavrt.tunnel.motion import MotionState
from uavrt.tunnel.wire import command_name
from uavrt.units import NANOSECONDS_PER_SECOND

log = get_logger()

TICK_S = 0.25
STATE_S = 1.0
POSE_SEND_NS = 190_000_000
LATE_PULSES_NS = 5 * NANOSECONDS_PER_SECOND
"""A pulse heard this long after the stop is of another flight, unless it was before it."""
COMMIT_S = 0.15
"""Pulses that come within this time are written together. Receipts go as often, and wait."""
ESTIMATE_LEAST_S = 0.4
ESTIMATE_SHARE = 8.0
"""Estimates run again after eight times as long as they took: at most 11 % of a core …"""
ESTIMATE_SHARE_OF_SEVERAL = 20.0
"""… and with several vehicles after so many times as long for each: 5 % in all."""
ESTIMATES_SHOWN_S = 2.0
"""Of many tags some come with each estimate: the page receives them at this interval."""

_WARNING = 4
"""MAV_SEVERITY_WARNING."""
_LOOKS_BACK = 10
"""Flights in which measurements for the next one are looked for."""
FOREIGN_REMEDY = "give each vehicle a number of its own (MAV_SYS_ID), or choose this one"

BATTERY_STEP_PERCENT = 5
"""What is left in the battery is noted in the flight at its start and after each such step."""
ENDS_WITHIN_S = 10.0
"""How long a session that ends waits for a slow disk."""
ESSENTIAL = (SystemState.DETECTING, SystemState.CAPTURING)


class GroundSession:
    """One ground station; `run` serves it until cancelled.

    `store`: its directory.
    `clock`: the ground's clock.
    `on_event`: called with each thing heard from the drone, before it is shown; with a pulse,
    or the content of a burst, after the write that is to store it.
    `keys`: secrets shared with the drone.
    `links`: links that are shared with the sessions of other vehicles; the first opens them.
    `companions`: get this session; give those of the other vehicles.
    `my_place`: of the first; without it there is one of its own.
    `estimating`: held while estimates are worked out, by one session at a time.
    `on_course`: takes this session and where its drone says that it goes.
    `also`: called in the disk thread with each pulse that is stored, see `FlightKeeper`.
    """

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
        self.store = store
        self._disk = store.disk
        self._links, self._companions = links, companions
        self._keys = keys
        self.clock = clock
        number, uid = store.vehicle
        self.identity = VehicleIdentity(store.system_id or number, uid)
        self._listens = my_place is None
        self.my_place = MyPlace() if my_place is None else my_place
        self._named: set[int] = set()
        self._foreign_told = False
        self._home_kept: tuple[str | None, tuple[float, float] | None] = (None, None)
        self._battery_kept: tuple[str | None, int] = (None, 0)
        self.hub = Hub()
        self.library = FlightLibrary(store.directory)
        self.flight = FlightKeeper(
            store.directory,
            clock,
            self._disk,
            also=also,
            on_written=self._written,
            begun=store.flights_begun,
        )
        self.log = EventLog(store.log_path, self._disk)
        self._receipts: Receipts | None = None
        self.link: GroundLink | None = None
        self.link_error: str | None = None
        self.state: SystemState | None = None
        self.busy: Busy | None = None
        self.sent_tags: tuple[Tag, ...] = ()
        self.estimates = Estimates(bearings=[], positions=[])
        self.commander = Commander(store.commander)
        self.marks: list[Mark] = []
        """Of the flight that goes on, or ended last."""
        self.commands = Commands(self)
        self.downloads = Downloads(self)
        self.flying = Flying(self)
        self._on_event, self._on_course = on_event, on_course
        self._estimator = Estimator()
        self._estimate_due = False
        self._estimate_at_s = 0.0
        self._estimate_fault = ""
        self._shown_s = 0.0
        self._one_at_a_time = asyncio.Lock() if estimating is None else estimating
        self.vehicle: VehicleWatch | None = None
        self._serving: asyncio.Task[None] | None = None
        self._estimating: asyncio.Task[None] | None = None
        self._commit_due = False
        self._committed_s = 0.0
        self._unshown: list[tuple[PulsePose | BurstInside, dict[str, Any]]] = []
        self.temperature_c: float | None = None
        self.heard: dict[int, int] = {}
        self._bench = Bench()
        self.drone_bearings: dict[tuple[int, int], LiveBearing] = {}
        self.beeps: list[Beep] = []
        """What beeps in the flight, as the drone has measured it last."""
        self.drone_directory = ""
        self._stopped_ns: int | None = None
        self._resumed = False
        self._skew = ClockSkew()
        self._was_present = False
        self._contact_ns = clock.now_ns()
        self._last_pose_ns = 0
        self._faults_told = 0
        self.last_pulse_s = 0.0

    @property
    def skew_ns(self) -> int | None:
        """How far the drone's clock is behind ours; None before it is judged."""
        return self._skew.skew_ns

    async def run(self) -> None:
        """Serve until cancelled; connect to the address that is set."""
        self._disk.start()
        await self._resume()
        try:
            with contextlib.suppress(UavrtError):
                await self.connect()
            await self._listen_for_place()
            next_state_s = 0.0
            while True:
                await asyncio.sleep(TICK_S)
                now_s = monotonic_s()
                await self._listen_for_place()
                if self._estimate_due and now_s >= self._estimate_at_s:
                    self._start_estimate()
                if now_s >= next_state_s:
                    next_state_s = now_s + STATE_S
                    self._once_a_second()
        finally:
            await self.downloads.stop()
            if self._listens:
                await self.my_place.close()
            await self.disconnect()
            if self._estimating is not None:
                self._estimating.cancel()
            await self._put_away()
            self.hub.close()

    async def _put_away(self) -> None:
        """Bring what was received to the disk, and say so if it does not take all."""
        self.flight.close()
        await self.flight.settle(ENDS_WITHIN_S)
        self._show_received()
        taken, durable = self.flight.progress
        if taken > durable:
            reason = self.flight.fault or "the disk does not answer"
            log.error(
                "pulses not stored: the drone keeps them", pulses=taken - durable, reason=reason
            )

    async def _listen_for_place(self) -> None:
        if self._listens:
            await self.my_place.listen(self.store.settings.my_place)

    @property
    def companions(self) -> Sequence["GroundSession"]:
        """The sessions of the other vehicles that are served."""
        return self._companions(self)

    async def connect(self) -> None:
        """Open the link that is set, in place of any other; a further vehicle's joins it.

        Raises `LinkError`: it cannot be opened; the state says why, too.
        """
        await self.disconnect()
        settings = self.store.settings
        if self._receipts is None:  # once: a link is opened again while the disk hangs, too
            try:
                self._receipts = await self._disk.run(open_receipts, self.store.own, self._disk)
            except RecordingError as error:
                self._unconnected(error)
        link = GroundLink(
            self.clock.now_ns,
            on_event=self._take,
            on_frame=self._take_frame,
            generation=settings.generation,
            receipts=self._receipts,
            component_id=self._keys.component_id,
            as_gcs=self._keys.as_gcs,
            key=self._keys.command,
            signing_key=self._keys.signing,
            identity=self.identity,
            links=self._links,
            progress=lambda: self.flight.progress,
        )
        link.protocol.tags = {tag.tag_id: tag for tag in self.sent_tags}
        self.vehicle = VehicleWatch(link.protocol.own, self.identity)
        joins = self.store.system_id is not None
        addresses = () if joins else settings.address.split()
        task = asyncio.create_task(link.run(*addresses))
        for _ in range(200):
            if joins or task.done() or link.link is not None:
                break
            await asyncio.sleep(0.01)
        if task.done() and (fault := task.exception()) is not None:
            self._unconnected(fault)
        self.link, self._serving, self.link_error = link, task, None
        self._faults_told = 0
        if not joins:
            self.note(6, f"connected to {settings.address}")
        self.send_state()

    def _unconnected(self, error: BaseException) -> NoReturn:
        """Show why there is no link, and raise it."""
        self.link_error = str(error)
        self.note(3, self.link_error)
        self.send_state()
        raise LinkError(self.link_error) from error

    async def disconnect(self) -> None:
        """Close the link."""
        if self._serving is not None:
            self._serving.cancel()
            with contextlib.suppress(asyncio.CancelledError, UavrtError):
                await self._serving
        self.link = self._serving = self.vehicle = None
        self.state = None
        self._was_present = False

    # ------------------------------------------------------------------- what is shown

    def snapshot(self) -> dict[str, Any]:
        """Everything that a page needs besides the flight's pulses."""
        return snapshot(self)

    def hello(self) -> dict[str, Any]:
        """First record of a listener: the whole present state."""
        return hello(self)

    def send_state(self) -> None:
        """Show the state to all listeners."""
        self.hub.send("state", self.snapshot())

    def tags_changed(self) -> None:
        """Show the tag table to all listeners."""
        self.hub.send("tags_version", table_version(self.store.tags))
        self.hub.send("tags", rows_from_tags(self.store.tags))
        self.send_state()

    def settings_changed(self) -> None:
        """Show the settings to all listeners and estimate again."""
        self.hub.send("settings", asdict(self.store.settings))
        self._estimate_due = True
        self.send_state()

    def situation(self) -> Situation:
        """The state that decides which buttons are enabled."""
        link, now_ns = self.link, self.clock.now_ns()
        present = link is not None and link.protocol.present(now_ns)
        return Situation(
            link_open=link is not None and link.link is not None,
            drone_present=present,
            state=self.state,
            tags=len(self.store.chosen_tags),
            tags_sent=self.sent_tags == self.store.chosen_tags,
            busy=self.busy,
            flight_open=self.flight.flight_id is not None,
            foreign=self.identity.foreign(now_ns),
            silent_s=(now_ns - self._contact_ns) / NANOSECONDS_PER_SECOND,
        )

    def usual_noise_db(self) -> float | None:
        """Read how loud this vehicle's receiver was at rest in past flights; takes a while."""
        live = None if self.flight.ended else self.flight.flight_id
        return self.library.usual_noise_db(self.identity.system_id, but=live)

    def first_flight(self, usual_noise_db: float | None) -> list[Finding]:
        """Judge whether all is ready for a first flight, with the noise of past ones."""
        now_ns, watch, situation = self.clock.now_ns(), self.vehicle, self.situation()
        pose = watch.pose if watch else None
        skew_ns = self.skew_ns
        facts = FlightFacts(
            tags=self.store.chosen_tags,
            state=self.state,
            heard=situation.drone_present,
            clock_off_s=None if skew_ns is None else skew_ns / NANOSECONDS_PER_SECOND,
            pose_age_s=None
            if pose is None
            else (now_ns - pose.time_ns) / NANOSECONDS_PER_SECOND,
            disk_free_mb=watch.disk_free_mb if watch else None,
            disk_needed_mb=RecordingSettings().minimum_free_mb,
            battery_percent=watch.battery_percent if watch else None,
            battery_v=watch.battery_v if watch else None,
            usual_noise_db=usual_noise_db,
        )
        return first_flight(facts, self._bench, now_ns)

    # ------------------------------------------------------------------- what comes

    def _take_frame(self, frame: Frame) -> None:
        if self.vehicle is None:
            return
        self.downloads.receive(frame)
        now_ns = self.clock.now_ns()
        pose = self.vehicle.receive(frame, now_ns)
        drones_ns = now_ns - (self.skew_ns or 0)
        self.flight.add_state(drones_ns, self.vehicle.armed, self.vehicle.landed)
        if pose is None:
            return
        self.flight.add_pose(replace(pose, time_ns=drones_ns))
        if now_ns - self._last_pose_ns >= POSE_SEND_NS:
            self._last_pose_ns = now_ns
            self.hub.send("pose", pose_record(pose, now_ns))

    def _take(self, event: GroundEvent) -> None:
        if self._on_event is not None and not isinstance(event, PulsePose | BurstInside):
            self._on_event(event)
        now_ns = self.clock.now_ns()
        self._bench.take(event, now_ns)
        match event:
            case PulsePose():
                self._take_pulse(event, now_ns)
            case BurstInside():
                self._take_inside(event)
            case SearchReport():
                self.heard[event.tag_id] = now_ns
                self.flight.add_search_report(event)
                self.hub.send("search", asdict(event))
            case DetectorAlive():
                self.heard[event.tag_id] = now_ns
                self._bench.alive(event.tag_id, now_ns)
            case Beep():
                if event not in self.beeps and not self._is_outdated(event):
                    keep_beep(self.beeps, event)
                    drop_beeps(self.beeps)
                    self.flight.add_beep(event)
                    self.send_state()
            case LiveBearing():
                self.drone_bearings[event.tag_id, event.start_time_ns] = event
                self._estimate_due = True
            case DroneHeartbeat():
                self._take_heartbeat(event)
            case MotionState():
                self.flying.take(event)
            case Course():
                self._on_course(self, event)
            case StatusText():
                self.flight.add_text(event.severity, event.text, now_ns)
                self.note(event.severity, event.text, source="drone")
            case Acknowledged():
                name = command_name(event.command)
                answer = "done" if event.accepted else "refused"
                text = f"{name}: {answer}" + (f" – {event.message}" if event.message else "")
                self.note(6 if event.accepted else 4, text, source="acknowledgement")

    def _take_pulse(self, event: PulsePose, now_ns: int) -> None:
        self.heard[event.pulse.tag_id] = now_ns
        self.last_pulse_s = monotonic_s()
        if (difference := self._skew.learn(now_ns - event.pulse.end_time_ns)) is not None:
            self.note(4, difference)
        if self.flight.flight_id is None or self._is_of_next_flight(event):
            self.begin_flight()
        if not self.flight.add_pulse(event):
            return
        self._estimate_due = True
        record = pulse_record(event) | {
            "received_ns": now_ns,
            "flight_id": self.flight.flight_id,
        }
        self._show_soon(event, record)

    def _take_inside(self, event: BurstInside) -> None:
        """Put into a burst what came after it."""
        here = self.flight.put_inside(event)
        flight_id = self.flight.flight_id if here else None
        self._show_soon(event, asdict(event) | {"flight_id": flight_id})

    def _show_soon(self, event: PulsePose | BurstInside, record: dict[str, Any]) -> None:
        """Show what was received after the next write, or within a second."""
        self._unshown.append((event, record))
        self.commit_soon()

    def _is_of_next_flight(self, event: PulsePose) -> bool:
        """Whether a pulse was sent after the flight had ended: someone else started again."""
        if not self.flight.ended or self._stopped_ns is None:
            return False
        sent_ns = event.pulse.start_time_ns + (self.skew_ns or 0)
        return sent_ns > self._stopped_ns + LATE_PULSES_NS

    def _take_heartbeat(self, event: DroneHeartbeat) -> None:
        before, self.state = self.state, event.state
        self.temperature_c = event.cpu_temperature_c
        if before is event.state:
            return
        self.note(6, f"drone is {event.state.words if event.state else 'in an unknown state'}")
        # The drone may have stopped before a resumed flight was; the states of before a start
        # may come after its acknowledgement.
        unseen = before is None and event.state is not None
        over = before in ESSENTIAL or (unseen and self._resumed)
        if event.state in ESSENTIAL and self.flight.ended:
            self.begin_flight()
        elif event.state not in ESSENTIAL and not self.flight.ended and over:
            self._end_flight()
        self.send_state()

    # ------------------------------------------------------------------- flight

    async def _resume(self) -> None:
        """Continue with the flight that a restart interrupted."""
        kept = self.store.current_flight
        self.beeps += await self._disk.run(self._last_beeps, kept)
        drop_beeps(self.beeps)
        if kept is None:
            return
        try:
            columns, summary, places = await self._disk.run(
                lambda: (
                    self.library.columns(kept),
                    self.library.summary(kept),
                    self.library.places(kept),
                )
            )
        except UavrtError as error:
            self.note(4, f"flight {kept} does not go on: {error}")
            return
        if not await self._disk.run(self.flight.resume, kept):
            return
        self.flight.load(columns)
        self._resumed = True
        self.sent_tags, self.marks = summary.tags, list(places.marks)
        self._estimate_due = True
        self.note(6, f"flight {kept} goes on")

    def begin_flight(self) -> None:
        """Begin a flight of our own."""
        tags = self.sent_tags or self.store.chosen_tags
        flight_id = self.flight.begin(tags, self._drones_own())
        self.store.set_flight(flight_id)
        self.estimates = Estimates(bearings=[], positions=[])
        for companion in self.companions:
            companion.estimate_soon()
        self._estimator = Estimator()
        self._stopped_ns, self._resumed = None, False
        self.heard.clear()
        self.marks = []
        self.drone_bearings.clear()
        self.beeps.clear()
        number = self.identity.system_id
        if number is not None:
            note = vehicle_note(number, self.store.settings.vehicle_name)
            self.flight.add_note(note, self.clock.now_ns())
        self.hub.send("flight", {"flight_id": flight_id})
        self.send_state()

    def _last_beeps(self, flight_id: str | None) -> list[Beep]:
        """Read what beeped in a flight, or in the last in which anything did."""
        paths = self.store.directory.glob(f"{flight_id or '*'}/flight.sqlite")
        with contextlib.suppress(OSError):
            for path in sorted(paths, key=lambda one: -one.stat().st_mtime)[:_LOOKS_BACK]:
                with contextlib.suppress(UavrtError):
                    if beeps := read_beeps(path.parent):
                        return [one for one in beeps if still_holds(one, self.store.tags)]
        return []

    def _is_outdated(self, beep: Beep) -> bool:
        """Whether a sender was measured before this station corrected its tag."""
        return not still_holds(beep, self.sent_tags) and any(
            one.tag_id in beep.tag_ids and still_holds(beep, (one.before,))
            for one in self.store.corrections
        )

    def _drones_own(self) -> Path | None:
        """Get the drone's own recording of its flight, where that is in our directory.

        Only what comes from this computer alone can be of the drone side that flies from it.
        """
        if self.store.system_id is not None:
            return None
        with contextlib.suppress(ConfigError):
            addresses = map(parse_address, self.store.settings.address.split())
            if all(address.is_loopback for address in addresses):
                return flight_under_way(self.store.directory)
        return None

    def _end_flight(self) -> None:
        self.flight.commit()
        self.flight.ended = True
        self._stopped_ns = self.clock.now_ns()
        self.store.set_flight(None)

    def commit_soon(self) -> None:
        """Write what was received to the disk, with what comes within `COMMIT_S`."""
        if not self._commit_due:
            self._commit_due = True
            wait_s = max(0.0, self._committed_s + COMMIT_S - monotonic_s())
            asyncio.get_running_loop().call_later(wait_s, self._commit)

    def _commit(self) -> None:
        self._commit_due = False
        self._committed_s = monotonic_s()
        self.flight.commit()

    def _written(self) -> None:
        """Show what the disk has, or has refused."""
        if text := self.flight.mended():
            self.note(3, text)
        self._show_received()

    def _show_received(self) -> None:
        unshown, self._unshown = self._unshown, []
        for event, record in unshown:
            if self._on_event is not None:
                self._on_event(event)
            if record["flight_id"] is not None:
                self.hub.send("pulse" if isinstance(event, PulsePose) else "burst", record)

    def _once_a_second(self) -> None:
        now_ns = self.clock.now_ns()
        link, watch = self.link, self.vehicle
        if self._serving is not None and self._serving.done():
            # A link that was given up for another has no exception, and raises when asked.
            ended = None if self._serving.cancelled() else self._serving.exception()
            self.link_error = str(ended or "closed")
            self.link = self._serving = self.vehicle = None
        if link is not None and link.link is not None and watch is not None:
            for message in (*watch.requests(now_ns), *watch.questions(now_ns)):
                link.send(message)
            self._tell_others(now_ns)
            self._keep_home(watch.home, now_ns)
            self._keep_battery(watch.battery_percent, now_ns)
            link.send(watch.ping(now_ns))
            self._watch_presence(link.protocol.present(now_ns))
            self._tell_faults(link.faults)
        if self._disk.failure is not None:
            raise self._disk.failure
        self._show_received()
        self._commit()
        self.send_state()

    def _watch_presence(self, present: bool) -> None:
        if present:
            self._contact_ns = self.clock.now_ns()
        if present != self._was_present:
            self._was_present = present
            self.note(6 if present else 3, "drone found" if present else "drone lost")
            if not present:
                self.state = None

    def _keep_home(self, home: tuple[float, float] | None, now_ns: int) -> None:
        """Write where the vehicle took off into the flight, once and when it changes."""
        key = (self.flight.flight_id, home)
        if home is not None and not self.flight.ended and key != self._home_kept:
            self._home_kept = key
            self.flight.add_note(home_note(*home), now_ns)

    def _keep_battery(self, percent: int | None, now_ns: int) -> None:
        """Write what is left into the flight: a season's summary counts batteries by it."""
        flight_id, noted = self.flight.flight_id, self._battery_kept
        if percent is None or self.flight.ended:
            return
        if noted[0] != flight_id or abs(noted[1] - percent) >= BATTERY_STEP_PERCENT:
            self._battery_kept = (flight_id, percent)
            self.flight.add_note(battery_note(percent), now_ns)

    def _tell_others(self, now_ns: int) -> None:
        """Name other vehicles on this link, each once, and another under our number."""
        ours = self.identity.system_id
        self._named |= {one.identity.system_id or 0 for one in self.companions}
        for system_id in sorted(set(self.identity.others) - self._named):
            self._named.add(system_id)
            self.note(4, f"another vehicle, {system_id}, is heard; this page keeps to {ours}")
        foreign = self.identity.foreign(now_ns)
        if foreign and not self._foreign_told:
            who = "autopilot" if self.vehicle_flies else "station"
            self.note(2, f"another {who} answers under the number {ours}: {FOREIGN_REMEDY}")
        self._foreign_told = foreign
        self.store.set_served(ours, self.identity.uid, self.commander.page)

    @property
    def vehicle_flies(self) -> bool:
        """Whether an autopilot speaks for our vehicle; else it is a mast, or a person."""
        return self.vehicle is not None and self.vehicle.autopilot is not None

    def choose_vehicle(self, system_id: int) -> None:
        """Serve another vehicle; the flight of the one before ends here, not on its drone.

        Raises `UsageError`: it has a page of its own, or this is the page of a further vehicle.
        """
        if self.store.system_id is not None:
            raise UsageError(f"this page is that of vehicle {self.store.system_id}")
        if any(one.identity.system_id == system_id for one in self.companions):
            raise UsageError(f"vehicle {system_id} has a page of its own")
        if not self.flight.ended:
            self._end_flight()
        self.identity.choose(system_id)
        self._named.clear()
        self._foreign_told = False
        self.state, self.temperature_c, self.drone_directory = None, None, ""
        self.sent_tags = ()
        self._bench.forget()
        self.flying.forget()
        if self.link is not None:
            self.link.protocol.forget()
            self.vehicle = VehicleWatch(self.link.protocol.own, self.identity)
        self.note(5, f"this page serves vehicle {system_id} now")
        self.send_state()

    def _tell_faults(self, faults: int) -> None:
        """Report frames that could not be handled: of the first, then when they double."""
        if faults.bit_length() > self._faults_told.bit_length():
            self._faults_told = faults
            self.note(3, f"{faults} frames could not be handled: this program's log says why")

    def estimate_soon(self) -> None:
        """Another vehicle has found out more about the tags."""
        self._estimate_due = True

    def _start_estimate(self) -> None:
        self._estimate_due = False
        self._estimate_at_s = float("inf")
        self._estimating = asyncio.get_running_loop().create_task(self._estimate())

    async def _estimate(self) -> None:
        async with self._one_at_a_time:
            await self._estimate_now()

    @property
    def _name(self) -> str:
        """What this vehicle is called beside others."""
        number, name = self.identity.system_id, self.store.settings.vehicle_name
        return "this vehicle" if number is None else vehicle_note(number, name)

    async def _estimate_now(self) -> None:
        columns = self.flight.columns()
        flight_id = self.flight.flight_id
        begun_s = monotonic_s()
        antenna, estimator = self.store.settings.antenna_choice, self._estimator
        past: Sequence[HeardInTurn] = ()
        try:
            if flight_id is not None:
                place = self.store.directory / flight_id
                past = await asyncio.to_thread(estimator.past, place, antenna)
            found = await asyncio.to_thread(
                estimator.estimate,
                columns,
                antenna,
                tuple(self.drone_bearings.values()),
                self.sent_tags,
                [one.estimates for one in self.companions],
                past,
                self._name,
                self.store.chosen_tags,
            )
        except UavrtError as error:
            if str(error) != self._estimate_fault:
                self._estimate_fault = str(error)
                self.note(4, f"No estimate: {error}")
            return
        finally:
            took_s = monotonic_s() - begun_s
            others = len(self.companions)
            share = ESTIMATE_SHARE_OF_SEVERAL * (1 + others) if others else ESTIMATE_SHARE
            wait_s = max(ESTIMATE_LEAST_S, share * took_s)
            self._estimate_at_s = monotonic_s() + wait_s
        if flight_id == self.flight.flight_id:
            if found.outline != self.estimates.outline:
                for companion in self.companions:
                    companion.estimate_soon()
            self.estimates, self._estimate_fault = found, ""
            self._estimate_due |= found.more
            if not found.more or monotonic_s() >= self._shown_s + ESTIMATES_SHOWN_S:
                self._shown_s = monotonic_s()
                self.hub.send("estimates", {"flight_id": flight_id, **found.record()})

    def note(self, severity: int, text: str, *, source: str = "ground") -> None:
        """Write a line of the log and show it."""
        line = self.log.add(self.clock.now_ns(), severity, text, source)
        self.hub.send("log", line)
        if source == "ground" and severity <= _WARNING and self._on_event is not None:
            self._on_event(StationNote(severity, text))
