"""A flight brings its own time to a connection that has run since long before."""

import asyncio
from pathlib import Path
from typing import Any

import made
import pytest
from delivered import numbers
from until import until_async as until

from uavrt.core.clock import Clock
from uavrt.core.earth.attitude import euler_deg
from uavrt.core.messages import Poses, PulsePose
from uavrt.ground.link.protocol import DetectorAlive, DroneHeartbeat

Bay = Any  # tests/unit/processes/conftest.py
HOUR_NS = 3600 * 10**9


@pytest.mark.parametrize("step_ns", [HOUR_NS, -HOUR_NS, 0])
async def test_pulses_and_poses_have_the_flights_time_and_nothing_falls_silent(
    bay: Bay, tmp_path: Path, step_ns: int
) -> None:
    base = bay.clock

    def yaw_error_deg(item: PulsePose) -> float:
        assert item.pose is not None
        middle_ns = (item.pulse.start_time_ns + item.pulse.end_time_ns) // 2 - step_ns
        truth = euler_deg(bay.vehicle(middle_ns).quaternion_wxyz)[0]
        told = euler_deg(item.pose.quaternion_wxyz)[0]
        return (told - truth + 180.0) % 360.0 - 180.0

    def feed(events: list[Any]) -> list[Any]:
        bay.send_pulse(100)
        return events

    async with bay.running(), bay.ground_station() as (_, events):
        await until(lambda: bay.health is not None and bay.health.status == "ready")
        bay.clock = Clock(base.offset_ns + step_ns)
        bay.begin_flight(tmp_path)
        await until(lambda: bay.health.time_ns > bay.clock.now_ns() - 10**9)
        for number in range(40):
            bay.send_pulse(number)
            await asyncio.sleep(0.02)
        await until(lambda: len(numbers(events)) == 40)
        recorded = [r for _, r in bay.records if isinstance(r, PulsePose)]
        sure = [r for r in recorded if r.pose is not None and not r.pose.extrapolated]
        assert len(sure) >= 20
        assert max(abs(yaw_error_deg(item)) for item in sure) < 1.5
        events.clear()
        bay.deliver("system_status", made.system_status(bay.clock.now_ns()))
        await until(lambda: sum(isinstance(e, DroneHeartbeat) for e in events) >= 2)
        await until(lambda: any(isinstance(e, DetectorAlive) for e in feed(events)))
        poses = [r for _, r in bay.records if isinstance(r, Poses)][-1].poses
        assert abs(poses[-1].time_ns - bay.clock.now_ns()) < 5 * 10**9

    def times(name: str) -> list[int]:
        return [record.time_ns for topic, record in bay.records if topic == name]

    assert all(abs(t - bay.clock.now_ns()) < 60 * 10**9 for t in times("delivered"))


async def test_a_later_connection_delivers_what_a_flight_left(bay: Bay, tmp_path: Path) -> None:
    flights = [
        bay.recorded_flight(tmp_path / f"flight_{n}", range(n * 9, n * 9 + 9)) for n in (0, 1)
    ]
    bay.last_flights(*flights)
    async with bay.running(), bay.ground_station() as (_, events):
        await until(lambda: sorted(numbers(events)) == list(range(18)))
