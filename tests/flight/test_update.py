"""``uavrt update`` on a drone that runs: a good version stays, a bad one goes."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from command_line import program
from update_maker import (
    digest_below,
    make_installation,
    make_key,
    sign_alone,
    whole_program,
    write_wheel,
)

from uavrt.core.clock import Clock
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.scenario_file import write_scenario

pytestmark = [pytest.mark.slow, pytest.mark.timeout(240)]

STARTED = '{"event": "started"'
RESTART = f"""\
import json, os, sys
started = [json.loads(line) for line in open(sys.argv[1]) if line.startswith({STARTED!r})]
os.kill(started[-1]["pid"], 9)
"""


class Drone:
    """A drone side that is installed and kept running, as by systemd, with an autopilot."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.prefix = directory / "opt"
        self.key, public = make_key(directory, "release")
        wheel = write_wheel(directory, "0.1.0", whole_program("0.1.0", _unchanged))
        make_installation(self.prefix, wheel, public)
        self._scenario = directory / "scenario.toml"
        scenario = demo_scenario(600.0, 1)
        write_scenario(scenario.starting_at(Clock.start().now_ns()), self._scenario)
        self._port, ground = free_udp_port(), free_udp_port()
        self._ground = f"127.0.0.1:{ground}"
        (directory / "uavrt.toml").write_text(
            f'[mavlink]\naddress = "udpin://127.0.0.1:{self._port}"\n', encoding="utf-8"
        )
        self._log = directory / "service.log"
        (directory / "restart.py").write_text(RESTART, encoding="utf-8")
        self._programs: list[subprocess.Popen[bytes]] = []
        self._autopilot = self._fly(armed=True)
        self._start(
            "uavrt_experiments.recovery.service_manager",
            "--",
            str(self.prefix / "venv/bin/uavrt"),
            "run",
        )

    def _start(self, module: str, *words: str) -> "subprocess.Popen[bytes]":
        with open(self._log, "ab") as log:
            one = subprocess.Popen(
                [sys.executable, "-m", module, *words],
                cwd=self.directory,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        self._programs.append(one)
        return one

    def _fly(self, *, armed: bool) -> "subprocess.Popen[bytes]":
        words = ["--scenario", str(self._scenario), "--companion", f"127.0.0.1:{self._port}"]
        words += [] if armed else ["--flies", "--on-ground", "--ground", self._ground]
        return self._start("uavrt.simulation.autopilot", *words)

    def land(self) -> None:
        """Put a disarmed vehicle in place of the armed one."""
        os.killpg(self._autopilot.pid, signal.SIGKILL)
        self._autopilot.wait()
        self._autopilot = self._fly(armed=False)

    def update(self, wheel: Path) -> "subprocess.CompletedProcess[str]":
        return program(
            *(self.prefix / "venv/bin/uavrt", "update", wheel, "--hold-s", "4"),
            *("--restart", f"{sys.executable} restart.py {self._log}", "--patience-s", "12"),
            cwd=self.directory,
        )

    def version(self) -> str:
        return (self.prefix / "venv").readlink().name

    def runs(self, version: str) -> bool:
        """Whether the service runs from a version, or does so soon."""
        deadline_s = time.monotonic() + 60.0
        while time.monotonic() < deadline_s:
            lines = self._log.read_text().splitlines()
            started = [json.loads(line) for line in lines if line.startswith(STARTED)]
            with contextlib.suppress(FileNotFoundError):  # it is being restarted
                if f"versions/{version}" in _argument0(started[-1]["pid"]):
                    return True
            time.sleep(0.1)
        return False

    def close(self) -> None:
        for one in reversed(self._programs):
            if one.poll() is None:
                os.killpg(one.pid, signal.SIGTERM)
                one.wait()


def _argument0(pid: int) -> str:
    return Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")[0].decode()


def _unchanged(_name: str, text: str) -> str:
    return text


def _poseless(name: str, text: str) -> str:
    """Spoil it so that only a flight shows it: no poses are reported any more."""
    if name != "uavrt/drone/processes/connection.py":
        return text
    spoilt = text.replace('frame.send("poses", poses)', "None")
    assert spoilt != text
    return spoilt


@pytest.fixture
def drone(tmp_path: Path) -> Iterator[Drone]:
    made = Drone(tmp_path)
    yield made
    made.close()


def test_versions_are_tried_on_the_running_drone(drone: Drone, tmp_path: Path) -> None:
    kept = tmp_path / "flights" / "flight_log_2026-01-01_00-00-00"
    kept.mkdir(parents=True)
    (kept / "flight.sqlite").write_bytes(b"a season's work")
    before = digest_below(kept)

    def signed(version: str, change: object) -> Path:
        files = whole_program(version, change)  # type: ignore[arg-type]
        return sign_alone(write_wheel(tmp_path, version, files), drone.key)

    good, poseless = signed("0.2.0", _unchanged), signed("0.3.0", _poseless)
    deadline_s = time.monotonic() + 40.0
    refused = drone.update(good)
    while "armed: nothing" not in refused.stderr and time.monotonic() < deadline_s:
        refused = drone.update(good)  # it is still starting
    assert "the vehicle is armed: nothing was changed" in refused.stderr
    assert (refused.returncode, drone.version()) == (2, "source")

    drone.land()
    taken = drone.update(good)
    while "nothing was changed" in taken.stderr and time.monotonic() < deadline_s:
        taken = drone.update(good)  # the autopilot is still starting
    assert taken.returncode == 0, (taken.stdout, taken.stderr)
    assert drone.version().startswith("0.2.0-")
    assert drone.runs("0.2.0-")

    back = drone.update(poseless)
    assert back.returncode == 1, (back.stdout, back.stderr)
    assert "missing: poses" in back.stdout
    assert "is restored" in back.stdout
    assert drone.version().startswith("0.2.0-")
    assert not (drone.prefix / "trial").is_symlink()
    assert drone.runs("0.2.0-")
    assert digest_below(kept) == before
