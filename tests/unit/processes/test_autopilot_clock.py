"""The autopilot's clock as PX4 1.17 tells it: answers to nobody, and 1.5 % slow."""

import asyncio
from dataclasses import replace
from typing import Any

import pytest
from until import until_async as until

from uavrt.core.earth.attitude import euler_deg
from uavrt.core.messages import PulsePose, StatusText
from uavrt.core.units import ns_from_s
from uavrt.link.mavlink import component
from uavrt.link.mavlink.autopilot import timesync


def yaw_error_deg(bay: Any, item: PulsePose) -> float:
    assert item.pose is not None
    told = euler_deg(item.pose.quaternion_wxyz)[0]
    truth = euler_deg(bay.vehicle(item.pose.time_ns).quaternion_wxyz)[0]
    return abs((told - truth + 180.0) % 360.0 - 180.0)


def pulse_poses(bay: Any) -> list[PulsePose]:
    return [record for topic, record in bay.records if topic == "pulse_pose"]


async def test_poses_are_right_by_a_slow_clock_that_answers_to_random_targets(bay: Any) -> None:
    bay.autopilot_settings = replace(
        bay.autopilot_settings, clock_skew_ppm=-15_000.0, companion_jitter_s=0.003
    )
    async with bay.running():
        await until(lambda: bay.process._link.component.time_sync.round_trips >= 24)
        for number in range(40):
            bay.send_pulse(number)
            await asyncio.sleep(0.1)
        await until(lambda: len(pulse_poses(bay)) == 40)
        known = bay.process._link.counters()
        assert known["clock_skew_ppm"] == pytest.approx(15_000.0, abs=1_500.0)
        assert known["clock_residual_ms"] < 5.0
        assert known.get("timesync_foreign", 0) == 0
    errors = [yaw_error_deg(bay, item) for item in pulse_poses(bay)]
    assert max(errors) <= 1.5
    assert sum(error**2 for error in errors) / len(errors) <= 0.5**2


async def test_poses_by_an_extrapolated_clock_are_marked_and_the_operator_is_warned(
    bay: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (timesync, component):
        monkeypatch.setattr(module, "STALE_NS", ns_from_s(2.5))
    async with bay.running():
        await until(lambda: bay.process._link.component.time_sync.round_trips >= 20)
        bay.send_pulse(1)
        await until(lambda: len(pulse_poses(bay)) == 1)
        bay.autopilot._settings = replace(bay.autopilot._settings, mute_clock=True)
        await until(lambda: bay.process._link.clock_is_stale)
        bay.send_pulse(2)
        await until(lambda: len(pulse_poses(bay)) == 2)
        stale = {fault.text for fault in bay.process._poses.faults()}
        bay.autopilot._settings = replace(bay.autopilot._settings, mute_clock=False)
        await until(lambda: not bay.process._link.clock_is_stale)
        bay.send_pulse(3)
        await until(lambda: len(pulse_poses(bay)) == 3)
        assert bay.counter("poses_on_stale_clock") >= 1
        assert bay.process._poses.faults() == []
    marked = [item.pose is not None and item.pose.extrapolated for item in pulse_poses(bay)]
    assert marked == [False, True, False]
    texts = [record.text for _, record in bay.records if isinstance(record, StatusText)]
    assert stale
    assert stale <= set(texts), "the ground is reminded of what was reported"
