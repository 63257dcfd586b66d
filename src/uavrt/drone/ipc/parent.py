"""End a child process when its parent ends, for whatever reason (Linux only)."""

import ctypes
import os
import signal
import sys

PARENT_VARIABLE = "UAVRT_PARENT_PID"
"""Environment variable with the process id of the supervisor that started this process."""
_PR_SET_PDEATHSIG = 1
"""prctl(2) option: signal to receive when the parent thread ends."""
_PR_SET_CHILD_SUBREAPER = 36
"""prctl(2) option: adopt descendants that lose their parent."""
_PR_GET_CHILD_SUBREAPER = 37


def adopt_orphans() -> None:
    """Become the parent of descendants whose parent has ended, so they can be ended too."""
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def adopts_orphans() -> bool:
    """True if `adopt_orphans` has an effect; it has none when another processor is emulated."""
    adopts = ctypes.c_int(0)
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(_PR_GET_CHILD_SUBREAPER, ctypes.byref(adopts), 0, 0, 0)
    return bool(adopts.value)


def die_with_parent(number: signal.Signals = signal.SIGKILL) -> None:
    """End this process when its parent ends, even by SIGKILL, even while stopped.

    With SIGTERM as `number` the process has time to finish, but while stopped it outlives the
    parent until continued, as by systemd.
    """
    if not sys.platform.startswith("linux"):
        return
    parent = int(os.environ.get(PARENT_VARIABLE) or os.getppid())
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, number, 0, 0, 0)
    if os.getppid() != parent or parent == 1:
        os.kill(os.getpid(), signal.SIGKILL)
