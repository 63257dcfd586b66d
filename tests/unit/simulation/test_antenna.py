import math

import pytest

from uavrt.simulation.scene import geometry
from uavrt.simulation.scene.antenna import PATTERNS_DB, Antenna, pattern_db, polarization_db


def towards(azimuth_deg: float, elevation_deg: float = 0.0) -> geometry.Vector:
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    return (
        math.cos(elevation) * math.cos(azimuth),
        math.cos(elevation) * math.sin(azimuth),
        -math.sin(elevation),
    )


@pytest.mark.parametrize("name", ["RA-2A", "RA-23K"])
def test_a_pattern_has_its_table_values_on_both_sides(name: str) -> None:
    antenna = Antenna(pattern=name)  # type: ignore[arg-type]
    for step, level_db in enumerate(PATTERNS_DB[name]):
        assert pattern_db(antenna, towards(10.0 * step)) == pytest.approx(level_db, abs=1e-6)
        assert pattern_db(antenna, towards(-10.0 * step)) == pytest.approx(level_db, abs=1e-6)


def test_the_tables_are_those_of_the_reference() -> None:
    assert len(PATTERNS_DB["RA-2A"]) == len(PATTERNS_DB["RA-23K"]) == 19
    assert PATTERNS_DB["RA-2A"][9] == min(PATTERNS_DB["RA-2A"]) == -27.5
    assert PATTERNS_DB["RA-23K"][9] == min(PATTERNS_DB["RA-23K"]) == -18.0
    assert PATTERNS_DB["RA-2A"][18] == PATTERNS_DB["RA-23K"][18] == -10.0


def test_an_own_table_may_have_any_step() -> None:
    antenna = Antenna(pattern="table", table_db=(0.0, -10.0, -4.0))
    assert pattern_db(antenna, towards(45.0)) == pytest.approx(-5.0)
    assert pattern_db(antenna, towards(180.0)) == pytest.approx(-4.0)


def test_a_monopole_hears_all_around_and_little_overhead() -> None:
    antenna = Antenna(pattern="monopole")
    assert pattern_db(antenna, towards(123.0)) == pytest.approx(0.0)
    assert pattern_db(antenna, towards(10.0, -60.0)) == pytest.approx(-6.02, abs=0.01)
    assert pattern_db(antenna, towards(0.0, -90.0)) == -30.0


def test_crossed_polarizations_leave_only_the_scatter() -> None:
    antenna = Antenna(polarization="horizontal", cross_polarization_db=-15.0)
    ahead = (1.0, 0.0, 0.0)
    assert polarization_db(antenna, ahead, (0.0, 1.0, 0.0)) == pytest.approx(0.0)
    assert polarization_db(antenna, ahead, (0.0, 0.0, 1.0)) == pytest.approx(-15.0)
    upright = Antenna(polarization="vertical")
    assert polarization_db(upright, ahead, (0.0, 0.0, 1.0)) == pytest.approx(0.0)


def test_a_field_at_45_degrees_loses_half_of_the_power() -> None:
    antenna = Antenna(polarization="horizontal", cross_polarization_db=-40.0)
    half = math.sqrt(0.5)
    loss_db = polarization_db(antenna, (1.0, 0.0, 0.0), (0.0, half, half))
    assert loss_db == pytest.approx(-3.01, abs=0.01)
