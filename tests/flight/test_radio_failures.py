"""Radios that fail in every way they know, with programs that stand in for ``airspy_rx``.

Each fails once, in its own way, then works: the system must say what is wrong and go on by
itself, with the same supervisor and the same receiver process.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from uavrt.config.settings import RadioSettings
from uavrt.messages import StatusText, SystemStatus

pytestmark = [pytest.mark.flight, pytest.mark.timeout(120)]

STAND_IN = """
import os, signal, sys, time
fault, marker = sys.argv[1:3]
first = not os.path.exists(marker)
open(marker, "a").write("x")

def samples(seconds):
    # 3 MS/s of noise at about the level of a receiver, paced, from one block made once.
    import random
    state = random.Random(7)
    import array
    block = array.array("f", (state.gauss(0.0, 0.01) for _ in range(2 * 16384))).tobytes() * 16
    began, n = time.monotonic(), 0
    while time.monotonic() - began < seconds:
        view = memoryview(block)
        while view:
            view = view[os.write(1, view):]
        n += 1
        time.sleep(max(0.0, began + n * 262144 / 3e6 - time.monotonic()))

if not first:
    samples(600.0)
elif fault == "hangs at once":
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    samples(1.0)
    time.sleep(600.0)
elif fault == "is unplugged":
    samples(1.0)
    print("airspy_start_rx() failed: AIRSPY_ERROR_NOT_FOUND (-5)", file=sys.stderr)
    sys.exit(1)
elif fault == "is killed":
    samples(1.0)
    os.kill(os.getpid(), signal.SIGKILL)
elif fault == "writes garbage":
    samples(1.0)
    while True:
        os.write(1, os.urandom(65536))
        time.sleep(0.002)
elif fault == "loses half a sample":
    samples(1.0)
    os.write(1, b"abc")
    samples(600.0)
elif fault == "writes only half a sample":
    os.write(1, b"abc")
    sys.exit(0)
elif fault == "gives only zeros":
    while True:
        os.write(1, bytes(8 * 16384))
        time.sleep(16384 / 3e6)
elif fault == "talks to stdout":
    print("usage: airspy_rx ...", flush=True)
    sys.exit(1)
"""

FAULTS = {
    "hangs at once": "no samples for",
    "is unplugged": "AIRSPY_ERROR_NOT_FOUND",
    "is killed": "SIGKILL",
    "writes garbage": "not samples",
    "loses half a sample": "not samples",
    "writes only half a sample": "ended with status 0",
    "gives only zeros": "only zeros",
    "talks to stdout": "ended with status 1",
}


def collect(
    drone: Any, seconds: float, done: Callable[[SystemStatus, list[str]], bool]
) -> tuple[SystemStatus, list[str]]:
    """Read records until `done`; get the last status and all texts to the operator."""
    import time

    texts: list[str] = []
    status = None
    deadline_s = time.monotonic() + seconds
    while time.monotonic() < deadline_s:
        for _, record in drone.status.read(0.2):
            if isinstance(record, StatusText):
                texts.append(record.text)
            elif isinstance(record, SystemStatus):
                status = record
                if done(status, texts):
                    return status, texts
    raise AssertionError(f"never came; texts: {texts}; last: {status}")


def receiver_of(status: SystemStatus) -> Any:
    return next((p for p in status.processes if p.process == "receiver"), None)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_radio_that_fails_is_reported_and_comes_back_by_itself(
    fault: str, drone_bay: Any, thesis_scenario: Any, tmp_path: Path
) -> None:
    program = tmp_path / "airspy_rx.py"
    program.write_text(STAND_IN)
    marker = tmp_path / "started"
    drone = drone_bay.launch(
        thesis_scenario,
        msgspec.json.encode(thesis_scenario.tags).decode(),
        radio=RadioSettings(program=(sys.executable, str(program), fault, str(marker))),
    )

    def recovered(status: SystemStatus, texts: list[str]) -> bool:
        receiver = receiver_of(status)
        return (
            receiver is not None
            and any("Radio gives samples again" in text for text in texts)
            and receiver.status == "receiving"
            and receiver.counters["radio_failures"] >= 1
        )

    status, texts = collect(drone, 60.0, recovered)
    failures = [text for text in texts if "radio absent" in text]
    assert failures
    assert FAULTS[fault] in failures[0]
    assert receiver_of(status).restarts == 0
    assert status.state == "detecting"
    assert len(status.tags) == 1
    detector = next(p for p in status.processes if p.process == "detector-1")
    assert detector.restarts == 0
    assert detector.ok
