"""The ground station behind the page: link, state, commands, estimates, storage.

Nothing is kept only in a browser: whatever is received is stored first, then shown to every
listener. `uavrt.ground.server` puts it on HTTP and WebSocket.
"""

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import uavrt
from uavrt import tunnel
from uavrt.clock import Clock, monotonic_s
from uavrt.errors import LinkError, UavrtError
from uavrt.ground.actions import ACTIONS, Busy, Situation, action_states
from uavrt.ground.estimates import Estimates, Estimator
from uavrt.ground.event_log import EventLog
from uavrt.ground.flight_keeper import FlightKeeper
from uavrt.ground.flights import FlightLibrary
from uavrt.ground.hub import Hub
from uavrt.ground.link import (
    Acknowledged,
    DetectorAlive,
    DroneHeartbeat,
    GroundEvent,
    GroundLink,
)
from uavrt.ground.settings import GroundStore
from uavrt.ground.tag_table import rows_from_tags
from uavrt.ground.vehicle import VehicleWatch
from uavrt.log import get_logger
from uavrt.mavlink.frame import Frame
from uavrt.messages import Pose, PulsePose, SearchReport, StatusText, SystemState, Tag
from uavrt.recording.pulse_files import pulse_record
from uavrt.units import NANOSECONDS_PER_SECOND

log = get_logger()

TICK_S = 0.25
STATE_S = 1.0
POSE_SEND_NS = 190_000_000
LATE_PULSES_NS = 5 * NANOSECONDS_PER_SECOND
"""A pulse heard this long after the stop is of another flight, unless it was before it."""
ESTIMATE_LEAST_S = 0.4
ESTIMATE_SHARE = 8.0
"""Estimates run again after eight times as long as they took: at most 11 % of a core."""
SKEW_TOLERANCE_NS = 3 * NANOSECONDS_PER_SECOND
"""Pulses come 0.5 to 2 s after they were; more, or before, is the drone's clock."""

ESSENTIAL = (SystemState.DETECTING, SystemState.CAPTURING)


class GroundSession:
    """One ground station; `run` serves it until cancelled.

    Parameters
    ----------
    store : GroundStore
        Its directory.
    clock : Clock
        The ground's clock.
    on_event : callable, optional
        Called with each thing heard from the drone, before it is shown.
    """

    def __init__(
        self,
        store: GroundStore,
        clock: Clock,
        on_event: Callable[[GroundEvent], None] | None = None,
    ) -> None:
        self.store = store
        self.clock = clock
        self.hub = Hub()
        self.library = FlightLibrary(store.directory)
        self.flight = FlightKeeper(store.directory, clock)
        self.log = EventLog(store.log_path)
        self.link: GroundLink | None = None
        self.link_error: str | None = None
        self.state: SystemState | None = None
        self.busy: Busy | None = None
        self.sent_tags: tuple[Tag, ...] = ()
        self.estimates = Estimates(bearings=[], positions=[])
        self._on_event = on_event
        self._estimator = Estimator()
        self._estimate_due = False
        self._estimate_at_s = 0.0
        self._vehicle: VehicleWatch | None = None
        self._serving: asyncio.Task[None] | None = None
        self._estimating: asyncio.Task[None] | None = None
        self._commit_due = False
        self._temperature_c: float | None = None
        self._heard: dict[int, int] = {}
        self._drone_directory = ""
        self._stopped_ns: int | None = None
        self._skew_ns: int | None = None
        self._was_present = False
        self._last_pose_ns = 0
        self.last_pulse_s = 0.0

    # ------------------------------------------------------------------- serving

    async def run(self) -> None:
        """Serve until cancelled; connect to the address that is set."""
        self._resume()
        try:
            with contextlib.suppress(UavrtError):
                await self.connect()
            next_state_s = 0.0
            while True:
                await asyncio.sleep(TICK_S)
                now_s = monotonic_s()
                if self._estimate_due and now_s >= self._estimate_at_s:
                    self._start_estimate()
                if now_s >= next_state_s:
                    next_state_s = now_s + STATE_S
                    self._once_a_second()
        finally:
            await self.disconnect()
            if self._estimating is not None:
                self._estimating.cancel()
            self.flight.close()
            self.hub.close()

    async def connect(self) -> None:
        """Open the link that is set, in place of any other.

        Raises
        ------
        LinkError
            It cannot be opened; the state says why, too.
        """
        await self.disconnect()
        settings = self.store.settings
        link = GroundLink(
            self.clock.now_ns,
            on_event=self._take,
            on_frame=self._take_frame,
            generation=settings.generation,
        )
        link.protocol.tags = {tag.tag_id: tag for tag in self.sent_tags}
        self._vehicle = VehicleWatch(link.protocol.own)
        task = asyncio.create_task(link.run(settings.address))
        for _ in range(200):
            if task.done() or link.link is not None:
                break
            await asyncio.sleep(0.01)
        if task.done() and (error := task.exception()) is not None:
            self.link_error = str(error)
            self._note(3, self.link_error)
            self.send_state()
            raise LinkError(self.link_error)
        self.link, self._serving, self.link_error = link, task, None
        self._note(6, f"connected to {settings.address}")
        self.send_state()

    async def disconnect(self) -> None:
        """Close the link."""
        if self._serving is not None:
            self._serving.cancel()
            with contextlib.suppress(asyncio.CancelledError, UavrtError):
                await self._serving
        self.link = self._serving = self._vehicle = None
        self.state = None
        self._was_present = False

    # ------------------------------------------------------------------- commands

    async def send_tags(self) -> str:
        """Send the tag table to the drone; gives what to tell the operator.

        Raises
        ------
        CommandRefused, LinkError
            The drone refused, or did not answer.
        """
        tags = self.store.tags
        link = self._allowed("send_tags")
        async with self._working("send_tags", f"sending {len(tags)} tags"):
            await link.upload_tags(tags, self._progress)
            self.sent_tags = tags
            return f"{len(tags)} tags sent"

    async def start(self) -> str:
        """Start detection; the ground begins a flight of its own."""
        link = self._allowed("start")
        settings = self.store.settings
        async with self._working("start", "starting"):
            frequency = settings.center_frequency_mhz
            self._drone_directory = await link.start_detection(
                center_frequency_hz=None if frequency is None else frequency * 1e6,
                gain=settings.gain or 0,
            )
            if self.flight.ended:
                self._begin_flight()
            return self._drone_directory or "detecting"

    async def stop(self) -> str:
        """Stop detection or capture."""
        link = self._allowed("stop")
        async with self._working("stop", "stopping"):
            await link.stop_detection()
            return "stopped"

    async def capture(self) -> str:
        """Record raw samples on the drone."""
        link = self._allowed("capture")
        settings = self.store.settings
        async with self._working("capture", "asking for a raw capture"):
            frequency = settings.center_frequency_mhz
            message = tunnel.RawCapture(
                gain=settings.gain or 0,
                frequency_hz=None if frequency is None else round(frequency * 1e6),
            )
            return (await link.command(message.encode())).message or "capturing"

    async def mark(self, text: str = "") -> str:
        """Write a remark with the time and the drone's place into the flight."""
        now_ns = self.clock.now_ns()
        pose = self._vehicle.pose if self._vehicle else None
        place = "" if pose is None else f" at {pose.latitude_deg:.6f}, {pose.longitude_deg:.6f}"
        note = f"mark{place}" + (f": {text.strip()[:200]}" if text.strip() else "")
        self.flight.add_note(note, now_ns)
        self._commit_soon()
        self._note(6, note)
        return note

    def _allowed(self, action: str) -> GroundLink:
        """Get the link, when the action is allowed now."""
        state = action_states(self._situation())[action]
        if not state["enabled"]:
            raise LinkError(str(state["reason"]))
        assert self.link is not None
        return self.link

    @contextlib.asynccontextmanager
    async def _working(self, action: str, text: str) -> Any:
        self.busy = Busy(action=action, text=text)
        self.send_state()
        try:
            yield
        except UavrtError as error:
            self._note(4, f"{ACTIONS[action]} failed: {error}")
            raise
        finally:
            self.busy = None
            self.send_state()

    def _progress(self, done: int, whole: int) -> None:
        if self.busy is not None:
            self.busy = replace(self.busy, done=done, whole=whole)
            self.send_state()

    # ------------------------------------------------------------------- what is shown

    def snapshot(self) -> dict[str, Any]:
        """Everything that a page needs besides the flight's pulses."""
        now_ns = self.clock.now_ns()
        link, watch = self.link, self._vehicle
        situation = self._situation()
        pose = watch.pose if watch else None
        return {
            "time_ns": now_ns,
            "version": uavrt.__version__,
            "connection": {
                "address": self.store.settings.address,
                "open": link is not None and link.link is not None,
                "error": self.link_error,
            },
            "drone": {
                "present": situation.drone_present,
                "system_id": link.protocol.drone.system_id
                if link and link.protocol.drone
                else None,
                "state": self.state.value if self.state else None,
                "cpu_temperature_c": self._temperature_c,
                "directory": self._drone_directory or None,
                "clock_skew_s": None if self._skew_ns is None else self._skew_ns / 1e9,
            },
            "link": self._link_state(now_ns),
            "vehicle": None if pose is None else pose_record(pose, now_ns),
            "armed": watch.armed if watch else None,
            "battery_v": watch.battery_v if watch else None,
            "battery_percent": watch.battery_percent if watch else None,
            "flight": {
                "flight_id": self.flight.flight_id,
                "start_time_ns": self.flight.start_time_ns,
                "ended": self.flight.ended,
                "pulses": self.flight.pulses,
                "fault": self.flight.fault,
            },
            "tags_sent": bool(self.sent_tags) and self.sent_tags == self.store.tags,
            "detectors": {
                str(tag_id): (now_ns - heard_ns) / 1e9
                for tag_id, heard_ns in self._heard.items()
            },
            "busy": None if self.busy is None else asdict(self.busy),
            "actions": action_states(situation),
        }

    def hello(self) -> dict[str, Any]:
        """First record of a listener: all that stands."""
        return {
            "state": self.snapshot(),
            "tags": rows_from_tags(self.store.tags),
            "settings": asdict(self.store.settings),
            "bearings": self.estimates.bearings,
            "positions": self.estimates.positions,
            "log": self.log.lines(),
        }

    def send_state(self) -> None:
        """Show the state to all listeners."""
        self.hub.send("state", self.snapshot())

    def tags_changed(self) -> None:
        """Show the tag table to all listeners."""
        self.hub.send("tags", rows_from_tags(self.store.tags))
        self.send_state()

    def settings_changed(self) -> None:
        """Show the settings to all listeners and estimate anew."""
        self.hub.send("settings", asdict(self.store.settings))
        self._estimate_due = True
        self.send_state()

    def _link_state(self, now_ns: int) -> dict[str, Any]:
        link, watch = self.link, self._vehicle
        if link is None or link.link is None or watch is None:
            return {"loss": None, "round_trip_s": None, "radio": None, "counters": {}}
        return {
            "loss": watch.loss.share(now_ns),
            "round_trip_s": watch.round_trip_s,
            "radio": None if watch.radio is None else asdict(watch.radio),
            "counters": {**asdict(link.link.counters), **link.protocol.counters},
        }

    def _situation(self) -> Situation:
        link = self.link
        present = link is not None and link.protocol.present(self.clock.now_ns())
        return Situation(
            link_open=link is not None and link.link is not None,
            drone_present=present,
            state=self.state,
            tags=len(self.store.tags),
            tags_sent=self.sent_tags == self.store.tags,
            busy=self.busy,
            flight_open=self.flight.flight_id is not None,
        )

    # ------------------------------------------------------------------- what comes

    def _take_frame(self, frame: Frame) -> None:
        if self._vehicle is None:
            return
        now_ns = self.clock.now_ns()
        pose = self._vehicle.receive(frame, now_ns)
        if pose is None:
            return
        self.flight.add_pose(replace(pose, time_ns=now_ns - (self._skew_ns or 0)))
        if now_ns - self._last_pose_ns >= POSE_SEND_NS:
            self._last_pose_ns = now_ns
            self.hub.send("pose", pose_record(pose, now_ns))
            if not self.flight.ended:
                self._commit_soon()

    def _take(self, event: GroundEvent) -> None:
        if self._on_event is not None:
            self._on_event(event)
        now_ns = self.clock.now_ns()
        match event:
            case PulsePose():
                self._take_pulse(event, now_ns)
            case SearchReport():
                self._heard[event.tag_id] = now_ns
                self.flight.add_search_report(event)
                self.hub.send("search", asdict(event))
            case DetectorAlive():
                self._heard[event.tag_id] = now_ns
            case DroneHeartbeat():
                self._take_heartbeat(event)
            case StatusText():
                self.flight.add_text(event.severity, event.text, now_ns)
                self._note(event.severity, event.text, source="drone")
            case Acknowledged():
                name = tunnel.CommandId(event.command).name.lower().replace("_", " ")
                answer = "done" if event.accepted else "refused"
                text = f"{name}: {answer}" + (f" – {event.message}" if event.message else "")
                self._note(6 if event.accepted else 4, text, source="acknowledgement")

    def _take_pulse(self, event: PulsePose, now_ns: int) -> None:
        self._heard[event.pulse.tag_id] = now_ns
        self.last_pulse_s = monotonic_s()
        self._learn_skew(now_ns - event.pulse.end_time_ns)
        if self.flight.flight_id is None or self._is_of_next_flight(event):
            self._begin_flight()
        if not self.flight.add_pulse(event):
            return
        self._estimate_due = True
        # Written first, shown then; pulses that come together are one transaction.
        self._commit_soon()
        record = pulse_record(event) | {
            "received_ns": now_ns,
            "flight_id": self.flight.flight_id,
        }
        asyncio.get_running_loop().call_soon(self.hub.send, "pulse", record)

    def _is_of_next_flight(self, event: PulsePose) -> bool:
        """Whether a pulse was sent after the flight had ended: someone else started again."""
        if not self.flight.ended or self._stopped_ns is None:
            return False
        sent_ns = event.pulse.start_time_ns + (self._skew_ns or 0)
        return sent_ns > self._stopped_ns + LATE_PULSES_NS

    def _take_heartbeat(self, event: DroneHeartbeat) -> None:
        before, self.state = self.state, event.state
        self._temperature_c = event.cpu_temperature_c
        if before is event.state:
            return
        self._note(6, f"drone is {event.state.value if event.state else 'in an unknown state'}")
        if event.state in ESSENTIAL and self.flight.ended:
            self._begin_flight()
        elif event.state not in ESSENTIAL and not self.flight.ended and before in ESSENTIAL:
            self._end_flight()
        self.send_state()

    def _learn_skew(self, delay_ns: int) -> None:
        """Learn how far the drone's clock is behind ours, from the promptest pulse."""
        skew = delay_ns if abs(delay_ns) > SKEW_TOLERANCE_NS else 0
        if self._skew_ns is None or skew < self._skew_ns:
            if skew != 0:
                self._note(4, f"the drone's clock differs by {-skew / 1e9:.0f} s")
            self._skew_ns = skew

    # ------------------------------------------------------------------- flight

    def _resume(self) -> None:
        """Go on with the flight that a restart interrupted."""
        kept = self.store.current_flight
        if kept is None or not self.flight.resume(kept):
            return
        self.flight.load(self.library.columns(kept))
        self.sent_tags = self.library.summary(kept).tags
        self._estimate_due = True
        self._note(6, f"flight {kept} goes on")

    def _begin_flight(self) -> None:
        flight_id = self.flight.begin(self.sent_tags or self.store.tags)
        self.store.set_flight(flight_id)
        self.estimates = Estimates(bearings=[], positions=[])
        self._estimator = Estimator()
        self._stopped_ns = None
        self._heard.clear()
        self.hub.send("flight", {"flight_id": flight_id})
        self.send_state()

    def _end_flight(self) -> None:
        self.flight.commit()
        self.flight.ended = True
        self._stopped_ns = self.clock.now_ns()
        self.store.set_flight(None)

    def _commit_soon(self) -> None:
        if not self._commit_due:
            self._commit_due = True
            asyncio.get_running_loop().call_soon(self._commit)

    def _commit(self) -> None:
        self._commit_due = False
        self.flight.commit()

    # ------------------------------------------------------------------- regularly

    def _once_a_second(self) -> None:
        now_ns = self.clock.now_ns()
        link, watch = self.link, self._vehicle
        if self._serving is not None and self._serving.done():
            self.link_error = str(self._serving.exception() or "closed")
            self.link = self._serving = self._vehicle = None
        if link is not None and link.link is not None and watch is not None:
            for message in watch.requests(now_ns):
                link.send(message)
            link.send(watch.ping(now_ns))
            self._watch_presence(link.protocol.present(now_ns))
        self.flight.commit()
        self.send_state()

    def _watch_presence(self, present: bool) -> None:
        if present != self._was_present:
            self._was_present = present
            self._note(6 if present else 3, "drone found" if present else "drone lost")
            if not present:
                self.state = None

    def _start_estimate(self) -> None:
        self._estimate_due = False
        self._estimate_at_s = float("inf")
        self._estimating = asyncio.get_running_loop().create_task(self._estimate())

    async def _estimate(self) -> None:
        columns = self.flight.columns()
        flight_id = self.flight.flight_id
        begun_s = monotonic_s()
        try:
            found = await asyncio.to_thread(
                self._estimator.estimate, columns, self.store.settings.antenna_choice
            )
        except UavrtError as error:
            log.warning("no estimate", reason=str(error))
            return
        finally:
            took_s = monotonic_s() - begun_s
            wait_s = max(ESTIMATE_LEAST_S, ESTIMATE_SHARE * took_s)
            self._estimate_at_s = monotonic_s() + wait_s
        if flight_id == self.flight.flight_id:
            self.estimates = found
            record = {"bearings": found.bearings, "positions": found.positions}
            self.hub.send("estimates", {"flight_id": flight_id, **record})

    def _note(self, severity: int, text: str, *, source: str = "ground") -> None:
        line = self.log.add(self.clock.now_ns(), severity, text, source)
        self.hub.send("log", line)


def pose_record(pose: Pose, now_ns: int) -> dict[str, Any]:
    """The vehicle's pose as JSON takes it."""
    roll_deg, pitch_deg, yaw_deg = tunnel.euler_deg(pose.quaternion_wxyz)
    return {
        "time_ns": pose.time_ns,
        "age_s": (now_ns - pose.time_ns) / 1e9,
        "latitude_deg": pose.latitude_deg,
        "longitude_deg": pose.longitude_deg,
        "altitude_amsl_m": pose.altitude_amsl_m,
        "altitude_relative_m": pose.altitude_relative_m,
        "roll_deg": roll_deg,
        "pitch_deg": pitch_deg,
        "heading_deg": yaw_deg % 360.0,
    }
