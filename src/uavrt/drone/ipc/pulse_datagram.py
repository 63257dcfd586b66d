"""Pulses as the original detector sends them to its controller: 96 bytes by UDP to port 50000.

Layout: the manual's reference of UDP formats. A heartbeat has only the tag's number.
"""

import math
import socket
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from uavrt.core.errors import FormatError, LinkError, os_errors_as
from uavrt.core.messages import Pulse, SearchReport
from uavrt.core.units import ns_from_s
from uavrt.link.tunnel.tunnel_records import from_pulse, from_search_report

RECORD: Final = struct.Struct("<12d")
HEARTBEAT_S: Final = 1.0
"""Time between two heartbeats of a tag's detector [s]; 3.6 s for the original detector."""

OVERDUE_NS: Final = ns_from_s(1.0)
"""Delay after a pulse's expected end at which the pulse counts as missed [ns]. Detectors report
a pulse about half a second late, in steps of up to 0.44 s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseRecord:
    """Content of a pulse datagram: its twelve numbers, in their order in the datagram."""

    tag_id: float
    frequency_hz: float = 0.0
    start_time_s: float = 0.0
    predict_next_start_s: float = 0.0
    snr_db: float = 0.0
    stft_score: float = 0.0
    group_sequence: float = 0.0
    group_index: float = 0.0
    group_snr_db: float = 0.0
    detection_status: float = 0.0
    confirmed: float = 0.0
    noise_psd: float = 0.0

    def encode(self) -> bytes:
        """Encode the record as 96 bytes."""
        return RECORD.pack(*(getattr(self, name) for name in self.__slots__))

    @classmethod
    def decode(cls, payload: bytes) -> "PulseRecord":
        """Decode a record of 96 bytes; raises `FormatError` for any other size.

        Numbers may be infinite.
        """
        if len(payload) != RECORD.size:
            raise FormatError(
                f"a pulse record must have {RECORD.size} bytes, but this one has "
                f"{len(payload)}",
                remedy="Check that the sender is a detector",
            )
        return cls(**dict(zip(cls.__slots__, RECORD.unpack(payload), strict=True)))


def record_of_pulse(pulse: Pulse) -> PulseRecord:
    """Convert a detected pulse to the record that is sent as a datagram."""
    return from_pulse(
        PulseRecord,
        pulse,
        group_sequence=pulse.group_sequence,
        group_index=pulse.group_index,
        confirmed=pulse.confirmed,
        noise_psd=pulse.noise_psd,
    )


def record_of_search(report: SearchReport) -> PulseRecord:
    """Convert a report of a search without detection to a pulse record of state 3."""
    return from_search_report(PulseRecord, report)


class PulseDatagramSender:
    """Sends pulse records and heartbeats by UDP; raises `LinkError` for an unknown host."""

    def __init__(self, host: str, port: int, tag_ids: Sequence[int]) -> None:
        with os_errors_as(LinkError, f"no address {host}", "Check the host's name"):
            found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self._place = found[4]
        self._socket = socket.socket(found[0], socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._tag_ids = tuple(tag_ids)
        self._last_heartbeat_s = -math.inf
        self._found_ns: dict[int, tuple[int, int]] = {}
        """Latest time span in which each tag's pulses arrived as expected [ns]."""
        self.sent = 0
        self.dropped = 0
        """Number of records not sent, for lack of buffer or network."""

    def send_pulses(self, pulses: Iterable[Pulse]) -> None:
        """Send a datagram for each pulse."""
        for pulse in pulses:
            self._send(record_of_pulse(pulse))
            self._note_found(pulse)

    def send_reports(self, reports: Iterable[SearchReport]) -> None:
        """Send reports of searches without detection, unless the tag is received regularly.

        Reports come every second, pulses often less often. Without this rule, a controller
        would consider a tag lost between two pulses.
        """
        for report in reports:
            begin_ns, end_ns = self._found_ns.get(report.tag_id, (0, -1))
            if not begin_ns <= report.time_ns <= end_ns:
                self._send(record_of_search(report))

    def heartbeat(self, now_s: float) -> None:
        """Send a heartbeat for each tag, at most once a second by the monotonic `now_s`."""
        if now_s - self._last_heartbeat_s >= HEARTBEAT_S:
            self._last_heartbeat_s = now_s
            for tag_id in self._tag_ids:
                self._send(PulseRecord(tag_id=tag_id))

    def _note_found(self, pulse: Pulse) -> None:
        """Extend the time span in which a tag is received regularly, or begin a new span."""
        next_ns = pulse.predicted_next_end_ns or pulse.end_time_ns
        begin_ns, end_ns = pulse.start_time_ns, next_ns + OVERDUE_NS
        before_ns, until_ns = self._found_ns.get(pulse.tag_id, (begin_ns, end_ns))
        # Pulses of a block may come before its reports, and a weak one later than its next;
        # stretches that are apart are a tag that was lost, or a clock that was set.
        if begin_ns <= until_ns and before_ns <= end_ns:
            begin_ns, end_ns = min(begin_ns, before_ns), max(end_ns, until_ns)
        self._found_ns[pulse.tag_id] = begin_ns, end_ns

    def close(self) -> None:
        """Close the UDP socket for pulse datagrams."""
        self._socket.close()

    def _send(self, record: PulseRecord) -> None:
        try:
            self._socket.sendto(record.encode(), self._place)
            self.sent += 1
        except OSError:
            self.dropped += 1
