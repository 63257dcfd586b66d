"""Wind and power on their way: from the autopilot to the guide, and into what it plans."""

from typing import Any

import pytest
from flown import Flown
from some import some
from tests.unit.processes.test_guide import Hub, ready
from tests.unit.processes.test_motion_handler import Link
from virtual_time import VirtualClock

from uavrt.config.settings import GuidanceSettings
from uavrt.drone.processes import guide
from uavrt.guidance.vehicle_reports import now_of
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.vehicle_messages import WATCHED_HZ, wind_of
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.commanded_vehicle import REQUESTABLE_IDS
from uavrt.simulation.vehicle.vehicle_telemetry import wind_message

BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
BLOWS = (-3.0, 4.0)
"""North and east: out of the north-west, towards the south-east."""


def test_arducopters_wind_is_named_by_where_it_comes_from() -> None:
    west = dialect.Wind(direction=-90.0, speed=5.0)
    assert wind_of(west) == pytest.approx((5.0, 0.0))
    north = dialect.Wind(speed=5.0)
    assert wind_of(north) == pytest.approx((0.0, -5.0))


@pytest.mark.parametrize("speed", [float("nan"), float("inf"), 1e6])
def test_a_wind_that_cannot_be_is_none(speed: float) -> None:
    assert wind_of(dialect.Wind(direction=10.0, speed=speed)) is None
    values = dict.fromkeys(dialect.WindCov.__slots__, 0.0) | {"time_usec": 0, "wind_x": speed}
    assert wind_of(dialect.WindCov(**values)) is None  # type: ignore[arg-type]


@BOTH
def test_the_motion_handler_reports_the_wind_until_it_is_old(flavour: Flavour) -> None:
    link = Link(flown=Flown(flavour, frame=Frame(wind_m_s=BLOWS)))
    message = wind_message(link.flown.vehicle, 1000)
    assert message.ID in WATCHED_HZ
    assert message.ID in REQUESTABLE_IDS[flavour]
    link.run(10.0)
    wind = some(some(now_of(link.reports[-1], 0.0)).wind)
    assert (wind.east_m_s, wind.north_m_s) == pytest.approx((4.0, -3.0))
    link.flown.wind_told = False
    link.run(32.0)
    assert link.reports[-1].wind_m_s is None


def far(hub: Hub) -> str:
    place = hub.flown.place(480.0, 0.0)
    return hub.ask("goto", places=(place,), height_m=60.0).summary


def test_the_settings_reach_what_is_planned() -> None:
    guidance = GuidanceSettings(
        airspeed_m_s=15.0, wind_m_s=7.0, return_height_m=25.0, hover_w=900.0
    )
    limits = guide.limits_of(guidance)
    assert (limits.airspeed_m_s, limits.wind_m_s) == (15.0, 7.0)
    assert (limits.return_height_m, limits.hover_w) == (25.0, 900.0)
    assert far(ready(hover_w=300.0)).startswith("fly to")
    refused = far(ready(hover_w=1200.0))
    assert "route, return and reserve need" in refused


def test_an_order_is_judged_by_the_wind_that_is_told() -> None:
    hub = ready(hover_w=400.0)
    hub.guide.receive("vehicle", hub.report(wind_m_s=(0.0, 11.5)))
    assert "wind of 12 m/s" in far(hub)


def test_the_guide_learns_over_all_its_orders(clock_of_test: VirtualClock) -> None:
    """Two minutes of reports of a drone that takes thrice what is believed."""
    hub = ready()
    offer = hub.ask("hold")
    flying: dict[str, Any] = {
        "standing": "in command",
        "order_id": offer.order_id,
        "obeyed": True,
    }
    for second in range(120):
        clock_of_test.now_s += 1.0
        used = 100.0 * 1200.0 * second / 3600.0 / 120.0
        report = hub.report(**flying, battery_percent=round(90.0 - used))
        hub.guide.receive("vehicle", report)
    assert hub.guide.counters()["lessons_of_power"] >= 3.0
    assert hub.guide.counters()["hover_w"] == pytest.approx(1200.0, rel=0.15)
    hub.guide.receive("vehicle", hub.report())  # out again: the next order knows it, too
    assert "reserve need" in far(hub)
