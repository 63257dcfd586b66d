"""The path of pulses: to their poses, the recorder, the ground stations, and their receipts."""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial

from uavrt.errors import RecordingError
from uavrt.ipc.process import ProcessFrame
from uavrt.log import get_logger
from uavrt.mavlink.connection import Connection
from uavrt.mavlink.pacing import Priority
from uavrt.messages import Delivered, FlightInfo, Pulse, PulsePose, Recorded, SearchReport
from uavrt.processes.ground_status import GroundStatus
from uavrt.processes.heard_tags import HeardTags
from uavrt.processes.named_values import NamedValues
from uavrt.processes.pose_desk import PoseDesk
from uavrt.processes.pulse_outlet import PulseOutlet
from uavrt.recording.disk_thread import DiskThread
from uavrt.recording.spool import heard_tags
from uavrt.tunnel.delivery import PulseDelivery
from uavrt.tunnel.exchange import Exchange

log = get_logger()

FIRST_REFILL_NS = 4_000_000_000
"""Wait for the recorder's commit after a start [ns]; pulses on the disk that no ground station
has are then sent."""


class PulsePath:
    """Pulses of the current flight; nothing is sent without a `linked` ground."""

    def __init__(
        self,
        frame: ProcessFrame,
        link: Connection,
        exchange: Exchange,
        poses: PoseDesk,
        status: GroundStatus,
        disk: DiskThread,
        *,
        linked: bool,
    ) -> None:
        self._send_record, self._now_ns = frame.send, frame.clock.now_ns
        self._link, self._linked = link, linked
        self._poses, self._status = poses, status
        self._delivery = PulseDelivery()
        self.outlet = PulseOutlet(
            exchange.pulse,
            self._note_delivered,
            disk,
            first_refill_ns=self._now_ns() + FIRST_REFILL_NS,
        )
        flight = frame.assignment.flight
        self._heard_tags = HeardTags(() if flight is None else flight.tags)
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
            disk(partial(_heard_before, flight.directory), self._go_on_from)

    def begin_flight(self, flight: FlightInfo) -> None:
        """Send the pulses of a new flight, in its time."""
        self._poses.use_clock(flight.clock_offset_ns)
        self._status.begin_flight(self._poses.shift_ns)
        self.outlet.flight(flight.directory)
        self._directory = flight.directory
        self._heard_tags.begin_flight(flight.tags)
        self._named_values.begin_flight()

    def add(self, pulse: Pulse) -> None:
        """Take a detector's pulse, which waits for its pose."""
        self._status.detector_alive(pulse.tag_id, self._now_ns())
        self._poses.add(pulse)

    def searched(self, report: SearchReport) -> None:
        """Report what a detector has searched."""
        self._status.search_report(report, self._now_ns())

    def tick(self, now_ns: int) -> None:
        """Pass on the pulses whose pose is known; repeat what was not acknowledged."""
        self.pass_on(self._poses.ready())
        sender = self.outlet.sender
        sender.station_present(self._link.station_present, now_ns)
        self.outlet.tick(now_ns)
        if sender.underway.unanswered(now_ns):
            self._link.tunnel.unanswered(now_ns)

    def pass_on(self, pulse_poses: Iterable[PulsePose]) -> None:
        """Send pulses with their pose to the recorder and to the ground.

        If a pose came too late, the recorder has already replaced it.
        """
        for pulse_pose in pulse_poses:
            if self._delivery.may_send(pulse_pose.pulse.key):
                self._send_record("pulse_pose", pulse_pose)
                self._send(pulse_pose)

    def made_up(self, pulse_pose: PulsePose) -> None:
        """Send a pulse whose pose the recorder has computed."""
        if self._delivery.may_send(pulse_pose.pulse.key):
            self._send(pulse_pose)

    def recorded(self, record: Recorded) -> None:
        """Note which pulses the flight's database has."""
        known = [self._delivery.recorded(key) for key in record.pulses]
        if not all(known):
            self.outlet.disk_has_news()

    def _send(self, pulse_pose: PulsePose) -> None:
        if self._linked:
            self.outlet.add(pulse_pose)
            self._report_tag(pulse_pose.pulse)
            self._link.tunnel.wake()

    def _report_tag(self, pulse: Pulse) -> None:
        """Inform stations that cannot read our pulses."""
        now_ns = self._now_ns()
        self._named_values.heard(pulse, now_ns)
        text = self._heard_tags.text(pulse)
        if text is not None and self._status.tag_text(text, now_ns):
            self._heard_tags.reported(pulse.tag_id)

    def receipt(self, payload: bytes, place: tuple[int, int]) -> None:
        """Handle a ground station's receipt."""
        now_ns, stores = self._now_ns(), self.outlet.sender.stores
        before = stores.present, stores.confirmed
        confirmed, trip_s = self.outlet.receipt(payload, place, now_ns)
        if stores.present - before[0] or stores.confirmed - before[1]:
            self._delivery.station_came()
        if confirmed:
            self._link.tunnel.rate.acknowledged(trip_s, now_ns)
        self._link.tunnel.wake()

    def _note_delivered(self, delivered: Delivered) -> None:
        time_ns = delivered.time_ns + self._poses.shift_ns
        self._send_record("delivered", replace(delivered, time_ns=time_ns))

    def _go_on_from(self, found: tuple[str, dict[int, tuple[int, int]]]) -> None:
        """Restore the tags that were received in this flight before this process began."""
        directory, heard = found
        if directory == self._directory:
            self._heard_tags.heard_before({tag: end_ns for tag, (_, end_ns) in heard.items()})
            self._named_values.heard_before({tag: count for tag, (count, _) in heard.items()})

    @property
    def unsent(self) -> int:
        """Pulses that wait for a pose, for sending, or for a receipt."""
        sender = self.outlet.sender
        return self._poses.pulses_waiting + sender.pulses.waiting + len(sender.underway)

    def counters(self) -> dict[str, float]:
        """Counts with names for a health record."""
        return {
            "pulses_waiting_for_recorder": self._delivery.unrecorded,
            **self.outlet.counters(),
        }


def _heard_before(directory: str) -> tuple[str, dict[int, tuple[int, int]]]:
    """Get the tags in the flight's database; empty if it cannot be read."""
    try:
        return directory, heard_tags(directory)
    except RecordingError as error:
        log.warning("tags heard before are not known", reason=error.message)
        return directory, {}
