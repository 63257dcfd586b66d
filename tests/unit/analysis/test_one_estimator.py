"""One flight has the same bearings, places and words, digit for digit, whoever estimates.

By `uavrt localize` and `uavrt bearing`, the report, batch, the page's replay and the page live.
"""

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from archived import flight_task
from depth import seeds
from file_bearings import read_bearings
from some import some
from turned import TurnedFlight, turned_flight

from uavrt.analysis.estimates.positions import read_positions
from uavrt.analysis.estimates.records import bearing_record, position_record
from uavrt.analysis.survey import read_survey
from uavrt.core.clock import Clock
from uavrt.ground.store.estimates import AntennaChoice, Estimates, Estimator
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.ground.store.stored_flights import FlightLibrary
from uavrt.localization.antenna import MONOPOLE

pytestmark = pytest.mark.slow

Record = dict[str, Any]
SHOWN_OTHERWISE = {"start_time_ns", "end_time_ns", "pulses", "altitude_amsl_m"}
"""The page has a turn's times, counts heard pulses alone, and no height above the sea."""
OF_LIST = {"name", "frequency_hz"}
"""`uavrt localize` names tags that several flights may have."""
NOT_IN_TABLES = {"interval90_deg", "paths_deg", "remarks", "outlier_probabilities"}
"""Columns of batch's tables are plain, under other names, or not there."""


def live(flight: TurnedFlight, directory: Path) -> Estimates:
    """The page's estimates as the flight went on, and after its end."""
    keeper = FlightKeeper(directory, Clock.start())
    keeper.begin(flight.tags)
    estimator, antenna = Estimator(), AntennaChoice(pattern=flight.antenna)
    poses, since = list(flight.poses), 0
    for number, pulse in enumerate(flight.pulse_poses):
        while since < len(poses) and poses[since].time_ns <= pulse.pulse.start_time_ns:
            keeper.add_pose(poses[since])
            since += 1
        keeper.add_pulse(pulse)
        if number == len(flight.pulse_poses) // 2:
            estimator.estimate(keeper.columns(), antenna, (), flight.tags)
    for pose in poses[since:]:
        keeper.add_pose(pose)
    keeper.close()
    return estimator.estimate(keeper.columns(), antenna, (), flight.tags)


def by_batch(place: Path) -> tuple[list[Record], list[Record]]:
    task = flight_task(place, "bearing", "localize")
    result = some(task.work(lambda: False, lambda _done: None))
    return [
        [{name: getattr(one, name) for name in one.__dataclass_fields__} for one in rows]
        for rows in (result.bearings, result.positions)
    ]  # type: ignore[return-value]


def same(one: list[Record], other: list[Record], but: set[str]) -> None:
    assert len(one) == len(other)
    for ours, theirs in zip(one, other, strict=True):
        shared = (ours.keys() & theirs.keys()) - but
        assert {name: ours[name] for name in shared} == {name: theirs[name] for name in shared}


@pytest.mark.parametrize("seed", seeds(6, 30))
def test_a_flight_has_the_same_bearings_places_and_words_by_all_five_ways(
    tmp_path: Path, seed: int
) -> None:
    flight = turned_flight(seed, tags=2 if seed % 10 == 0 else 1)
    place = flight.recorded(tmp_path / "drone" / "flight_log_x")
    bearings = []
    if flight.antenna != MONOPOLE:
        bearings = [bearing_record(one) for one in read_bearings(place)]
    positions = [position_record(one) for one in read_positions(place)]
    assert all("latitude_deg" in one or one["reason"] for one in positions)

    survey = read_survey(place)
    same([bearing_record(one) for one in survey.bearings], bearings, set())
    same([position_record(one) for one in survey.positions], positions, OF_LIST)

    placed = [one for one in positions if "latitude_deg" in one]
    in_batch = by_batch(place)
    same(in_batch[0], bearings, NOT_IN_TABLES)
    for row, one in zip(in_batch[1], placed, strict=True):
        assert row["remarks"] == "; ".join(one["remarks"])
        assert row["track_latitude_deg"] == tuple(at["latitude_deg"] for at in one["track"])
        for name in ("latitude_deg", "longitude_deg", "radius50_m", "radius95_m", "at_edge"):
            assert row[name] == one[name]

    library, antenna = FlightLibrary(place.parent), AntennaChoice(pattern=flight.antenna)
    columns = library.columns(place.name)
    replayed = Estimator().estimate(columns, antenna, (), flight.tags)
    for page in (replayed, live(flight, tmp_path / "ground")):
        same(page.bearings, bearings, SHOWN_OTHERWISE)
        same(page.positions, placed, OF_LIST | {"end_time_ns"})


def test_estimates_of_many_tags_come_in_turn_and_are_all_there_in_the_end(
    tmp_path: Path,
) -> None:
    """Each update of a live flight after the first computes one of each, at most."""
    flight = turned_flight(3, tags=4, turns=2)
    keeper = FlightKeeper(tmp_path, Clock.start())
    keeper.begin(flight.tags)
    for pose in flight.poses:
        keeper.add_pose(pose)
    antenna, estimator = AntennaChoice(), Estimator()
    for pulse in flight.pulse_poses:
        keeper.add_pulse(pulse)
        if estimator.estimate(keeper.columns(), antenna, (), flight.tags).bearings:
            break
    for pulse in flight.pulse_poses:
        keeper.add_pulse(pulse)
    columns, more = keeper.columns(), True
    keeper.close()
    sizes: list[tuple[int, int]] = []
    while more:
        found = estimator.estimate(columns, antenna, (), flight.tags)
        sizes.append((len(found.bearings), len(found.positions)))
        more = found.more
    assert sizes[0][0] <= 2
    steps = [(b - a, d - c) for (a, c), (b, d) in pairwise(sizes)]
    assert all(bearings <= 1 and positions <= 1 for bearings, positions in steps)
    whole = Estimator().estimate(keeper.columns(), antenna, (), flight.tags)
    assert (found.bearings, found.positions) == (whole.bearings, whole.positions)
    assert len(found.positions) == 4
