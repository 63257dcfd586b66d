"""A computer whose clock has no battery, and believes that it is 1970."""

import os
import time
from pathlib import Path
from typing import Any

import pytest
from listening import Listening

from uavrt.flight.flight_order import flights_in_order
from uavrt.flight.reading.flight_reader import read_flight

pytestmark = pytest.mark.timeout(150)

EARLIER = """
import os, socket, time

def earlier(real, shift):
    return lambda: real() - shift

time.time_ns = earlier(time.time_ns, int(os.environ["UAVRT_TEST_EARLIER_NS"]))
time.time = earlier(time.time, int(os.environ["UAVRT_TEST_EARLIER_NS"]) * 1e-9)

class Socket(socket.socket):
    def setsockopt(self, level, option, *value):
        if (level, option) != (socket.SOL_SOCKET, 35):
            super().setsockopt(level, option, *value)

socket.socket = Socket
"""
"""Python reads it before all else in each of its processes (``sitecustomize``). The kernel,
whose clock is right, is not asked when a frame came (35: SO_TIMESTAMPNS)."""
MINUTE_NS = 60 * 10**9


def test_it_flies_says_so_and_its_flight_stays_the_newest(
    drone_bay: Any, thesis_scenario: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shift_ns = time.time_ns() - 5 * MINUTE_NS
    (tmp_path / "sitecustomize.py").write_text(EARLIER)
    path = os.pathsep.join(filter(None, (str(tmp_path), os.environ.get("PYTHONPATH"))))
    with monkeypatch.context() as patch:
        patch.setenv("PYTHONPATH", path)
        patch.setenv("UAVRT_TEST_EARLIER_NS", str(shift_ns))
        real_ns = time.time_ns
        patch.setattr(time, "time_ns", lambda: real_ns() - shift_ns)
        drone = drone_bay.launch(thesis_scenario, tags=thesis_scenario.tags)
    ground = Listening(drone)
    ground.listen(
        lambda: len(ground.pulses) >= 3,
        lambda: any("the clock shows 1970-01-01 00:0" in text for text in ground.texts),
    )
    assert all(item.pose is not None for item in ground.pulses)
    assert all(0 < item.pulse.start_time_ns < 15 * MINUTE_NS for item in ground.pulses)
    drone.end()
    flights = drone.directory / "flights"
    (flown,) = flights_in_order(flights)
    assert flown.name.startswith("flight_log_1970-01-01_00-0")
    read = read_flight(flown)
    assert len(read.pulse_poses) >= len(ground.pulses)
    assert read.info.start_time_ns < 15 * MINUTE_NS
