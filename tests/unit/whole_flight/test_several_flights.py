"""A tag too weak in each of several flights is found in all together, and chance is not."""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import made
import numpy as np
import pytest
from command_line import Ran
from depth import share
from sigmf_meta import write_meta
from some import some
from tests.unit.whole_flight.conftest import (
    RATE_HZ,
    WINDOW_HZ,
    Rotation,
    judged_rotation,
    rotation,
)
from tests.unit.whole_flight.test_from_arrays_and_tracks import FIXED

from uavrt.analysis.whole_flights.judged_flights import IntegratedTag
from uavrt.analysis.whole_flights.several_flights import (
    TagOfFlights,
    common_tags,
    judge_together,
    share_alone,
)
from uavrt.core.clock import iso_utc
from uavrt.core.errors import UsageError
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.integrated import read_integrated
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import PATTERNS
from uavrt_experiments.detection.signals import START_NS

HOUR_NS = 3_600_000_000_000
WEAK_DB = 4.7


def flights_of(seed: int, enr_db: float | None, east_m: Sequence[float]) -> list[Rotation]:
    """Rotations of 100 pulses an hour apart, of one tag."""
    first = rotation(seed, enr_db, pulses=100, east_m=east_m[0])
    later = [
        rotation(
            seed + n,
            enr_db,
            pulses=100,
            like=first,
            east_m=east,
            start_ns=START_NS + n * HOUR_NS,
        )
        for n, east in enumerate(east_m[1:], 1)
    ]
    return [first, *later]


def alone(flown: Sequence[Rotation], path: Path) -> list[IntegratedTag]:
    """What each flight shows by itself."""
    return [judged_rotation(one, path, share_alone(0.01, len(flown))) for one in flown]


def together(
    flown: Sequence[Rotation], each: Sequence[IntegratedTag], *, moves: bool = False
) -> TagOfFlights:
    flights = [one.flight for one in flown]
    return judge_together(flights, each, PATTERNS["RA-23K"], moves=moves)


@pytest.fixture(scope="module")
def flown() -> list[Rotation]:
    """Three flights past one tag that rests."""
    return flights_of(41, WEAK_DB, [0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def each(
    flown: list[Rotation], tmp_path_factory: pytest.TempPathFactory
) -> list[IntegratedTag]:
    return alone(flown, tmp_path_factory.mktemp("alone"))


@pytest.mark.parametrize("moves", share([True, False], 2))
def test_a_tag_too_weak_in_each_flight_is_found_in_all_together(
    flown: list[Rotation], each: list[IntegratedTag], moves: bool
) -> None:
    one = together(flown, each, moves=moves)
    assert min(one.alone) > share_alone(0.01, 3)
    assert one.together
    assert one.found
    assert one.false_alarm_probability < 0.001
    assert (one.place is None) is moves
    told = [flight for flight in one.flights if flight.found]
    assert told
    for flight in told:
        assert flight.pulses.interval_s == pytest.approx(flown[0].interval_s, abs=4e-4)
        assert flight.pulses.offset_hz == pytest.approx(flown[0].offset_hz, abs=40.0)
        place = some(flight.place)
        away = abs(difference_deg(place.bearing_deg, flown[0].bearing_deg))
        assert away < place.arc95_deg < 90.0


def test_half_of_the_false_alarms_are_for_either_decision(
    flown: list[Rotation], tmp_path: Path
) -> None:
    assert 3 * share_alone(0.01, 3) == pytest.approx(0.005)
    strong = [rotation(45, 8.0, pulses=100), *flights_of(46, None, [0.0, 0.0])]
    one = together(strong, alone(strong, tmp_path))
    assert one.found
    # Found alone: its own chance, times six.
    assert one.false_alarm_probability <= 6.001 * min(one.alone)
    assert [flight.found for flight in one.flights] == [True, False, False]


def on_disk(flown: Sequence[Rotation], root: Path) -> list[str]:
    """Flight directories with what each recorded of the band."""
    names = []
    for number, one in enumerate(flown):
        directory = root / f"flight_log_2023-11-14_{22 + number}-13-20"
        info = replace(one.flight.info, directory=str(directory), tags=(one.tag,))
        made.flight(info, poses=one.flight.poses)
        samples = FlightLayout(directory).iq_directory / "band.sigmf-data"
        samples.parent.mkdir(exist_ok=True)
        one.samples.tofile(samples)
        start = iso_utc(one.flight.info.start_time_ns)
        write_meta(samples, RATE_HZ, {"frequency": one.tag.frequency_hz, "datetime": start})
        names.append(str(directory))
    return names


COMMAND = ("integrate", "--frequency-window", WINDOW_HZ)


def test_the_command_tells_each_flight_and_writes_beside_each(
    flown: list[Rotation], tmp_path: Path, ran: Ran
) -> None:
    names = on_disk(flown, tmp_path)
    (said,) = ran(*COMMAND, *names, "--json").json
    assert said["found"]
    assert said["together"]
    assert np.isfinite(said["bearing_deg"])
    assert set(FIXED) <= set(said)
    assert said["interval_s"] == pytest.approx(flown[0].interval_s, abs=5e-4)
    assert abs(said["frequency_hz"] - flown[0].tag.frequency_hz - flown[0].offset_hz) < 40.0
    assert said["pulses"] == sum(one["pulses"] for one in said["flights"]) > 80
    assert said["enr_db"] == said["level_db"] == pytest.approx(WEAK_DB, abs=2.0)
    assert said["antenna"] == "RA-23K"
    assert said["antenna_assumed"]
    assert [one["flight"] for one in said["flights"]] == [Path(name).name for name in names]
    saved = [read_integrated(name)[0][0] for name in names]
    assert [one.found for one in saved] == [one["found"] for one in said["flights"]]
    assert {one.flights for one in saved} == {3}
    text = ran(*COMMAND, *names, "--no-save").out
    assert text.startswith("tag 2: found over 3 flights together")
    assert text.count("by itself: noise alone gives such a result") == 3


def test_flights_that_cannot_be_judged_together_are_named(
    flown: list[Rotation], tmp_path: Path, ran: Ran
) -> None:
    (first,) = on_disk(flown[:1], tmp_path)
    second = flown[1]
    other = replace(second, tag=replace(second.tag, frequency_hz=149.1e6))
    (strange,) = on_disk([other], tmp_path / "strange")
    renamed = replace(second, tag=replace(second.tag, tag_id=8))
    (unlisted,) = on_disk([renamed], tmp_path / "unlisted")
    posed = replace(second, flight=replace(second.flight, poses=()))
    (blind,) = on_disk([posed], tmp_path / "blind")
    for arguments, says in (
        ((first, first, "--recording", "band.cf32"), "samples of one flight"),
        ((first, "--moves"), "--moves needs several flights"),
        ((first, first), "are the same flight"),
        ((first, strange), r"tag 2 has another frequency.*strange"),
        ((first, unlisted), "no tag is listed in all of these flights"),
        ((first, blind), r"blind.* has no poses"),
    ):
        assert re.search(says, ran(*COMMAND, *arguments, ends=2).words), says


def test_flights_far_apart_have_no_place_in_common(tmp_path: Path) -> None:
    flown = flights_of(51, WEAK_DB, [0.0, 9000.0])
    each = alone(flown, tmp_path)
    with pytest.raises(UsageError, match=r"lies 4\.5 km from the middle of all flights"):
        together(flown, each)
    assert len(together(flown, each, moves=True).flights) == 2


def test_tags_are_those_that_all_flights_list(flown: list[Rotation]) -> None:
    flights = [one.flight for one in flown]
    more = replace(flown[0].tag, tag_id=9)
    listed = (flown[0].tag, more)
    first = replace(flights[0], info=replace(flights[0].info, tags=listed))
    assert [tag.tag_id for tag in common_tags([first, *flights[1:]])] == [2]
    assert common_tags(flights, listed) == list(listed)
    times = [one.info.start_time_ns for one in flights]
    assert all(b - a == HOUR_NS for a, b in pairwise(times))
