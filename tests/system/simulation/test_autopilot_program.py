"""The simulated autopilot as a program of its own."""

import asyncio
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from uavrt.core.clock import Clock
from uavrt.core.errors import LinkError
from uavrt.link.mavlink import dialect as d
from uavrt.link.mavlink.frame import FrameParser
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.scenario_file import write_scenario
from uavrt.simulation.vehicle.fake_autopilot import AutopilotSettings, FakeAutopilot

PROGRAM = [sys.executable, "-m", "uavrt.simulation.autopilot"]


def test_it_flies_the_scenario_from_the_given_start_and_stops_on_sigterm(
    tmp_path: Path,
) -> None:
    scenario = demo_scenario(duration_s=60.0)
    write_scenario(scenario, tmp_path / "world.toml")
    start_ns = time.time_ns() - 20 * 10**9
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as companion:
        companion.bind(("127.0.0.1", 0))
        companion.settimeout(30.0)
        place = f"127.0.0.1:{companion.getsockname()[1]}"
        arguments = ["--scenario", str(tmp_path / "world.toml"), "--companion", place]
        arguments += ["--start-time-ns", str(start_ns)]
        program = subprocess.Popen(
            PROGRAM + arguments, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        position, unix_time, parser = None, None, FrameParser()
        while position is None or unix_time is None:
            for frame in parser.feed(companion.recv(2048)):
                message = frame.message()
                if isinstance(message, d.SystemTime):
                    unix_time = message
                if isinstance(message, d.GlobalPositionInt):
                    position = message
        program.send_signal(signal.SIGTERM)
        output, errors = program.communicate(timeout=30.0)
    assert program.returncode == 0
    assert "dropped_to_ground" in errors
    assert output == ""
    # Both were sent within moments of each other; the drone moves a few metres a second.
    true = scenario.starting_at(start_ns).vehicle_pose(unix_time.time_unix_usec * 1000)
    assert abs(position.lat / 1e7 - true.latitude_deg) < 1e-4
    assert abs(position.lon / 1e7 - true.longitude_deg) < 1e-4
    assert abs(position.relative_alt / 1e3 - true.altitude_relative_m) < 10.0


def test_a_missing_scenario_ends_it_with_the_file_named(tmp_path: Path) -> None:
    arguments = ["--scenario", str(tmp_path / "none.toml"), "--companion", "127.0.0.1:9"]
    done = subprocess.run(PROGRAM + arguments, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "none.toml" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_port_in_use_is_named_with_its_remedy() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        settings = AutopilotSettings(
            companion=("127.0.0.1", 9), companion_port=taken.getsockname()[1]
        )
        autopilot = FakeAutopilot(demo_scenario().vehicle_pose, settings, Clock.start())

        with pytest.raises(LinkError, match="another port"):
            asyncio.run(autopilot.run())
