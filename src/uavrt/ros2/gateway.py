"""The gateway's translation: the drone's records to ROS 2 messages, and commands back.

It has no sockets: it is given records, messages and the time, and returns records.
"""

from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import Any

from uavrt.allowance import Allowance
from uavrt.commands import CommandName, SystemState
from uavrt.config.parameters import check_start
from uavrt.config.settings import Settings
from uavrt.errors import ConfigError, FormatError, LinkError
from uavrt.messages import (
    Command,
    CommandReply,
    FlightInfo,
    Pose,
    Poses,
    Pulse,
    PulsePose,
    StatusText,
    SystemStatus,
)
from uavrt.pose.mounting import Mounting
from uavrt.ros2 import convert, graph
from uavrt.ros2.bus import Bus
from uavrt.ros2.cdr import decode
from uavrt.ros2.graph import (
    AIRSPY,
    COMPONENTS,
    SERVICE_BURST,
    SERVICE_PER_S,
    START_STOP,
    TOPICS,
    detector_node,
)
from uavrt.ros2.inbox import BYTES_OF_ONE
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
from uavrt.ros2.status import STALE_AFTER_S, component_status, detector_of_tag
from uavrt.ros2.upload import Upload
from uavrt.units import NANOSECONDS_PER_SECOND, ns_from_s, number_in

SOURCE = "ros2"
TAG_TOPICS = ("store_tag_information", "store_coded_tag_information")
STATUS_PERIOD_S = 0.5
POSE_PERIOD_S = 0.5
HEARTBEAT_PERIOD_S = 1.0
ASKED_KEPT = 1000
"""Commands whose reply may still come."""
DROPS_PERIOD_S = 10.0
"""Time between two log lines about dropped messages of one topic [s]."""
CLOCK_ERROR_S = 2.0
"""Difference of two computers' clocks that counts as none [s]."""
REMEMBERED_PULSES = 1000
"""Pulses from other computers that must not be sent back."""

LOG_LEVELS = (50, 50, 50, 40, 30, 20, 20, 10)
"""Level of ``rosout`` for each severity of MAVLink, 0 emergency to 7 debug."""


class Gateway:
    """Both directions of the translation, between a `bus` of ROS 2 and the supervisor."""

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
        """State of each component at the supervisor's last report, once a second."""
        self._pose: Pose | None = None
        self._next_status_ns = self._next_pose_ns = 0
        self._next_heartbeat_ns: dict[int, int] = {}
        self._next_drops_ns: dict[str, int] = {}
        self._drops_said: dict[str, int] = {}
        # Unlike any number before a restart of this process: the supervisor answers a number
        # it has seen before with the old reply.
        self._request_id = now_ns() // 1_000_000
        self._asked: OrderedDict[int, Command] = OrderedDict()
        self._begun = False
        """Whether an upload was begun with the supervisor."""
        self._upload = Upload()
        self._resumed = False
        self._parameters = ParameterServices(
            lambda: self._settings, self._running, ask=self._ask_parameter, reply=bus.reply
        )
        self._gateways_said = 0
        self._foreign: OrderedDict[tuple[int, int], None] = OrderedDict()
        # Each request may set many, and every command is recorded: none may fill the disk.
        self._parameters_allowed = Allowance(burst=100, per_s=10)
        self._lines_allowed = Allowance(burst=50, per_s=1)
        self._detectors: frozenset[int] = frozenset()
        """Tags that have a node of their own."""
        self.counters: dict[str, float] = {
            "ros2_pulses_published": 0,
            "ros2_commands": 0,
            "ros2_messages_refused": 0,
            "ros2_pulses_taken": 0,
        }
        self._show_detectors()

    # ------------------------------------------------- from the drone to ROS 2

    def take(self, record: Any) -> None:
        """Publish a record of the drone side."""
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
        """Publish that a flight has started, or (None) ended; it may bring another clock."""
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
        now_ns = self._now_ns()
        if not self._resumed and self._status is not None:
            self._resume_upload(self._status)
        arrivals = self._bus.inbox.take()
        if not arrivals:
            self._upload.quiet(self._lost_tags())
        for arrival in arrivals:
            self._hear(arrival)
        self._show_drops(now_ns)
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
        """Keep a node for each tag of the flight, until the next flight."""
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
        """Publish a command of the ground station, as the original passed it on."""
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
        """Send each component its start: one message for each tag's detector."""
        center = {"center_frequency": f"{flight.center_frequency_hz / 1e6:.6f}"}
        radio = self._order("start", self._settings.radio.kind, center)
        self._control("channelizer", self._order("start", "receiver", center))
        self._control("airspy_csdr_netcat", radio)
        for tag in flight.tags:
            values = center | {"config_path": self._tag_directory(tag.tag_id)}
            self._control("detector", self._order("start", f"tag_id_{tag.tag_id}", values))

    def _control(self, component: str, order: DiagnosticArray) -> None:
        """Publish a command to a component and its echo."""
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
                    directory = self._tag_directory(tag.tag_id)
                    beat = convert.heartbeat(tag.tag_id, now_ns, directory)
                    self._publish_pulse(tag.tag_id, beat)

    def _tag_directory(self, tag_id: int) -> str:
        root = self._flight.directory if self._flight is not None else ""
        return f"{root}/detector_log/tag_id_{tag_id}" if root else ""

    # ------------------------------------------------- from ROS 2 to the drone

    def _hear(self, arrival: Arrival) -> None:
        """Handle one message from the network; invalid ones are refused and counted."""
        try:
            message = decode(arrival.topic.message, arrival.cdr)
        except FormatError as error:
            if arrival.topic.message in (RosTag, RosCodedTag):
                self._upload.add(None, self._lost_tags())
            self._refuse(str(error))
            return
        try:
            self._act(arrival, message)
        except (FormatError, ConfigError) as error:
            self._refuse(str(error))

    def _show_drops(self, now_ns: int) -> None:
        """Log dropped messages rarely, and other gateways."""
        inbox = self._bus.inbox
        for topic, count in inbox.dropped.items():
            new = count - self._drops_said.get(topic, 0)
            if new and now_ns >= self._next_drops_ns.get(topic, 0):
                self._next_drops_ns[topic] = now_ns + ns_from_s(DROPS_PERIOD_S)
                self._drops_said[topic] = count
                self.log(4, f"{topic}: dropped messages: {new}. {self._limits_of(topic)}")
        while self._gateways_said < len(inbox.gateways):
            self._gateways_said += 1
            self.log(
                5,
                "another gateway, or a recording, is in this ROS domain: its orders are not "
                "obeyed. Give each vehicle a [ros2] namespace",
            )

    def _limits_of(self, topic: str) -> str:
        """Describe the limits of a topic."""
        if topic in self._bus.inbox.closed:
            return "Pulses of other computers are not read: [ros2] accept_pulses = false"
        row = TOPICS.get(topic)
        if row is not None and not row.burst:
            return "Nothing of it is read"
        rate = (SERVICE_BURST, SERVICE_PER_S) if row is None else (row.burst, row.per_s)
        return (
            f"{rate[0]} at once and {rate[1]:g} a second are read at most, each begun "
            f"{BYTES_OF_ONE} bytes counted as one"
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
                    self._ask("end_tags", tag_count=self._upload.tag_count)
            case DiagnosticArray() if topic in (
                "control_start_subprocess",
                "control_stop_subprocess",
            ):
                self._take_order(topic, message)
            case DiagnosticArray():
                self._refuse_part(topic, message)

    def _refusal_of(self, arrival: Arrival) -> str | None:
        """Explain why the sender of this may not change anything."""
        if not self._settings.ros2.accept_commands:
            return "commands from ROS 2 are off (accept_commands = false)"
        return "its sender is not known to DDS" if arrival.sender == UNKNOWN else None

    def _running(self) -> bool:
        status = self._status
        return status is not None and (
            status.state is SystemState.DETECTING and not status.ending
        )

    def _resume_upload(self, status: SystemStatus) -> None:
        """Take over the upload that was open when an earlier gateway process ended."""
        self._resumed = True
        if (
            status.state is SystemState.RECEIVING_TAGS
            and status.commander == SOURCE
            and not self._begun
        ):
            self._upload.resume((tag.tag_id for tag in status.tags), self._lost_tags())
            self.log(4, "the gateway restarted while tags came: send all tags again")

    def _lost_tags(self) -> int:
        dropped = self._bus.inbox.dropped
        return sum(dropped.get(name, 0) for name in TAG_TOPICS)

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
        center_hz = gain = None
        if (text := values.get("center_frequency")) is not None:
            center_hz = number_in(text) * 1e6
        if (text := values.get("gain")) is not None:
            gain = number_in(text)
        self._ask(
            "start_detection",
            center_frequency_hz=center_hz,
            gain=check_start(self._settings, center_hz, gain),
            tag_count=self._upload.tag_count,
        )

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
        """Pass on a pulse of another computer's detector, if enabled."""
        if message.frequency == 0.0:
            return
        pulse = convert.pulse_from_ros(message, int(self.counters["ros2_pulses_taken"]))
        self._check_pulse(pulse)
        key = (pulse.tag_id, pulse.start_time_ns)
        if key not in self._foreign:
            self._foreign[key] = None
            while len(self._foreign) > REMEMBERED_PULSES:
                self._foreign.popitem(last=False)
            self.counters["ros2_pulses_taken"] += 1
            self._send("pulse", pulse)

    def _check_pulse(self, pulse: Pulse) -> None:
        """Refuse a pulse that is not of this flight."""
        flight = self._flight
        if flight is None:
            raise FormatError(f"pulse of tag {pulse.tag_id} refused: no flight")
        if all(tag.tag_id != pulse.tag_id for tag in flight.tags):
            raise FormatError(f"pulse of tag {pulse.tag_id} refused: not a tag of this flight")
        late_s = (pulse.start_time_ns - self._now_ns()) * 1e-9
        before_s = (flight.start_time_ns - pulse.start_time_ns) * 1e-9
        for seconds, words in ((late_s, "in the future"), (before_s, "before the flight")):
            if seconds > CLOCK_ERROR_S:
                raise FormatError(
                    f"pulse of tag {pulse.tag_id} refused: {seconds:.0f} s {words}. Set the "
                    "clocks of both computers, by NTP or GNSS"
                )

    def _ask_parameter(self, name: str, value: float) -> int | None:
        """Ask the supervisor to set a parameter; None when there are too many."""
        if not self._parameters_allowed.take(self._now_ns()):
            self._refuse("set_parameter: commands come too fast")
            return None
        return self._ask("set_parameter", parameter=name, value=value)

    def _ask(self, name: CommandName, **details: Any) -> int:
        """Send a command to the supervisor; returns its number."""
        self._request_id += 1
        command = Command(name=name, request_id=self._request_id, source=SOURCE, **details)
        self._asked[command.request_id] = command
        while len(self._asked) > ASKED_KEPT:
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
        # A flood must not fill the shared log.
        if self._lines_allowed.take(self._now_ns()):
            self.log(4, reason[:500], node)


def _next_due(due_ns: int, now_ns: int, period_s: float) -> int:
    """Time of the next beat; skip beats that are too late."""
    period_ns = ns_from_s(period_s)
    return due_ns + period_ns if now_ns - due_ns < period_ns else now_ns + period_ns
