import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from uavrt.recording import read_flight


@pytest.mark.flight
@pytest.mark.timeout(180)
def test_the_demo_finds_and_delivers_the_pulses_and_loses_nothing(tmp_path: Path) -> None:
    finished = subprocess.run(
        [
            sys.executable,
            *("-m", "uavrt.cli", "demo", "--headless", "--json"),
            *("--duration", "45", "--seed", "3", "--flight-dir", str(tmp_path)),
        ],
        capture_output=True,
        text=True,
        timeout=150,
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    summary = json.loads(finished.stdout.splitlines()[-1])
    assert summary["samples_lost"] == 0
    tags = summary["tags"].values()
    assert len(tags) == 3
    for tag in tags:
        assert tag["transmitted"] >= tag["detectable"] > 5
        assert tag["delivered"] == tag["detected"]
        assert abs(tag["snr_error_db"]) < 1.5
        assert tag["frequency_error_hz"] < 10.0
        assert tag["time_error_ms"] < 5.0
    delivered = sum(tag["detectable_delivered"] for tag in tags)
    assert delivered >= 0.95 * sum(tag["detectable"] for tag in tags)
    processes = {"supervisor", "receiver", "detector-1", "connection", "recorder", "ground"}
    if find_spec("cyclonedds") is not None:
        processes.add("ros2")
    assert processes <= set(summary["cpu_seconds"])
    flight = read_flight(summary["flight_directory"])
    assert sum(tag["detected"] + tag["false"] for tag in tags) == len(flight.pulse_poses)
    assert all(item.pose is not None for item in flight.pulse_poses)
