"""Ctrl-C to a program, and the processor time that its end takes."""

import os
import resource
import signal
import subprocess
from contextlib import suppress
from pathlib import Path

TRIAL_TIMEOUT_S = 90.0


def interrupted(program: "subprocess.Popen[str]") -> tuple[str, str, float]:
    """Send Ctrl-C to a program and its process group as a terminal does.

    Returns what it printed, and its processor time from then to its end [s]: a busy computer
    makes an end late, and no dearer.
    """
    spent_s, others_s = _spent_s(program.pid), _ended_s()
    os.killpg(program.pid, signal.SIGINT)
    said, fault = program.communicate(timeout=TRIAL_TIMEOUT_S)
    return said or "", fault or "", _ended_s() - others_s - spent_s


def _spent_s(group: int) -> float:
    """Processor time of a process group, with its children that have ended [s]."""
    ticks = 0
    for place in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = place.read_text().rpartition(")")[2].split()
            if int(fields[2]) == group:
                ticks += sum(map(int, fields[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")


def _ended_s() -> float:
    """Processor time of this process's children that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
