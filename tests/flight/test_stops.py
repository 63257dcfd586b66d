"""Ctrl-C and SIGTERM, at any moment: the program ends in order and shows no traceback."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from uavrt.demo.programs import free_udp_port

pytestmark = [pytest.mark.flight, pytest.mark.timeout(120)]

TAG = "1, 148715000, 1000, 15, 20, 20, 3, 0.01\n"
BAD = re.compile(r"Traceback|Exception ignored|KeyboardInterrupt|never awaited|leaked")
PATIENCE_S = 30.0
STARTING_S = 0.35


def drone(_: Path) -> list[str]:
    return ["run"]


def headless_ground(_: Path) -> list[str]:
    link = f"udpin://127.0.0.1:{free_udp_port()}"
    return ["ground", "--headless", "--mavlink", link, "-o", "got"]


def page(_: Path) -> list[str]:
    link = f"udpin://127.0.0.1:{free_udp_port()}"
    return ["ground", "--port", "0", "--no-browser", "--mavlink", link, "-o", "page"]


def recording(_: Path) -> list[str]:
    return ["detect", "air.cf32", *BAND, "--tags", "tags.txt", "-o", "pulses.csv"]


def stream(_: Path) -> list[str]:
    return ["detect", "-", "--format", "cf32", *BAND, "--tags", "tags.txt"]


def channels(_: Path) -> list[str]:
    return ["channelize", "-"]


def demo(_: Path) -> list[str]:
    return ["demo", "--headless", "--duration", "60", "--flight-dir", "demo"]


def monitor(_: Path) -> list[str]:
    return ["monitor", "--socket", "status.sock"]


def fetch(_: Path) -> list[str]:
    return ["fetch", "--mavlink", f"udpin://127.0.0.1:{free_udp_port()}"]


def detection_experiment(_: Path) -> list[str]:
    return ["experiment", "detection", "--only", "E1"]


def resources(_: Path) -> list[str]:
    return ["experiment", "resources"]


def packets(_: Path) -> list[str]:
    return ["experiment", "packets"]


BAND = ["--sample-rate", "375e3", "--center-frequency", "148.7e6"]
PROGRAMS = [
    drone,
    headless_ground,
    page,
    recording,
    stream,
    channels,
    demo,
    monitor,
    fetch,
    detection_experiment,
    resources,
    packets,
]
ENDLESS_INPUT = (stream, channels)


def prepared(directory: Path) -> None:
    """Tags, half a minute of noise, and a drone without radio and autopilot."""
    (directory / "tags.txt").write_text(TAG)
    (directory / "uavrt.toml").write_text(
        '[mavlink]\naddress = ""\n[recording]\ndirectory = "flights"\n'
        '[radio]\nprogram = ["sleep", "100"]\n'
    )
    noise = np.random.default_rng(1).standard_normal(2 * 375_000, dtype=np.float32)
    with (directory / "air.cf32").open("wb") as samples:
        for _ in range(60):
            noise.tofile(samples)


@pytest.mark.parametrize("after_s", [STARTING_S, 1.0, 3.0], ids=["start", "begun", "midway"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["INT", "TERM"])
@pytest.mark.parametrize("program", PROGRAMS, ids=lambda one: one.__name__)
def test_a_stop_ends_in_order(
    program: Callable[[Path], list[str]], number: signal.Signals, after_s: float, tmp_path: Path
) -> None:
    prepared(tmp_path)
    endless = program in ENDLESS_INPUT
    with (tmp_path / "told").open("w+") as told:
        started = subprocess.Popen(
            [sys.executable, "-m", "uavrt.cli", *program(tmp_path)],
            cwd=tmp_path,
            stdin=subprocess.PIPE if endless else subprocess.DEVNULL,
            stdout=told,
            stderr=told,
            start_new_session=True,
        )
        feeder = None
        if endless:
            feeder = subprocess.Popen(
                ["sh", "-c", "while :; do cat air.cf32; done"],
                cwd=tmp_path,
                stdout=started.stdin,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
            started.stdin.close()  # type: ignore[union-attr]
        try:
            time.sleep(after_s)
            if number is signal.SIGINT:  # a terminal sends it to all
                os.killpg(started.pid, number)
            else:
                started.send_signal(number)
            status = started.wait(PATIENCE_S)
        finally:
            for one in filter(None, (started, feeder)):
                if one.poll() is None:
                    os.killpg(one.pid, signal.SIGKILL)
                    one.wait()
        told.seek(0)
        text = told.read()
    if after_s > STARTING_S or "uavrt" in text:  # Python itself starts before us
        assert BAD.search(text) is None, text
    assert status in (0, 1, 2, 128 + number, -number), text
