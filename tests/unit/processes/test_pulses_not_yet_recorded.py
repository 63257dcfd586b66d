"""Pulses are sent at once; the flight's database has them seconds later."""

import asyncio
from pathlib import Path
from typing import Any

import pytest
from delivered import numbers
from until import until_async as until

from uavrt.core.messages import Recorded
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.ground.link.delivery_receipts import Receipts


@pytest.mark.timeout(90)
async def test_a_ground_station_that_comes_before_a_pulse_is_recorded_gets_it_afterwards(
    bay: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("uavrt.drone.processes.connection_parts.pulse_path.FIRST_REFILL_NS", 0)
    bay.recorder_quick = False

    async with bay.running():
        info = bay.flight_info(tmp_path / "flight_log_1")
        recorder = FlightRecorder.create(info)
        bay.deliver("flight", info)
        async with bay.ground_station(receipts=Receipts(1)) as (_, first):
            bay.send_pulse(1)
            await until(lambda: numbers(first) == [1])
            # It leaves the memory of the connection: its only reader has it.
            await until(lambda: bay.counter("pulses_acknowledged") == 1)
        async with bay.ground_station(receipts=Receipts(2)) as (_, second):
            # Another pulse shows the new station's store; the first is nowhere to be found.
            bay.send_pulse(2)
            await until(lambda: numbers(second) == [2])
            await asyncio.sleep(1.5)
            posed = [r for topic, r in bay.records if topic == "pulse_pose"]
            recorder.write_pulses(posed)
            recorder.commit()
            bay.deliver("recorded", Recorded(pulses=tuple(one.pulse.key for one in posed)))
            await until(lambda: sorted(numbers(second)) == [1, 2])
        recorder.close()
