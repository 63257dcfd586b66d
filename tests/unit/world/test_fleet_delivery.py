"""Five drones deliver to one ground station, each over a radio that loses a fifth both ways."""

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path

from asked_page import AskedPage

from uavrt.core.commands import SystemState
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.simulation.demo.demo_programs import free_udp_port
from world import THESIS_TAG, World, until

VEHICLES, PULSES, PULSES_HZ, LOSS = 5, 64, 8.0, 0.2


async def test_no_pulse_of_five_drones_is_missing_at_20_percent_loss(tmp_path: Path) -> None:
    numbers, port = range(1, VEHICLES + 1), free_udp_port()
    drones = {
        number: World(tmp_path / str(number), ground_port=port, system_id=number, seed=number)
        for number in numbers
    }
    page = AskedPage(
        tmp_path / "ground", f"udpin://127.0.0.1:{port}", further_vehicles=tuple(numbers)[1:]
    )
    async with page.served(), AsyncExitStack() as stack:
        await stack.enter_async_context(drones[1].flying())
        await page.until(lambda state: state["drone"]["system_id"] == 1)
        for number in tuple(numbers)[1:]:
            await stack.enter_async_context(drones[number].flying())
        for drone in drones.values():
            drone.radio.loss = LOSS
            drone.detect(THESIS_TAG)
        sessions = page.station.fleet.sessions
        assert len(sessions) == VEHICLES
        await until(
            lambda: all(one.vehicle.drone.state is SystemState.DETECTING for one in sessions)
        )
        for number in range(PULSES):
            for drone in drones.values():
                drone.find_pulse(number)
            await asyncio.sleep(1.0 / PULSES_HZ)
        await until(
            lambda: all(one.vehicle.flight.keeper.pulses == PULSES for one in sessions), 60.0
        )
        flights = (await page.ask("GET", "/api/flights")).json
        assert {one["vehicle"] for one in flights} == {str(number) for number in numbers}
        for one in flights:
            recorded = read_flight(page.directory / one["flight_id"]).pulse_poses
            assert len({pulse.pulse.start_time_ns for pulse in recorded}) == PULSES
        assert all(drone.radio.lost > 0.1 * PULSES for drone in drones.values())
