"""Programs of the demo: simulated autopilot, real drone software, real ground station.

Each runs in its own process, as in the field; only radio, autopilot and world are simulated.
"""

import json
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from itertools import cycle, islice
from pathlib import Path
from types import MappingProxyType
from typing import Any

from uavrt.config.settings import (
    AntennaSettings,
    MavlinkSettings,
    RadioSettings,
    RecordingSettings,
    Settings,
)
from uavrt.core.errors import LinkError, UavrtError
from uavrt.core.runtime.blas import blas_environment
from uavrt.drone.ipc.record_link import LineBuffer
from uavrt.simulation.scene.scenario import Scenario

STOP_TIMEOUT_S = 15.0
PORTS = range(61_000, 65_400)
"""UDP ports from which free ones are chosen; Linux never assigns them
(``ip_local_port_range``)."""
_ports = cycle(random.SystemRandom().sample(PORTS, len(PORTS)))
_END_WITH_US = ("setpriv", "--pdeathsig", "TERM", "--") if shutil.which("setpriv") else ()
"""Command prefix that makes the kernel end a program of the demo when the demo's process
ends."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoPaths:
    """Files and sockets of one demo run."""

    directory: Path
    """Working directory for scenario, tags, logs and the ground station's flight."""
    flights: Path
    """Parent directory of the drone's flight."""

    def below(self, name: str) -> "DemoPaths":
        """Paths for one of several drones, in subdirectories; the directories are created."""
        own = DemoPaths(directory=self.directory / name, flights=self.flights / name)
        own.directory.mkdir()
        own.flights.mkdir(parents=True, exist_ok=True)
        return own

    @property
    def scenario(self) -> Path:
        """Scenario file of the simulated radio and autopilot."""
        return self.directory / "scenario.toml"

    @property
    def tags(self) -> Path:
        """File with the operator's tag list."""
        return self.directory / "tags.toml"

    @property
    def status_socket(self) -> Path:
        """UNIX socket on which the supervisor publishes its records."""
        return self.directory / "status.sock"

    @property
    def flown(self) -> Path:
        """File with the true path of a drone that obeys commands."""
        return self.directory / "flown.path"


def free_udp_port(host: str = "127.0.0.1") -> int:
    """Get an unused UDP port from `PORTS`; each call returns another port.

    The kernel is not asked for a port, because it could give the port to another program before
    it is used.
    """
    for port in islice(_ports, len(PORTS)):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            try:
                sock.bind((host, port))
            except OSError:
                continue
            return port
    raise LinkError(
        f"no UDP port of {host} from {PORTS[0]} to {PORTS[-1]} is free",
        remedy="Stop other programs that use UDP ports, or try again",
    )


def free_ros_domain() -> int:
    """Get an unused ROS domain below 102 for the demo.

    Domain 0 and the domain in this computer's environment are excluded, because a real drone in
    the lab uses one of them. The ports of domains up to 101 lie below those that Linux assigns
    by itself (32768).
    """
    domains = random.sample(range(1, 102), 101)
    for domain in domains:
        if str(domain) == os.environ.get("ROS_DOMAIN_ID", "").strip():
            continue
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock, suppress(OSError):
            # Unicast discovery port of the domain's first participant (DDSI-RTPS §9.6.1).
            sock.bind(("127.0.0.1", 7400 + 250 * domain + 10))
            return domain
    raise UavrtError("no ROS domain is free", remedy="Stop programs that use ROS 2")


def demo_environment() -> dict[str, str]:
    """Environment variables that separate the demo's programs from the site's ROS 2 network."""
    kept = {name: v for name, v in os.environ.items() if name != "CYCLONEDDS_URI"}
    return kept | blas_environment({}) | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def drone_settings(
    scenario: Scenario, paths: DemoPaths, companion_port: int, *, flies: bool = False
) -> Settings:
    """Settings of a drone as in a real ``uavrt.toml``, but with a simulated radio program.

    With `flies`, the radio receives at the position of the commanded drone, otherwise at that
    of the scenario's flight.
    """
    names = {one.name for one in fields(AntennaSettings)}
    mounting = {k: v for k, v in asdict(scenario.antenna).items() if k in names}
    return Settings(
        radio=RadioSettings(
            kind="airspy",
            program=(
                sys.executable,
                "-P",
                "-m",
                "uavrt.simulation.airspy_rx",
                "--world",
                str(paths.scenario),
                *(("--flown", str(paths.flown)) if flies else ()),
            ),
            sample_rate_hz=scenario.radio.sample_rate_hz,
        ),
        mavlink=MavlinkSettings(address=f"udpin://127.0.0.1:{companion_port}"),
        antenna=AntennaSettings(**mounting),
        recording=RecordingSettings(directory=str(paths.flights)),
        status_socket=str(paths.status_socket),
    )


class Program:
    """One program of the demo, with its output in a file.

    `name`: name in messages. `log`: file for the output. `interpreter`: command before the
    arguments; if it is empty, the first argument is the program, and the log's directory is its
    working directory. `environment`: variables added to the demo's environment.
    """

    def __init__(
        self,
        name: str,
        arguments: Sequence[str],
        log: Path,
        *,
        interpreter: Sequence[str] = (sys.executable, "-P", "-m"),
        environment: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.name = name
        self.log = log
        self._lines = LineBuffer()
        self._read_to = 0
        self.exit_code: int | None = None
        self.cpu_s = 0.0
        with log.open("wb") as output:
            self._process = subprocess.Popen(
                [*_END_WITH_US, *interpreter, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env=demo_environment() | dict(environment),
                cwd=None if interpreter else log.parent,
                process_group=0,
            )
        self.pid = self._process.pid

    def check(self) -> None:
        """Raise `UavrtError` with the last output if the program has ended."""
        if self._wait(0.0):
            words = self.last_line()
            raise UavrtError(
                f"{self.name} ended (exit {self.exit_code})" + (f": {words}" if words else ""),
                remedy=f"Read its output in {self.log}",
            )

    def last_line(self) -> str:
        """Last line of the program's output; empty if there is none."""
        lines = self.log.read_text(errors="replace").splitlines()
        texts = [line.strip() for line in lines if line.strip() and line[0] != "{"]
        return texts[-1].removeprefix("uavrt: ").rstrip(".") if texts else ""

    def new_events(self) -> list[dict[str, Any]]:
        """JSON events that the program has printed since the last call."""
        with self.log.open("rb") as file:
            file.seek(self._read_to)
            data = file.read()
        self._read_to += len(data)
        return [json.loads(line) for line in self._lines.feed(data) if line[:1] == b"{"]

    @property
    def ended(self) -> bool:
        """True if the program has ended."""
        return self._wait(0.0)

    def terminate(self) -> None:
        """Send SIGTERM without waiting."""
        if not self.ended:
            self._process.send_signal(signal.SIGTERM)

    def stop(self) -> None:
        """Stop the program by SIGTERM, then by SIGKILL."""
        self.terminate()
        if not self._wait(STOP_TIMEOUT_S):
            self._process.kill()
            self._wait(STOP_TIMEOUT_S)

    def _wait(self, timeout_s: float) -> bool:
        deadline_s = time.monotonic() + timeout_s
        while self.exit_code is None:
            pid, status, usage = os.wait4(self.pid, os.WNOHANG)
            if pid == self.pid:
                self.exit_code = os.waitstatus_to_exitcode(status)
                self._process.returncode = self.exit_code
                self.cpu_s = usage.ru_utime + usage.ru_stime
            elif time.monotonic() >= deadline_s:
                return False
            else:
                time.sleep(0.02)
        return True
