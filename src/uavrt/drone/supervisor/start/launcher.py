"""Start processes: by the fork server (`nursery`) if it is ready, otherwise by exec.

This module has few imports. The supervisor starts the fork server before it imports the rest,
so that both import at the same time.
"""

import json
import os
import select
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence

from uavrt.core.clock import monotonic_s
from uavrt.core.log import get_logger
from uavrt.core.runtime.blas import blas_environment
from uavrt.drone.ipc.parent import adopts_orphans
from uavrt.drone.supervisor.start.nursery import NURSERY_VARIABLE
from uavrt.drone.supervisor.start.restarts import Restarts
from uavrt.drone.supervisor.start.usage import children_of

log = get_logger()

ANSWER_S = 1.0
"""Longest wait for the fork server's answer to a request [s]; a fork takes 5 ms."""
PING_S = 2.0
SILENCE_S = 3.0
"""Silence after which the fork server is killed [s]; it is checked every `PING_S`."""
IMPORT_S = 20.0
"""Longest silence of the importing fork server [s]; imports take 0.6 s of CPU."""
FIRST_WAIT_S = 10.0
"""Longest wait for the fork server's imports [s]; then processes start without it."""
ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}
"""Environment variables that limit BLAS to one thread; more would compete for few cores."""


class Launcher:
    """Starts processes: through the fork server (`nursery`) if it is ready, else by exec."""

    def __init__(self) -> None:
        self._environment = blas_environment() | ENVIRONMENT
        self._process: subprocess.Popen[bytes] | None = None
        self._sock: socket.socket | None = None
        self._ready = False
        self._ever_ready = False
        self._born_s = monotonic_s()
        self._heard_s = 0.0
        self._asked_s: float | None = None
        """Time of the fork server's unanswered life check [s, monotonic]; None without one."""
        self._fault = ""
        self._restarts = Restarts()

    # ------------------------------------------------------------------ nursery

    @property
    def pid(self) -> int | None:
        """Process id of the fork server; None if it does not run."""
        return self._process.pid if self._process is not None else None

    @property
    def restarts(self) -> int:
        """Number of times the fork server was restarted."""
        return self._restarts.total

    @property
    def importing(self) -> bool:
        """True while the first processes should wait for the fork server's imports."""
        return (
            self._process is not None
            and not self._ever_ready
            and monotonic_s() - self._born_s < FIRST_WAIT_S
        )

    def fileno(self) -> int | None:
        """Return a descriptor readable once the fork server answers or ends; None if it does
        not run.
        """
        return self._sock.fileno() if self._sock is not None else None

    def warm_up(self) -> None:
        """Start the fork server; it then imports its modules."""
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            environment = {NURSERY_VARIABLE: str(theirs.fileno())}
            try:
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "uavrt.drone.supervisor.start.nursery"],
                    stdin=subprocess.DEVNULL,
                    pass_fds=(theirs.fileno(),),
                    env=os.environ | self._environment | environment,
                    process_group=0,
                )
            except OSError as error:
                ours.close()
                self._restarts.ended(monotonic_s(), str(error.strerror))
                return
        self._sock = ours
        self._asked_s = monotonic_s()
        self._restarts.started(self._asked_s)

    def tend(self) -> str | None:
        """Check the fork server, restart it when due; return why it ended, or None."""
        now_s = monotonic_s()
        if self._process is None:
            if now_s >= self._restarts.not_before_s:
                self.warm_up()
            return None
        self._listen(now_s)
        code = self._process.poll()
        if code is None:
            return None
        reason = self._fault or (
            f"ended (exit {code})" if code >= 0 else f"was killed (signal {-code})"
        )
        self._forget()
        self._restarts.ended(now_s, reason)
        return reason

    def _listen(self, now_s: float) -> None:
        while self._sock is not None and self._readable(0.0):
            if self._receive() is None:
                return
            self._heard_s, self._asked_s = now_s, None
            self._ready = self._ever_ready = True
        if self._asked_s is not None:
            if now_s - self._asked_s > (SILENCE_S if self._ready else IMPORT_S):
                self._give_up("fell silent")
        elif now_s - self._heard_s > PING_S:
            self._asked_s = now_s
            self._send(b"{}", [])

    def close(self) -> None:
        """End the fork server; processes forked from it keep running."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._forget()

    def _forget(self) -> None:
        if self._sock is not None:
            self._sock.close()
        self._process = self._sock = None
        self._ready = False
        self._fault = ""

    # ------------------------------------------------------------------ starting

    def start(
        self,
        module: str,
        *,
        name: str,
        output: int,
        fds: Sequence[int],
        environment: Mapping[str, str],
        arguments: Sequence[str] = (),
    ) -> int:
        """Start ``python -m MODULE`` in its own process group; return the process id.

        The caller must reap the process.
        """
        environment = {**self._environment, **environment}
        pid = self._fork(module, name, output, fds, environment, arguments)
        if pid is not None:
            return pid
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", module, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            pass_fds=tuple(fds),
            env=os.environ | environment,
            process_group=0,
        )
        process.returncode = 0  # the caller waits for it, not subprocess
        return process.pid

    # ------------------------------------------------------- what was started

    def watch(self, pid: int) -> int:
        """Return a descriptor readable once the process ends; raises `OSError` if that is
        impossible.
        """
        return os.pidfd_open(pid)

    def signal(self, pid: int, number: int) -> None:
        """Send a signal to a process group; raises `ProcessLookupError` if it is gone."""
        os.killpg(pid, number)

    def reap(self, pid: int) -> tuple[int, float]:
        """Collect an ended process; return its exit code and its CPU time [s]."""
        _, status, usage = os.wait4(pid, 0)
        return os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime

    def children(self) -> tuple[int, ...]:
        """Return the process ids of this program's living children."""
        return children_of(os.getpid())

    def _fork(
        self,
        module: str,
        name: str,
        output: int,
        fds: Sequence[int],
        environment: Mapping[str, str],
        arguments: Sequence[str],
    ) -> int | None:
        # A process forked twice becomes our child only if we adopt orphans.
        if not self._ready or self._sock is None or not adopts_orphans():
            return None
        request = {
            "module": module,
            "name": name,
            "arguments": list(arguments),
            "environment": dict(environment),
            "parent": os.getpid(),
            "places": [1, *fds],
        }
        # The forked process waits for this pipe: an answer that comes too late must not
        # leave a second process with the same sockets.
        go, give = os.pipe()
        try:
            if not self._send(json.dumps(request).encode(), [output, *fds, go]):
                return None
            answer = self._answer()
            if answer is None:
                if self._ready:
                    self._give_up("did not answer")
                return None
            if "pid" not in answer:
                log.warning("cannot fork a process", reason=answer["error"])
                return None
            os.write(give, b"!")
        finally:
            os.close(go)
            os.close(give)
        return int(answer["pid"])

    def _answer(self) -> dict[str, int | str] | None:
        """Wait for the fork server's answer; None if none arrives within `ANSWER_S`."""
        deadline_s = monotonic_s() + ANSWER_S
        answer: dict[str, int | str] | None = {}
        while answer == {} and self._readable(max(0.0, deadline_s - monotonic_s())):
            answer = self._receive()
        return answer or None

    def _give_up(self, fault: str) -> None:
        """Kill the fork server because of a fault; `tend` will restart it."""
        log.warning("fork server killed; it restarts", reason=fault)
        self._ready = False
        self._fault = fault
        if self._process is not None:
            self._process.kill()

    def _send(self, data: bytes, fds: Sequence[int]) -> bool:
        assert self._sock is not None
        try:
            socket.send_fds(self._sock, [data], fds, socket.MSG_DONTWAIT)
        except BlockingIOError:  # a stopped one: it will be found silent
            return True
        except OSError:
            self._ready = False
            return False
        return True

    def _readable(self, timeout_s: float) -> bool:
        assert self._sock is not None
        return bool(select.select([self._sock], [], [], timeout_s)[0])

    def _receive(self) -> dict[str, int | str] | None:
        assert self._sock is not None
        try:
            data = self._sock.recv(4096)
        except OSError:
            data = b""
        if not data:
            self._ready = False
            return None
        answer: dict[str, int | str] = json.loads(data)
        return answer
