"""Turns in place are found in the poses, and only they, whatever path lies between them."""

from copy import deepcopy
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import UsageError
from uavrt.localization.bearing.turns import Turn, find_turns

RATE_HZ = 5.0
START_NS = 1_700_000_000_000_000_000
PLANE = TangentPlane(latitude_deg=-41.2, longitude_deg=174.9)


@dataclass
class Flight:
    """A flight made of manoeuvres, with hover drift, GNSS and compass noise."""

    yaw: list[float] = field(default_factory=lambda: [0.0])
    east: list[float] = field(default_factory=lambda: [0.0])
    height: list[float] = field(default_factory=lambda: [0.0])

    def hover(self, seconds: float) -> "Flight":
        return self.turn(0.0, seconds)

    def turn(self, degrees: float, seconds: float, drift_m_s: float = 0.0) -> "Flight":
        steps = max(1, round(seconds * RATE_HZ))
        self.yaw += list(self.yaw[-1] + degrees * np.arange(1, steps + 1) / steps)
        self.east += list(self.east[-1] + drift_m_s * np.arange(1, steps + 1) / RATE_HZ)
        self.height += [self.height[-1]] * steps
        return self

    def climb(self, metres: float, speed: float = 2.0, turned: float = 0.0) -> "Flight":
        steps = round(abs(metres) / speed * RATE_HZ)
        self.yaw += list(self.yaw[-1] + turned * np.arange(1, steps + 1) / steps)
        self.east += [self.east[-1]] * steps
        self.height += list(self.height[-1] + metres * np.arange(1, steps + 1) / steps)
        return self

    def fly(self, metres: float, speed: float = 8.0) -> "Flight":
        steps = round(metres / speed * RATE_HZ)
        self.yaw += [self.yaw[-1]] * steps
        self.east += list(self.east[-1] + metres * np.arange(1, steps + 1) / steps)
        self.height += [self.height[-1]] * steps
        return self

    def stops(self, count: int, dwell_s: float, way: float = 1.0) -> "Flight":
        for _ in range(count - 1):
            self.hover(dwell_s).turn(way * 360.0 / count, 2.0)
        return self.hover(dwell_s)

    def seconds(self) -> float:
        return len(self.yaw) / RATE_HZ

    def turns(self, on_ground: NDArray[np.bool_] | None = None) -> list[Turn]:
        rng = np.random.default_rng(len(self.yaw))
        count = len(self.yaw)
        time_ns: NDArray[np.int64] = START_NS + (np.arange(count) * 1e9 / RATE_HZ).astype(
            np.int64
        )
        drift = np.cumsum(rng.normal(0, 0.03, (2, count)), axis=1)
        east = np.array(self.east) + drift[0] + rng.normal(0, 0.1, count)
        north = drift[1] + rng.normal(0, 0.1, count)
        yaw = np.remainder(np.array(self.yaw) + rng.normal(0, 0.5, count), 360.0)
        height = np.array(self.height) + rng.normal(0, 0.1, count)
        return find_turns(
            time_ns, yaw, *PLANE.to_geodetic(east, north), height_m=height, on_ground=on_ground
        )


def seconds_of(turn: Turn) -> list[float]:
    return [(turn.start_time_ns - START_NS) / 1e9, (turn.end_time_ns - START_NS) / 1e9]


@pytest.mark.parametrize("degrees", [360.0, -360.0, 300.0, -720.0])
def test_a_continuous_turn_is_found_whichever_way_round(degrees: float) -> None:
    flight = Flight().fly(200).hover(20)
    begin = flight.seconds()
    flight.turn(degrees, 60)
    end = flight.seconds()
    (turn,) = flight.hover(30).fly(100).turns()
    assert turn.turned_deg == pytest.approx(degrees, abs=8.0)
    assert turn.stops == 0
    assert seconds_of(turn) == pytest.approx([begin, end], abs=2.5)


@pytest.mark.parametrize(("count", "way"), [(8, 1.0), (8, -1.0), (16, 1.0)])
def test_a_turn_of_stops_holds_all_its_stops(count: int, way: float) -> None:
    (turn,) = Flight().fly(300).stops(count, 10.0, way).fly(300).turns()
    assert turn.stops == count
    assert turn.turned_deg == pytest.approx(way * 360.0 * (count - 1) / count, abs=6.0)
    assert turn.widest_gap_deg <= 360.0 / count + 6.0


def test_a_pause_does_not_end_a_turn() -> None:
    (turn,) = Flight().fly(100).hover(5).turn(150, 25).hover(40).turn(210, 35).hover(5).turns()
    assert turn.turned_deg == pytest.approx(360.0, abs=8.0)


def test_turns_at_several_places_are_separate() -> None:
    turns = Flight().turn(360, 40).fly(200).turn(-360, 40).fly(200).stops(8, 5.0).turns()
    assert [turn.stops for turn in turns] == [0, 0, 8]
    east = [float(PLANE.to_local(turn.latitude_deg, turn.longitude_deg)[0]) for turn in turns]
    assert east == pytest.approx([0.0, 200.0, 400.0], abs=5.0)


@pytest.mark.parametrize("speed_m_s", [0.3, 0.5, 0.8, 1.0, 1.3, 1.6, 2.0])
@pytest.mark.parametrize("way_m", [20.0, 60.0, 150.0, 300.0])
def test_turns_with_a_walk_between_them_are_separate(way_m: float, speed_m_s: float) -> None:
    flight = Flight().turn(372, 40).fly(way_m, speed_m_s).hover(3).stops(8, 6.0)
    flight.fly(way_m, speed_m_s).turn(-372, 40).fly(way_m, speed_m_s).turn(372, 40)
    turns = flight.turns()
    turned_deg = [turn.turned_deg for turn in turns]
    assert turned_deg == pytest.approx([372.0, 315.0, -372.0, 372.0], abs=10.0)
    east = [float(PLANE.to_local(turn.latitude_deg, turn.longitude_deg)[0]) for turn in turns]
    assert np.diff(east) == pytest.approx([way_m] * 3, abs=6.0)


@pytest.mark.parametrize("speed_m_s", [0.3, 1.0, 2.0])
def test_a_walk_without_turning_is_no_turn(speed_m_s: float) -> None:
    flight = Flight()
    for degrees in (170.0, 170.0, 170.0):  # round three corners, each at another place
        flight.fly(60.0, speed_m_s).turn(degrees, 20)
    assert flight.fly(60.0, speed_m_s).turns() == []


def test_a_turn_of_stops_that_drifts_is_found_whole() -> None:
    flight = Flight()
    for _ in range(8):
        flight.turn(45.0, 3.0, 0.3).turn(0.0, 6.0, 0.3)
    (turn,) = flight.fly(200).turns()
    assert turn.stops == 8
    assert turn.turned_deg == pytest.approx(360.0, abs=12.0)


def test_an_antenna_that_swings_on_the_way_joins_no_turns() -> None:
    flight = Flight().turn(372, 40)
    for swing_deg in (25.0, -50.0, 50.0, -50.0, 25.0):
        flight.turn(swing_deg, 8.0, 1.0)
    assert len(flight.turn(372, 40).turns()) == 2


def test_back_and_forth_is_two_turns() -> None:
    turns = Flight().hover(5).turn(360, 40).turn(-360, 40).hover(5).turns()
    assert [np.sign(turn.turned_deg) for turn in turns] == [1.0, -1.0]


def test_a_circle_flown_is_no_turn_in_place() -> None:
    angle = np.arange(0, 360, 2.0)
    time_ns = START_NS + (np.arange(len(angle)) * 4e8).astype(np.int64)
    places = PLANE.to_geodetic(60 * np.cos(np.radians(angle)), 60 * np.sin(np.radians(angle)))
    assert find_turns(time_ns, 360.0 - angle, *places) == []


@pytest.mark.parametrize(
    "before",
    [
        Flight().turn(9.0, 150).climb(40.0).hover(3),
        Flight().climb(40.0).turn(8.0, 130),
        Flight().climb(40.0, speed=1.0, turned=120.0).hover(3),
    ],
    ids=["heading drifts before the take-off", "drifts in hover", "yaws in the climb"],
)
def test_a_heading_that_changes_before_and_after_a_turn_is_no_part_of_it(
    before: Flight,
) -> None:
    flight = deepcopy(before)
    begin = flight.seconds()
    end = flight.turn(360, 60).seconds()
    (turn,) = flight.turn(7.0, 120).fly(100).turns()
    assert seconds_of(turn) == pytest.approx([begin, end], abs=2.5)
    assert turn.turned_deg == pytest.approx(360.0, abs=8.0)


@pytest.mark.parametrize(
    "flight",
    [
        Flight().turn(120, 10).turn(-200, 20).turn(90, 10).fly(500),
        Flight().turn(170, 30).hover(400).turn(170, 30),
        Flight().climb(40.0, speed=1.0, turned=300.0).fly(100),
    ],
    ids=["looks around", "a pause of minutes", "yaws in the climb"],
)
def test_other_changes_of_the_heading_are_no_turn(flight: Flight) -> None:
    assert flight.turns() == []


def test_a_drone_that_is_carried_after_landing_makes_no_turn() -> None:
    flight = Flight().climb(40.0).hover(3).turn(360, 60).hover(3).climb(-40.0)
    (turn,) = flight.turn(330, 30).fly(8, speed=1.0).turn(-300, 25).turns()
    assert turn.turned_deg == pytest.approx(360.0, abs=8.0)


def test_a_turn_below_the_place_of_the_take_off_counts() -> None:
    flight = Flight().climb(20.0).fly(300).climb(-60.0).hover(3)
    assert len(flight.turn(360, 60).hover(3).climb(60.0).fly(-300).turns()) == 1


def test_a_turn_counts_on_a_turntable_that_never_flies() -> None:
    assert len(Flight().hover(10).turn(360, 60).hover(10).turns()) == 1


def test_a_gust_that_lifts_the_drone_does_not_cut_a_turn() -> None:
    flight = Flight().climb(40.0).hover(3).turn(180, 30)
    flight.climb(2.0, speed=1.0, turned=12.0)
    (turn,) = flight.turn(168, 28).hover(3).fly(100).turns()
    assert turn.turned_deg == pytest.approx(360.0, abs=8.0)


def test_poses_out_of_order_are_refused() -> None:
    zero = np.zeros(5)
    with pytest.raises(UsageError, match="not increasing"):
        find_turns(np.zeros(5, np.int64), zero, zero, zero)
    with pytest.raises(UsageError, match="number"):
        find_turns(np.arange(6), zero, zero, zero)


@pytest.mark.parametrize(
    "sunk_m", [33.0, 40.0], ids=["a barometer 7 m off at landing", "carried 8 m higher"]
)
def test_a_carry_is_no_turn_where_the_autopilot_says_landed(sunk_m: float) -> None:
    flight = Flight().climb(40.0).hover(3).turn(360, 60).hover(3).climb(-sunk_m).hover(20)
    landed = len(flight.yaw)
    if sunk_m == 40.0:
        flight.climb(8.0, speed=0.25)
    flight.turn(340, 30).hover(10)
    on_ground = np.arange(len(flight.yaw)) >= landed - 50
    (turn,) = flight.turns(on_ground)
    assert turn.turned_deg == pytest.approx(360.0, abs=8.0)


def test_turns_where_nothing_flew_count_also_where_the_autopilot_says_landed() -> None:
    flight = Flight().hover(5).turn(360, 60).hover(5)
    assert len(flight.turns(np.ones(len(flight.yaw), bool))) == 1


def test_turns_are_separate_whatever_curved_path_lies_between_them() -> None:
    """Paths of 15 to 40 m on which the heading turns by 45 to 400°."""
    for seed in range(150):
        rng = np.random.default_rng(seed)
        flight, turns, slow = Flight().hover(3), [], 0
        way = float(rng.choice([-1, 1]))
        for number in range(3):
            begin = flight.seconds()
            if rng.random() < 0.3:
                flight.stops(8, 5.0, way).turn(way * 45.0, 2.0)
            else:
                flight.turn(way * rng.uniform(345.0, 400.0), rng.uniform(25.0, 60.0))
            turns.append((begin, flight.seconds()))
            if number < 2:
                metres, degrees = rng.uniform(15.0, 40.0), rng.uniform(45.0, 400.0)
                speed = rng.uniform(0.4, 1.4)
                swings = way * rng.choice([-1, 1], p=[0.25, 0.75])
                flight.turn(swings * degrees, metres / speed, speed)
                slow += bool(degrees >= 265.0 and metres / degrees <= 8.5 / 90.0)
                way *= rng.choice([-1, 1], p=[0.3, 0.7])
        found = [seconds_of(turn) for turn in flight.hover(3).turns()]
        for begin, end in turns:
            shared = [min(end, one[1]) - max(begin, one[0]) for one in found]
            assert sum(one > 0.8 * (end - begin) for one in shared) == 1, seed
        # A path so slow that it stays within the radius of a turn may be one.
        assert len(turns) <= len(found) <= len(turns) + slow, seed


def test_a_turn_that_drifts_is_found_whole_however_it_begins() -> None:
    for seed in range(150):
        rng = np.random.default_rng(seed)
        degrees = float(rng.uniform(345.0, 400.0))
        metres = min(27.0, rng.uniform(0.0, 6.7) * degrees / 90.0)
        seconds = max(25.0, metres / rng.uniform(0.15, 0.45))
        before_s, after_s = rng.choice([2.0, 60.0], 2)
        flight = Flight().turn(0.0, before_s, metres / seconds)
        flight.turn(degrees * rng.choice([-1, 1]), seconds, metres / seconds)
        flight.turn(0.0, after_s, metres / seconds)
        turned = [abs(turn.turned_deg) for turn in flight.fly(200).turns()]
        assert len(turned) == 1, seed
        assert abs(turned[0] - degrees) < 25.0, (seed, turned, degrees)


def test_a_curved_path_without_a_turn_is_no_turn() -> None:
    for seed in range(100):
        rng = np.random.default_rng(seed)
        metres, speed = rng.uniform(40.0, 300.0), rng.uniform(0.4, 1.4)
        degrees = min(rng.uniform(270.0, 500.0), 90.0 * metres / 9.5)
        assert Flight().hover(5).turn(degrees, metres / speed, speed).turns() == [], seed
