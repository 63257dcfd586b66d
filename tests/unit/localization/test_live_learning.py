"""A flight that goes on computes nothing of its past turns again."""

from collections.abc import Sequence
from dataclasses import replace

import pytest
from turned import turned_flight

from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.bearing.learned_pattern import TurnPulses, learn_pattern
from uavrt.localization.estimates import flight_estimates
from uavrt.localization.estimates.estimate_cache import Cache
from uavrt.localization.estimates.flight_estimates import (
    EstimationOptions,
    TagBearing,
    estimate,
)
from uavrt.localization.estimates.heard import Heard


def test_poses_after_the_last_turn_teach_nothing_again(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = turned_flight(3, tags=2, turns=4)
    learnt: list[int] = []

    def counted(
        turns: Sequence[TurnPulses], antenna: AntennaPattern, *, threshold_db: float
    ) -> AntennaPattern:
        learnt.append(len(turns))
        return learn_pattern(turns, antenna, threshold_db=threshold_db)

    monkeypatch.setattr(flight_estimates, "learn_pattern", counted)
    cache, of_first_turn = Cache(), list[TagBearing]()
    last_ns = flight.poses[-1].time_ns
    for seconds in range(6, -1, -1):
        poses = [one for one in flight.poses if one.time_ns <= last_ns - seconds * 10**9]
        heard = Heard.of_records(
            [one for one in flight.pulse_poses if one.pulse.start_time_ns <= poses[-1].time_ns],
            poses,
            tags=flight.tags,
            antenna=flight.antenna,
        )
        found = estimate(replace(heard, goes_on=True), EstimationOptions(), cache=cache).found
        of_first_turn.append(found.bearings[0])
    assert learnt
    assert len(learnt) == len(set(learnt))
    # What the page shows of a bearing is made again when it is another object.
    assert len({id(one) for one in of_first_turn}) == len(learnt)
