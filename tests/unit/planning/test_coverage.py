"""The probability that a tag is heard, at each place of a map."""

from dataclasses import replace

import made
import numpy as np
import pytest
from numpy.typing import NDArray
from some import some

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.detection.sensitivity import enr_needed_db
from uavrt.localization.antenna import pattern_named
from uavrt.localization.headings import Headings
from uavrt.localization.terrain.squares import GroundGrid
from uavrt.planning.detectability.detection_coverage import (
    AntennaPath,
    Coverage,
    absence,
    coverage_of,
    planned_antenna_path,
)
from uavrt.planning.detectability.link_budget import LinkBudget
from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.propagation import Propagation
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.world import World

_Floats = NDArray[np.float64]
TAG = made.tag(2, 150e6, interval_uncertainty_s=0.06, interval_jitter_s=0.01)
BUDGET = LinkBudget(
    frequency_hz=150e6, pulse_width_s=0.02, tag_eirp_dbm=-50.0, drone_height_m=60.0
)


def land(height_m: NDArray[np.floating], cell_m: float = 50.0) -> GroundGrid:
    """Squares around home, which is in the middle."""
    rows, columns = height_m.shape
    return GroundGrid(
        plane=TangentPlane(latitude_deg=47.0, longitude_deg=8.0),
        west_m=-cell_m * (columns // 2),
        south_m=-cell_m * (rows // 2),
        cell_m=cell_m,
        known=np.ones(height_m.shape, bool),
        height_m=height_m.astype(np.float32),
    )


def hovering(count: int, **more: object) -> AntennaPath:
    zero = np.zeros(count)
    return AntennaPath(
        time_s=1.254 * np.arange(count, dtype=np.float64),
        east_m=zero,
        north_m=zero,
        height_m=zero + 60.0,
        **more,  # type: ignore[arg-type]
    )


def test_over_level_ground_a_group_is_heard_to_the_range_that_the_budget_tells() -> None:
    ground = land(np.zeros((5, 241)))
    found = coverage_of(ground, hovering(3), TAG, BUDGET, level_sigma_db=0.0, hills=False)
    east = ground.east_m[120:]
    for probability in (0.9, 0.5):
        told = BUDGET.distance_m(enr_needed_db(TAG, probability))
        reached = east[found.heard[2, 120:] >= probability].max()
        assert reached == pytest.approx(some(told), abs=60.0)


def test_the_ground_of_elevation_files_that_is_level_changes_nothing() -> None:
    ground = land(np.full((41, 41), 700.0))
    flat = coverage_of(ground, hovering(3), TAG, BUDGET, hills=False)
    hills = coverage_of(ground, hovering(3), TAG, BUDGET, hills=True)
    assert hills.heard == pytest.approx(flat.heard, abs=0.03)


def test_behind_a_ridge_less_is_heard_and_before_it_as_much() -> None:
    height = np.zeros((41, 81))
    height[:, 50:53] = 120.0
    over = coverage_of(land(height), hovering(6), TAG, BUDGET)
    level = coverage_of(land(np.zeros((41, 81))), hovering(6), TAG, BUDGET)
    assert over.heard[:, :48] == pytest.approx(level.heard[:, :48], abs=0.05)
    assert over.heard[20, 55:62].max() < level.heard[20, 55:62].min() - 0.3


def test_an_antenna_hears_ahead_and_a_turned_one_to_that_side() -> None:
    ground = land(np.zeros((61, 61)))
    for yaw_deg, ahead in ((90.0, (30, 50)), (0.0, (50, 30))):
        way = hovering(3, headings=Headings.level(np.full(3, yaw_deg)))
        found = coverage_of(ground, way, TAG, BUDGET, pattern=pattern_named("RA-23K"))
        behind = (60 - ahead[0], 60 - ahead[1])
        assert found.heard[ahead] > found.heard[behind] + 0.2


def test_a_whip_does_not_hear_what_lies_below_it() -> None:
    ground = land(np.zeros((41, 41)), cell_m=5.0)
    weak = replace(BUDGET, tag_eirp_dbm=-75.0)
    way = hovering(3, headings=Headings.level(np.full(3, 90.0)))
    alike, whip = (
        coverage_of(ground, way, TAG, weak, pattern=pattern_named(name), level_sigma_db=0.0)
        for name in ("isotropic", "monopole")
    )
    assert alike.heard[20, 20] > 0.9
    assert whip.heard[20, 20] < 0.1
    assert whip.heard[20, 40] == pytest.approx(whip.heard[0, 20], abs=1e-6)


def test_a_noisy_drone_hears_less() -> None:
    ground = land(np.zeros((61, 61)))
    quiet = coverage_of(ground, hovering(3), TAG, BUDGET, hills=False)
    noisy = coverage_of(
        ground, hovering(3, noise_db=np.full(3, 10.0)), TAG, BUDGET, hills=False
    )
    assert noisy.mean < quiet.mean - 0.1


def test_where_the_ground_is_not_known_there_is_no_figure() -> None:
    ground = land(np.zeros((21, 21)))
    ground.known[3, 4] = False
    found = coverage_of(ground, hovering(3), TAG, BUDGET)
    assert np.isnan(found.heard[3, 4])
    assert np.isfinite(found.heard).sum() == 440


def test_a_way_is_flown_at_its_speed_and_nose_first() -> None:
    way = planned_antenna_path(
        [(0.0, 0.0), (100.0, 0.0), (100.0, -50.0)],
        height_m=40.0,
        speed_m_s=10.0,
        interval_s=1.0,
        nose_first=True,
    )
    assert len(way.time_s) == 16
    assert (way.east_m[7], way.north_m[7]) == (70.0, 0.0)
    assert (way.east_m[12], way.north_m[12]) == (100.0, -20.0)
    assert some(way.headings).yaw_deg[[3, 13]].tolist() == [90.0, 180.0]


def test_silence_where_a_tag_would_have_been_heard_says_that_it_is_elsewhere() -> None:
    ground = land(np.zeros((10, 10)))
    heard = np.zeros((10, 10), np.float32)
    heard[:, :5] = 0.9
    inside = np.zeros((10, 10), bool)
    inside[:, :5] = True
    found = absence(Coverage(ground=ground, heard=heard, groups=3), inside, None)
    assert found.prior == 0.5
    assert found.not_here == pytest.approx(1.0 - 0.05 / 0.55)
    told = absence(Coverage(ground=ground, heard=heard, groups=3), inside, 0.2)
    assert told.not_here == pytest.approx(1.0 - 0.02 / 0.82)


def test_unknown_ground_is_no_reason_to_say_that_a_tag_is_not_there() -> None:
    ground = land(np.zeros((10, 10)))
    heard = np.full((10, 10), np.nan, np.float32)
    inside = np.ones((10, 10), bool)
    found = absence(Coverage(ground=ground, heard=heard, groups=3), inside, 0.3)
    assert found.not_here == pytest.approx(0.7)


def hill(north_m: _Floats, east_m: _Floats) -> _Floats:
    """A long ridge to the east, over a slope that falls to the south."""
    return np.asarray(70.0 * np.exp(-(((east_m - 700.0) / 120.0) ** 2)) + 0.03 * north_m)


def test_the_simulated_world_loses_behind_hills_what_the_map_says() -> None:
    """Two implementations that share no code: levels of pulses, tag by tag."""
    rng = np.random.default_rng(11)
    places = [(float(n), float(e)) for n, e in rng.uniform(-1400.0, 1400.0, (40, 2))]
    scenario = Scenario(
        seed=1,
        antenna=Antenna(pattern="isotropic", gain_dbi=4.0, polarization="any"),
        propagation=Propagation(model="two_ray", doppler=False),
        flight=Flight(height_m=60.0, wobble_deg=0.0, leg=(Leg(duration_s=5.0),)),
        tag=tuple(
            made.simulated_tag(number, 150e6, north_m=north, east_m=east, erp_dbm=-50.0)
            for number, (north, east) in enumerate(places, start=1)
        ),
    )
    north, east = np.meshgrid(
        np.arange(-1500.0, 1501.0, 10.0), np.arange(-1500.0, 1501.0, 10.0)
    )
    ground = land(hill(north.T, east.T), cell_m=10.0)
    from uavrt.planning.detectability.detection_coverage import _View

    budget = LinkBudget(
        frequency_hz=150e6,
        pulse_width_s=0.02,
        tag_eirp_dbm=-50.0,
        drone_height_m=60.0,
        mismatch_db=0.0,
    )
    energies = 10.0 * np.log10(_View(ground, budget, None, hovering(1), hills=True).energies(0))
    world = World(scenario, ground=hill)
    apart = []
    for tag, (n, e) in zip(scenario.tag, places, strict=True):
        told = energies[round((n + 1500.0) / 10.0), round((e + 1500.0) / 10.0)]
        apart.append(world.pulse(tag, 0).enr_db - float(told))
    assert sum(e > 900.0 for _, e in places) > 3  # behind the ridge
    # Cells are 10 m wide, and the simulated world's edge is Fresnel's own: 0.3 dB.
    assert np.abs(np.median(apart)) < 0.1
    assert np.abs(apart).max() < 0.6
