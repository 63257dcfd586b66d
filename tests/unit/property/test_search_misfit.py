"""Searches find animals within their circles where strength and ground are unknown to them.

The tables give a search the world's own path loss. Here it has the prior of the field, and the
tags lie above ground that reflects. Half a metre above it their levels fall with distance to
the fourth power; 2 m above it they rise and fall by 10 dB, and where the ground slopes, also
with the direction. ``UAVRT_SEARCHES=40`` flies 40 searches, ``UAVRT_GROUNDS=all`` over all
kinds of ground, ``-s`` shows the share.
"""

import os
from dataclasses import replace

import numpy as np
import pytest

from uavrt.planning.drone_model.drone_motion import Multirotor
from uavrt.planning.keep_away import KeepAway
from uavrt.planning.stopping import AccuracyStop
from uavrt_experiments.search.drones import FlightOfDrones
from uavrt_experiments.search.reflection import Reflection
from uavrt_experiments.search.scenario import Contender, Scenario, Truth

SEARCHES = int(os.environ.get("UAVRT_SEARCHES", "8"))
GROUNDS = {
    "level": Reflection(),
    "sloping": Reflection(slope_deg=4.0),
    "dry": Reflection(permittivity=4.0, polarization="vertical"),
    "wet": Reflection(permittivity=30.0, polarization="mixed"),
    "dipoles": Reflection(polarization="dipole"),
    "rough": Reflection(roughness_m=0.3),
    "uneven": Reflection(uneven_m=0.3, uneven_length_m=30.0),
    "dry, all at once": Reflection(
        permittivity=4.0, polarization="mixed", roughness_m=0.2, slope_deg=3.0, uneven_m=0.2
    ),
}
CASES = [("level", 0.5, 0.87), ("level", 2.0, 0.87)]
if os.environ.get("UAVRT_GROUNDS") == "all":
    CASES = [(name, height_m, 0.75) for name in GROUNDS for height_m in (0.3, 1.0, 2.0)]
WIDE_M, WISH = 455.0, AccuracyStop(radius95_m=30.0)
LOW_TAGS = Scenario(
    name="low tags",
    title="three tags above the ground, one of them walking",
    east_m=WIDE_M,
    north_m=WIDE_M,
    tags=3,
    places=((400.0, 190.0), (320.0, 380.0), (100.0, 110.0)),
    truth=Truth(
        level_1m_db=82.0,
        exponent=2.5,
        sigma_db=1.5,
        antenna="RA-23K",
        reflection=Reflection(),
        tag_height_m=0.5,
        travellers=1,
        walk_speed_m_s=0.4,
        threshold_db=11.4,
    ),
    vehicle=Multirotor(speed_m_s=8.0, acceleration_m_s2=4.0, yaw_rate_deg_s=60.0),
    paper_stop=WISH,
    our_stop=WISH,
    start_m=(WIDE_M / 2.0, WIDE_M / 2.0),
    height_m=40.0,
    keep_away=KeepAway(radius_m=30.0, probability=0.99, margin=1.4),
    limit_s=900,
)


class AsInTheField(FlightOfDrones):
    """A search that knows nothing of its tags but their frequencies."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        super().__init__(scenario, Contender(planner="mi_rate", stop="ours"), seed)
        for one in self.drones:
            one._equipment = replace(one._equipment, known={})


@pytest.mark.slow
@pytest.mark.timeout(36_000)
@pytest.mark.parametrize(("ground", "height_m", "least"), CASES)
def test_animals_lie_within_the_circle_at_which_the_search_calls_them_found(
    ground: str, height_m: float, least: float
) -> None:
    truth = replace(LOW_TAGS.truth, reflection=GROUNDS[ground], tag_height_m=height_m)
    world = replace(LOW_TAGS, truth=truth)
    flights = [AsInTheField(world, seed).flown() for seed in range(1, 1 + SEARCHES)]
    finds = [one for flight in flights for one in flight.judged]
    held = np.mean([one.error_m is not None and one.error_m < one.radius95_m for one in finds])
    complete = np.mean([flight.complete for flight in flights])
    print(f"found all: {complete:.2f}; {held:.3f} of {len(finds)} within the 95 % circle")
    assert complete > 0.85
    assert held > least
