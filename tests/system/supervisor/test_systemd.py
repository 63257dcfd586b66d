"""What systemd is told, and a stand-in for systemd that acts on it."""

import json
import os
import signal
import socket
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from until import until

from uavrt.drone.supervisor.tree.systemd import SystemdNotifier


def test_states_go_to_the_socket_of_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "15000000")
        monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
        systemd = SystemdNotifier()
        assert systemd.watchdog_s == 7.5
        systemd.ready()
        systemd.alive("detecting")
        systemd.stopping()
        systemd.close()
        said = [manager.recv(100) for _ in range(3)]
    assert said == [b"READY=1", b"WATCHDOG=1\nSTATUS=detecting", b"STOPPING=1"]


def test_a_watchdog_meant_for_another_process_is_not_ours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    monkeypatch.setenv("WATCHDOG_USEC", "15000000")
    monkeypatch.setenv("WATCHDOG_PID", "1")
    systemd = SystemdNotifier()
    assert systemd.watchdog_s is None
    systemd.ready()  # nobody to tell: nothing happens


def test_a_manager_that_has_gone_does_not_stop_the_flight_and_gets_states_once_it_is_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = str(tmp_path / "manager")
    monkeypatch.setenv("NOTIFY_SOCKET", place)
    systemd = SystemdNotifier()
    systemd.alive("detecting")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(place)
        systemd.alive("still detecting")
        assert manager.recv(100) == b"WATCHDOG=1\nSTATUS=still detecting"
    systemd.close()


SERVICE = """
import os, socket, sys, time
lives = sys.argv[1]
with open(lives, "a") as file:
    file.write("x")
life = os.path.getsize(lives)
sock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
sock.connect(os.environ["NOTIFY_SOCKET"])
sock.send(b"READY=1")
if life == 1:
    sys.exit(3)              # fails
if life == 2:
    time.sleep(60)           # falls silent
while True:                  # works
    sock.send(b"WATCHDOG=1")
    time.sleep(0.05)
"""


def test_the_stand_in_for_systemd_restarts_what_fails_or_falls_silent(tmp_path: Path) -> None:
    program = tmp_path / "service.py"
    program.write_text(textwrap.dedent(SERVICE))
    output = tmp_path / "events"
    with output.open("w") as file:
        manager = subprocess.Popen(
            [
                *(sys.executable, "-m", "uavrt_experiments.recovery.service_manager"),
                *("--watchdog-s", "3", "--restart-s", "0.05", "--"),
                *(sys.executable, str(program), str(tmp_path / "lives")),
            ],
            stdout=file,
        )

    def events() -> list[str]:
        return [json.loads(line)["event"] for line in output.read_text().splitlines()]

    until(lambda: events().count("ready") >= 3, 60.0)
    manager.send_signal(signal.SIGTERM)
    assert manager.wait(60.0) == 0
    life = ["started", "ready"]
    assert events() == [*life, "ended", *life, "watchdog", "ended", *life, "ended"]
