"""Ctrl-C and SIGTERM, at any moment: the program ends in order and shows no traceback."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from depth import ALL
from until import until

from uavrt.drone.supervisor.start.usage import own_usage
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt_experiments.resources.usage import is_alive

TAG = "1, 148715000, 1000, 15, 20, 20, 3, 0.01\n"
BAD = re.compile(r"Traceback|Exception ignored|KeyboardInterrupt|never awaited|leaked")
TRIAL_TIMEOUT_S = 30.0
STOPPED_AFTER_S = {"midway": 3.0, "begun": 1.0, "start": 0.35}
STARTED_CPU_S = 0.1
"""CPU time after which Python itself has started: that takes 15 ms, our imports more."""


BAND = ("--sample-rate", "375e3", "--center-frequency", "148.7e6")
LINK = "udpin://127.0.0.1:0"
"""With a free port in place of 0."""
PROGRAMS = {
    "drone": ("run",),
    "headless ground": ("ground", "--headless", "--mavlink", LINK, "-o", "got"),
    "page": ("ground", "--port", "0", "--no-browser", "--mavlink", LINK, "-o", "page"),
    "recording": ("detect", "air.cf32", *BAND, "--tags", "tags.txt", "-o", "pulses.csv"),
    "stream": ("detect", "-", "--format", "cf32", *BAND, "--tags", "tags.txt"),
    "channels": ("channelize", "-"),
    "demo": ("demo", "--headless", "--duration", "60", "--flight-dir", "demo"),
    "monitor": ("monitor", "--socket", "status.sock"),
    "fetch": ("fetch", "--mavlink", LINK),
    "detection experiment": ("experiment", "detection", "--only", "E1"),
    "resources": ("experiment", "resources"),
    "packets": ("experiment", "packets"),
}


@pytest.fixture(scope="module")
def noise(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A minute of noise."""
    path = tmp_path_factory.mktemp("air") / "air.cf32"
    some = np.random.default_rng(1).standard_normal(2 * 375_000, dtype=np.float32)
    with path.open("wb") as samples:
        for _ in range(60):
            some.tofile(samples)
    return path


class Started:
    """A program in its own directory, with tags, noise, and no radio and autopilot."""

    def __init__(self, words: tuple[str, ...], directory: Path, noise: Path) -> None:
        directory.mkdir()
        (directory / "air.cf32").symlink_to(noise)
        (directory / "tags.txt").write_text(TAG)
        (directory / "uavrt.toml").write_text(
            '[mavlink]\naddress = ""\n[recording]\ndirectory = "flights"\n'
            '[radio]\nprogram = ["sleep", "100"]\n'
        )
        self._output = directory / "output"
        self._feeder: subprocess.Popen[bytes] | None = None
        endless = "-" in words
        link = LINK.replace(":0", f":{free_udp_port()}")
        command = [link if word == LINK else word for word in words]
        with self._output.open("w") as output:
            self._process = subprocess.Popen(
                [sys.executable, "-X", "faulthandler", "-m", "uavrt.cli", *command],
                cwd=directory,
                stdin=subprocess.PIPE if endless else subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        if endless:
            self._feeder = subprocess.Popen(
                ["sh", "-c", "while :; do cat air.cf32; done"],
                cwd=directory,
                stdout=self._process.stdin,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
            self._process.stdin.close()  # type: ignore[union-attr]

    def has_started(self) -> bool:
        """Whether our code runs, on however busy a machine, or has ended."""
        pid = self._process.pid
        return not is_alive(pid) or own_usage(pid).cpu_s > STARTED_CPU_S

    def signal(self, number: signal.Signals) -> None:
        if self._process.poll() is not None:
            return
        if number is signal.SIGINT:  # a terminal sends it to all
            os.killpg(self._process.pid, number)
        else:
            self._process.send_signal(number)

    def end(self) -> tuple[int, str]:
        """Get the exit code and the output; a program that does not end shows its stacks."""
        try:
            status = self._process.wait(TRIAL_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.send_signal(signal.SIGABRT)
            self._process.wait(TRIAL_TIMEOUT_S)
            pytest.fail(f"it did not end: {self._output.read_text()}")
        finally:
            self.close()
        return status, self._output.read_text()

    def close(self) -> None:
        """Leave nothing running."""
        for one in filter(None, (self._process, self._feeder)):
            if one.poll() is None:
                os.killpg(one.pid, signal.SIGKILL)
                one.wait()


def signals_at(moment: str, program: str) -> tuple[signal.Signals, ...]:
    """Both signals midway; earlier one of them, by turns from program to program."""
    both = (signal.SIGINT, signal.SIGTERM)
    if ALL or moment == "midway":
        return both
    return (both[([*STOPPED_AFTER_S].index(moment) + [*PROGRAMS].index(program)) % 2],)


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_stop_ends_in_order(program: str, tmp_path: Path, noise: Path) -> None:
    """At its start, when it has begun and midway: at once, to spare time."""
    words = PROGRAMS[program]
    with ExitStack() as stack:
        running: dict[tuple[str, signal.Signals], Started] = {}
        left_s = max(STOPPED_AFTER_S.values())
        for moment, after_s in STOPPED_AFTER_S.items():
            time.sleep(left_s - after_s)
            left_s = after_s
            for number in signals_at(moment, program):
                started = Started(words, tmp_path / f"{moment}-{number.name}", noise)
                stack.callback(started.close)
                running[moment, number] = started
        time.sleep(left_s)
        for (moment, _), one in running.items():
            if moment != "start":
                until(one.has_started, TRIAL_TIMEOUT_S)
        for (_, number), one in running.items():
            one.signal(number)
        for (moment, number), one in running.items():
            status, text = one.end()
            story = f"{moment} {number.name}: {text}"
            if moment != "start" or "uavrt/cli/" in text:  # Python itself starts before us
                assert BAD.search(text) is None, story
            assert status in (0, 1, 2, 128 + number, -number), story
