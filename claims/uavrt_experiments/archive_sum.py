"""Estimate the time to search 100 TB on 50 machines, from ``benchmarks/results.md``.

``python -m uavrt_experiments.archive_sum`` writes it into ``docs/how-to/search-an-archive.md``;
run it after ``python -m benchmarks archive``.
"""

import re
import sys
from dataclasses import dataclass
from pathlib import Path

_ROOT = Path(__file__).parents[2]
RESULTS = _ROOT / "benchmarks/results.md"
PAGE = _ROOT / "docs/how-to/search-an-archive.md"
BEGIN, END = "<!-- begin archive sum -->", "<!-- end archive sum -->"
GB = 10**9
BYTES_A_SAMPLE, HOUR_S = 4, 3600.0
ARCHIVE_BYTES, MACHINES, CORES = 100e12, 50, 8
DISK, LINE, STORE = 0.75e9, 1.25e9, 5e9
"""Reading speed [B/s] of a machine's own disk, of a line of 10 Gbit/s, and of one store."""
LEAD_IN_S, SHORT_CELL_S = 120.0, 900.0
INTERVAL_S = 1.2
WRITING_S, TASK_S = 16e-6, 1e-3
"""Time to join and write one pulse, and of Dask's scheduler for one task [s]; measured
separately."""


@dataclass(frozen=True, slots=True)
class Way:
    """One configuration of the archive benchmark: one process, several, or a Dask cluster."""

    name: str
    cpu_s: float
    """CPU time of all recordings together [s]."""
    worker_mb: float
    """Largest memory of a worker [MB]."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Figures of the archive benchmark."""

    machine: str
    signal_s: float
    """Total length of all recordings [s]."""
    rate_hz: float
    tags: int
    ways: tuple[Way, ...]
    """Configurations measured; the first uses one process, which also writes."""

    @property
    def bytes_a_second(self) -> float:
        """Bytes in one second of a recording."""
        return BYTES_A_SAMPLE * self.rate_hz

    @property
    def hour_cpu_s(self) -> float:
        """CPU time for an hour of recording [s]."""
        return HOUR_S * self.ways[0].cpu_s / self.signal_s

    @property
    def core_bytes_a_second(self) -> float:
        """Bytes that one core processes in a second."""
        return self.bytes_a_second * HOUR_S / self.hour_cpu_s


def measured(results: str) -> Measured:
    """Read the figures from the archive section of ``benchmarks/results.md``."""
    section = results.partition("<!-- begin archive -->")[2].partition("<!-- end archive")[0]
    machine = re.search(r"UTC; (.+?), Linux", section)
    table = section.partition("### Cores side by side")[2]
    rows = re.findall(r"^\| ([^|]+?) \| [\d.]+ × \| ([\d.]+) s .*\| (\d+) MB \|", table, re.M)
    what = re.search(r"(\d+) recordings of (\d+) s at (\d+) MS/s, 16 bit, (\d+) tags", table)
    if machine is None or what is None or not rows:
        raise SystemExit(
            "benchmarks/results.md has no archive figures: run python -m benchmarks archive"
        )
    files, length_s, rate, tags = map(int, what.groups())
    return Measured(
        machine=machine[1],
        signal_s=files * length_s,
        rate_hz=1e6 * rate,
        tags=tags,
        ways=tuple(Way(name, float(cpu), float(mb)) for name, cpu, mb in rows),
    )


def render(results: str) -> str:
    """Write the estimate's tables and text as Markdown."""
    found = measured(results)
    return "\n\n".join([BEGIN, _measured_table(found), _sum_table(found), _so(found), END])


def _measured_table(found: Measured) -> str:
    one = found.ways[0]
    lines = [
        f"The table gives the CPU time on {found.machine} to search {found.signal_s:.0f} s of "
        f"recordings ({found.rate_hz / 1e6:.0f} MS/s, 16-bit integers) for {found.tags} tags. "
        "The files were in memory before the run (`python -m benchmarks archive`):",
        "",
        f"| | CPU for {found.signal_s:.0f} s | CPU of one process over that of all | most "
        "memory of a worker (PSS) |",
        "|---|---|---|---|",
    ]
    for way in found.ways:
        name = f"{way.name}, which writes too" if way is one else way.name
        share = "" if way is one else f"{100 * one.cpu_s / way.cpu_s:.0f} %"
        lines.append(f"| {name} | {way.cpu_s} s | {share} | {way.worker_mb:.0f} MB |")
    hour_bytes = found.bytes_a_second * HOUR_S
    lines += [
        "",
        f"An hour of recording ({hour_bytes / GB:.0f} GB) takes {found.hour_cpu_s:.0f} s of "
        f"one core. A core processes {found.core_bytes_a_second / GB:.2f} GB/s, "
        f"{HOUR_S / found.hour_cpu_s:.0f} times real time. A search for more tags takes little "
        "longer.",
    ]
    return "\n".join(lines)


def _sum_table(found: Measured) -> str:
    hours = ARCHIVE_BYTES / found.bytes_a_second / HOUR_S
    more, cores = 1.0 + LEAD_IN_S / HOUR_S, MACHINES * CORES
    read_bytes, core_hours = ARCHIVE_BYTES * more, hours * more * found.hour_cpu_s / HOUR_S
    pulses = found.tags * hours * HOUR_S / INTERVAL_S
    lead_in, written = f"{100 * (more - 1.0):.0f} %", f"{WRITING_S * pulses / 60:.0f} min"
    return "\n".join(
        [
            f"The next table gives the time to search **100 TB on {MACHINES} machines**, "
            "computed from the measured CPU times (`python -m uavrt_experiments.archive_sum`):",
            "",
            f"| | whole archive | {MACHINES} machines of {CORES} cores |",
            "|---|---|---|",
            f"| recordings | {hours:.0f} h | {hours * more:.0f} h with the lead-in of cells, "
            f"{hours * more / cores:.1f} for each core |",
            f"| detection, {found.hour_cpu_s:.0f} CPU s an hour and {lead_in} of lead-in | "
            f"{core_hours:.0f} core-hours | {60 * core_hours / cores:.0f} min; "
            f"{CORES * found.core_bytes_a_second / GB:.1f} GB/s for each machine |",
            f"| reading from a disk in each machine, {DISK / GB:g} GB/s | | "
            f"**{read_bytes / MACHINES / DISK / 60:.0f} min** |",
            "| reading over 10 Gbit/s for each machine, if the store gives "
            f"{MACHINES * LINE / GB:.1f} GB/s | | "
            f"{read_bytes / MACHINES / LINE / 60:.0f} min |",
            f"| reading from one store of {STORE / GB:g} GB/s | "
            f"**{read_bytes / STORE / HOUR_S:.1f} h** | the same |",
            f"| writing {pulses / 1e6:.0f} million pulses, {1e6 * WRITING_S:.0f} µs each, one "
            f"process | {written} | {written}, in parallel |",
            f"| Dask's scheduler, about {1e3 * TASK_S:.0f} ms a task | {TASK_S * hours:.0f} s "
            "| |",
        ]
    )


def _so(found: Measured) -> str:
    more, hour_s = LEAD_IN_S / HOUR_S, found.hour_cpu_s
    by_disk_s = ARCHIVE_BYTES * (1.0 + more) / MACHINES / DISK
    short_s = hour_s * (SHORT_CELL_S + LEAD_IN_S) / HOUR_S
    return (
        "The speed of a search is limited by reading, so buy faster disks or networks, not "
        "more processors. The disk of a machine reads as fast as "
        f"{DISK / found.core_bytes_a_second:.1f} cores can search; further cores wait. A store "
        "that all machines share is slower still.\n\n"
        f"With twice as many machines and disks, the search takes {by_disk_s / 120:.0f} min. "
        "The speed is then limited by the single process that writes the results "
        f"({round(1.0 / WRITING_S, -4):.0f} pulses a second).\n\n"
        "At the end, some cores may wait while others finish their last cell, for up to "
        f"{hour_s * (1.0 + more):.0f} s. `--cell {SHORT_CELL_S:.0f}` shortens this to "
        f"{short_s:.0f} s, but {100 * LEAD_IN_S / SHORT_CELL_S:.0f} % of the samples are then "
        f"read twice as lead-in, instead of {100 * more:.0f} %."
    )


def in_page(page: str, text: str) -> str:
    """Replace the text between the page's two marks."""
    before, _, rest = page.partition(BEGIN)
    return f"{before}{text}{rest.partition(END)[2]}"


def main() -> None:
    """Write the estimate into the manual's page."""
    page = PAGE.read_text(encoding="utf-8")
    text = render(RESULTS.read_text(encoding="utf-8"))
    PAGE.write_text(in_page(page, text), encoding="utf-8")
    sys.stdout.write(f"Written: {PAGE.relative_to(_ROOT)}\n")


if __name__ == "__main__":
    main()
