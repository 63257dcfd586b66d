"""Levels of several receivers: each has its own gain, which is not known."""

from dataclasses import replace

import numpy as np
import pytest
from depth import count

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.strengths import Strengths

PLANE = TangentPlane(latitude_deg=46.5, longitude_deg=8.0)
SIGMA_DEG = 4.0
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


def drawn(rng: np.random.Generator, receivers: int) -> tuple[Stations, tuple[float, float]]:
    """Draw turns of receivers whose gains differ by up to 80 dB, and the tag's place."""
    tag = (float(rng.uniform(-300.0, 300.0)), float(rng.uniform(200.0, 500.0)))
    receiver = np.repeat(np.arange(receivers), 3)
    count = len(receiver)
    east, north = rng.uniform(-300.0, 300.0, count), rng.uniform(-150.0, 150.0, count)
    height_m = np.repeat(rng.choice([1.5, 60.0], receivers), 3)
    distance_m = np.hypot(np.hypot(tag[0] - east, tag[1] - north), height_m)
    level_db = 25.0 - 25.0 * np.log10(distance_m / 100.0)
    level_db += rng.uniform(-40.0, 40.0, receivers)[receiver] + rng.normal(0.0, 3.0, count)
    bearing_deg = np.degrees(np.arctan2(tag[0] - east, tag[1] - north))
    latitude, longitude = PLANE.to_geodetic(east, north)
    stations = Stations(
        latitude_deg=latitude,
        longitude_deg=longitude,
        bearing_deg=bearing_deg + rng.normal(0.0, SIGMA_DEG, count),
        sigma_deg=np.full(count, SIGMA_DEG),
        level_db=level_db,
        level_sigma_db=np.full(count, 0.5),
        height_m=height_m,
        receiver=receiver,
    )
    return stations, tag


@pytest.mark.parametrize("receivers", [2, 3])
def test_the_circle_of_95_percent_holds_whatever_the_gains_are(receivers: int) -> None:
    rng, flights = np.random.default_rng(receivers), count(20, 40)
    held = {"each its own": 0, "all of one": 0}
    for _ in range(flights):
        stations, tag = drawn(rng, receivers)
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
    stations, _ = drawn(np.random.default_rng(7), 2)
    assert stations.level_db is not None
    stations = replace(stations, listeners=listeners)
    louder = stations.level_db + 20.0 * (stations.receivers == 1)
    first, second = (
        estimate_position(one) for one in (stations, replace(stations, level_db=louder))
    )
    assert second.latitude_deg == pytest.approx(first.latitude_deg, abs=5e-11)
    assert second.radius95_m == pytest.approx(first.radius95_m, rel=1e-6)
