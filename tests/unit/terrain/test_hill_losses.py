"""What hills take from a flight's pulses: as the view from each place, remembered, bounded."""

import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.localization.terrain.elevation import Elevation
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.localization.terrain.squares import ground_grid
from uavrt.localization.terrain.viewshed import terrain_loss_map
from uavrt_experiments.search.terrain import PLANE, elevation_of

_Floats = NDArray[np.float64]
SIDES = {"west": -1.0, "east": 1.0, "south": -1.0, "north": 1.0}


def ridge(east_m: _Floats, north_m: _Floats) -> _Floats:
    """60 m high, 200 m east of the take-off, from south to north."""
    return np.asarray(400.0 + 60.0 * np.exp(-(((east_m - 200.0) / 60.0) ** 2)) + 0.0 * north_m)


def around(elevation: Elevation) -> HillLosses:
    return HillLosses(
        elevation, latitude_deg=PLANE.latitude_deg, longitude_deg=PLANE.longitude_deg
    )


def test_losses_are_those_of_the_view_from_the_drone() -> None:
    elevation = elevation_of(ridge)
    hills = around(elevation)
    east, north = np.array([-300.0, 150.0, 350.0, 480.0]), np.array([0.0, 50.0, -40.0, 200.0])
    sides = {f"{side}_m": sign * 510.0 for side, sign in SIDES.items()}
    ground = ground_grid(elevation, PLANE, **sides, cell_m=10.0)
    view = terrain_loss_map(
        ground, east_m=-100.0, north_m=0.0, antenna_m=40.0, tag_m=0.5, frequency_hz=150e6
    )
    row, column = (np.rint((one + 510.0) / 10.0).astype(int) for one in (north, east))
    lost = hills.loss_db((-100.0, 0.0, 40.0), east, north)
    assert lost == pytest.approx(view[row, column], abs=1.5)
    assert lost[2] > 15.0
    assert lost[0] < 1.0
    rise_m = hills.rise_m(np.array([200.0, 0.0]), np.zeros(2))
    assert rise_m == pytest.approx([60.0, 0.0], abs=4.0)


def test_a_plane_with_another_origin_reads_the_same_ground() -> None:
    hills = around(elevation_of(ridge))
    latitude, longitude = PLANE.to_geodetic(120.0, -80.0)
    other = hills.in_plane(
        TangentPlane(latitude_deg=float(latitude), longitude_deg=float(longitude))
    )
    there = hills.loss_db((0.0, 0.0, 40.0), np.array([350.0]), np.array([60.0]))
    same = other.loss_db((-120.0, 80.0, 40.0), np.array([230.0]), np.array([140.0]))
    assert same == pytest.approx(there, abs=0.05)


def test_a_long_way_costs_a_bounded_number_of_views() -> None:
    hills = around(elevation_of(ridge))
    rng = np.random.default_rng(4)
    east, north = rng.uniform(-450.0, 450.0, (2, 2000))
    seen = hills.seen_from(east, north, np.full(2000, 60.0))
    assert len(seen.maps) <= 100
    assert len(hills.rough().seen_from(east, north, np.full(2000, 60.0)).maps) <= 40
    lost = seen(np.array([300.0]), np.array([0.0]))
    assert lost.shape == (1, 2000)
    west = east < 0.0
    assert np.median(lost[0, west]) > np.median(lost[0, ~west]) + 5.0


def test_ground_that_nobody_knows_is_level_and_told() -> None:
    hills = HillLosses(elevation_of(ridge), latitude_deg=10.0, longitude_deg=10.0)
    assert hills.level
    assert "do not cover the flight" in hills.cautions()[0]
    assert not hills.loss_db((0.0, 0.0, 40.0), np.array([300.0]), np.zeros(1)).any()


def test_a_void_is_told() -> None:
    def with_void(east_m: _Floats, north_m: _Floats) -> _Floats:
        return np.where(north_m > 250.0, np.nan, ridge(east_m, north_m))

    hills = around(elevation_of(with_void))
    hills.cover([400.0], [400.0])
    (told,) = hills.cautions()
    assert "have no height for 2" in told  # a quarter of the ground


def test_who_asks_the_same_again_is_answered_from_memory_and_others_are_not() -> None:
    hills = around(elevation_of(ridge))
    latitude, longitude = PLANE.to_geodetic(120.0, -80.0)
    east, north, up = np.array([0.0, 40.0]), np.array([0.0, 9.0]), np.array([40.0, 40.0])
    first = hills.seen_from(east, north, up)
    assert hills.seen_from(east.copy(), north, up) is first
    others = [
        hills.at(450e6).seen_from(east, north, up),
        hills.rough().seen_from(east, north, up),
        hills.seen_from(east, north, up + 30.0),
        hills.in_plane(
            TangentPlane(latitude_deg=float(latitude), longitude_deg=float(longitude))
        ).seen_from(east, north, up),
    ]
    behind = np.array([350.0]), np.array([60.0])
    lost = [float(one.between(np.intp(0), *behind)[0]) for one in (first, *others)]
    assert len({round(one, 3) for one in lost}) == 5
