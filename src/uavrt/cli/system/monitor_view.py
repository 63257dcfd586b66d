"""The terminal view: state, processes, rates, losses, tags."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.text import Text

from uavrt.config.tags.tag_corrections import words_of_beeps
from uavrt.core.messages import (
    Beep,
    ProcessStatus,
    Pulse,
    SearchReport,
    StatusText,
    SystemStatus,
    keep_beep,
)
from uavrt.core.terminal_tables import plain_table
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.reading.outline import ReceivedTag

RATE_WINDOW_S = 60.0
FRESH_S = 5.0
TEXTS_SHOWN = 6
LOSSES = (
    "samples_lost",
    "channel_samples_dropped",
    "kept_samples_dropped",
    "records_dropped",
    "records_refused",
)
"""Health counters that should stay zero; the monitor shows them as losses."""


@dataclass(slots=True)
class Heard:
    """Pulses of one tag that were received in this flight."""

    pulses: int = 0
    recorded_ns: int = 0
    """Start of the last pulse recorded before the monitor started [ns, UTC]; 0: none."""
    last: Pulse | None = None
    last_s: float | None = None
    times_s: deque[float] = field(default_factory=deque)
    searched: SearchReport | None = None


@dataclass(slots=True)
class MonitorView:
    """Collects records for display; `render` draws them."""

    status: SystemStatus | None = None
    heard: dict[int, Heard] = field(default_factory=dict)
    texts: deque[StatusText] = field(default_factory=lambda: deque(maxlen=TEXTS_SHOWN))
    beeps: list[Beep] = field(default_factory=list)
    cpu_percent: dict[str, float] = field(default_factory=dict)
    _cpu_before: dict[str, tuple[int, float]] = field(default_factory=dict)

    def add(self, topic: str, record: object, now_s: float) -> None:
        """Add a record from the status socket."""
        match record:
            case Pulse() if topic == "pulse":
                heard = self.heard.setdefault(record.tag_id, Heard())
                heard.pulses += record.start_time_ns > heard.recorded_ns
                heard.last, heard.last_s = record, now_s
                heard.times_s.append(now_s)
            case Beep():
                keep_beep(self.beeps, record)
            case SearchReport():
                self.heard.setdefault(record.tag_id, Heard()).searched = record
            case StatusText():
                self.texts.append(record)
            case SystemStatus():
                before = None if self.status is None else self.status.flight_directory
                if record.flight_directory not in (None, before):
                    self.heard.clear()
                    self.beeps.clear()
                self.status = record
                for process in record.processes:
                    self._measure(process, record.time_ns)

    def take_recorded(self, heard: Mapping[int, ReceivedTag], now_s: float) -> None:
        """Add the pulses that were recorded in this flight before the monitor started."""
        assert self.status is not None
        for tag_id, one in heard.items():
            ago_s = (self.status.time_ns - one.last_ns) / NANOSECONDS_PER_SECOND
            self.heard[tag_id] = Heard(
                pulses=one.pulses, recorded_ns=one.last_ns, last_s=now_s - max(0.0, ago_s)
            )

    def _measure(self, process: ProcessStatus, time_ns: int) -> None:
        before = self._cpu_before.get(process.process)
        self._cpu_before[process.process] = (time_ns, process.cpu_s)
        if before is not None and time_ns > before[0]:
            share = (process.cpu_s - before[1]) * NANOSECONDS_PER_SECOND / (time_ns - before[0])
            smooth = self.cpu_percent.get(process.process, 100.0 * share)
            self.cpu_percent[process.process] = 0.7 * smooth + 30.0 * share

    @property
    def losses(self) -> float:
        """Total of all counters of lost or refused items, over all processes."""
        processes = self.status.processes if self.status else ()
        return sum(p.counters.get(name, 0.0) for p in processes for name in LOSSES)

    def render(self, now_s: float) -> RenderableType:
        """Draw the view at a time of the monotonic clock [s]."""
        if self.status is None:
            return Panel("waiting for the supervisor …", title="uavrt monitor")
        return Panel(
            Group(
                self._head(),
                self._tags(now_s),
                self._processes(),
                *(Text(line, "yellow") for line in words_of_beeps(self.beeps)),
                *self._reasons(),
                *self._texts(),
            ),
            title="uavrt monitor",
        )

    def _head(self) -> RenderableType:
        status = self.status
        assert status is not None
        losses = self.losses
        center = status.center_frequency_hz
        return Text.assemble(
            ("state ", "dim"),
            (status.state.words, "bold"),
            ("   radio at ", "dim"),
            f"{center / 1e6:.4f} MHz" if center else "–",
            ("   lost ", "dim"),
            (f"{losses:.0f}", "bold red" if losses else "bold green"),
            ("   flight ", "dim"),
            Path(status.flight_directory).name if status.flight_directory else "–",
            ("   UTC ", "dim"),
            f"{datetime.fromtimestamp(status.time_ns * 1e-9, tz=UTC):%H:%M:%S}",
        )

    def _tags(self, now_s: float) -> RenderableType:
        table = plain_table(
            *(
                "tag",
                "frequency",
                "last SNR",
                "noise",
                "usable",
                "per minute",
                "pulses",
                "detected",
            )
        )
        assert self.status is not None
        for tag in self.status.tags:
            heard = self.heard.get(tag.tag_id, Heard())
            while heard.times_s and heard.times_s[0] < now_s - RATE_WINDOW_S:
                heard.times_s.popleft()
            last = heard.last
            ago_s = None if heard.last_s is None else now_s - heard.last_s
            frequency = last.frequency_hz if last else tag.frequency_hz
            table.add_row(
                " ".join(filter(None, (_number(tag.tag_id, last), tag.name))),
                f"{frequency / 1e6:.5f} MHz",
                f"{'≥ ' if last.clipped else ''}{last.snr_db:.1f} dB" if last else "–",
                f"{last.noise_psd:.1e}" if last else "–",
                _usable(heard.searched),
                str(len(heard.times_s)),
                str(heard.pulses),
                Text(
                    "never" if ago_s is None else f"{ago_s:.0f} s ago",
                    "bold green" if ago_s is not None and ago_s < FRESH_S else "yellow",
                ),
            )
        return table

    def _processes(self) -> RenderableType:
        table = plain_table("process", "status", "CPU", "memory", "restarts", "losses")
        assert self.status is not None
        for process in self.status.processes:
            lost = sum(process.counters.get(name, 0.0) for name in LOSSES)
            table.add_row(
                process.process,
                Text(process.status, "" if process.ok else "bold red"),
                f"{self.cpu_percent.get(process.process, 0.0):.1f} %",
                f"{process.memory_mb:.0f} MB",
                str(process.restarts),
                f"{lost:.0f}",
            )
        return table

    def _reasons(self) -> list[RenderableType]:
        assert self.status is not None
        return [Text(one.reason, "bold red") for one in self.status.processes if one.reason]

    def _texts(self) -> list[RenderableType]:
        return [
            Text(
                text.text,
                "bold red" if text.severity <= 3 else "yellow" if text.severity <= 4 else "",
            )
            for text in self.texts
        ]


def _number(tag_id: int, last: Pulse | None) -> str:
    others = last.also_possible_tag_ids if last is not None else ()
    return " or ".join(map(str, (tag_id, *others)))


def _usable(searched: SearchReport | None) -> str:
    """Text with the usable share of the time, and the weakest pulses found with Pd 0.9 [dB]."""
    if searched is None or searched.usable_share is None:
        return "–"
    weakest_db = searched.weakest_enr_db
    weakest = "" if weakest_db is None else f", from {weakest_db:.0f} dB"
    return f"{100.0 * searched.usable_share:.0f} %{weakest}"
