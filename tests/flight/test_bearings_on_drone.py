"""Bearings on the drone, by its row in the table: a link that loses most still brings one."""

from dataclasses import replace
from typing import Any

import pytest
from listening import linked
from until import until_async as until

from uavrt.config.settings import BearingSettings
from uavrt.core.errors import LinkError
from uavrt.core.messages import LiveBearing, PulsePose
from uavrt.localization.angles import difference_deg
from uavrt.simulation.scene.flight import Flight, Leg


@pytest.mark.timeout(150)
async def test_a_link_that_loses_half_of_all_messages_brings_a_bearing_of_all_pulses(
    drone_bay: Any, thesis_scenario: Any
) -> None:
    # It turns a circle in 20 s: before half of one, a beam fits ahead and astern.
    turning = Flight(height_m=40.0, leg=(Leg(duration_s=120.0, turn_deg=6 * 360.0),))
    drone = drone_bay.launch(
        replace(thesis_scenario, flight=turning),
        autopilot_options=("--ground-loss", "0.5", "--seed", "3"),
        bearings=BearingSettings(on_drone=True),
    )
    bearings: list[LiveBearing] = []
    pulses: list[PulsePose] = []

    def take(event: object) -> None:
        if isinstance(event, LiveBearing):
            bearings.append(event)
        if isinstance(event, PulsePose):
            pulses.append(event)

    def sure() -> list[LiveBearing]:
        return [one for one in bearings if one.accepted and not one.ambiguous]

    # Without receipts, as a plain ground station: a lost pulse is lost.
    options = {"on_event": take, "ack_wait_s": 0.5, "generation": "G0"}
    async with linked(drone.ground_port, **options) as link:
        for command in (lambda: link.upload_tags(thesis_scenario.tags), link.start_detection):
            for _ in range(8):
                try:
                    await command()
                    break
                except LinkError:
                    continue
        await until(sure)
    found = sure()[-1]
    assert found.tag_id == 2
    truth = 21.8  # 150 m north, 60 m east; the drone turns over its home
    assert abs(difference_deg(found.bearing_deg, truth)) < 45.0
    assert found.pulses > len([one for one in pulses if one.pose is not None])
