"""Real processes fly a simulated drone that anybody may take back."""

import math
import os
import pty
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
from some import some
from tests.flight.conftest import Drone, DroneBay, hovering_scenario

from uavrt.config.settings import GuidanceSettings
from uavrt.core.messages import Tag
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.simulation.demo.demo_programs import Program, free_udp_port
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.simulated_flying import MODES

pytestmark = [pytest.mark.slow, pytest.mark.timeout(240)]
OURS = "1/191"
TURN = ("rotate", "--seconds", "12")
SILENT_S = 4.5
"""Time of three commands: a turn of twelve seconds has one each second and a half."""


class Qgc:
    """A second station, at the autopilot's ground port."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._socket.settimeout(0.2)
        self._parser, self._writer = FrameParser(), FrameWriter(255, 190)
        self.place: dialect.GlobalPositionInt | None = None
        self.mode = -1

    def listen(self, seconds: float) -> None:
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            with suppress(TimeoutError):
                data, self.autopilot = self._socket.recvfrom(4096)
                self._parser.reset()
                for frame in self._parser.feed(data):
                    message = frame.message()
                    if isinstance(message, dialect.GlobalPositionInt):
                        self.place = message
                    if isinstance(message, dialect.Heartbeat) and frame.component_id == 1:
                        self.mode = message.custom_mode

    def until(self, condition: Callable[[], bool], timeout_s: float) -> None:
        end_s = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end_s
            self.listen(0.1)

    @property
    def yaw_deg(self) -> float:
        return some(self.place).hdg / 100.0

    def off_m(self, other: "dialect.GlobalPositionInt") -> float:
        assert self.place is not None
        north = (self.place.lat - other.lat) * 1.112e-2
        return math.hypot(north, (self.place.lon - other.lon) * 1.112e-2 * 0.68)

    def send(self, message: Any) -> None:
        self._socket.sendto(self._writer.encode(message), self.autopilot)

    def ask_for_place(self) -> None:
        """ArduPilot streams nothing unasked."""
        self.send(
            made.command_long(
                dialect.MavCmd.SET_MESSAGE_INTERVAL,
                float(dialect.GlobalPositionInt.ID),
                100_000.0,
            )
        )

    def arm(self) -> None:
        """As a pilot does."""
        self.send(made.command_long(dialect.MavCmd.COMPONENT_ARM_DISARM, 1.0))

    def pause(self, flavour: Flavour) -> None:
        if flavour == "ardupilot":
            self.set_mode(flavour, "brake")
            return
        self.send(made.reposition())

    def set_mode(self, flavour: Flavour, name: str) -> None:
        mode = MODES[flavour][name]
        px4 = flavour == "px4"
        self.send(
            made.command_long(
                dialect.MavCmd.DO_SET_MODE,
                1.0,
                float(mode >> 16 & 255 if px4 else mode),
                float(mode >> 24 if px4 else 0),
            )
        )

    def close(self) -> None:
        self._socket.close()


class Typed:
    """`uavrt fly` in a terminal, where a person types."""

    def __init__(self, words: tuple[str, ...], log: Path) -> None:
        self._keyboard, terminal = pty.openpty()
        self._log = log
        with log.open("wb") as output:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "uavrt.cli", "fly", *words],
                stdin=terminal,
                stdout=output,
                stderr=subprocess.STDOUT,
            )
        os.close(terminal)

    @property
    def asks(self) -> bool:
        """Whether it waits for the word."""
        return 'Type "fly"' in self._log.read_text()

    def type(self, text: str) -> None:
        os.write(self._keyboard, text.encode() + b"\n")

    @property
    def ended(self) -> bool:
        return self._process.poll() is not None

    def stop(self) -> None:
        """End it where it has not ended."""
        self.kill()

    def kill(self) -> None:
        """As a ground station whose computer is switched off: without a word."""
        self._process.kill()
        self._process.wait()
        os.close(self._keyboard)


class Field:
    """A drone that hovers, a second station, and `uavrt fly`."""

    def __init__(
        self,
        bay: DroneBay,
        flavour: Flavour,
        work: Path,
        scenario: Scenario | None = None,
        *,
        tags: Sequence[Tag] = (),
        options: tuple[str, ...] = (),
        key: Path | None = None,
        **guidance: Any,
    ) -> None:
        self.port, self.work, self.number = free_udp_port(), work, 0
        self.flavour = flavour
        self.drone: Drone = bay.launch(
            scenario or hovering_scenario(),
            tags=tags,
            flies=True,
            autopilot_options=("--flavour", flavour, *options),
            mavlink=lambda m: replace(
                m,
                direct_links=(f"udpin://127.0.0.1:{self.port}",),
                key_file=None if key is None else str(key),
            ),
            guidance=GuidanceSettings(
                enabled=True, battery_wh=200.0, speed_m_s=8.0, **guidance
            ),
        )
        self.qgc = Qgc(self.drone.ground_port)
        self.qgc.until(lambda: self.qgc.mode >= 0, 30.0)
        self.qgc.ask_for_place()
        self.qgc.until(lambda: self.qgc.place is not None, 10.0)

    def fly(self, *words: str) -> Program:
        self.number += 1
        options = ("--mavlink", f"udpout://127.0.0.1:{self.port}", "--json")
        return Program(
            "fly", ("uavrt.cli", "fly", *words, *options), self.work / f"fly{self.number}.log"
        )

    def ordered(self, *words: str) -> Program:
        """An order that is confirmed and has begun; asked again until the drone is ready."""
        sent = self.commands()
        for _ in range(10):
            program = self.fly(*words, "--yes", "--sticks-unseen")
            self.qgc.until(lambda p=program: p.ended or self.commands() > sent, 20.0)  # type: ignore[misc]
            if not program.ended:
                return program
        raise AssertionError((self.work / f"fly{self.number}.log").read_text())

    def typed(self, *words: str, meanwhile: Callable[[], None] = lambda: None) -> "Typed":
        """An order in a terminal, confirmed by typing; asked again until the drone is ready."""
        options, sent = (
            ("--mavlink", f"udpout://127.0.0.1:{self.port}", "--json"),
            self.commands(),
        )
        for _ in range(10):
            self.number += 1
            program = Typed((*words, *options), self.work / f"fly{self.number}.log")
            end_s = time.monotonic() + 40.0
            while not (program.ended or program.asks):
                assert time.monotonic() < end_s
                meanwhile()
                self.qgc.listen(0.3)
            assert self.commands() == sent
            program.type("fly")
            self.qgc.until(lambda p=program: p.ended or self.commands() > sent, 20.0)  # type: ignore[misc]
            if not program.ended:
                return program
            program.kill()
        raise AssertionError(self.events())

    def motions(self) -> list[int]:
        """Numbers of our commands of motion, in turn."""
        found = (
            re.search(r"command[=:\s\"]+(\d+)", line) for line in self.log() if OURS in line
        )
        return [int(one[1]) for one in found if one is not None]

    def log(self) -> list[str]:
        text = (self.drone.directory / "autopilot.log").read_text(errors="replace")
        return [line for line in text.splitlines() if "motion" in line]

    def commands(self) -> int:
        return sum(OURS in line for line in self.log())

    def events(self) -> str:
        return (self.work / f"fly{self.number}.log").read_text()


def test_it_turns_here_goes_there_is_taken_back_and_hovers_when_a_process_is_killed(
    drone_bay: DroneBay, tmp_path: Path
) -> None:
    field = Field(drone_bay, "px4", tmp_path)
    with closing(field.qgc) as qgc:
        start = some(qgc.place)
        assert_too_far_is_refused(field)
        program = field.ordered(*TURN)
        quarters: set[int] = set()

        def turned() -> bool:
            quarters.add(int(qgc.yaw_deg // 90))
            return program.ended

        qgc.until(turned, 90.0)
        assert '"text": "done"' in field.events()
        assert quarters == {0, 1, 2, 3}
        assert qgc.off_m(start) < 2.0

        here = (start.lat / 1e7 + 60.0 / 111_200.0, start.lon / 1e7)
        program = field.ordered("goto", *map(str, here), "--height", "45")
        qgc.until(lambda: program.ended, 60.0)
        assert '"text": "done"' in field.events()
        assert qgc.off_m(start) == pytest.approx(60.0, abs=4.0)

        before = field.commands()
        program = field.ordered(*TURN)
        qgc.until(lambda: field.commands() >= before + 2, 30.0)
        qgc.listen(1.0)
        qgc.pause(field.flavour)
        qgc.listen(0.3)
        sent = field.commands()
        qgc.until(lambda: program.ended, 5.0)
        assert '"out"' in field.events()
        qgc.listen(SILENT_S)
        assert field.commands() == sent

        for victim in ("guide", "supervisor"):
            assert_hovers_without(victim, field, field.ordered(*TURN))


def assert_hovers_without(victim: str, field: Field, program: "Program | Typed") -> None:
    """Kill a process while the drone turns: no command follows, and it stands."""
    qgc = field.qgc
    whole = field.drone.supervisor.pid if victim == "supervisor" else None
    os.kill(whole or field.drone.pid_of(victim), signal.SIGKILL)
    qgc.listen(0.5)
    sent, place = field.commands(), some(qgc.place)
    qgc.listen(SILENT_S)
    assert field.commands() == sent
    assert qgc.off_m(place) < 2.0
    program.stop()
    if victim != "supervisor":
        status = field.fly("status")
        qgc.until(lambda: status.ended, 20.0)
        assert '"event": "out"' in field.events()


def assert_too_far_is_refused(field: Field) -> None:
    """With the reason, and nothing is flown."""
    place = some(field.qgc.place)
    far = (place.lat / 1e7 + 0.02, place.lon / 1e7)
    for _ in range(10):  # at first the drone side has no home yet
        program = field.fly("goto", *map(str, far), "--yes", "--sticks-unseen")
        field.qgc.until(lambda p=program: p.ended, 30.0)  # type: ignore[misc]
        assert program.exit_code != 0
        if "beyond the fence" in field.events():
            break
        field.qgc.listen(1.0)
    assert "beyond the fence" in field.events()
    assert field.commands() == 0


def test_sealed_orders_take_off_with_sticks_seen_and_the_ground_is_lost_on_the_way(
    drone_bay: DroneBay, tmp_path: Path
) -> None:
    """A pilot arms; the drone climbs, turns, loses its link's process, and flies off again.

    It holds without a ground, and returns.
    """
    key = tmp_path / "key"
    key.write_text("5a" * 32)
    key.chmod(0o600)
    field = Field(
        *(drone_bay, "ardupilot", tmp_path),
        options=("--on-ground", "--sticks"),
        key=key,
        may_take_off=True,
        return_after_s=2.0,
    )
    with closing(field.qgc) as qgc:
        start, sealed = qgc.place, ("--command-key", str(key))
        assert start is not None
        # Nothing is said of sticks: they are seen. Left on the ground it would disarm.
        takes_off = field.typed("takeoff", "25", *sealed, meanwhile=qgc.arm)
        qgc.until(lambda: takes_off.ended, 40.0)
        takes_off.kill()
        assert '"text": "done"' in field.events()
        assert field.motions() == [176, 22]
        assert some(qgc.place).relative_alt == pytest.approx(25_000, abs=2_500)

        assert_hovers_without("connection", field, field.typed(*TURN, *sealed))
        flown = field.motions()

        there = (start.lat / 1e7 + 200.0 / 111_200.0, start.lon / 1e7)
        goes = field.typed("goto", *map(str, there), *sealed)
        qgc.until(lambda: qgc.off_m(start) > 5.0, 20.0)
        goes.kill()
        qgc.until(lambda: qgc.mode == MODES["ardupilot"]["return"], 30.0)
        assert field.motions()[len(flown) :] == [192, 192, 20]  # there, and where it held
        assert 20.0 < qgc.off_m(start) < 150.0
