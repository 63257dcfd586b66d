"""How a station takes up with a vehicle: its session, its number, and two of one number."""

from pathlib import Path

import pytest
from attacked import key_file

from uavrt.core.commands import SystemState
from uavrt.core.errors import CommandRefused
from uavrt.link.tunnel.own_messages.seal import read_key
from world import THESIS_TAG, World


@pytest.mark.parametrize("silent_s", [0.0, 5.0], ids=["at once", "after the drone"])
async def test_the_session_is_announced_under_the_autopilot_s_number_alone(
    tmp_path: Path, silent_s: float
) -> None:
    key = key_file(tmp_path)
    world = World(tmp_path, system_id=4, mavlink={"key_file": str(key)})
    start_ns = world.clock.now_ns()
    restarts = [(at_s, world.restart_autopilot) for at_s in (0.0, 1.4, 2.8, 4.2) if silent_s]
    async with world.flying(restarts), world.station(key=read_key(key)) as (link, _):
        assert world.clock.now_ns() - start_ns >= silent_s * 1e9
        await link.upload_tags([THESIS_TAG])
        assert link.protocol.counters["bad_payloads"] == 0


async def test_an_upload_shared_out_among_two_vehicles_is_named(tmp_path: Path) -> None:
    world = World(tmp_path)
    async with world.flying(), world.station() as (link, _):

        def other_vehicle_took_it(count: int, _total: int) -> None:
            if count == 1:  # the start went to a vehicle of the same number
                world.mission.state = SystemState.IDLE

        with pytest.raises(CommandRefused, match=r"two vehicles use number 1.*MAV_SYS"):
            await link.upload_tags([THESIS_TAG], other_vehicle_took_it)
        await link.upload_tags([THESIS_TAG])
        assert world.mission.state is SystemState.HAS_TAGS
