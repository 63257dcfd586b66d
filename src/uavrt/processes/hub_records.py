"""Handlers of the supervisor's records, in a table by their type."""

from collections.abc import Callable
from typing import Any

from uavrt.commands import SystemState
from uavrt.config.settings import Settings
from uavrt.errors import TunnelError
from uavrt.log import get_logger
from uavrt.mavlink.connection import Connection
from uavrt.mavlink.pacing import Priority
from uavrt.messages import (
    Beep,
    CommandReply,
    Course,
    FlightInfo,
    LiveBearing,
    MotionOffer,
    Operation,
    ProcessStatus,
    Pulse,
    PulsePose,
    Recorded,
    SearchReport,
    StatusText,
    SystemStatus,
    VehicleWish,
)
from uavrt.processes.ground_stations import GroundStations
from uavrt.processes.ground_status import GroundStatus
from uavrt.processes.motion_desk import MotionDesk
from uavrt.processes.parameter_desk import ParameterDesk
from uavrt.processes.pose_desk import PoseDesk
from uavrt.processes.pulse_path import PulsePath
from uavrt.tunnel.exchange import Exchange
from uavrt.tunnel.live_bearing import BEARING_TYPE, encode_bearing
from uavrt.tunnel.neighbours import encode_course
from uavrt.tunnel.private import COURSE_TYPE

log = get_logger()


class HubRecords:
    """Passes each record to its part of the process; what has no handler is left out.

    `text`: sends a text to the operator.
    `linked`: there is a link to the ground.
    """

    def __init__(
        self,
        link: Connection,
        stations: GroundStations,
        exchange: Exchange,
        pulses: PulsePath,
        poses: PoseDesk,
        status: GroundStatus,
        parameters: ParameterDesk,
        motion: MotionDesk | None,
        *,
        text: Callable[[StatusText], None],
        now_ns: Callable[[], int],
        linked: bool,
    ) -> None:
        self._link, self._stations, self._exchange = link, stations, exchange
        self._poses, self._status = poses, status
        self._parameters, self._motion = parameters, motion
        self.state: SystemState | None = None
        """None until the supervisor reports it: a restarted connection must not end a flight
        on the ground."""
        self.processes: tuple[ProcessStatus, ...] = ()
        self._handlers: dict[type, Callable[[Any], None]] = {
            Pulse: pulses.add,
            PulsePose: pulses.made_up,
            Recorded: pulses.recorded,
            FlightInfo: pulses.begin_flight,
            Beep: status.beep,
            Operation: lambda record: stations.answer(exchange.progress(record)),
            CommandReply: self._reply,
            Settings: self._changed,
            StatusText: text,
            SystemStatus: self._system,
        }
        if motion is not None:
            self._handlers |= {MotionOffer: motion.orders.offer, VehicleWish: motion.wish}
        if linked:
            self._handlers |= {
                LiveBearing: self._bearing,
                Course: self._course,
                SearchReport: lambda record: status.search_report(record, now_ns()),
            }

    def receive(self, topic: str, record: Any) -> None:
        """Handle a record."""
        if topic == "corrected_tags":
            self._status.forget_beeps()
        elif (handler := self._handlers.get(type(record))) is not None:
            handler(record)

    def _reply(self, reply: CommandReply) -> None:
        answer = self._exchange.reply(reply)
        if answer is not None and reply.accepted:
            self._stations.accepted(answer.asker)
        self._stations.answer(answer)
        self._parameters.reply(reply)
        if self._motion is not None:
            self._motion.orders.reply(reply)

    def _changed(self, settings: Settings) -> None:
        self._parameters.changed(settings)
        self._status.radio_set(settings.radio)
        self._poses.use(settings.pose)

    def _system(self, status: SystemStatus) -> None:
        self.state, self.processes = status.state, status.processes
        self._stations.commander(status.commander)
        self._parameters.running(status.state is SystemState.DETECTING and not status.ending)
        self._status.tags(len(status.tags))

    def _bearing(self, bearing: LiveBearing) -> None:
        self._link.tunnel.send_tunnel(
            encode_bearing(bearing), Priority.STATUS, payload_type=BEARING_TYPE
        )

    def _course(self, course: Course) -> None:
        """Report to all where the drone is going."""
        try:
            payload = encode_course(course)
        except TunnelError as error:
            log.warning("course not told", reason=error.message)
            return
        self._link.tunnel.send_tunnel(payload, Priority.STATUS, payload_type=COURSE_TYPE)
