"""Levels of several receivers: each has its own gain, which is not known."""

from dataclasses import replace

import numpy as np
import pytest
from depth import count

from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.strengths import Strengths
from uavrt_experiments.localization.misfit_worlds import PLANE, unequal_receivers

MAST = Strengths(
    listener="a mast",
    pulses=20,
    latitude_deg=PLANE.to_geodetic([0.0], [100.0])[0],
    longitude_deg=np.array([PLANE.longitude_deg]),
    height_m=np.array([6.0]),
    yaw_deg=np.zeros(1),
    level_db=np.array([10.0]),
    sigma_db=np.ones(1),
    antenna=None,
)
"""A whip 100 m north of the middle."""


@pytest.mark.parametrize("receivers", [2, 3])
def test_the_circle_of_95_percent_holds_whatever_the_gains_are(receivers: int) -> None:
    rng, flights = np.random.default_rng(receivers), count(20, 40)
    held = {"each its own": 0, "all of one": 0}
    for _ in range(flights):
        stations, tag = unequal_receivers(rng, receivers)
        for name, one in (
            ("each its own", stations),
            ("all of one", replace(stations, receiver=None)),
        ):
            found = estimate_position(one)
            assert found.radius95_m is not None
            east, north = PLANE.to_local(found.latitude_deg, found.longitude_deg)
            held[name] += bool(np.hypot(east - tag[0], north - tag[1]) <= found.radius95_m)
    # Chance of fewer than 17 of 20, or 34 of 40, for a true 95 %: 1.6 % or 0.3 %.
    assert held["each its own"] >= 0.85 * flights
    # The test can fail: levels compared as those of one receiver lead astray.
    assert held["all of one"] < 0.85 * flights


@pytest.mark.parametrize("listeners", [(), (MAST,)])
def test_the_gain_of_a_receiver_changes_nothing(listeners: tuple[Strengths, ...]) -> None:
    stations, _ = unequal_receivers(np.random.default_rng(7), 2)
    assert stations.level_db is not None
    stations = replace(stations, listeners=listeners)
    louder = stations.level_db + 20.0 * (stations.receivers == 1)
    first, second = (
        estimate_position(one) for one in (stations, replace(stations, level_db=louder))
    )
    assert second.latitude_deg == pytest.approx(first.latitude_deg, abs=5e-11)
    assert second.radius95_m == pytest.approx(first.radius95_m, rel=1e-6)
