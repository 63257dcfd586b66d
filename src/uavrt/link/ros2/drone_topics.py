"""Publish the drone's pulses, poses, states and commands on ROS 2."""

from collections.abc import Callable, Mapping

from uavrt.core.commands import SystemState
from uavrt.core.errors import LinkError
from uavrt.core.messages import Command, FlightInfo, Pose, Pulse
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.link.ros2 import ros_records as convert
from uavrt.link.ros2.drone_state import DroneState, RosLog
from uavrt.link.ros2.graph import COMPONENTS, TOPICS, detector_node
from uavrt.link.ros2.network.bus import Bus
from uavrt.link.ros2.status import STALE_AFTER_S, component_status, detector_of_tag
from uavrt.link.ros2.types.ros_messages import (
    OK,
    DiagnosticArray,
    DiagnosticStatus,
    Flag,
    Header,
    RosPulse,
)
from uavrt.localization.pose.mounting import Mounting

STATUS_PERIOD_S = 0.5
POSE_PERIOD_S = 0.5
HEARTBEAT_PERIOD_S = 1.0


class DroneTopics:
    """Publishes pulses, poses, states and commands of the drone on ROS 2."""

    def __init__(
        self, bus: Bus, drone: DroneState, log: RosLog, now_ns: Callable[[], int]
    ) -> None:
        self._bus, self._drone, self._log, self._now_ns = bus, drone, log, now_ns
        self._mounting = Mounting.from_settings(drone.settings.antenna)
        self._parts: dict[str, tuple[DiagnosticStatus, ...]] = {}
        """State of each component in the supervisor's last report, sent once a second."""
        self._pose: Pose | None = None
        self._next_status_ns = self._next_pose_ns = 0
        self._next_heartbeat_ns: dict[int, int] = {}
        self._detectors: frozenset[int] = frozenset()
        """Tags whose detectors have their own ROS 2 node."""
        self.published = 0
        """Number of pulses published on ROS 2."""
        self._show_detectors()

    def pulse(self, pulse: Pulse) -> None:
        """Publish a pulse; for a burst of a coded tag, also publish the single pulses."""
        self.published += 1
        directory = self._drone.tag_directory(pulse.tag_id)
        self._publish_pulse(pulse.tag_id, convert.pulse_to_ros(pulse, directory))
        if pulse.burst_starts_ns:
            self._bus.publish("burst", convert.burst_to_ros(pulse, directory))

    def record(self, record: object) -> None:
        """Publish a record on every topic that shows records of its type."""
        for topic in TOPICS.values():
            if topic.made_of is not None and isinstance(record, topic.made_of[0]):
                self._bus.publish(
                    topic.name, topic.made_of[1](record, self._drone.tag_directory)
                )

    def pose(self, pose: Pose) -> None:
        """Store the pose that `tick` publishes next."""
        self._pose = pose

    def status_changed(self) -> None:
        """Discard the component states; `tick` then publishes those of the latest status."""
        self._parts.clear()

    def flight_changed(self, *, started: bool) -> None:
        """Publish a flight's start or end; restart the schedule, as the clock may differ."""
        self._next_status_ns = self._next_pose_ns = 0
        self._next_heartbeat_ns.clear()
        self._show_detectors()
        flight = self._drone.flight
        if started and flight is not None:
            self._show_start(flight)
        elif flight is None:
            for component in COMPONENTS:
                self._control(component, self._order("stop", "stop all"))

    def tick(self, now_ns: int) -> None:
        """Publish poses, states and heartbeats that are due."""
        if now_ns >= self._next_status_ns:
            self._next_status_ns = _next_due(self._next_status_ns, now_ns, STATUS_PERIOD_S)
            self._show_status(now_ns)
        if self._pose is not None and now_ns >= self._next_pose_ns:
            self._next_pose_ns = _next_due(self._next_pose_ns, now_ns, POSE_PERIOD_S)
            pose, self._pose = self._mounting.antenna_pose(self._pose), None
            self._bus.publish("antenna_pose", convert.pose_stamped(pose))
        self._show_heartbeats(now_ns)

    def _publish_pulse(self, tag_id: int, message: RosPulse) -> None:
        node = detector_node(tag_id) if tag_id in self._detectors else None
        self._bus.publish("pulse", message, node)

    def _show_detectors(self) -> None:
        """Keep a ROS 2 node for each tag of this flight until the next flight starts."""
        if not self._drone.settings.ros2.node_per_tag or self._drone.flight is None:
            return
        tag_ids = [tag.tag_id for tag in self._drone.flight.tags]
        try:
            self._bus.show_detectors([detector_node(tag_id) for tag_id in tag_ids])
        except LinkError as error:
            self._log.write(4, str(error))
            return
        self._detectors = frozenset(tag_ids)

    def command(self, command: Command) -> None:
        """Publish a command of the ground station, as the original system did."""
        match command.name:
            case "add_tag" if command.tag is not None and command.tag.coded:
                coded = convert.coded_tag_to_ros(command.tag)
                self._bus.publish("store_coded_tag_information", coded)
            case "add_tag" if command.tag is not None:
                self._bus.publish("store_tag_information", convert.tag_to_ros(command.tag))
            case "end_tags":
                self._bus.publish("release_tag_information", Flag(data=True))
            case "start_detection":
                order = self._order("start", "start all", frame="start_command_subprocesses")
                self._bus.publish("control_start_subprocess", order)
            case "stop_detection":
                order = self._order("stop", "stop all", frame="stop_command_subprocesses")
                self._bus.publish("control_stop_subprocess", order)

    def _show_start(self, flight: FlightInfo) -> None:
        """Publish a start to each component: one message for each tag's detector."""
        center = {"center_frequency": f"{flight.center_frequency_hz / 1e6:.6f}"}
        radio = self._order("start", self._drone.settings.radio.kind, center)
        self._control("channelizer", self._order("start", "receiver", center))
        self._control("airspy_csdr_netcat", radio)
        for tag in flight.tags:
            values = center | {"config_path": self._drone.tag_directory(tag.tag_id)}
            self._control("detector", self._order("start", f"tag_id_{tag.tag_id}", values))

    def _control(self, component: str, order: DiagnosticArray) -> None:
        """Publish a command to a component, and the component's confirmation."""
        self._bus.publish(f"control_{component}_subprocess", order)
        self._bus.publish(f"status_{component}_subprocess", order)

    def _order(
        self,
        what: str,
        hardware_id: str,
        values: Mapping[str, object] | None = None,
        *,
        frame: str = "control",
    ) -> DiagnosticArray:
        status = DiagnosticStatus(
            level=OK,
            name="NA",
            message=what,
            hardware_id=hardware_id,
            values=convert.key_values(values or {}),
        )
        header = Header(stamp=convert.time_to_ros(self._now_ns()), frame_id=frame)
        return DiagnosticArray(header=header, status=(status,))

    def _show_status(self, now_ns: int) -> None:
        header = Header(stamp=convert.time_to_ros(now_ns), frame_id="status")
        age_s = (now_ns - self._drone.status_heard_ns) * 1e-9
        if age_s > STALE_AFTER_S:
            self._parts.clear()
        for component in COMPONENTS:
            if component not in self._parts:
                self._parts[component] = component_status(
                    component, self._drone.status, age_s, self._drone.settings
                )
            array = DiagnosticArray(header=header, status=self._parts[component])
            self._bus.publish(f"status_{component}_subprocess", array)

    def _show_heartbeats(self, now_ns: int) -> None:
        """Publish the heartbeats of running detectors, spread over the second."""
        status = self._drone.status
        if status is None or status.state is not SystemState.DETECTING:
            self._next_heartbeat_ns.clear()
            return
        if now_ns - self._drone.status_heard_ns > STALE_AFTER_S * NANOSECONDS_PER_SECOND:
            return
        detectors = detector_of_tag(status)
        for index, tag in enumerate(status.tags):
            due_ns = self._next_heartbeat_ns.get(tag.tag_id)
            if due_ns is None:
                self._next_heartbeat_ns[tag.tag_id] = now_ns + index * 10_000_000 % 10**9
            elif now_ns >= due_ns:
                self._next_heartbeat_ns[tag.tag_id] = _next_due(
                    due_ns, now_ns, HEARTBEAT_PERIOD_S
                )
                detector = detectors.get(tag.tag_id)
                if detector is not None and detector.running:
                    directory = self._drone.tag_directory(tag.tag_id)
                    beat = convert.heartbeat(tag.tag_id, now_ns, directory)
                    self._publish_pulse(tag.tag_id, beat)


def _next_due(due_ns: int, now_ns: int, period_s: float) -> int:
    """Return the time of the next heartbeat [ns]; heartbeats that are overdue are skipped."""
    period_ns = ns_from_s(period_s)
    return due_ns + period_ns if now_ns - due_ns < period_ns else now_ns + period_ns
