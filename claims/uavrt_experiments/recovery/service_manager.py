"""Stand-in for systemd: keeps one ``Type=notify`` service running.

``python -m uavrt_experiments.recovery.service_manager [OPTIONS] -- COMMAND …``, with
``--watchdog-s S`` and ``--restart-s S`` as options.

It gives the command a ``NOTIFY_SOCKET`` and a watchdog time as systemd does (sd_notify(3),
sd_watchdog_enabled(3)). It starts the command again unless it ended by ``exit 0``
(``Restart=on-failure``), and kills it when it stops resetting the watchdog
(``WatchdogSignal=SIGKILL``). It reports events as JSON lines. Unlike systemd it does not kill
processes that the service leaves behind.
"""

import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

STOP_TIMEOUT_S = 15.0


class ServiceManager:
    """Runs a command until it exits with 0 or is stopped.

    `command`: program and arguments.
    `socket_path`: path of the notification socket.
    `watchdog_s`: longest time between two messages of the service once it is ready [s].
    `restart_s`: wait before a restart [s].
    """

    def __init__(
        self, command: Sequence[str], socket_path: Path, *, watchdog_s: float, restart_s: float
    ) -> None:
        self._command = list(command)
        self._path = socket_path
        self._watchdog_s, self._restart_s = watchdog_s, restart_s
        self._sock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._sock.bind(str(socket_path))
        self._stopping = False

    def stop(self) -> None:
        """Stop the service and end; safe in a signal handler."""
        self._stopping = True

    def run(self) -> int:
        """Keep the service running until it exits with 0 or is stopped; returns 0."""
        while True:
            code = self._one_life()
            _say("ended", exit_code=code)
            if self._stopping or code == 0:
                return 0
            time.sleep(self._restart_s)

    def _one_life(self) -> int:
        environment = os.environ | {
            "NOTIFY_SOCKET": str(self._path),
            "WATCHDOG_USEC": str(round(self._watchdog_s * 1e6)),
        }
        environment.pop("WATCHDOG_PID", None)
        service = subprocess.Popen(
            self._command, env=environment, stdin=subprocess.DEVNULL, process_group=0
        )
        _say("started", pid=service.pid)
        ready, heard_s, asked_s = False, time.monotonic(), None
        while (code := service.poll()) is None:
            states = self._receive(0.05)
            if "READY=1" in states and not ready:
                ready = True
                _say("ready", pid=service.pid)
            if states:
                heard_s = time.monotonic()
            if ready and time.monotonic() - heard_s > self._watchdog_s and asked_s is None:
                _say("watchdog", pid=service.pid)
                service.kill()
                heard_s = time.monotonic()
            if self._stopping and asked_s is None:
                asked_s = time.monotonic()
                service.terminate()
            if asked_s is not None and time.monotonic() - asked_s > STOP_TIMEOUT_S:
                service.kill()
        return code

    def _receive(self, timeout_s: float) -> set[str]:
        self._sock.settimeout(timeout_s)
        try:
            return set(self._sock.recv(4096).decode("utf-8", "replace").split("\n"))
        except TimeoutError:
            return set()


def _say(event: str, **facts: object) -> None:
    sys.stdout.write(json.dumps({"event": event, **facts}) + "\n")
    sys.stdout.flush()


def main(arguments: Sequence[str]) -> int:
    """Run the stand-in for systemd from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--watchdog-s", type=float, default=10.0)
    parser.add_argument("--restart-s", type=float, default=0.5)
    parser.add_argument("command", nargs="+")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="uavrt-service-") as directory:
        manager = ServiceManager(
            given.command,
            Path(directory) / "notify",
            watchdog_s=given.watchdog_s,
            restart_s=given.restart_s,
        )

        def end(_number: int, _frame: FrameType | None) -> None:
            manager.stop()

        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, end)
        return manager.run()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
