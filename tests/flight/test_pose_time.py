"""Each pulse gets the yaw that the antenna had: through jitter, skew, reboot and clock steps.

The bar: 0.5° rms, 1.5° at most, over turns at 30°/s.
"""

import asyncio
import math
import os
import time
from pathlib import Path
from typing import Any

import made
import pytest
from listening import linked
from some import some
from sql import sql
from tests.flight.conftest import FLIGHT_RATE_HZ
from until import until_async as until

from uavrt.core.earth.attitude import euler_deg
from uavrt.core.messages import PulsePose
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import FrameWriter
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.scenario import Radio, Scenario

SITE = """
import os, sys, time
_real, _real_ns = time.time, time.time_ns
def _step():
    with open(os.environ["STEP_FILE"]) as file:
        return int(file.read() or 0)
if not any(argument.startswith("uavrt.simulation") for argument in sys.orig_argv):
    time.time = lambda: _real() + _step()
    time.time_ns = lambda: _real_ns() + _step() * 1_000_000_000
"""


BEFORE_S = -7200


def status_texts(directory: Path) -> list[tuple[int, str]]:
    return sql(directory, "SELECT severity, text FROM status_texts")


def turning_scenario(duration_s: float) -> Scenario:
    """Two tags, and a drone that turns at 30°/s all the time."""
    tags = tuple(
        made.simulated_tag(
            2 * number,
            148_700_000.0 + 10_000.0 * number,
            interval_s,
            interval_uncertainty_s=0.01,
            interval_jitter_s=0.01,
            k=3,
            false_alarm_probability=0.005,
            north_m=60.0,
            east_m=20.0 * number,
            erp_dbm=-20.0,
        )
        for number, interval_s in ((1, 1.0), (2, 1.13))
    )
    return Scenario(
        duration_s=duration_s,
        radio=Radio(center_frequency_hz=148_705_000.0, sample_rate_hz=FLIGHT_RATE_HZ),
        tag=tags,
        flight=Flight(
            height_m=40.0, leg=(Leg(duration_s=duration_s, turn_deg=30.0 * duration_s),)
        ),
    )


def yaw_error_deg(scenario: Scenario, item: PulsePose) -> float:
    middle_ns = (item.pulse.start_time_ns + item.pulse.end_time_ns) // 2 - BEFORE_S * 10**9
    truth = euler_deg(scenario.vehicle_pose(middle_ns).quaternion_wxyz)[0]
    told = euler_deg(some(item.pose).quaternion_wxyz)[0]
    return (told - truth + 180.0) % 360.0 - 180.0


@pytest.mark.timeout(150)
async def test_the_yaw_of_each_pulse_is_right_through_jitter_skew_reboot_and_a_clock_step(
    drone_bay: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    # The wall clock is corrected after the start of uavrt, and by an hour more in flight; the
    # zone is 14 hours ahead.
    site = tmp_path / "site"
    site.mkdir()
    (site / "sitecustomize.py").write_text(SITE)
    step = tmp_path / "step"
    step.write_text("0")
    monkeypatch.setenv("STEP_FILE", str(step))
    monkeypatch.setenv("PYTHONPATH", f"{site}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    monkeypatch.setenv("TZ", "Pacific/Kiritimati")
    options = ("--companion-jitter-s", "0.003", "--clock-skew-ppm", "-15000")
    drone = drone_bay.launch(turning_scenario(90.0), autopilot_options=options)
    received: list[PulsePose] = []

    def take(event: object) -> None:
        if isinstance(event, PulsePose):
            received.append(event)

    async with linked(drone.ground_port, on_event=take) as link:
        await link.upload_tags(drone.scenario.tags)
        step.write_text(str(BEFORE_S))
        started_s = time.time()
        await link.start_detection()
        await until(lambda: len(received) >= 12)
        step.write_text(str(BEFORE_S + 3600))
        await until(lambda: len(received) >= 24)
        before = len(received)
        reboot = made.command_long(dialect.MavCmd.PREFLIGHT_REBOOT_SHUTDOWN, 1.0)
        some(link.link).send(FrameWriter(255, 190).encode(reboot))
        await until(lambda: len(received) >= before + 24)
        await link.stop_detection()
        await asyncio.sleep(3.0)
    (directory,) = (drone.directory / "flights").glob("flight_log_*")
    flight = read_flight(directory)
    known = [item for item in flight.pulse_poses if item.pose and not item.pose.extrapolated]
    assert len(known) >= 40
    assert len(known) >= 0.85 * len(flight.pulse_poses)  # 1.5 s of the reboot are without
    errors = [yaw_error_deg(drone.scenario, item) for item in known]
    rms = math.sqrt(sum(error**2 for error in errors) / len(errors))
    assert rms <= 0.5
    assert max(map(abs, errors)) <= 1.5
    # The flight's own times are those of the samples, an hour notwithstanding.
    assert abs(flight.info.start_time_ns / 1e9 - BEFORE_S - started_s) < 10.0
    (noted,) = [text for _, text in status_texts(directory) if "Wall clock" in text]
    assert "corrected by +3600." in noted
    lengths_s = (flight.pulse_poses[-1].pulse.end_time_ns - flight.info.start_time_ns) / 1e9
    assert 0.0 < lengths_s < 100.0
    log = (drone.directory / "autopilot.log").read_text()
    assert "simulated autopilot restarts" in log
