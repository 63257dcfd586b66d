"""An upload that one vehicle opens and another one refuses: both answer under one number."""

from pathlib import Path

import pytest

from uavrt.core.commands import SystemState
from uavrt.core.errors import CommandRefused
from world import THESIS_TAG, World


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
