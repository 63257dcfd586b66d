"""Timing by CPU time, interleaved, and results that can be read.

"CPU %" is CPU seconds per 100 seconds of signal: per cent of one core at the real-time rate.
Ratios and bars are between cases timed in turn in the same run (A B A B …), so that a busy or
slow machine moves both.
"""

import os
import platform
import re
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime

from uavrt_experiments.measured import measured_now, processor

FOLDERS = ("detection", "dsp", "localization", "link/tunnel")
"""Of the package: code whose changes may change a figure here …"""
FOLDERS_OF = {
    "search": ("localization", "planning"),
    "terrain": ("planning", "localization/terrain"),
}
"""… and of sections that time something else."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Something to time."""

    name: str
    run: Callable[[], object]
    """Works through `signal_s` seconds of signal."""
    signal_s: float
    scale: float = 1.0
    """Multiplies the time: 1 / 16.6 makes one thing stand for another of known ratio."""
    at_most: float | None = None
    """Bar: this many times the baseline."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A heading, rows of text and remarks."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = field(default_factory=tuple)


def compare(
    title: str,
    cases: Sequence[Case],
    *,
    baseline: str | None = None,
    rounds: int = 15,
    in_a_row: int = 6,
    absent: Sequence[tuple[str, str]] = (),
    notes: Sequence[str] = (),
) -> Table:
    """Time cases in turn and put medians, ratios and bars in a table.

    `baseline`: name of the case that ratios refer to; a ratio is the median over rounds of the
    quotient within the round.
    `rounds`: each case has so many turns, after one that does not count.
    `in_a_row`: timed runs in a turn, after one untimed: a case pays for its own work, not for
    the caches that the case before has emptied.
    `absent`: peers that could not be timed here; listed, so that nothing is left out silently.
    """
    times: dict[str, list[float]] = {case.name: [] for case in cases}
    for round_ in range(rounds + 1):
        for case in cases:
            case.run()
            started = time.process_time()
            for _ in range(in_a_row):
                case.run()
            spent = (time.process_time() - started) * case.scale / (case.signal_s * in_a_row)
            if round_:
                times[case.name].append(spent)
    rows = [_row(case, times, baseline) for case in cases]
    rows += [[name, reason, "", "", ""] for name, reason in absent]
    header = [
        "",
        "CPU %",
        "× real time",
        f"ratio to {baseline}" if baseline else "ratio",
        "bar",
    ]
    return Table(title=title, header=header, rows=rows, notes=notes)


def _row(case: Case, times: dict[str, list[float]], baseline: str | None) -> list[str]:
    own = times[case.name]
    spent = statistics.median(own)
    ratio = bar = ""
    if baseline in times:
        pairs = zip(own, times[baseline], strict=True)
        value = statistics.median(mine / theirs for mine, theirs in pairs)
        ratio = f"{value:.2f}"
        if case.at_most is not None:
            bar = f"≤ {case.at_most:g}: {'met' if value <= case.at_most else 'NOT met'}"
    elif case.at_most is not None:
        bar = f"≤ {case.at_most:g}: no baseline"
    return [case.name, f"{100 * spent:.3f}", f"{1 / spent:.0f}", ratio, bar]


def machine() -> str:
    """What this was measured on, in one line."""
    import numpy as np
    import scipy

    from uavrt.core.runtime import native

    load = os.getloadavg()[0]
    return (
        f"{os.cpu_count()} × {processor()}, {platform.system()} {platform.machine()}, "
        f"Python {platform.python_version()}, NumPy {np.__version__}, "
        f"SciPy {scipy.__version__}, {native.description()}, one thread, load {load:.1f}; "
        f"yardsticks: {yardsticks()}"
    )


def yardsticks() -> str:
    """How fast this machine is now, at what the programs here do most.

    Beside what the reference's machine took: the bars are figures
    of that machine, and virtual machines of one name differ by a factor of two.
    """
    import numpy as np
    from scipy.signal import upfirdn

    def least_s(work: Callable[[], object], rounds: int) -> float:
        times = []
        for _ in range(rounds):
            begun = time.process_time()
            work()
            times.append(time.process_time() - begun)
        return min(times)

    few = np.zeros(8, np.float32)
    call_us = 1e2 * least_s(lambda: [np.add(few, few) for _ in range(10_000)], 20)
    taps = np.hamming(81).astype(np.float32)
    samples = np.ones(300_000, np.complex64)
    filter_percent = 1e3 * least_s(lambda: upfirdn(taps, samples, down=8), 10)
    return (
        f"a small NumPy call {call_us:.2f} µs (the bars' machine 0.3), "
        f"upfirdn of 3 MS/s {filter_percent:.1f} % (11.4)"
    )


def render_section(section: str, tables: Sequence[Table]) -> str:
    """Markdown of a section, with machine and date."""
    stamp = f"{datetime.now(tz=UTC):%Y-%m-%d %H:%M} UTC"
    measured = measured_now(FOLDERS_OF.get(section, FOLDERS))
    parts = [f"## {section}", f"{stamp}; {machine()}.", measured]
    for table in tables:
        lines = [
            "| " + " | ".join(table.header) + " |",
            "| --- " + "| ---: " * (len(table.header) - 1) + "|",
        ]
        lines += ["| " + " | ".join(row) + " |" for row in table.rows]
        parts += [f"### {table.title}", "\n".join(lines), *table.notes]
    return "\n\n".join(parts)


TOP = """# Results of `make bench`

CPU % is CPU time per signal time in per cent of one core: the load at the real-time rate. Each
section is written by `python -m benchmarks SECTION` and names its machine and date. What fills
vector units and caches suffers more from a busy neighbour core than what does not: ratios hold
for a quiet machine."""


def merge_section(old: str, section: str, text: str) -> str:
    """Replace one section of the results, or add it; sections are in alphabetical order."""
    found = re.findall(r"<!-- begin (\w+) -->\n(.*?)\n<!-- end \1 -->", old, re.DOTALL)
    sections = dict(found) | {section: text}
    blocks = [
        f"<!-- begin {name} -->\n{body}\n<!-- end {name} -->"
        for name, body in sorted(sections.items())
    ]
    return "\n\n".join([TOP, *blocks]) + "\n"
