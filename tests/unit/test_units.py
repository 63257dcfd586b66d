import math

from hypothesis import given
from hypothesis import strategies as st

from uavrt.core import units


@given(st.floats(-1e6, 1e6))
def test_wrapping_keeps_the_direction(angle_deg: float) -> None:
    for wrapped in (units.wrap_degrees_360(angle_deg), units.wrap_degrees_180(angle_deg)):
        turns = (angle_deg - wrapped) / 360.0
        assert abs(turns - round(turns)) < 1e-9
    assert 0.0 <= units.wrap_degrees_360(angle_deg) < 360.0
    assert -180.0 <= units.wrap_degrees_180(angle_deg) < 180.0


@given(st.floats(-200, 200))
def test_decibels_survive_a_round_trip(level_db: float) -> None:
    assert math.isclose(
        units.db_from_power(units.power_from_db(level_db)), level_db, abs_tol=1e-9
    )


def test_megahertz_become_exact_hertz() -> None:
    assert units.hz_from_mhz(148.71) == 148_710_000.0


def test_durations_are_told_in_units_that_people_count_in() -> None:
    told = {40.2: "40 s", -90: "90 s", 721: "12 min", -18_000: "5 h", 1.7e9: "19676 days"}
    assert {seconds: units.rough_duration(seconds) for seconds in told} == told
