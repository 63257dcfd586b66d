"""Translate the drone's records to ROS 2 messages, and ROS 2 commands to records.

The gateway opens no sockets: it receives records, messages and the time, and returns records.
"""

from collections.abc import Callable
from typing import Any

from uavrt.config.settings import Settings
from uavrt.core.errors import ConfigError, FormatError
from uavrt.core.messages import (
    Command,
    CommandReply,
    FlightInfo,
    Poses,
    Pulse,
    StatusText,
    SystemStatus,
)
from uavrt.core.newest import Newest
from uavrt.core.units import ns_from_s
from uavrt.link.ros2 import ros_records as convert
from uavrt.link.ros2.drone_state import SOURCE, DroneState, RosLog
from uavrt.link.ros2.drone_topics import DroneTopics
from uavrt.link.ros2.graph import SERVICE_BURST, SERVICE_PER_S, TOPICS
from uavrt.link.ros2.inbox import BYTES_OF_ONE
from uavrt.link.ros2.network.bus import Bus
from uavrt.link.ros2.ros_commands import RosCommands
from uavrt.link.ros2.ros_senders import Arrival
from uavrt.link.ros2.types.cdr import decode
from uavrt.link.ros2.types.ros_messages import RosCodedTag, RosPulse, RosTag

DROPS_PERIOD_S = 10.0
"""Time between two log lines about dropped messages of one topic [s]."""
CLOCK_ERROR_S = 2.0
"""Largest accepted clock difference between two computers [s]."""
REMEMBERED_PULSES = 1000
"""Largest number of remembered pulses from other computers; remembered pulses are not published
again."""


class Gateway:
    """Translates between ROS 2 (`bus`) and the drone's supervisor, in both directions."""

    def __init__(
        self,
        bus: Bus,
        settings: Settings,
        send: Callable[[str, object], None],
        now_ns: Callable[[], int],
        flight: FlightInfo | None = None,
    ) -> None:
        self._bus, self._send, self._now_ns = bus, send, now_ns
        self._drone = DroneState(settings, flight)
        self._log = RosLog(bus, settings.ros2.namespace, now_ns)
        self._topics = DroneTopics(bus, self._drone, self._log, now_ns)
        self._commands = RosCommands(bus, self._drone, self._log, send, now_ns)
        self._next_drops_ns: dict[str, int] = {}
        self._drops_said: dict[str, int] = {}
        self._gateways_said = 0
        self._foreign: Newest[tuple[int, int], None] = Newest(REMEMBERED_PULSES)
        self._pulses_taken = 0

    @property
    def counters(self) -> dict[str, float]:
        """Counts of messages and commands by name, for a health record."""
        return {
            "ros2_pulses_published": self._topics.published,
            "ros2_commands": self._commands.sent,
            "ros2_messages_refused": self._log.refused,
            "ros2_pulses_taken": self._pulses_taken,
        }

    def receive(self, record: Any) -> None:
        """Publish a record of the drone on ROS 2."""
        match record:
            case Pulse():
                if (record.tag_id, record.start_time_ns) not in self._foreign:
                    self._topics.pulse(record)
            case Poses(poses=poses) if poses:
                self._topics.pose(poses[-1])
            case SystemStatus():
                self._drone.status, self._drone.status_heard_ns = record, self._now_ns()
                self._topics.status_changed()
            case Command() if record.source != SOURCE:
                self._commands.foreign_command(record)
                self._topics.command(record)
            case CommandReply():
                self._commands.answered(record)
            case Settings():
                self._drone.settings = record
            case StatusText():
                self._log.write(record.severity, record.text)
            case _:
                self._topics.record(record)

    def take_flight(self, flight: FlightInfo | None) -> None:
        """Publish the start of a flight (None: its end), and restart the schedule."""
        self._drone.status_heard_ns = self._now_ns()
        started, self._drone.flight = flight is not None and self._drone.flight is None, flight
        self._topics.flight_changed(started=started)

    def tick(self) -> None:
        """Handle received messages and publish due messages; call it 20 times a second."""
        now_ns = self._now_ns()
        self._commands.resume()
        arrivals = self._bus.inbox.take()
        if not arrivals:
            self._commands.set_loss_baseline()
        for arrival in arrivals:
            self._receive(arrival)
        self._show_drops(now_ns)
        self._topics.tick(now_ns)

    def _receive(self, arrival: Arrival) -> None:
        """Handle one message from the network; an invalid one is refused and counted."""
        try:
            message = decode(arrival.topic.message, arrival.cdr)
        except FormatError as error:
            if arrival.topic.message in (RosTag, RosCodedTag):
                self._commands.unreadable_tag()
            self._log.refuse(str(error))
            return
        try:
            if isinstance(message, RosPulse):
                self._receive_pulse(message)
            else:
                self._commands.receive(arrival, message)
        except (FormatError, ConfigError) as error:
            self._log.refuse(str(error))

    def _show_drops(self, now_ns: int) -> None:
        """Log dropped messages and other gateways, at most every `DROPS_PERIOD_S`."""
        inbox = self._bus.inbox
        for topic, count in inbox.dropped.items():
            new = count - self._drops_said.get(topic, 0)
            if new and now_ns >= self._next_drops_ns.get(topic, 0):
                self._next_drops_ns[topic] = now_ns + ns_from_s(DROPS_PERIOD_S)
                self._drops_said[topic] = count
                limits = self._limits_of(topic)
                self._log.write(4, f"{topic}: dropped messages: {new}. {limits}")
        while self._gateways_said < len(inbox.gateways):
            self._gateways_said += 1
            self._log.write(
                5,
                "another gateway, or a recording, is in this ROS domain: its commands are "
                "ignored. Give each vehicle a [ros2] namespace",
            )

    def _limits_of(self, topic: str) -> str:
        """Describe how many messages a topic accepts at once and per second."""
        if topic in self._bus.inbox.closed:
            return "Pulses of other computers are ignored: [ros2] accept_pulses = false"
        row = TOPICS.get(topic)
        if row is not None and not row.burst:
            return "No message on this topic is accepted"
        rate = (SERVICE_BURST, SERVICE_PER_S) if row is None else (row.burst, row.per_s)
        return (
            f"At most {rate[0]} messages at once and {rate[1]:g} a second are accepted; a long "
            f"message counts once for each {BYTES_OF_ONE} bytes begun"
        )

    def _receive_pulse(self, message: RosPulse) -> None:
        """Pass on a pulse from another computer's detector, if the settings enable this."""
        if message.frequency == 0.0:
            return
        pulse = convert.pulse_from_ros(message, self._pulses_taken)
        self._check_pulse(pulse)
        key = (pulse.tag_id, pulse.start_time_ns)
        if key not in self._foreign:
            self._foreign[key] = None
            self._pulses_taken += 1
            self._send("pulse", pulse)

    def _check_pulse(self, pulse: Pulse) -> None:
        """Raise `FormatError` for a pulse that does not belong to this flight."""
        flight = self._drone.flight
        if flight is None:
            raise FormatError(
                f"pulse of tag {pulse.tag_id} refused: no flight is being recorded"
            )
        if all(tag.tag_id != pulse.tag_id for tag in flight.tags):
            raise FormatError(f"pulse of tag {pulse.tag_id} refused: not a tag of this flight")
        late_s = (pulse.start_time_ns - self._now_ns()) * 1e-9
        before_s = (flight.start_time_ns - pulse.start_time_ns) * 1e-9
        for seconds, words in ((late_s, "in the future"), (before_s, "before the flight")):
            if seconds > CLOCK_ERROR_S:
                raise FormatError(
                    f"pulse of tag {pulse.tag_id} refused: it lies {seconds:.0f} s "
                    f"{words}. Set the "
                    "clocks of both computers, by NTP or GNSS"
                )
