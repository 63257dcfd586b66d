"""Pass a vehicle's MAVLink frames and its drone's events to the station's parts."""

from collections.abc import Callable
from dataclasses import asdict, replace

from uavrt.core.messages import (
    Beep,
    BurstInside,
    Course,
    LiveBearing,
    PulsePose,
    SearchReport,
    StatusText,
)
from uavrt.flight.logs.pulse_files import pulse_record
from uavrt.ground.estimate_loop import EstimateLoop
from uavrt.ground.fetch.downloads import Downloads
from uavrt.ground.link.motions.page_motions import MotionCommands
from uavrt.ground.link.protocol import Acknowledged, DetectorAlive, DroneHeartbeat, GroundEvent
from uavrt.ground.link.served_vehicle import ServedVehicle
from uavrt.ground.snapshots import pose_record
from uavrt.link.mavlink.frame import Frame
from uavrt.link.tunnel.generations.wire import command_name
from uavrt.link.tunnel.own_messages.motion_messages import MotionState

POSE_SEND_NS = 190_000_000


class Reception:
    """Passes frames and events of one vehicle to the parts of the station that use them."""

    def __init__(
        self,
        vehicle: ServedVehicle,
        estimates: EstimateLoop,
        flying: MotionCommands,
        downloads: Downloads,
        on_course: Callable[[Course], None],
    ) -> None:
        self._vehicle, self._estimates = vehicle, estimates
        self._flying, self._downloads = flying, downloads
        self._on_course = on_course
        self._last_pose_ns = 0

    def receive_frame(self, frame: Frame) -> None:
        """Handle a frame of the link, whether from the drone or the autopilot."""
        vehicle, watch = self._vehicle, self._vehicle.connection.watch
        if watch is None:
            return
        self._downloads.receive(frame)
        now_ns = vehicle.clock.now_ns()
        pose = watch.receive(frame, now_ns)
        drones_ns = now_ns - (vehicle.drone.skew_ns or 0)
        vehicle.flight.keeper.add_state(drones_ns, watch.armed, watch.landed)
        if pose is None:
            return
        vehicle.flight.keeper.add_pose(replace(pose, time_ns=drones_ns))
        if now_ns - self._last_pose_ns >= POSE_SEND_NS:
            self._last_pose_ns = now_ns
            vehicle.feed.send("pose", pose_record(pose, now_ns))

    def receive_event(self, event: GroundEvent) -> None:
        """Pass on an event of the drone: pulse, report, state or message."""
        vehicle, drone, keeper = self._vehicle, self._vehicle.drone, self._vehicle.flight.keeper
        if not isinstance(event, PulsePose | BurstInside):  # these once they are stored
            vehicle.feed.emit(event)
        now_ns = vehicle.clock.now_ns()
        drone.bench.add(event, now_ns)
        match event:
            case PulsePose():
                self._receive_pulse(event, now_ns)
            case BurstInside():
                here = keeper.put_inside(event)
                record = asdict(event) | {"flight_id": keeper.flight_id if here else None}
                vehicle.flight.show_soon(event, record)
            case SearchReport():
                drone.heard[event.tag_id] = now_ns
                keeper.write(event)
                vehicle.feed.send("search", asdict(event))
            case DetectorAlive():
                drone.heard[event.tag_id] = now_ns
                drone.bench.alive(event.tag_id, now_ns)
            case Beep() if drone.receive_beep(event, vehicle.store.corrections):
                keeper.write(event)
                vehicle.feed.send_state()
            case LiveBearing():
                drone.bearings[event.tag_id, event.start_time_ns] = event
                self._estimates.soon()
            case DroneHeartbeat():
                vehicle.receive_heartbeat(event)
            case MotionState():
                self._flying.receive_state(event)
            case Course():
                self._on_course(event)
            case StatusText():
                keeper.add_text(event.severity, event.text, now_ns)
                vehicle.feed.note(event.severity, event.text, source="drone")
            case Acknowledged():
                name = command_name(event.command)
                answer = "done" if event.accepted else "refused"
                text = f"{name}: {answer}" + (f" – {event.message}" if event.message else "")
                severity = 6 if event.accepted else 4
                vehicle.feed.note(severity, text, source="acknowledgement")

    def _receive_pulse(self, event: PulsePose, now_ns: int) -> None:
        vehicle, flight = self._vehicle, self._vehicle.flight
        if (difference := vehicle.drone.receive_pulse(event, now_ns)) is not None:
            vehicle.feed.note(4, difference)
        skew_ns = vehicle.drone.skew_ns or 0
        if flight.keeper.flight_id is None or flight.is_of_next(event, skew_ns):
            vehicle.begin_flight()
        if not flight.keeper.add_pulse(event):
            return
        self._estimates.soon()
        received = {"received_ns": now_ns, "flight_id": flight.keeper.flight_id}
        flight.show_soon(event, pulse_record(event) | received)
