"""Bearings and positions: what holds whatever the numbers."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st
from some import some

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.bearing.estimate_bearing import estimate_bearing
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.power_law import power_tables

angles = st.floats(0.0, 360.0, exclude_max=True)


@given(st.sampled_from(sorted(PATTERNS)), st.floats(-720.0, 720.0))
def test_a_pattern_is_mirrored_and_has_a_period_of_a_turn(name: str, angle: float) -> None:
    pattern = PATTERNS[name]
    here, mirrored, turned = pattern.gain_db([angle, -angle, angle + 360.0])
    assert abs(here - mirrored) < 1e-9
    assert abs(here - turned) < 1e-9
    assert here <= 0.0


@given(st.sampled_from(sorted(PATTERNS)), angles)
def test_a_level_antenna_has_its_table_in_the_plane_of_its_elements(
    name: str, angle: float
) -> None:
    turn = np.radians([angle])
    gain = PATTERNS[name].gain_towards_db(np.cos(turn), np.sin(turn), np.zeros(1))
    np.testing.assert_allclose(gain, PATTERNS[name].gain_db([angle]), atol=1e-5)


@settings(max_examples=10)
@given(angles, angles, st.integers(10, 24), st.floats(15.0, 60.0))
@example(0.0, 0.0, 18, 52.0)
def test_turning_the_world_turns_the_bearing(
    bearing: float, turn: float, pulses: int, snr_db: float
) -> None:
    yaw = np.arange(pulses) * 360.0 / pulses
    snr = snr_db + PATTERNS["RA-2A"].gain_db(bearing - yaw)
    plain = estimate_bearing(yaw, snr, antenna="RA-2A")
    turned = estimate_bearing(yaw + turn, snr, antenna="RA-2A")
    assert abs(difference_deg(plain.bearing_deg, bearing)) < 2.0
    assert abs(difference_deg(turned.bearing_deg, plain.bearing_deg + turn)) < 0.3


@settings(max_examples=15)
@given(
    st.lists(st.tuples(angles, st.floats(-20.0, 70.0) | st.just(float("nan"))), min_size=1),
    st.floats(0.0, 20.0),
)
def test_any_pulses_give_a_posterior_that_holds_together(
    pulses: list[tuple[float, float]], threshold_db: float
) -> None:
    yaw, snr = np.array([(0.0, 12.0), *pulses]).T
    found = estimate_bearing(yaw, snr, threshold_db=threshold_db)
    assert found.posterior is not None
    assert np.all(found.posterior >= 0.0)
    assert abs(found.posterior.sum() - 1.0) < 1e-9
    assert 0.0 <= found.bearing_deg < 360.0
    assert 0.0 < some(found.sigma_deg) <= 25.1
    assert -1e-12 <= some(found.second_lobe_probability) <= 1.0


@settings(max_examples=15)
@given(
    st.floats(0.01, 0.5, exclude_max=True) | st.floats(10.0, 1e4, exclude_min=True),
    st.integers(1, 20),
    st.sampled_from([0.5, 2.5, 6.5]),
)
def test_the_power_law_is_greatest_near_the_measured_power(
    power: float, folds: int, fading_db: float
) -> None:
    tables = power_tables(np.array([power]), np.zeros(0), folds=folds, fadings_db=(fading_db,))
    level = tables.lowest_db + 0.25 * int(np.argmax(tables.log_likelihood[0, :, 0]))
    if power > 10.0:
        # Fading skews the law towards lower levels by up to some tenths of a decibel.
        assert abs(level - 10 * np.log10(power - 1.0)) < 1.5
    else:
        assert level < 0.0


@given(
    st.floats(-80.0, 80.0),
    st.floats(-180.0, 180.0),
    st.floats(-5000.0, 5000.0),
    st.floats(-5000.0, 5000.0),
)
def test_metres_and_degrees_go_to_and_fro(
    latitude: float, longitude: float, east: float, north: float
) -> None:
    plane = TangentPlane(latitude_deg=latitude, longitude_deg=longitude)
    back_east, back_north = plane.to_local(*plane.to_geodetic(east, north))
    # A point of the plane 7 km out is 4 m above the ground; coming down moves it by 4 mm.
    assert abs(float(back_east) - east) < 0.01
    assert abs(float(back_north) - north) < 0.01


@settings(max_examples=15)
@given(
    st.lists(
        st.tuples(st.floats(-500.0, 500.0), st.floats(-500.0, 500.0), angles),
        min_size=1,
        max_size=8,
    )
)
def test_any_bearings_give_a_region_that_holds_together(
    rays: list[tuple[float, float, float]],
) -> None:
    east, north, bearing = np.array(rays).T
    plane = TangentPlane(latitude_deg=-35.0, longitude_deg=179.999)
    latitude, longitude = plane.to_geodetic(east, north)
    found = estimate_position(
        Stations(
            latitude_deg=latitude,
            longitude_deg=longitude,
            bearing_deg=bearing,
            sigma_deg=np.full(len(east), 5.0),
        )
    )
    assert abs(some(found.grid).probability.sum() - 1.0) < 1e-9
    assert 0.0 < some(found.radius50_m) <= some(found.radius95_m)
    assert all(0.0 <= p <= 1.0 for p in some(found.outlier_probabilities))
    assert abs(found.latitude_deg + 35.0) < 0.05
