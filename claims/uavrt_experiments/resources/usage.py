"""CPU time, memory and disk writes of a process, at the resolution of ``/proc``."""

import math
import os
import re
from pathlib import Path

from uavrt.drone.supervisor.start.usage import read_proc


def own_cpu_s(pid: int) -> float:
    """Get a process's CPU time to the scheduler's nanosecond [s]; 0 if it is gone."""
    total_ns = 0
    for task in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        try:
            total_ns += int(task.read_text().split()[0])
        except (OSError, IndexError):
            continue
    return total_ns * 1e-9


def written_mb(pid: int) -> float:
    """Disk writes of a process since its start [MB]; 0 if it is gone.

    Counted are whole pages that the process changed, again after each write-back
    (``write_bytes`` of proc(5), less those truncated before); NaN where the kernel does not
    count it.
    """
    try:
        lines = read_proc(f"/proc/{pid}/io").split("\n")
    except OSError:
        return math.nan if not os.path.exists("/proc/self/io") else 0.0
    counts = {
        name: int(count) for name, _, count in (line.partition(": ") for line in lines[:7])
    }
    return (counts["write_bytes"] - counts["cancelled_write_bytes"]) / 1e6


def pss_mb(pid: int) -> float:
    """Get the proportional set size [MB]: a page shared by n processes counts 1/n in each.

    The sum over processes is the memory they take together. 0 when the process has gone.
    """
    try:
        rollup = read_proc(f"/proc/{pid}/smaps_rollup")
    except OSError:
        return 0.0
    found = re.search(r"^Pss:\s+(\d+) kB", rollup, re.MULTILINE)
    return int(found.group(1)) * 1024 / 1e6 if found else 0.0


def is_alive(pid: int) -> bool:
    """True if a process runs; False for a zombie."""
    try:
        return read_proc(f"/proc/{pid}/stat").rpartition(") ")[2][:1] not in ("Z", "")
    except OSError:
        return False
