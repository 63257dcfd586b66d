"""How far a tag is heard."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from some import some

from uavrt.planning.detectability.link_budget import LinkBudget

TAG = LinkBudget(
    frequency_hz=150e6,
    pulse_width_s=0.020,
    tag_eirp_dbm=-40.0,
    drone_height_m=60.0,
    noise_figure_db=10.0,
    ground="free",
)


def test_the_sum_is_friis_equation() -> None:
    # 1 km: 75.96 dB. -40 + 4 - 3 - 75.96 = -114.96 dBm; noise -163.98 dBm/Hz; 20 ms: -16.99 dB.
    over_ground = math.sqrt(1000.0**2 - 59.5**2)
    assert float(TAG.enr_db(np.array([over_ground]))[0]) == pytest.approx(32.03, abs=0.02)


def test_the_lines_add_up() -> None:
    lines = {term: value for term, value, _ in TAG.lines(10.3, 3000.0)}
    terms = list(lines.items())
    received = sum(value for _, value in terms[:4])
    assert lines["power at the receiver"] == pytest.approx(received)
    pulse = lines["pulse of 20 ms"]
    noise = lines["thermal noise"] + lines["noise of receiver, drone and sky"]
    enr = lines["energy over noise density, ENR"]
    assert enr == pytest.approx(received + pulse - noise)
    assert lines["margin"] == pytest.approx(enr - 10.3)


@given(
    power_dbm=st.floats(-90.0, 0.0),
    height_m=st.floats(5.0, 120.0),
    needed_db=st.floats(0.0, 15.0),
    ground=st.sampled_from(["free", "two-ray"]),
)
def test_nearer_than_the_distance_it_is_strong_enough_everywhere(
    power_dbm: float, height_m: float, needed_db: float, ground: str
) -> None:
    budget = LinkBudget(
        frequency_hz=150e6,
        pulse_width_s=0.020,
        tag_eirp_dbm=power_dbm,
        drone_height_m=height_m,
        ground="free" if ground == "free" else "two-ray",
    )
    distance = budget.distance_m(needed_db)
    if distance is None:
        assert budget.enr_db(np.zeros(1))[0] < needed_db
        return
    nearer = np.linspace(0.0, distance, 500)
    assert budget.enr_db(nearer).min() > needed_db - 0.5


def test_ten_decibels_are_about_twice_the_distance_over_flat_ground() -> None:
    budget = LinkBudget(
        frequency_hz=150e6, pulse_width_s=0.020, tag_eirp_dbm=-30.0, drone_height_m=60.0
    )
    far, near = budget.distance_m(0.0), budget.distance_m(10.0)
    assert some(far) / some(near) == pytest.approx(10.0 ** (10.0 / 40.0), rel=0.1)
