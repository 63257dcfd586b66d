"""The thesis's §5.4, by model and through links."""

import asyncio
from dataclasses import replace

import made
import pytest

from uavrt.core.clock import Clock
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.vehicle.fake_autopilot import AutopilotSettings, FakeAutopilot
from uavrt_experiments.capacity.links import run_links
from uavrt_experiments.capacity.model import model_row, our_sender_row
from uavrt_experiments.capacity.thesis import COUNTS, GAPS_MS


@pytest.mark.parametrize("count", COUNTS)
def test_the_simulated_autopilot_reproduces_the_thesis_within_seven_percent(count: int) -> None:
    rows = [model_row(count, gap_ms) for gap_ms in GAPS_MS]
    assert [row for row in rows if not row.result.met] == []
    assert all(row.received + row.dropped_by_autopilot == count for row in rows)


def test_another_autopilot_would_not_pass_for_the_thesiss() -> None:
    assert not replace(model_row(1000, 2), received=700).result.met


@pytest.mark.parametrize("gap_s", [0.012, 0.020])
def test_our_sender_loses_none_in_4_ms_and_8_ms_loops(gap_s: float) -> None:
    for pass_ns in (4_000_000, 8_333_333):
        row = our_sender_row(1500, gap_s, pass_ns)
        assert (row.received, row.dropped_by_autopilot) == (1500, 0)


async def test_through_links_every_loss_is_the_autopilots() -> None:
    companion, ground = ("127.0.0.1", free_udp_port()), ("127.0.0.1", free_udp_port())
    autopilot = FakeAutopilot(
        made.pose, AutopilotSettings(companion=companion, ground=ground), Clock.start()
    )
    task = asyncio.create_task(autopilot.run())
    try:
        here, there = (f"udpin://{host}:{port}" for host, port in (companion, ground))
        rows = await run_links(here, there, (60,), (0, 20))
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    together, apart, ours = rows
    assert together.received < 20
    assert all(row.between == 60 - row.received for row in rows)
    # A busy machine holds up a pass, which then meets messages that were 20 ms apart.
    assert apart.received >= 45
    assert (ours.ours, ours.received) == (True, 60)
    lost = sum(row.between for row in rows)
    assert autopilot.counters()["dropped_to_ground"] == lost
