"""The whole chain in one process: `uavrt detect -`, fed through a pipe at the real-time rate.

Samples are 3 MS/s complex float32, written in 87 ms blocks by another process that is not
counted; a quarter of the tags beep. CPU time is that of the `uavrt` process from the sixth
second on: interpreter start, imports and filter design are not part of a flight.

A core that sleeps between two blocks wakes slow and with empty caches; a virtual one may have
been somebody else's meanwhile. Each case is therefore run twice: as it is, and with a process
of the scheduling class "idle" on the same core, which takes nothing from the work but never
lets the core sleep.
"""

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.harness import Table

RATE_HZ = 3_000_000
CENTER_HZ = 148.7e6
BLOCK = 262_144
START_S = 5.0
MEASURE_S = 20.0
NARROW_HZ, WIDE_HZ = 120e3, 1.3e6
CASES = (
    (1, NARROW_HZ, 3.5),
    (10, NARROW_HZ, 4.0),
    (50, NARROW_HZ, 6.0),
    (100, NARROW_HZ, 9.0),
    (200, NARROW_HZ, None),
    (400, NARROW_HZ, None),
    (100, WIDE_HZ, 12.0),
)
"""Tags, half of the band that they lie in, and the most that their detection may cost
[per cent of a core]."""
MEMORY_MB = 150.0
WIDTH_S, INTERVAL_S = 0.020, 1.254


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What a run took."""

    cpu_percent: float
    peak_mb: float
    pulses: int


def run() -> list[Table]:
    """All tables of this section."""
    rows = []
    for tags, reach_hz, most in CASES:
        costs = [paced(tags, reach_hz, awake=False), paced(tags, reach_hz, awake=True)]
        peak_mb = max(cost.peak_mb for cost in costs)
        bar = ""
        if most is not None:
            bars = [cost.cpu_percent <= most for cost in costs]
            verdict = ", ".join("met" if met else "NOT met" for met in bars)
            memory = "met" if peak_mb <= MEMORY_MB else "NOT met"
            bar = f"≤ {most:g} %: {verdict}; ≤ {MEMORY_MB:g} MB: {memory}"
        rows.append(
            [
                f"{tags} over ± {reach_hz / 1e3:g} kHz",
                *(f"{cost.cpu_percent:.2f}" for cost in costs),
                f"{peak_mb:.0f}",
                str(costs[0].pulses),
                bar,
            ]
        )
    header = [
        "tags",
        "CPU %, core idle between blocks",
        "CPU %, core kept awake",
        "peak MB",
        "pulses found",
        "bar (idle, awake)",
    ]
    notes = [
        f"`uavrt detect -`, one process, {MEASURE_S:g} s of 3 MS/s cf32 through a pipe, paced "
        "in 87 ms blocks; the writer is not counted. The work is the same in both columns: "
        "what the first has more is the waking of a sleeping (here virtual) core, with cold "
        "caches, and is counted as the process's own time. In the second a process of "
        "scheduling class SCHED_IDLE on the same core keeps it from sleeping."
    ]
    return [
        Table(
            title="Whole chain, paced at the real-time rate",
            header=header,
            rows=rows,
            notes=notes,
        ),
        flat(10),
    ]


def flat(tags: int) -> Table:
    """How fast a file is worked through."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "tags.txt").write_text(tag_lines(tags))
        seconds = 30
        with (folder / "rec.cf32").open("wb") as file:
            made = Signal(tags)
            for number in range(seconds * RATE_HZ // BLOCK):
                file.write(made.block(number))
        started = time.monotonic()
        before = os.times()
        subprocess.run(
            [*command(folder, str(folder / "rec.cf32")), "-o", str(folder / "p.csv")],
            check=True,
            stderr=subprocess.DEVNULL,
        )
        elapsed = time.monotonic() - started
        after = os.times()
        cpu = after.children_user + after.children_system
        cpu -= before.children_user + before.children_system
    speed = seconds / cpu
    return Table(
        title=f"A recording of {seconds} s with {tags} tags, start-up included",
        header=["", "elapsed s", "CPU s", "× real time on one core", "bar"],
        rows=[
            [
                "uavrt detect rec.cf32",
                f"{elapsed:.2f}",
                f"{cpu:.2f}",
                f"{speed:.0f}",
                f"≥ 15: {'met' if speed >= 15 else 'NOT met'}",
            ]
        ],
    )


@contextlib.contextmanager
def one_core(child: int, *, awake: bool) -> Iterator[None]:
    """Keep a process on the last core and this one off it; maybe never let it sleep."""
    cores = os.sched_getaffinity(0)
    core = max(cores)
    os.sched_setaffinity(child, {core})
    os.sched_setaffinity(0, cores - {core} or cores)
    spinner = None
    if awake:
        spin = (
            "import os\n"
            f"os.sched_setaffinity(0, {{{core}}})\n"
            "os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))\n"
            "while os.getppid() != 1: pass"
        )
        spinner = subprocess.Popen([sys.executable, "-c", spin])
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)
        if spinner is not None:
            spinner.kill()
            spinner.wait()


def paced(tags: int, reach_hz: float = NARROW_HZ, *, awake: bool = False) -> Cost:
    """Run `uavrt detect -` on a stream in real time, with its core kept `awake` or not."""
    with tempfile.TemporaryDirectory() as scratch, contextlib.ExitStack() as stack:
        folder = Path(scratch)
        (folder / "tags.txt").write_text(tag_lines(tags, reach_hz))
        made = Signal(tags, reach_hz)
        child = subprocess.Popen(
            [*command(folder, "-"), "-o", str(folder / "p.csv")],
            stdin=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=0,
        )
        started_cpu = 0.0
        stack.enter_context(one_core(child.pid, awake=awake))
        assert child.stdin is not None
        os.set_blocking(child.stdin.fileno(), True)
        began = time.monotonic()
        first = round(START_S * RATE_HZ / BLOCK)
        last = round((START_S + MEASURE_S) * RATE_HZ / BLOCK)
        for number in range(last):
            view = made.block(number)
            wait = began + (number + 1) * BLOCK / RATE_HZ - time.monotonic()
            if wait > 0:
                time.sleep(wait)
            while view:
                view = view[os.write(child.stdin.fileno(), view) :]
            if number + 1 == first:
                started_cpu = cpu_s(child.pid)
        # By the signal's time: on a machine too busy for it the clock's is longer.
        spent = cpu_s(child.pid) - started_cpu
        signal_s = (last - first) * BLOCK / RATE_HZ
        peak_mb = peak_memory_mb(child.pid)
        child.stdin.close()
        if child.wait(60) != 0:
            raise RuntimeError("uavrt detect failed")
        pulses = len((folder / "p.csv").read_text().splitlines()) - 1
    return Cost(cpu_percent=100.0 * spent / signal_s, peak_mb=peak_mb, pulses=pulses)


def command(folder: Path, recording: str) -> list[str]:
    return [
        *(sys.executable, "-m", "uavrt.cli", "detect", recording),
        *("--tags", str(folder / "tags.txt"), "--format", "cf32"),
        *("--sample-rate", str(RATE_HZ), "--center-frequency", str(CENTER_HZ)),
    ]


def frequency_hz(tag: int, tags: int, reach_hz: float) -> float:
    """Spread in equal steps, so at any place in the channels; never at the centre."""
    places = max(tags, 100) + 1
    return float(
        round(CENTER_HZ - reach_hz + (tag * 37 % places + 0.37) * 2.0 * reach_hz / places)
    )


def tag_lines(tags: int, reach_hz: float = NARROW_HZ) -> str:
    return "".join(
        f"{2 * tag}, {frequency_hz(tag, tags, reach_hz):.0f}, 1254, 20, 60, 10, 3, 0.01\n"
        for tag in range(1, tags + 1)
    )


class Signal:
    """Noise, fresh for each block (repeated, it would beep), and every fourth tag's pulses."""

    def __init__(self, tags: int, reach_hz: float = NARROW_HZ) -> None:
        self._random = np.random.default_rng(7)
        time_s = np.arange(round(WIDTH_S * RATE_HZ)) / RATE_HZ
        # 20 dB: amplitude² × width × rate = 100 × variance (2 × 0.01² for both parts).
        amplitude = np.sqrt(100 * 2e-4 / (WIDTH_S * RATE_HZ))
        self._pulses = []
        for tag in range(1, tags + 1, 4):
            turn = 2j * np.pi * (frequency_hz(tag, tags, reach_hz) - CENTER_HZ) * time_s
            pulse = (amplitude * np.exp(turn)).astype(np.complex64)
            self._pulses.append(((tag * 345_678) % round(INTERVAL_S * RATE_HZ), pulse))

    def block(self, number: int) -> memoryview:
        """Samples of one block."""
        noise = self._random.standard_normal((BLOCK, 2), np.float32)
        samples = noise.view(np.complex64)[:, 0] * np.float32(0.01)
        start, interval = number * BLOCK, round(INTERVAL_S * RATE_HZ)
        for phase, pulse in self._pulses:
            before = (start - phase) // interval
            for beep in (before, before + 1):
                offset = beep * interval + phase - start
                first, last = max(offset, 0), min(offset + len(pulse), BLOCK)
                if first < last:
                    samples[first:last] += pulse[first - offset : last - offset]
        return samples.view(np.uint8).data


def cpu_s(pid: int) -> float:
    """CPU time of a process so far, to the scheduler's nanosecond."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) * 1e-9


def peak_memory_mb(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024.0
