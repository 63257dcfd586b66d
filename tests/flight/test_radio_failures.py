"""A radio that fails in every way known, by a program that stands in for ``airspy_rx``.

Each time it is started it fails in the next way, and at last it works. The system must say what
is wrong and go on by itself, with the same supervisor, receiver and detector.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.flight.conftest import process

from uavrt.config.settings import RadioSettings
from uavrt.core.messages import StatusText, SystemStatus

FAULTS = {
    "works, then is unplugged": "no radio is plugged in",
    "hangs": "no samples arrive",
    "is killed": "SIGKILL",
    "writes garbage": "not samples",
    "sends only zeros": "only zeros",
    "loses half a sample": "not samples",
    "writes only half a sample": "ended with status 0",
    "talks to stdout": "ended with status 1",
}
"""How it fails, and what the operator reads; the same twice in a row would be told once."""
STAND_IN = """
import array, os, random, signal, sys, time
marker, *faults = sys.argv[1:]
faults = faults[:faults.index("then works")]
with open(marker, "ab") as file:
    number = file.tell()
    file.write(b"x")
fault = faults[number] if number < len(faults) else "works"

def samples(seconds):
    # 3 MS/s of noise at about the level of a receiver, paced, from one block made once.
    state = random.Random(7)
    block = array.array("f", (state.gauss(0.0, 0.01) for _ in range(2 * 16384))).tobytes() * 4
    began, n = time.monotonic(), 0
    while time.monotonic() - began < seconds:
        view = memoryview(block)
        while view:
            view = view[os.write(1, view):]
        n += 1
        time.sleep(max(0.0, began + n * 65536 / 3e6 - time.monotonic()))

if fault == "works":
    samples(600.0)
elif fault == "works, then is unplugged":
    samples(1.0)
    print("airspy_start_rx() failed: AIRSPY_ERROR_NOT_FOUND (-5)", file=sys.stderr)
    sys.exit(1)
elif fault == "hangs":
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    samples(0.3)
    time.sleep(600.0)
elif fault == "is killed":
    samples(0.3)
    os.kill(os.getpid(), signal.SIGKILL)
elif fault == "writes garbage":
    samples(0.3)
    while True:
        os.write(1, os.urandom(65536))
        time.sleep(0.002)
elif fault == "loses half a sample":
    samples(0.3)
    os.write(1, b"abc")
    samples(600.0)
elif fault == "writes only half a sample":
    os.write(1, b"abc")
    sys.exit(0)
elif fault == "sends only zeros":
    while True:
        os.write(1, bytes(8 * 16384))
        time.sleep(16384 / 3e6)
elif fault == "talks to stdout":
    print("usage: airspy_rx ...", flush=True)
    sys.exit(1)
"""


def collect(
    drone: Any, seconds: float, done: Callable[[SystemStatus, list[str]], bool]
) -> tuple[SystemStatus, list[str]]:
    """Read records until `done`; get the last status and all texts to the operator."""
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


def test_a_radio_that_fails_in_every_way_is_reported_and_comes_back_by_itself(
    drone_bay: Any, thesis_scenario: Any, tmp_path: Path
) -> None:
    program = tmp_path / "airspy_rx"
    command = (str(program), str(tmp_path / "starts"), *FAULTS, "then works")
    drone = drone_bay.launch(
        thesis_scenario,
        tags=thesis_scenario.tags,
        radio=RadioSettings(program=command, retry_s=0.2),
    )

    # At first there is no such program.
    status, texts = collect(
        drone,
        30.0,
        lambda status, texts: (
            any(p.status == "radio absent" and not p.ok for p in status.processes)
            and any("radio absent" in text for text in texts)
        ),
    )
    assert process(status, "connection").ok
    assert "airspy_rx is not installed" in process(status, "receiver").reason
    assert str(program) in (drone.directory / "supervisor.log").read_text()
    ready, starts = tmp_path / "ready", tmp_path / "starts"
    ready.write_text(f"#!{sys.executable}\n{STAND_IN}")
    ready.chmod(0o755)
    ready.rename(program)

    def recovered(status: SystemStatus, texts: list[str]) -> bool:
        return (
            process(status, "receiver").status == "receiving"
            and starts.exists()
            and starts.stat().st_size > len(FAULTS)
        )

    status, more = collect(drone, 90.0, recovered)
    missing, *failures = [text for text in texts + more if "radio absent" in text]
    assert "not installed" in missing
    assert len(failures) == len(FAULTS)
    for failure, words in zip(failures, FAULTS.values(), strict=True):
        assert words in failure
    # Five of them gave samples before they failed, and the last one goes on.
    assert sum("Radio delivers samples again" in text for text in more) >= 4
    assert status.state == "detecting"
    assert len(status.tags) == 1
    for name in ("receiver", "detector-1"):
        survivor = process(status, name)
        assert (survivor.running, survivor.restarts) == (True, 0)
    assert process(status, "detector-1").ok
