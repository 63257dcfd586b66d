import contextlib
import json
import signal
import subprocess
import sys
import time
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import pytest
from command_line import started

from uavrt.core.errors import UavrtError
from uavrt.flight.reading.flight_reader import read_flight

CODED = {"12": (0.022, 0.0488, 0.0366), "14": (0.0317, 0.0268, 0.0561)}


@pytest.mark.full_rate
@pytest.mark.timeout(180)
def test_the_demo_finds_and_delivers_the_pulses_and_loses_nothing(tmp_path: Path) -> None:
    finished = started(
        "demo",
        "--headless",
        "--json",
        "--coded",
        "--duration",
        "45",
        "--seed",
        "3",
        "--flight-dir",
        tmp_path,
        timeout=150,
    )
    assert finished.returncode == 0, finished.stderr
    summary = json.loads(finished.stdout.splitlines()[-1])
    assert summary["samples_lost"] == 0
    tags = summary["tags"].values()
    assert set(summary["tags"]) == {"2", "4", "6", *CODED}
    for number, tag in summary["tags"].items():
        assert tag["transmitted"] >= tag["detectable"] > 5
        assert tag["delivered"] == tag["detected"]
        assert abs(tag["snr_error_db"]) < 1.5
        assert tag["frequency_error_hz"] < (30.0 if number in CODED else 10.0)
        assert tag["time_error_ms"] < 5.0
    delivered = sum(tag["detectable_delivered"] for tag in tags)
    assert delivered >= 0.95 * sum(tag["detectable"] for tag in tags)
    processes = {"supervisor", "receiver", "detector-1", "connection", "recorder", "ground"}
    if find_spec("cyclonedds") is not None:
        processes.add("ros2")
        assert "ROS_DOMAIN_ID=" in finished.stderr
    assert processes <= set(summary["cpu_seconds"])
    flight = read_flight(summary["flight_directory"])
    assert sum(tag["detected"] + tag["false"] for tag in tags) == len(flight.pulse_poses)
    assert all(item.pose is not None for item in flight.pulse_poses)
    # A record for each burst, with the pulses inside, and whose it is.
    for number, gaps_s in CODED.items():
        bursts = [one.pulse for one in flight.pulse_poses if one.pulse.tag_id == int(number)]
        assert len(bursts) > 5
        for burst in bursts:
            found_s = [1e-9 * (b - a) for a, b in pairwise(burst.burst_starts_ns)]
            assert found_s == pytest.approx(gaps_s, abs=2e-3)


@pytest.mark.timeout(180)
def test_ctrl_c_ends_the_demo_with_its_table_and_where_the_flight_is(tmp_path: Path) -> None:
    running = subprocess.Popen(
        [
            sys.executable,
            *("-m", "uavrt.cli", "demo", "--headless", "--duration", "120"),
            *("--flight-dir", str(tmp_path)),
        ],
        stdout=subprocess.PIPE,
        text=True,
        # A shell's background job would ignore it.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    while not (heard := heard_in(tmp_path)):
        assert running.poll() is None
        time.sleep(0.5)
    running.send_signal(signal.SIGINT)
    said, _ = running.communicate(timeout=90)
    assert running.returncode == 0
    assert "What became of every pulse" in said
    assert f"flight: {heard[0].parent}" in said.replace("\n", "")


def heard_in(directory: Path) -> list[Path]:
    """Databases of flights in which there are pulses."""
    found = []
    for path in directory.glob("*/flight.sqlite"):
        with contextlib.suppress(UavrtError):
            if read_flight(path.parent).pulse_poses:
                found.append(path)
    return found
