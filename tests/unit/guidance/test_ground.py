"""Heights by a map of the ground: hills on the way, on the way home, and maps that are off."""

from typing import Any

import numpy as np
import pytest
from flown import HOME, Flown
from numpy.typing import NDArray
from searched import Animal, Searched
from some import some

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import PlanError
from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.ground_heights import GroundAround
from uavrt.guidance.operator_orders import Limits
from uavrt.simulation.vehicle.airframe import Flavour

BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
PLANE = TangentPlane(latitude_deg=HOME.latitude_deg, longitude_deg=HOME.longitude_deg)
Floats = NDArray[np.float64]


def hill(latitude: Floats, longitude: Floats) -> Floats:
    """45 m high, 100 m north of home; beyond 250 m east nothing is known."""
    east, north = (np.asarray(one) for one in PLANE.to_local(latitude, longitude))
    high = 430.0 + 45.0 * np.exp(-(((north - 100.0) / 30.0) ** 2 + (east / 30.0) ** 2))
    return np.where(east > 250.0, np.nan, high)


def limits(off_m: float = 0.0, **values: Any) -> Limits:
    ground = GroundAround.around(lambda a, b: hill(a, b) + off_m, PLANE, 400.0)
    return Limits(battery_wh=160.0, fence_m=400.0, ground=ground, **values)


def flying(
    flavour: Flavour, at: tuple[float, float] = (0.0, 0.0), height_m: float = 40.0
) -> Flown:
    flown = Flown(flavour, limits=limits())
    flown.vehicle.body.north_m, flown.vehicle.body.east_m = at
    flown.vehicle.body.height_m = height_m
    flown.run(0.2)
    return flown


@BOTH
@pytest.mark.parametrize(
    ("start", "goal"),
    [((0.0, 0.0), (100.0, 0.0)), ((0.0, 0.0), (250.0, 0.0)), ((220.0, 180.0), (220.0, 0.0))],
    ids=["on it", "over it", "home over it"],
)
def test_a_way_too_near_to_a_hill_is_refused_with_the_height_it_needs(
    flavour: Flavour, start: tuple[float, float], goal: tuple[float, float]
) -> None:
    flown = flying(flavour, start)
    with pytest.raises(PlanError, match=r"need 6[0-9] m above home"):
        flown.order("goto", places=(flown.place(*goal),), height_m=45.0)
    assert flown.authority.standing is ControlStage.OUT


def test_it_flies_over_a_hill_from_the_height_that_it_needs() -> None:
    flown = flying("px4", height_m=75.0)
    flown.order("goto", places=(flown.place(250.0, 0.0),), height_m=75.0)
    low = flying("px4", height_m=40.0)
    with pytest.raises(PlanError, match="Climb first"):  # it may climb as late as it likes
        low.order("goto", places=(low.place(250.0, 0.0),), height_m=75.0)


@pytest.mark.parametrize("action", ["hold", "rotate"])
def test_beside_a_hill_nothing_sinks_below_the_way_home(action: str) -> None:
    flown = flying("px4", (220.0, 0.0), 80.0)
    with pytest.raises(PlanError, match="above home"):
        flown.order(action, height_m=40.0)
    flown.order(action, height_m=70.0)


def test_where_the_map_knows_nothing_there_is_no_descent() -> None:
    flown = flying("px4", (0.0, 300.0), 80.0)
    with pytest.raises(PlanError, match="map has no data"):
        flown.order("hold", height_m=60.0)
    with pytest.raises(PlanError, match="map has no data"):
        flown.order("goto", places=(flown.place(0.0, 150.0),), height_m=60.0)
    flown.order("hold", height_m=80.0)


@pytest.mark.parametrize("off_m", [-16.0, 16.0, 47.0])
def test_a_map_that_is_off_at_home_is_not_flown_by(off_m: float) -> None:
    flown = Flown("px4", limits=limits(off_m))
    with pytest.raises(PlanError, match="from the elevation map"):
        flown.order("hold")
    Flown("px4", limits=limits(14.0)).order("hold")


def test_a_map_without_home_is_refused() -> None:
    with pytest.raises(PlanError, match="does not cover home"):
        GroundAround.around(lambda a, b: a * np.nan, PLANE, 400.0)


@BOTH
def test_it_holds_and_asks_when_home_leaves_the_map_in_flight(flavour: Flavour) -> None:
    flown = flying(flavour, (0.0, -50.0), 60.0)
    execution = flown.order("goto", places=(flown.place(0.0, -350.0),), height_m=60.0)
    flown.run(8.0)
    # The barometer's height above home drifts from the altitude: as the map sees it.
    execution._limits = limits(20.0)
    flown.run(12.0)
    place = flown.vehicle.body.place_m
    flown.run(10.0)
    assert "from the elevation map: holding" in execution.status_text
    assert np.hypot(*np.subtract(flown.vehicle.body.place_m, place)) < 2.0
    assert flown.authority.standing is ControlStage.IN_COMMAND


def test_a_search_keeps_its_height_above_a_hill_and_on_the_way_home() -> None:
    given = limits(keep_away_m=0.0, speed_m_s=8.0)
    search = Searched("px4", [Animal(180.0, 20.0)], limits=given, duration_s=60.0)
    search.flown.vehicle.body.height_m = 45.0
    search.flown.run(0.3)
    search.begin()
    ground = some(given.ground)
    least = np.inf
    for _ in range(1500):
        search.step()
        if search.out:
            break
        north, east = search.flown.vehicle.body.place_m
        x, y = np.array([east]), np.array([north])
        high = max(float(ground.above_home_m(x, y)[0]), float(ground.highest_home_m(x, y)[0]))
        least = min(least, 45.0 - high)
    assert least >= 20.0 - 3.0


def test_no_square_is_lower_than_what_lies_in_it() -> None:
    ground = some(limits().ground)
    rng = np.random.default_rng(2)
    east, north = rng.uniform(-200.0, 200.0, (2, 500))
    true = hill(*(np.asarray(one) for one in PLANE.to_geodetic(east, north))) - 430.0
    assert (ground.above_home_m(east, north) >= true - 0.8).all()
    assert np.isnan(ground.above_home_m(np.array([300.0, 900.0]), np.array([0.0, 0.0]))).all()
