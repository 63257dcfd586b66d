"""Status messages for the ground: heartbeats, detector reports, texts, computer load.

Part of the connection process. The link may carry only 1200 bytes a second, so each kind of
message has its own rate.
"""

import os
import shutil
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from uavrt.config.settings import RadioSettings
from uavrt.core.commands import SystemState
from uavrt.core.messages import (
    Beep,
    ProcessStatus,
    SearchReport,
    StatusText,
    drop_beeps,
    keep_beep,
)
from uavrt.core.runtime.disk_thread import Disk, at_once
from uavrt.core.units import ns_from_s
from uavrt.link.mavlink.dialect import MavSeverity, OnboardComputerStatus
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.sending.pacing import Priority
from uavrt.link.mavlink.sending.sender import TunnelSender
from uavrt.link.mavlink.sending.statustext import TextLimiter
from uavrt.link.tunnel.drone_exchange import Exchange
from uavrt.link.tunnel.own_messages.beep import BEEP_TYPE, encode_beep

HEARTBEAT_NS = ns_from_s(1.0)
COMPUTER_NS = ns_from_s(10.0)
"""Time between reports of the computer's load [ns]; they take 2 % of the slowest link."""
FAULTS_NS = ns_from_s(2.0)
FAULT_REPEAT_NS = ns_from_s(30.0)
"""Time between reports of a lasting fault [ns]; they take less than 1 % of the slowest link."""
SEARCH_REPORT_NS = ns_from_s(5.0)
"""Shortest time between search reports about a tag [ns], to leave room for pulses."""
ALIVE_NS = ns_from_s(3.0)
"""Shortest time between two heartbeats of a tag's detector [ns]. The original ground station
waits K + 1 pulse intervals plus 1 s for one, about 6 s, where K is the number of pulses that
are searched together."""
ALIVE_PER_TAG_NS = ns_from_s(0.1)
"""Shortest time between detector heartbeats of two tags [ns]; limits the sum to 10 a second."""
BEEP_NS = ns_from_s(5.0)
"""Time between reports about unlisted beeping senders [ns]; each describes one, in turn."""
THERMAL_ZONE = Path("/sys/class/thermal/thermal_zone0/temp")
UNKNOWN_U8 = 0xFF
UNKNOWN_I8 = 127
UNKNOWN_U32 = 0xFFFFFFFF


class GroundStatus:
    """Sends each status message when it is due; limits the rates of texts and reports."""

    def __init__(
        self, exchange: Exchange, sender: TunnelSender, root: Path, disk: Disk = at_once
    ) -> None:
        self._exchange = exchange
        self._sender = sender
        self._root = root
        self._disk = disk
        self._space_mib = (UNKNOWN_U32, UNKNOWN_U32)
        self._asking = False
        self._limiter = TextLimiter()
        self._tag_limiter = TextLimiter()
        """Separate rate limit, so that texts about many tags suppress no warning."""
        self._beeps: list[Beep] = []
        self._ppm: float | None = None
        self._next_beep = 0
        self.beeps_left_out = 0
        """Number of beeping senders dropped from the reports because there were too many."""
        self._next_ns: dict[str, int] = {}
        self._state: SystemState | None = None
        self._tags = 1
        self._shift_ns = 0
        """Clock of the flight minus the clock of this process [ns]."""
        self._busy = _busy_ticks()

    @property
    def texts_left_out(self) -> int:
        """Number of operator texts dropped by the rate limits."""
        return self._limiter.left_out + self._tag_limiter.left_out

    def tags(self, count: int) -> None:
        """Set the number of searched tags; with more tags, each tag is reported less often."""
        self._tags = count

    def tick(self, state: SystemState, now_ns: int) -> None:
        """Send the messages that are due; send a heartbeat at once if the state has changed."""
        if state is not self._state:
            self._state = state
            self._next_ns.pop("heartbeat", None)
        if self._due("heartbeat", HEARTBEAT_NS, now_ns):
            self._send(self._exchange.heartbeat(state, cpu_temperature_c()))
            for step in self._exchange.operations.again():
                self._sender.send_tunnel(step.payload, Priority.STATUS, Peer(*step.requester))
        if self._beeps and self._due("beep", BEEP_NS, now_ns):
            self._send_beep()
        if self._due("computer", COMPUTER_NS, now_ns):
            self._report_computer()

    def begin_flight(self, shift_ns: int) -> None:
        """Set the clock shift of a new flight, and delete the list of beeping senders."""
        self._shift_ns = shift_ns
        self._beeps.clear()

    def clear_beeps(self) -> None:
        """Delete the list of beeping senders, because the list of tags has changed."""
        self._beeps.clear()

    def radio_set(self, radio: RadioSettings) -> None:
        """Delete the list of beeping senders if the radio's frequency correction changes."""
        if radio.frequency_correction_ppm != self._ppm:
            self._ppm = radio.frequency_correction_ppm
            self._beeps.clear()

    def beep(self, beep: Beep) -> None:
        """Add a beeping sender, or a newer measurement of one already added."""
        keep_beep(self._beeps, beep)
        self.beeps_left_out += drop_beeps(self._beeps)
        if beep in self._beeps:
            self._next_beep = self._beeps.index(beep)
            self._next_ns.pop("beep", None)

    def _send_beep(self) -> None:
        self._next_beep %= len(self._beeps)
        payload = encode_beep(self._beeps[self._next_beep])
        self._sender.send_tunnel(payload, Priority.OTHER, payload_type=BEEP_TYPE)
        self._next_beep += 1

    def text(self, text: StatusText, now_ns: int) -> None:
        """Send a text to the operator, unless the rate limit forbids it."""
        if self._limiter.allows(text.severity, text.text, now_ns):
            self._sender.send_text(text.severity, text.text)

    def faults(
        self,
        processes: Sequence[ProcessStatus],
        others: Sequence[StatusText],
        now_ns: int,
        *,
        new_station: bool,
    ) -> None:
        """Repeat the texts of lasting faults, for stations that did not receive them.

        With `new_station`, send all of them at once.
        """
        if not new_station and not self._due("faults", FAULTS_NS, now_ns):
            return
        for fault in (*map(_fault_of, filter(lambda one: one.reason, processes)), *others):
            if new_station or not self._limiter.sent_within(
                fault.text, FAULT_REPEAT_NS, now_ns
            ):
                self.text(fault, now_ns)

    def tag_text(self, text: str, now_ns: int) -> bool:
        """Send a text about a tag; False if the rate limit forbids it."""
        allowed = self._tag_limiter.allows(MavSeverity.INFO, text, now_ns)
        if allowed:
            self._sender.send_text(MavSeverity.INFO, text)
        return allowed

    def search_report(self, report: SearchReport, now_ns: int) -> None:
        """Send a tag's search report or, soon after another one, a detector heartbeat."""
        if self._due(f"search {report.tag_id}", SEARCH_REPORT_NS, now_ns):
            self._send(self._exchange.search_report(report))
        else:
            self.detector_alive(report.tag_id, now_ns)

    def detector_alive(self, tag_id: int, now_ns: int) -> None:
        """Report that a tag's detector works, at a limited rate."""
        period_ns = max(ALIVE_NS, ALIVE_PER_TAG_NS * self._tags)
        if self._due(f"alive {tag_id}", period_ns, now_ns):
            self._send(self._exchange.detector_heartbeat(tag_id, now_ns + self._shift_ns))

    def _due(self, name: str, period_ns: int, now_ns: int) -> bool:
        if now_ns < self._next_ns.get(name, 0):
            return False
        self._next_ns[name] = now_ns + period_ns
        return True

    def _send(self, payload: bytes | None) -> None:
        if payload is not None:
            self._sender.send_tunnel(payload, Priority.STATUS)

    def _report_computer(self) -> None:
        """Send the computer's load and free disk space.

        If the disk does not answer, use the last known space.

        A pending query is not repeated, because queued queries would delay file transfers
        later.
        """
        asked = not self._asking
        if asked:
            self._asking = True
            asked = self._disk(partial(_disk_mib, self._root), self._receive_space)
            self._asking = self._asking and asked
        if not asked:
            self._sender.send_message(self._computer_status())

    def _receive_space(self, space_mib: tuple[int, int]) -> None:
        self._asking = False
        self._space_mib = space_mib
        self._sender.send_message(self._computer_status())

    def _computer_status(self) -> OnboardComputerStatus:
        before, self._busy = self._busy, _busy_ticks()
        ticks = self._busy[1] - before[1]
        load = round(100 * (self._busy[0] - before[0]) / ticks) if ticks > 0 else UNKNOWN_U8
        memory = _memory_mib()
        disk = self._space_mib
        temperature = cpu_temperature_c()
        core = UNKNOWN_I8 if temperature is None else max(-127, min(126, round(temperature)))
        unknown = (UNKNOWN_U32,)
        return OnboardComputerStatus(
            time_usec=time.monotonic_ns() // 1000,
            uptime=time.monotonic_ns() // 1_000_000 & 0xFFFFFFFF,
            cpu_cores=bytes([UNKNOWN_U8] * 8),
            cpu_combined=bytes([load, *[UNKNOWN_U8] * 9]),
            gpu_cores=bytes([UNKNOWN_U8] * 4),
            gpu_combined=bytes([UNKNOWN_U8] * 10),
            temperature_board=UNKNOWN_I8,
            temperature_core=(core, *[UNKNOWN_I8] * 7),
            fan_speed=(32767,) * 4,
            ram_usage=memory[0],
            ram_total=memory[1],
            storage_type=(0, *unknown * 3),
            storage_usage=(disk[0], *unknown * 3),
            storage_total=(disk[1], *unknown * 3),
            link_type=unknown * 6,
            link_tx_rate=unknown * 6,
            link_rx_rate=unknown * 6,
            link_tx_max=unknown * 6,
            link_rx_max=unknown * 6,
        )


def _fault_of(process: ProcessStatus) -> StatusText:
    """Return a text on a faulty process: its name, its state and the reason."""
    words = process.reason
    if not words.startswith(process.process):
        words = f"{process.process}: {process.status} (reason {words})"
    return StatusText(severity=MavSeverity.WARNING, text=words[:200])


def cpu_temperature_c() -> float | None:
    """Processor temperature [°C]; None if the system does not report it."""
    try:
        return int(THERMAL_ZONE.read_text()) / 1000.0
    except (OSError, ValueError):
        return None


def _busy_ticks() -> tuple[int, int]:
    try:
        first = Path("/proc/stat").read_text().split("\n", 1)[0].split()
        ticks = [int(part) for part in first[1:9]]
    except (OSError, ValueError):
        return 0, 0
    return sum(ticks) - ticks[3] - ticks[4], sum(ticks)


def _memory_mib() -> tuple[int, int]:
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        kib = {line.split(":")[0]: int(line.split()[1]) for line in lines[:5]}
        total = kib["MemTotal"]
        return (total - kib["MemAvailable"]) // 1024, total // 1024
    except (OSError, ValueError, KeyError, IndexError):
        return UNKNOWN_U32, UNKNOWN_U32


def _disk_mib(place: Path) -> tuple[int, int]:
    try:
        usage = shutil.disk_usage(place if place.exists() else os.curdir)
    except OSError:
        return UNKNOWN_U32, UNKNOWN_U32
    return usage.used >> 20, usage.total >> 20
