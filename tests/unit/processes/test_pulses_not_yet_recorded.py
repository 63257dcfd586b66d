"""Pulses are sent at once; the flight's database has them seconds later."""

import asyncio
from pathlib import Path
from typing import Any

import made
import pytest
from until import until_async as until

from uavrt.core.messages import PulsePose, Recorded
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.ground.link.delivery_receipts import Receipts


@pytest.mark.timeout(90)
async def test_a_ground_station_that_comes_before_a_pulse_is_recorded_gets_it_afterwards(
    bay: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("uavrt.drone.processes.connection_parts.pulse_path.FIRST_REFILL_NS", 0)
    bay.recorder_quick = False
    directory = tmp_path / "flight_log_1"

    def got(events: list[Any]) -> list[int]:
        return [round(e.pulse.frequency_hz) for e in events if isinstance(e, PulsePose)]

    async with bay.running():
        info = made.flight_info(
            directory, start_time_ns=bay.clock.now_ns(), clock_offset_ns=bay.clock.offset_ns
        )
        recorder = FlightRecorder.create(info)
        bay.deliver("flight", info)
        async with bay.ground_station(receipts=Receipts(1)) as (_, first):
            bay.send_pulse(1)
            await until(lambda: len(got(first)) == 1)
            # It leaves the memory of the connection: its only reader has it.
            await until(lambda: bay.counter("pulses_acknowledged") == 1)
        async with bay.ground_station(receipts=Receipts(2)) as (_, second):
            # Another pulse shows the new station's store; the first is nowhere to be found.
            bay.send_pulse(2)
            await until(lambda: len(got(second)) == 1)
            await asyncio.sleep(1.5)
            posed = [r for topic, r in bay.records if topic == "pulse_pose"]
            recorder.write_pulses(posed)
            recorder.commit()
            bay.deliver("recorded", Recorded(pulses=tuple(one.pulse.key for one in posed)))
            await until(lambda: len(got(second)) == 2)
            assert sorted(got(second)) == [148_710_001, 148_710_002]
        recorder.close()
