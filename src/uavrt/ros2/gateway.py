"""The gateway's translation: the drone's records to ROS 2 messages, and commands back.

It knows nothing of sockets: it is given records, messages and the time, and returns records.
"""

from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import Any

from uavrt.allowance import Allowance
from uavrt.config import Settings
from uavrt.errors import FormatError, LinkError
from uavrt.messages import (
    Command,
    CommandName,
    CommandReply,
    FlightInfo,
    Pose,
    Poses,
    Pulse,
    PulsePose,
    StatusText,
    SystemState,
    SystemStatus,
)
from uavrt.pose import Mounting
from uavrt.ros2 import convert, graph
from uavrt.ros2.bus import Bus
from uavrt.ros2.cdr import decode
from uavrt.ros2.graph import AIRSPY, COMPONENTS, START_STOP, detector_node
from uavrt.ros2.messages import (
    ERROR,
    OK,
    DiagnosticArray,
    DiagnosticStatus,
    Flag,
    Header,
    Log,
    RosCodedTag,
    RosMessage,
    RosPulse,
    RosTag,
)
from uavrt.ros2.parameter_messages import ServiceMessage
from uavrt.ros2.parameters import ParameterServices
from uavrt.ros2.senders import UNKNOWN, Arrival
from uavrt.ros2.status import STALE_AFTER_S, component_status
from uavrt.ros2.upload import Upload
from uavrt.units import NANOSECONDS_PER_SECOND, ns_from_s

SOURCE = "ros2"
TAG_TOPICS = ("store_tag_information", "store_coded_tag_information")
STATUS_PERIOD_S = 0.5
POSE_PERIOD_S = 0.5
HEARTBEAT_PERIOD_S = 1.0
MESSAGES_AT_ONCE = 20
"""Received messages handled in one tick: at 20 ticks a second 400 a second, a hundred tags in a
quarter of a second; a flood costs no more than this."""
NEIGHBOURS_TOLD = 20
"""Other gateways that are named in the log, each once."""
REMEMBERED_PULSES = 1000
"""Pulses from other computers that must not be sent back to where they came from."""

LOG_LEVELS = (50, 50, 50, 40, 30, 20, 20, 10)
"""Level of ``rosout`` for each severity of MAVLink, 0 emergency to 7 debug."""


class Gateway:
    """Both directions; see the module's text.

    Parameters
    ----------
    bus : Bus
        The ROS 2 side.
    settings : Settings
        The drone side's settings.
    send : callable
        Takes a topic and a record for the supervisor.
    now_ns : callable
        Time [ns, UTC].
    flight : FlightInfo or None
        The flight in progress.
    """

    def __init__(
        self,
        bus: Bus,
        settings: Settings,
        send: Callable[[str, object], None],
        now_ns: Callable[[], int],
        flight: FlightInfo | None = None,
    ) -> None:
        self._bus = bus
        self._settings = settings
        self._namespace = settings.ros2.namespace
        self._send = send
        self._now_ns = now_ns
        self._flight = flight
        self._mounting = Mounting.from_settings(settings.antenna)
        self._status: SystemStatus | None = None
        self._status_heard_ns = 0
        self._parts: dict[str, tuple[DiagnosticStatus, ...]] = {}
        """Each component's state as of the supervisor's last word; that is once a second."""
        self._pose: Pose | None = None
        self._next_status_ns = self._next_pose_ns = 0
        self._next_heartbeat_ns: dict[int, int] = {}
        # Unlike any number of an earlier life of this process: the supervisor answers a number
        # it has seen before with the old reply.
        self._request_id = now_ns() // 1_000_000
        self._asked: OrderedDict[int, Command] = OrderedDict()
        self._begun = False
        """An upload was begun with the supervisor."""
        self._upload = Upload()
        self._parameters = ParameterServices(
            lambda: self._settings,
            self._running,
            ask=lambda name, value: self._ask("set_parameter", parameter=name, value=value),
            reply=bus.reply,
        )
        self._neighbours: set[str] = set()
        self._foreign: OrderedDict[tuple[int, int], None] = OrderedDict()
        # A hundred tags sent three times over, then what a person types; every command is
        # recorded, so a stranger could fill the disk.
        self._commands_allowed = Allowance(burst=400, per_s=10)
        self._pulses_allowed = Allowance(burst=1000, per_s=100)
        self._lines_allowed = Allowance(burst=50, per_s=1)
        self._detectors: frozenset[int] = frozenset()
        """Tags that have a node of their own."""
        self.counters: dict[str, float] = {
            "ros2_pulses_published": 0,
            "ros2_commands": 0,
            "ros2_messages_refused": 0,
            "ros2_pulses_taken": 0,
            "ros2_messages_of_gateways": 0,
        }
        self._show_detectors()

    # ------------------------------------------------- from the drone to ROS 2

    def take(self, record: Any) -> None:
        """Show a record of the drone side."""
        match record:
            case Pulse():
                self._show_pulse(record)
            case PulsePose():
                directory = self._tag_directory(record.pulse.tag_id)
                message = convert.pulse_pose_to_ros(record, directory)
                self._bus.publish("pulse_pose", message)
            case Poses(poses=poses) if poses:
                self._pose = poses[-1]
            case SystemStatus():
                self._status, self._status_heard_ns = record, self._now_ns()
                self._parts.clear()
            case Command() if record.source != SOURCE:
                self._show_command(record)
            case CommandReply():
                self._show_reply(record)
                self._parameters.answered(record)
            case Settings():
                self._settings = record
            case StatusText():
                self.log(record.severity, record.text)

    def take_flight(self, flight: FlightInfo | None) -> None:
        """Show that a flight has started, or (None) ended; it may bring another clock."""
        self._status_heard_ns = self._now_ns()
        self._next_status_ns = self._next_pose_ns = 0
        self._next_heartbeat_ns.clear()
        started, self._flight = flight is not None and self._flight is None, flight
        self._show_detectors()
        if started and flight is not None:
            self._show_start(flight)
        elif flight is None:
            for component in COMPONENTS:
                self._control(component, self._order("stop", "stop all"))

    def log(self, severity: int, text: str, node: str = START_STOP) -> None:
        """Write a line of ``rosout``; `severity` is MAVLink's."""
        message = Log(
            stamp=convert.time_to_ros(self._now_ns()),
            level=LOG_LEVELS[max(0, min(7, severity))],
            name=".".join([*filter(None, self._namespace.split("/")), node]),
            msg=text,
        )
        self._bus.publish(graph.LOG_TOPIC, message, node)

    def tick(self) -> None:
        """Handle what has arrived and send what is due; call it 20 times a second."""
        arrivals = self._bus.take(MESSAGES_AT_ONCE)
        if not arrivals:
            self._upload.quiet(self._lost_tags())
        for arrival in arrivals:
            self._hear(arrival)
        now_ns = self._now_ns()
        if now_ns >= self._next_status_ns:
            self._next_status_ns = _next_due(self._next_status_ns, now_ns, STATUS_PERIOD_S)
            self._show_status(now_ns)
        if self._pose is not None and now_ns >= self._next_pose_ns:
            self._next_pose_ns = _next_due(self._next_pose_ns, now_ns, POSE_PERIOD_S)
            pose, self._pose = self._mounting.antenna_pose(self._pose), None
            self._bus.publish("antenna_pose", convert.pose_stamped(pose))
        self._show_heartbeats(now_ns)

    def _show_pulse(self, pulse: Pulse) -> None:
        if (pulse.tag_id, pulse.start_time_ns) in self._foreign:
            return
        self.counters["ros2_pulses_published"] += 1
        directory = self._tag_directory(pulse.tag_id)
        self._publish_pulse(pulse.tag_id, convert.pulse_to_ros(pulse, directory))
        if pulse.burst_starts_ns:
            self._bus.publish("burst", convert.burst_to_ros(pulse, directory))

    def _publish_pulse(self, tag_id: int, message: RosPulse) -> None:
        node = detector_node(tag_id) if tag_id in self._detectors else None
        self._bus.publish("pulse", message, node)

    def _show_detectors(self) -> None:
        """Have a node for each tag of the flight; they stay until the next flight."""
        if not self._settings.ros2.node_per_tag or self._flight is None:
            return
        tag_ids = [tag.tag_id for tag in self._flight.tags]
        try:
            self._bus.show_detectors([detector_node(tag_id) for tag_id in tag_ids])
        except LinkError as error:
            self.log(4, str(error))
            return
        self._detectors = frozenset(tag_ids)

    def _show_command(self, command: Command) -> None:
        """Show what the ground station asks, as the original passed it on."""
        if command.name == "start_tags":
            self._upload.forget()
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
        """Tell each component what it starts with: one message for each tag's detector."""
        center = {"center_frequency": f"{flight.center_frequency_hz / 1e6:.6f}"}
        radio = self._order("start", self._settings.radio.kind, center)
        self._control("channelizer", self._order("start", "receiver", center))
        self._control("airspy_csdr_netcat", radio)
        for tag in flight.tags:
            values = center | {"config_path": self._tag_directory(tag.tag_id)}
            self._control("detector", self._order("start", f"tag_id_{tag.tag_id}", values))

    def _control(self, component: str, order: DiagnosticArray) -> None:
        """Publish an order to a component and its echo."""
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
        age_s = (now_ns - self._status_heard_ns) * 1e-9
        if age_s > STALE_AFTER_S:
            self._parts.clear()
        for component in COMPONENTS:
            if component not in self._parts:
                self._parts[component] = component_status(
                    component, self._status, age_s, self._settings
                )
            array = DiagnosticArray(header=header, status=self._parts[component])
            self._bus.publish(f"status_{component}_subprocess", array)

    def _show_heartbeats(self, now_ns: int) -> None:
        """Report that detectors live, each tag in its turn within the second."""
        status = self._status
        if status is None or status.state is not SystemState.DETECTING:
            self._next_heartbeat_ns.clear()
            return
        if now_ns - self._status_heard_ns > STALE_AFTER_S * NANOSECONDS_PER_SECOND:
            return
        workers = [p for p in status.processes if p.process.startswith("detector-")]
        for index, tag in enumerate(status.tags):
            due_ns = self._next_heartbeat_ns.get(tag.tag_id)
            if due_ns is None:
                self._next_heartbeat_ns[tag.tag_id] = now_ns + index * 10_000_000 % 10**9
            elif now_ns >= due_ns:
                self._next_heartbeat_ns[tag.tag_id] = _next_due(
                    due_ns, now_ns, HEARTBEAT_PERIOD_S
                )
                if workers and workers[index % len(workers)].running:
                    directory = self._tag_directory(tag.tag_id)
                    beat = convert.heartbeat(tag.tag_id, now_ns, directory)
                    self._publish_pulse(tag.tag_id, beat)

    def _tag_directory(self, tag_id: int) -> str:
        root = self._flight.directory if self._flight is not None else ""
        return f"{root}/detector_log/tag_id_{tag_id}" if root else ""

    # ------------------------------------------------- from ROS 2 to the drone

    def _hear(self, arrival: Arrival) -> None:
        """Handle one message from the network; what makes no sense is refused and counted."""
        if arrival.sender.gateway:
            self._pass_over(arrival)
            return
        if arrival.topic.name == "pulse_pose":
            return
        try:
            message = decode(arrival.topic.message, arrival.cdr)
        except FormatError as error:
            if arrival.topic.message in (RosTag, RosCodedTag):
                self._upload.add(None, self._lost_tags())
            self._refuse(str(error))
            return
        try:
            self._act(arrival, message)
        except FormatError as error:
            self._refuse(str(error))

    def _pass_over(self, arrival: Arrival) -> None:
        """Leave to another drone what is its own: its orders, and its pulses."""
        self.counters["ros2_messages_of_gateways"] += 1
        key = arrival.sender.key
        if key not in self._neighbours and len(self._neighbours) < NEIGHBOURS_TOLD:
            self._neighbours.add(key)
            self.log(
                5,
                "another gateway, or a recording, is in this ROS domain: its orders are not "
                "obeyed. Give each vehicle a [ros2] namespace",
            )

    def _act(self, arrival: Arrival, message: RosMessage) -> None:
        topic = arrival.topic.name
        match message:
            case RosPulse():
                self._take_pulse(message)
            case ServiceMessage():
                self._parameters.hear(message, self._refusal_of(arrival))
            case _ if not self._settings.ros2.accept_commands:
                self._refuse("commands from ROS 2 are off (accept_commands = false)")
            case _ if arrival.sender == UNKNOWN:
                self._refuse(f"{topic}: its sender is not known to DDS")
            case RosTag() | RosCodedTag():
                self._take_tag(message, arrival)
            case Flag():
                if message.data:
                    self._begun = False
                    self._upload.release(arrival.sender, arrival.sent_ns)
                    self._ask("end_tags")
            case DiagnosticArray() if topic in (
                "control_start_subprocess",
                "control_stop_subprocess",
            ):
                self._take_order(topic, message)
            case DiagnosticArray():
                self._refuse_part(topic, message)

    def _refusal_of(self, arrival: Arrival) -> str | None:
        """Explain why whoever sent this may not change anything."""
        if not self._settings.ros2.accept_commands:
            return "commands from ROS 2 are off (accept_commands = false)"
        return "its sender is not known to DDS" if arrival.sender == UNKNOWN else None

    def _running(self) -> bool:
        status = self._status
        return status is not None and (
            status.state is SystemState.DETECTING and not status.ending
        )

    def _lost_tags(self) -> int:
        return sum(self._bus.lost(name) for name in TAG_TOPICS)

    def _take_tag(self, message: RosTag | RosCodedTag, arrival: Arrival) -> None:
        """Begin an upload with the first tag; the original has no message for that."""
        tag_id = message.tag_id if isinstance(message, RosTag) else message.tag.tag_id
        if self._upload.is_late(arrival.sender, arrival.sent_ns):
            self._upload.add_late(tag_id)
            self._refuse(f"tag {tag_id} came after its release: send all tags again")
            return
        self._upload.add(tag_id, self._lost_tags())
        tag = convert.tag_from_ros(message)
        receiving = self._status is not None and (
            self._status.state is SystemState.RECEIVING_TAGS
        )
        if not self._begun and not receiving:
            self._ask("start_tags")
        self._begun = True
        self._ask("add_tag", tag=tag)

    def _take_order(self, topic: str, order: DiagnosticArray) -> None:
        expected = "start" if topic == "control_start_subprocess" else "stop"
        if not order.status or order.status[0].message != expected:
            raise FormatError(f"{topic}: the first status must have the message '{expected}'")
        if expected == "stop":
            self._ask("stop_detection")
            return
        values = {item.key: item.value for item in order.status[0].values}
        try:
            megahertz = values.get("center_frequency")
            gain = values.get("gain")
            self._ask(
                "start_detection",
                center_frequency_hz=None if megahertz is None else float(megahertz) * 1e6,
                gain=None if gain is None else int(gain),
                tag_count=self._upload.tag_count,
            )
        except ValueError as error:
            raise FormatError(f"{topic}: {error}") from error

    def _refuse_part(self, topic: str, order: DiagnosticArray) -> None:
        """Refuse to start or stop one component alone, in the component's own status."""
        component = topic.removeprefix("control_").removesuffix("_subprocess")
        reason = "not alone: publish to control_start_subprocess or control_stop_subprocess"
        first = order.status[0] if order.status else DiagnosticStatus()
        refused = DiagnosticStatus(
            level=ERROR,
            name=first.name,
            message=reason,
            hardware_id=first.hardware_id,
            values=first.values,
        )
        self._bus.publish(
            f"status_{component}_subprocess",
            DiagnosticArray(header=order.header, status=(refused,)),
        )
        self._refuse(f"{topic}: {reason}", node=COMPONENTS.get(component, AIRSPY))

    def _take_pulse(self, message: RosPulse) -> None:
        """Pass on a pulse of another computer's detector, if such are wanted."""
        if message.frequency == 0.0 or not self._settings.ros2.accept_pulses:
            return
        pulse = convert.pulse_from_ros(message, int(self.counters["ros2_pulses_taken"]))
        key = (pulse.tag_id, pulse.start_time_ns)
        if key not in self._foreign:
            if not self._pulses_allowed.take(self._now_ns()):
                self._refuse("pulses come faster than a hundred tags beep")
                return
            self._foreign[key] = None
            while len(self._foreign) > REMEMBERED_PULSES:
                self._foreign.popitem(last=False)
            self.counters["ros2_pulses_taken"] += 1
            self._send("pulse", pulse)

    def _ask(self, name: CommandName, **details: Any) -> int | None:
        """Give a command to the supervisor; its number, None when there are too many."""
        if not self._commands_allowed.take(self._now_ns()):
            self._refuse(f"{name}: commands come too fast")
            return None
        self._request_id += 1
        command = Command(name=name, request_id=self._request_id, source=SOURCE, **details)
        self._asked[command.request_id] = command
        while len(self._asked) > MESSAGES_AT_ONCE * 10:
            self._asked.popitem(last=False)
        self.counters["ros2_commands"] += 1
        self._send("command", command)
        return command.request_id

    def _show_reply(self, reply: CommandReply) -> None:
        """Write the supervisor's answer into the log."""
        asked = self._asked.pop(reply.request_id, None)
        if asked is None or asked.name != reply.name:
            return
        if reply.accepted:
            text = f"{reply.name}: {reply.message}" if reply.message else reply.name
            self.log(6, text)
        else:
            if reply.name in ("start_tags", "add_tag"):
                self._begun = False
            self.log(4, f"{reply.name} refused: {reply.message}")

    def _refuse(self, reason: str, node: str = START_STOP) -> None:
        self.counters["ros2_messages_refused"] += 1
        # A flood must not fill everybody's log.
        if self._lines_allowed.take(self._now_ns()):
            self.log(4, reason[:500], node)


def _next_due(due_ns: int, now_ns: int, period_s: float) -> int:
    """Keep the beat, unless so late that it is lost."""
    period_ns = ns_from_s(period_s)
    return due_ns + period_ns if now_ns - due_ns < period_ns else now_ns + period_ns
