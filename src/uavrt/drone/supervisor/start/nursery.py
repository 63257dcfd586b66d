"""The fork server (nursery): imports all modules once; other processes are forked from it.

``python -m uavrt.drone.supervisor.start.nursery``, started by
`uavrt.drone.supervisor.start.launcher`. Imports cost each process 0.1 to 0.4 s of CPU and 13 to
40 MB. Here they are done once, and the forked processes share the memory pages.

A process is forked twice, so that it becomes the supervisor's own child (the supervisor adopts
orphans) and outlives the nursery.

A request is one datagram: JSON with file descriptors (``SCM_RIGHTS``). The answer is the
process id. An empty datagram is a life check, answered by an empty one. The first datagram is
empty too, and reports that the imports are done.
"""

import ctypes
import fcntl
import gc
import importlib
import json
import os
import random
import signal
import socket
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

NURSERY_VARIABLE = "UAVRT_NURSERY_FD"
"""Name of the environment variable with the file descriptor of the fork server's socket."""
MODULES = (
    "uavrt.drone.processes.receiver",
    "uavrt.drone.processes.detector",
    "uavrt.drone.processes.connection",
    "uavrt.drone.processes.recorder",
)
"""Modules that the fork server imports before its first fork: processes that every drone
runs."""
MAX_REQUEST_BYTES = 65_536
MAX_FDS = 200
FIRST_FREE_FD = 500
"""Lowest number for a temporary copy of a file descriptor; requested numbers are smaller."""
_PR_SET_NAME = 15
"""Option number of prctl(2) that sets the process name shown by ``top``."""


@dataclass(frozen=True, slots=True)
class ForkedProcess:
    """What a newly forked process needs to set up its environment."""

    request: dict[str, Any]
    """Request of `Launcher`: module, name, arguments, environment, parent, descriptors."""
    fds: list[int]
    """Received file descriptors: one per requested number, then one to confirm the fork."""
    parent_id: int
    """Process id of the intermediate process between the fork server and this one."""


def serve(sock: socket.socket) -> ForkedProcess | None:
    """Fork a process for each request.

    Returns its data in the new process, and None in the fork server when the supervisor has
    ended.
    """
    while True:
        data, fds, _, _ = socket.recv_fds(sock, MAX_REQUEST_BYTES, MAX_FDS)
        if not data:
            return None
        request = json.loads(data)
        if not request:
            sock.send(data)
            continue
        try:
            process = fork_twice(request, fds)
        except OSError as error:
            answer: dict[str, object] = {"error": str(error.strerror)}
        else:
            if isinstance(process, ForkedProcess):
                return process
            answer = {"pid": process}
        for fd in fds:
            os.close(fd)
        sock.send(json.dumps(answer).encode())


def fork_twice(request: dict[str, Any], fds: list[int]) -> ForkedProcess | int:
    """Fork a process that becomes a child of the supervisor.

    Returns its process id here, and its data in the new process.
    """
    reader, writer = os.pipe()
    try:
        parent_id = os.fork()
    except OSError:
        os.close(reader)
        os.close(writer)
        raise
    if parent_id == 0:
        own_id = os.getpid()
        code = 1
        try:
            child = os.fork()
            if child == 0:
                os.close(reader)
                os.close(writer)
                return ForkedProcess(request, fds, own_id)
            # Before the supervisor has its id, since it may kill the group at once.
            os.setpgid(child, child)
            os.write(writer, str(child).encode())
            code = 0
        finally:
            if os.getpid() == own_id:
                os._exit(code)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        text = pipe.read()
    os.waitpid(parent_id, 0)
    if not text:
        raise OSError(0, "the process could not be forked")
    return int(text)


def set_up(process: ForkedProcess) -> None:
    """Give a forked process the environment, file descriptors and name that exec would."""
    request = process.request
    # The kernel will end us with our parent (below), so wait for the right one.
    while (parent := os.getppid()) == process.parent_id:
        time.sleep(0.0005)
    if parent != request["parent"]:
        os._exit(1)
    *fds, go = process.fds
    if not os.read(go, 1):
        os._exit(1)  # the supervisor has not waited for us
    os.close(go)
    place_descriptors(fds, request["places"])
    os.environ.update(request["environment"])
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    random.seed()
    sys.argv = [request["module"], *request["arguments"]]
    set_process_name(request["name"], request["module"])


def place_descriptors(fds: list[int], places: list[int]) -> None:
    """Move file descriptors to the requested numbers; stderr becomes a copy of stdout."""
    raised = [fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, FIRST_FREE_FD) for fd in fds]
    for fd in fds:
        os.close(fd)
    for fd, place in zip(raised, places, strict=True):
        os.dup2(fd, place, inheritable=place <= 2)
        if place == 1:
            os.dup2(fd, 2)
        os.close(fd)


def set_process_name(name: str, module: str) -> None:
    """Change the process name in ``top`` and the command line in ``ps``, see proc(5).

    The arguments are in the process's own memory (arg_start and arg_end of proc(5)); Python has
    copied them.
    """
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_NAME, name.encode()[:15], 0, 0, 0)
    with suppress(OSError, ValueError, IndexError):
        with open("/proc/self/stat", encoding="utf-8", errors="replace") as file:
            fields = file.read().rpartition(") ")[2].split()
        start, end = int(fields[45]), int(fields[46])
        title = f"{sys.executable}\0-P\0-m\0{module}\0".encode()
        if 0 < start < end:
            ctypes.memmove(start, title.ljust(end - start, b"\0"), end - start)


def main() -> None:
    """Import the modules, then fork on request. In a forked process, run its ``main``."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sock = socket.socket(fileno=int(os.environ.pop(NURSERY_VARIABLE)))
    from uavrt.core.runtime.heap import fill_pools
    from uavrt.drone.ipc.parent import die_with_parent

    die_with_parent()
    for module in MODULES:
        with suppress(Exception):  # the process itself will say what is wrong
            importlib.import_module(module)
    gc.collect()
    filling = fill_pools()
    gc.freeze()
    sock.send(b"{}")
    process = serve(sock)
    sock.close()
    if process is not None:
        set_up(process)
        importlib.import_module(process.request["module"]).main()
    del filling  # until now: what it fills must not become free


if __name__ == "__main__":
    main()
