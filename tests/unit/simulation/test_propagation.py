import math

import numpy as np
import pytest

from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.propagation import (
    SPEED_OF_LIGHT_M_S,
    Fading,
    Link,
    Propagation,
    Wall,
    fading_db,
    ground_reflection,
    link,
    water_loss_db,
)

ISOTROPIC = Antenna(pattern="isotropic", gain_dbi=0.0, polarization="any")
FREQUENCY_HZ = 150e6


def link_over(
    propagation: Propagation,
    distance_m: float,
    *,
    tag_height_m: float = 30.0,
    height_m: float = 30.0,
    antenna: Antenna = ISOTROPIC,
    polarization_deg: float = 90.0,
) -> Link:
    return link(
        propagation,
        antenna,
        tag_ned_m=(distance_m, 0.0, -tag_height_m),
        antenna_ned_m=(0.0, 0.0, -height_m),
        antenna_quaternion_wxyz=(1.0, 0.0, 0.0, 0.0),
        polarization_deg=polarization_deg,
        frequency_hz=FREQUENCY_HZ,
    )


def test_free_space_loses_what_friis_says() -> None:
    wavelength_m = SPEED_OF_LIGHT_M_S / FREQUENCY_HZ
    expected_db = -20 * math.log10(4 * math.pi * 1000.0 / wavelength_m)
    assert link_over(Propagation(), 1000.0).gain_db == pytest.approx(expected_db)
    assert expected_db == pytest.approx(-75.97, abs=0.01)


def test_the_exponent_sets_the_slope() -> None:
    world = Propagation(exponent=3.1)
    near, far = (link_over(world, distance).gain_db for distance in (100.0, 1000.0))
    assert near - far == pytest.approx(31.0)


def test_far_from_the_ground_tag_two_rays_fall_by_40_db_a_decade() -> None:
    # Beyond 4·h·h/λ = 60 m here there are no fringes.
    world = Propagation(model="two_ray")
    near, far = (
        link_over(world, distance, tag_height_m=1.0).gain_db for distance in (3000.0, 30000.0)
    )
    assert near - far == pytest.approx(40.0, abs=0.5)


def test_height_counts_twice_for_a_distant_ground_tag() -> None:
    world = Propagation(model="two_ray")
    low, high = (
        link_over(world, 10000.0, tag_height_m=1.0, height_m=height).gain_db
        for height in (20.0, 40.0)
    )
    assert high - low == pytest.approx(6.0, abs=0.5)


def test_the_ground_turns_the_wave_over_at_grazing_incidence() -> None:
    world = Propagation(model="two_ray")
    for horizontal in (True, False):
        factor = ground_reflection(world, 1e-4, FREQUENCY_HZ, horizontal=horizontal)
        assert factor == pytest.approx(-1.0, abs=0.01)
    assert abs(ground_reflection(world, 0.26, FREQUENCY_HZ, horizontal=False)) < 0.2


def test_a_wall_beside_the_path_makes_fringes_and_one_behind_makes_none() -> None:
    beside = Propagation(wall=(Wall(north_m=0.0, east_m=-20.0, facing_deg=90.0),))
    levels = [link_over(beside, distance).gain_db for distance in np.arange(50.0, 80.0, 0.25)]
    free = [link_over(Propagation(), d).gain_db for d in np.arange(50.0, 80.0, 0.25)]
    difference = np.subtract(levels, free)
    assert difference.max() > 1.0
    assert difference.min() < -1.0
    away = Propagation(wall=(Wall(north_m=0.0, east_m=-20.0, facing_deg=270.0),))
    assert link_over(away, 60.0).gain_db == link_over(Propagation(), 60.0).gain_db


def test_an_upright_wave_meets_a_flat_antenna_badly() -> None:
    antenna = Antenna(pattern="RA-23K", cross_polarization_db=-15.0)
    flat, upright = (
        link_over(Propagation(), 500.0, antenna=antenna, polarization_deg=angle).gain_db
        for angle in (90.0, 0.0)
    )
    assert flat - upright == pytest.approx(15.0, abs=0.01)


def test_the_geometry_of_a_link_is_that_of_a_map() -> None:
    way = link(
        Propagation(),
        ISOTROPIC,
        tag_ned_m=(0.0, -300.0, -1.0),
        antenna_ned_m=(0.0, 0.0, -301.0),
        antenna_quaternion_wxyz=(1.0, 0.0, 0.0, 0.0),
        polarization_deg=90.0,
        frequency_hz=FREQUENCY_HZ,
    )
    assert way.bearing_deg == pytest.approx(270.0)
    assert way.elevation_deg == pytest.approx(-45.0)
    assert way.off_boresight_deg == pytest.approx(90.0)
    assert way.distance_m == pytest.approx(300.0 * math.sqrt(2.0))


def test_water_takes_a_step_at_the_surface_and_some_for_every_metre() -> None:
    assert water_loss_db(0.0, 0.01) == 0.0
    assert water_loss_db(1e-9, 0.01) == pytest.approx(4.44, abs=0.01)
    assert water_loss_db(2.0, 0.01) - water_loss_db(1.0, 0.01) == pytest.approx(1.82, abs=0.01)


def test_lognormal_fading_has_its_deviation_and_its_correlation_time() -> None:
    fading = Fading(kind="lognormal", sigma_db=4.0, correlation_time_s=2.0)
    apart = np.array([fading_db(fading, 1, 7, 20.0 * n) for n in range(2000)])
    assert apart.std() == pytest.approx(4.0, rel=0.06)
    assert apart.mean() == pytest.approx(0.0, abs=0.3)
    later = np.array([fading_db(fading, 1, 7, 20.0 * n + 2.0) for n in range(2000)])
    assert np.corrcoef(apart, later)[0, 1] == pytest.approx(math.exp(-1.0), abs=0.07)


def test_rician_fading_keeps_the_mean_power() -> None:
    fading = Fading(kind="rician", k_factor_db=6.0, correlation_time_s=0.1)
    power = 10 ** (np.array([fading_db(fading, 1, 3, 2.0 * n) for n in range(3000)]) / 10)
    assert power.mean() == pytest.approx(1.0, abs=0.05)
    # Var = (1 + 2K)/(1 + K)² for the power of a Rician wave, K = 3.98.
    assert power.var() == pytest.approx(0.361, rel=0.15)
