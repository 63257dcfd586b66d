"""Send commands from ROS 2 to the supervisor: tags, starts, stops and parameters."""

from collections.abc import Callable
from typing import Any

from uavrt.config.parameters import check_start
from uavrt.core.commands import CommandName, SystemState
from uavrt.core.errors import FormatError
from uavrt.core.messages import Command, CommandReply
from uavrt.core.newest import Newest
from uavrt.core.units import number_in
from uavrt.link.allowance import Allowance
from uavrt.link.ros2 import ros_records as convert
from uavrt.link.ros2.drone_state import SOURCE, DroneState, RosLog
from uavrt.link.ros2.graph import AIRSPY, COMPONENTS
from uavrt.link.ros2.network.bus import Bus
from uavrt.link.ros2.ros_parameters import ParameterServices
from uavrt.link.ros2.ros_senders import UNKNOWN, Arrival
from uavrt.link.ros2.types.parameter_messages import ServiceMessage
from uavrt.link.ros2.types.ros_messages import (
    ERROR,
    DiagnosticArray,
    DiagnosticStatus,
    Flag,
    RosCodedTag,
    RosMessage,
    RosTag,
)
from uavrt.link.ros2.upload import Upload

TAG_TOPICS = ("store_tag_information", "store_coded_tag_information")
MOST_PENDING_COMMANDS = 1000
"""Largest number of sent commands remembered until the supervisor replies."""


class RosCommands:
    """Converts ROS 2 messages to commands; `send` passes them to the supervisor by topic."""

    def __init__(
        self,
        bus: Bus,
        drone: DroneState,
        log: RosLog,
        send: Callable[[str, object], None],
        now_ns: Callable[[], int],
    ) -> None:
        self._bus, self._drone, self._log = bus, drone, log
        self._send, self._now_ns = send, now_ns
        # Unlike any number before a restart of this process: the supervisor answers a number
        # it has seen before with the old reply.
        self._request_id = now_ns() // 1_000_000
        self._asked: Newest[int, Command] = Newest(MOST_PENDING_COMMANDS)
        self._begun = False
        """True once this gateway has begun a tag upload with the supervisor."""
        self._upload = Upload()
        self._resumed = False
        self._parameters = ParameterServices(
            lambda: drone.settings,
            lambda: drone.running,
            ask=self._request_parameter,
            reply=bus.reply,
        )
        # Each request may set many, and every command is recorded: none may fill the disk.
        self._parameters_allowed = Allowance(burst=100, per_s=10)
        self.sent = 0
        """Number of commands sent to the supervisor."""

    def foreign_command(self, command: Command) -> None:
        """Handle a command not sent by ROS 2; its tag upload replaces one begun by ROS 2."""
        if command.name == "start_tags":
            self._upload.forget()

    def receive(self, arrival: Arrival, message: RosMessage) -> None:
        """Handle a message; raises `FormatError` or `ConfigError` for a refused one."""
        topic = arrival.topic.name
        match message:
            case ServiceMessage():
                self._parameters.receive(message, self._refusal_of(arrival))
            case _ if not self._drone.settings.ros2.accept_commands:
                self._log.refuse("commands from ROS 2 are off (accept_commands = false)")
            case _ if arrival.sender == UNKNOWN:
                self._log.refuse(f"{topic}: DDS has not announced its sender")
            case RosTag() | RosCodedTag():
                self._receive_tag(message, arrival)
            case Flag():
                if message.data:
                    self._begun = False
                    self._upload.release(arrival.sender, arrival.sent_ns)
                    self._ask("end_tags", tag_count=self._upload.tag_count)
            case DiagnosticArray() if topic in (
                "control_start_subprocess",
                "control_stop_subprocess",
            ):
                self._receive_order(topic, message)
            case DiagnosticArray():
                self._refuse_part(topic, message)

    def _refusal_of(self, arrival: Arrival) -> str | None:
        """Reason why a message's sender may not change anything; None if it may."""
        if not self._drone.settings.ros2.accept_commands:
            return "commands from ROS 2 are off (accept_commands = false)"
        return "DDS has not announced its sender" if arrival.sender == UNKNOWN else None

    def resume(self) -> None:
        """Continue the upload that was in progress when an earlier gateway process ended."""
        status = self._drone.status
        if self._resumed or status is None:
            return
        self._resumed = True
        if (
            status.state is SystemState.RECEIVING_TAGS
            and status.commander == SOURCE
            and not self._begun
        ):
            self._upload.resume((tag.tag_id for tag in status.tags), self._lost_tags())
            self._log.write(4, "the gateway restarted during the upload: send all tags again")

    def set_loss_baseline(self) -> None:
        """Store the number of tag messages lost so far, so that the next upload does not count
        them.
        """
        self._upload.quiet(self._lost_tags())

    def unreadable_tag(self) -> None:
        """Count a tag of the upload that could not be read."""
        self._upload.add(None, self._lost_tags())

    def _lost_tags(self) -> int:
        dropped = self._bus.inbox.dropped
        return sum(dropped.get(name, 0) for name in TAG_TOPICS)

    def _receive_tag(self, message: RosTag | RosCodedTag, arrival: Arrival) -> None:
        """Send a tag; the first also begins an upload, as the original has no such message."""
        tag_id = message.tag_id if isinstance(message, RosTag) else message.tag.tag_id
        if self._upload.is_late(arrival.sender, arrival.sent_ns):
            self._upload.add_late(tag_id)
            self._log.refuse(
                f"tag {tag_id} arrived after the end of its upload: send all tags again"
            )
            return
        self._upload.add(tag_id, self._lost_tags())
        tag = convert.tag_from_ros(message)
        if not self._begun and not self._drone.is_in(SystemState.RECEIVING_TAGS):
            self._ask("start_tags")
        self._begun = True
        self._ask("add_tag", tag=tag)

    def _receive_order(self, topic: str, order: DiagnosticArray) -> None:
        expected = "start" if topic == "control_start_subprocess" else "stop"
        if not order.status or order.status[0].message != expected:
            raise FormatError(
                f"{topic}: the first status must contain the message '{expected}'"
            )
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
            gain=check_start(self._drone.settings, center_hz, gain),
            tag_count=self._upload.tag_count,
        )

    def _refuse_part(self, topic: str, order: DiagnosticArray) -> None:
        """Refuse to start or stop a single component; the refusal is published on its status
        topic.
        """
        component = topic.removeprefix("control_").removesuffix("_subprocess")
        reason = (
            "a component cannot be started or stopped alone: publish to "
            "control_start_subprocess or control_stop_subprocess"
        )
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
        self._log.refuse(f"{topic}: {reason}", node=COMPONENTS.get(component, AIRSPY))

    def _request_parameter(self, name: str, value: float) -> int | None:
        """Request a parameter change from the supervisor; None if too many are pending."""
        if not self._parameters_allowed.take(self._now_ns()):
            self._log.refuse("set_parameter refused: too many commands are pending")
            return None
        return self._ask("set_parameter", parameter=name, value=value)

    def _ask(self, name: CommandName, **details: Any) -> int:
        """Send a command to the supervisor and return the command's number."""
        self._request_id += 1
        command = Command(name=name, request_id=self._request_id, source=SOURCE, **details)
        self._asked[command.request_id] = command
        self.sent += 1
        self._send("command", command)
        return command.request_id

    def answered(self, reply: CommandReply) -> None:
        """Handle the supervisor's answer to a command: log it, or reply to the client."""
        self._write_reply(reply)
        self._parameters.answered(reply)

    def _write_reply(self, reply: CommandReply) -> None:
        asked = self._asked.pop(reply.request_id, None)
        if asked is None or asked.name != reply.name:
            return
        if reply.accepted:
            text = f"{reply.name}: {reply.message}" if reply.message else reply.name
            self._log.write(6, text)
        else:
            if reply.name in ("start_tags", "add_tag"):
                self._begun = False
            self._log.write(4, f"{reply.name} refused: {reply.message}")
