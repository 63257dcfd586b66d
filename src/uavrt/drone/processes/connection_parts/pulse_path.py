"""The way of a pulse through the connection process: pose, recorder, ground, receipt."""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial

from uavrt.core.errors import RecordingError
from uavrt.core.log import get_logger
from uavrt.core.messages import Delivered, FlightInfo, Pulse, PulsePose, Recorded, SearchReport
from uavrt.core.runtime.disk_thread import DiskThread
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.drone.processes.connection_parts.ground_status import GroundStatus
from uavrt.drone.processes.connection_parts.named_values import NamedValues
from uavrt.drone.processes.connection_parts.pose_collector import PoseCollector
from uavrt.drone.processes.connection_parts.pulse_outlet import PulseOutlet
from uavrt.drone.processes.connection_parts.tag_texts import TagTexts
from uavrt.flight.database.spool import received_tags
from uavrt.link.mavlink.mavlink_connection import Connection
from uavrt.link.mavlink.sending.pacing import Priority
from uavrt.link.tunnel.drone_exchange import Exchange

log = get_logger()

FIRST_REFILL_NS = 4_000_000_000
"""Time from the start until unsent pulses are read from disk [ns]; the recorder must commit
first."""


class PulsePath:
    """Sends pulses of the present flight to the recorder and, if `linked`, to the ground."""

    def __init__(
        self,
        frame: ProcessFrame,
        link: Connection,
        exchange: Exchange,
        poses: PoseCollector,
        status: GroundStatus,
        disk: DiskThread,
        *,
        linked: bool,
    ) -> None:
        self._send_record, self._now_ns = frame.send, frame.clock.now_ns
        self._link, self._linked = link, linked
        self._poses, self._status = poses, status
        self.outlet = PulseOutlet(
            exchange.pulse,
            self._note_delivered,
            disk,
            first_refill_ns=self._now_ns() + FIRST_REFILL_NS,
        )
        flight = frame.assignment.flight
        self._tag_texts = TagTexts(() if flight is None else flight.tags)
        self._named_values = NamedValues(
            frame.assignment.settings.mavlink.named_values,
            wanted=lambda: link.other_station_present,
            pulses_wait=lambda: self.outlet.sender.pulses.waiting > 0,
        )
        link.tunnel.add_source(self.outlet.sender, Priority.PULSE)
        link.tunnel.add_source(self._named_values, Priority.VALUE)
        link.tunnel.changed = self.outlet.sender.link_changed
        for directory in frame.assignment.last_flights:
            self.outlet.flight(directory, resumed=True)
        self._directory = "" if flight is None else flight.directory
        if flight is not None:
            self.outlet.flight(flight.directory, resumed=True)
            disk(partial(_heard_before, flight.directory), self._restore_tags)

    def begin_flight(self, flight: FlightInfo) -> None:
        """Reset for a new flight, and use its clock."""
        self._poses.use_clock(flight.clock_offset_ns)
        self._status.begin_flight(self._poses.shift_ns)
        self.outlet.flight(flight.directory)
        self._directory = flight.directory
        self._tag_texts.begin_flight(flight.tags)
        self._named_values.begin_flight()

    def add(self, pulse: Pulse) -> None:
        """Accept a detector's pulse; it is sent as soon as its pose is known."""
        self._status.detector_alive(pulse.tag_id, self._now_ns())
        self._poses.add(pulse)

    def searched(self, report: SearchReport) -> None:
        """Report to the ground that a detector has searched without a detection."""
        self._status.search_report(report, self._now_ns())

    def tick(self, now_ns: int) -> None:
        """Send pulses whose pose is now known, and repeat those without acknowledgement."""
        self.pass_on(self._poses.ready())
        sender = self.outlet.sender
        sender.station_present(self._link.station_present, now_ns)
        self.outlet.tick(now_ns)
        if sender.underway.unanswered(now_ns):
            self._link.tunnel.unanswered(now_ns)

    def pass_on(self, pulse_poses: Iterable[PulsePose]) -> None:
        """Send pulses with poses to recorder and ground, unless they were sent before.

        The recorder itself sends those whose pose it has reconstructed.
        """
        for pulse_pose in pulse_poses:
            if self.outlet.delivery.may_send(pulse_pose.pulse.key):
                self._send_record("pulse_pose", pulse_pose)
                self._send(pulse_pose)

    def pose_reconstructed(self, pulse_pose: PulsePose) -> None:
        """Send to the ground a pulse whose pose the recorder has reconstructed."""
        if self.outlet.delivery.may_send(pulse_pose.pulse.key):
            self._send(pulse_pose)

    def recorded(self, record: Recorded) -> None:
        """Note which pulses are now in the flight's database."""
        self.outlet.recorded(record.pulses)

    def _send(self, pulse_pose: PulsePose) -> None:
        if self._linked:
            self.outlet.add(pulse_pose)
            self._report_tag(pulse_pose.pulse)
            self._link.tunnel.wake()

    def _report_tag(self, pulse: Pulse) -> None:
        """Report a tag's SNR, pulse count and text to stations that cannot decode pulses."""
        now_ns = self._now_ns()
        self._named_values.heard(pulse, now_ns)
        text = self._tag_texts.text(pulse)
        if text is not None and self._status.tag_text(text, now_ns):
            self._tag_texts.reported(pulse.tag_id)

    def receipt(self, payload: bytes, place: tuple[int, int]) -> None:
        """Handle a station's receipt for pulses; adapt the send rate to the round-trip time."""
        now_ns = self._now_ns()
        confirmed, trip_s = self.outlet.receipt(payload, place, now_ns)
        if confirmed:
            self._link.tunnel.rate.acknowledged(trip_s, now_ns)
        self._link.tunnel.wake()

    def _note_delivered(self, delivered: Delivered) -> None:
        time_ns = delivered.time_ns + self._poses.shift_ns
        self._send_record("delivered", replace(delivered, time_ns=time_ns))

    def _restore_tags(self, found: tuple[str, dict[int, tuple[int, int]]]) -> None:
        directory, heard = found
        if directory == self._directory:
            self._tag_texts.restore({tag: end_ns for tag, (_, end_ns) in heard.items()})
            self._named_values.restore({tag: count for tag, (count, _) in heard.items()})

    @property
    def unsent(self) -> int:
        """Number of pulses that wait for a pose, for sending, or for acknowledgement."""
        sender = self.outlet.sender
        return self._poses.pulses_waiting + sender.pulses.waiting + len(sender.underway)

    def counters(self) -> dict[str, float]:
        """Counts of pulses and receipts, for the health report."""
        return self.outlet.counters()


def _heard_before(directory: str) -> tuple[str, dict[int, tuple[int, int]]]:
    try:
        return directory, received_tags(directory)
    except RecordingError as error:
        log.warning("cannot read the tags received earlier in the flight", reason=error.message)
        return directory, {}
