"""Turns in place are found whatever path lies between them, and however they drift."""

import numpy as np
from tests.unit.localization.test_turns import Flight, seconds_of


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
