"""Live view of the demo in a terminal."""

import io
import re
from collections import deque
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from uavrt.core.messages import Pulse, SystemStatus, Tag
from uavrt.core.terminal_tables import plain_table
from uavrt.simulation.demo.watch import RECEIVER, samples_lost

RATE_WINDOW_S = 60.0
FRESH_S = 5.0
WIDE = 100
"""Width of the terminal from which bars and units are shown [columns]."""


@dataclass(slots=True)
class TagView:
    """Values of one tag that the view shows."""

    tag: Tag
    last: Pulse | None = None
    times_s: deque[float] = field(default_factory=deque)
    """Arrival times of the tag's recent pulses on the viewer's clock [s]."""
    detected: int = 0
    delivered: int = 0

    def add(self, pulse: Pulse, now_s: float) -> None:
        """Add a detected pulse of the tag; `now_s`: time on the viewer's clock [s]."""
        self.detected += 1
        self.times_s.append(now_s)
        if self.last is None or pulse.start_time_ns > self.last.start_time_ns:
            self.last = pulse

    def per_minute(self, now_s: float, running_s: float) -> float:
        """Pulses per minute over the last `RATE_WINDOW_S`, or over `running_s` if shorter."""
        while self.times_s and self.times_s[0] < now_s - RATE_WINDOW_S:
            self.times_s.popleft()
        return len(self.times_s) * 60.0 / max(1.0, min(RATE_WINDOW_S, running_s))


_SHORT = ("tag", "MHz", "SNR, dB", "rate, s", "a minute", "found", "ground")
_WIDE = (
    *("tag", "frequency", "last SNR", "", "rate", "per minute", "detected"),
    "on the ground",
)
_BAR = 3
"""Index of the column with a bar for the SNR, which only wide terminals show."""
_PROCESSES = ("process", "status", "CPU of a core", "memory")


@dataclass(slots=True)
class DemoView:
    """Data that the terminal view shows; `render` draws them."""

    duration_s: float
    tags: dict[int, TagView]
    status: SystemStatus | None = None
    elapsed_s: float = 0.0
    phase: str = "starting"
    cpu_percent: dict[str, float] = field(default_factory=dict)
    flight_directory: str = ""
    page_address: str = ""
    ros_domain: int | None = None

    def render(self, now_s: float) -> RenderableType:
        """Draw the view for a time of the viewer's clock [s]; it fits the terminal's width."""
        return _Drawn(self, now_s)

    def drawn(self, now_s: float, width: int) -> RenderableType:
        """Draw the view for a given terminal width [columns]."""
        narrow = width < WIDE
        more = (
            ""
            if narrow
            else (
                " – simulated animals, radio and autopilot; "
                "real receiver, detectors, link and ground"
            )
        )
        return Panel(
            Group(
                self._head(narrow=narrow),
                self._tag_table(now_s, narrow=narrow),
                self._process_table(narrow=narrow),
            ),
            title=f"[bold]uavrt demo[/bold]{more}",
            border_style="cyan",
        )

    def save_picture(self, path: Path, now_s: float) -> None:
        """Save the view as SVG."""
        console = Console(record=True, width=100, file=io.StringIO())
        console.print(self.render(now_s))
        svg = console.export_svg(title="uavrt demo")
        # Rich names fonts at addresses; a picture in a document must not fetch anything.
        svg = re.sub(r"@font-face \{.*?\}", "", svg, flags=re.DOTALL)
        path.write_text(svg.replace("Fira Code", "DejaVu Sans Mono"), encoding="utf-8")

    def _head(self, *, narrow: bool) -> RenderableType:
        state = self.status.state.words if self.status else "starting"
        lost = sum(
            samples_lost(process.counters)
            for process in (self.status.processes if self.status else ())
            if process.process == RECEIVER
        )
        grid = Table.grid(expand=True, padding=(0, 1 if narrow else 2))
        lost_title, of = ("lost ", "/") if narrow else ("samples lost ", " of ")
        for _ in range(4):
            grid.add_column()
        grid.add_row(
            Text.assemble(("state ", "dim"), (state, "bold")),
            Text.assemble(("phase ", "dim"), (self.phase, "bold")),
            Text.assemble(
                (lost_title, "dim"), (str(lost), "bold red" if lost else "bold green")
            ),
            Text.assemble(
                ("time ", "dim"), (f"{self.elapsed_s:.0f}{of}{self.duration_s:.0f} s", "bold")
            ),
        )
        bar = Table.grid(expand=True)  # alone, a bar does not end its line
        done_s = min(self.elapsed_s, self.duration_s)
        bar.add_row(ProgressBar(total=self.duration_s, completed=done_s))
        rows: list[RenderableType] = [grid, bar]
        if self.page_address:
            rows.append(Text.assemble(("page ", "dim"), (self.page_address, "bold cyan")))
        if self.ros_domain is not None:
            named = f"ROS_DOMAIN_ID={self.ros_domain}"
            rows.append(Text.assemble(("ROS 2 ", "dim"), (named, "bold cyan")))
        return Group(*rows)

    def _tag_table(self, now_s: float, *, narrow: bool) -> RenderableType:
        table = plain_table(*(_SHORT if narrow else _WIDE))
        if not narrow:
            table.columns[_BAR].justify = "left"
        for view in self.tags.values():
            cells = self._tag_cells(view, now_s, narrow=narrow)
            if narrow:
                del cells[_BAR]
            table.add_row(*cells)
        return table

    def _tag_cells(self, view: TagView, now_s: float, *, narrow: bool) -> list[RenderableType]:
        mhz, db, s = ("", "", "") if narrow else (" MHz", " dB", " s")
        last = view.last
        name = f"{view.tag.tag_id} {view.tag.name or ''}"
        if last is None:
            return [name, f"{view.tag.frequency_hz / 1e6:.4f}{mhz}", "–", "", "", "0", "0", "0"]
        fresh = bool(view.times_s) and now_s - view.times_s[-1] < FRESH_S
        style = "bold green" if fresh else "yellow"
        bar = "█" * max(1, min(20, round(last.snr_db / 2)))
        return [
            Text(name, style="bold"),
            f"{last.frequency_hz / 1e6:.5f}{mhz}",
            Text(f"{last.snr_db:.1f}{db}", style=style),
            Text(bar, style=style),
            f"{view.tag.pulse_intervals_s[last.rate - 1]:.3f}{s}",
            f"{view.per_minute(now_s, self.elapsed_s):.0f}",
            str(view.detected),
            str(view.delivered),
        ]

    def _process_table(self, *, narrow: bool) -> RenderableType:
        """Table of the processes.

        `narrow`: show two processes in each row, and the status of faulty processes only.
        """
        table = plain_table(*(2 * ("process", "CPU", "MB") if narrow else _PROCESSES))
        known = {one.process: one for one in (self.status.processes if self.status else ())}
        rows: list[list[RenderableType]] = []
        unit = "" if narrow else " MB"
        for name, percent in self.cpu_percent.items():
            process = known.get(name)
            status = Text("" if process is None else process.status)
            if process is not None and not process.ok:
                status.style = "bold red"
            memory = f"{process.memory_mb:.0f}{unit}" if process else ""
            if narrow:
                words = Text.assemble(name, " ", status) if status.style else name
                rows.append([words, f"{percent:.1f} %", memory])
            else:
                rows.append([name, status, f"{percent:.1f} %", memory])
        if narrow:
            half = (len(rows) + 1) // 2
            pairs = zip_longest(rows[:half], rows[half:], fillvalue=["", "", ""])
            rows = [[*left, *right] for left, right in pairs]
        for row in rows:
            table.add_row(*row)
        return table


@dataclass(frozen=True, slots=True)
class _Drawn:
    """The view for one time; it is drawn once the width of the terminal is known."""

    view: DemoView
    now_s: float

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield self.view.drawn(self.now_s, options.max_width)
