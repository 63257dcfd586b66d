"""I6: several flights of one tag evaluated together: false alarms, sensitivity, place."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavrt.core.units import ns_from_s
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies
from uavrt.localization.whole_flight.flight_judgement import pulse_weights
from uavrt.localization.whole_flight.heard_train import HeardTrain, train_pulses
from uavrt.localization.whole_flight.tag_places import (
    Places,
    common_gains,
    distinct,
    places_around,
)
from uavrt.localization.whole_flight.together import JointTrain, Listened, search_together
from uavrt.localization.whole_flight.train_place import place_belief
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.signals import START_NS
from uavrt_experiments.figures import measured, median, share
from uavrt_experiments.integrate.false_alarms import NOMINAL, chance_rows, tilted, white
from uavrt_experiments.integrate.flights import (
    PLANE,
    Samples,
    World,
    add_pulses,
    silence,
    turning,
)
from uavrt_experiments.integrate.place import from_middle
from uavrt_experiments.integrate.sensitivity import level_row
from uavrt_experiments.result import Row

_Floats = NDArray[np.float64]
_LEVELS_DB = (3.0, 4.0, 5.0, 6.0, 7.0)
_UNLIKE_S = 4e-5
"""Largest difference of a flight's interval from the mean [s]."""
_TOGETHER = 0.5
"""Share of the false-alarm probability that is used for all flights together."""


def worlds(flights: int, apart_m: float = 0.0, pulses: int = 100) -> tuple[World, ...]:
    """Worlds that turn on the spot, from west to east; a search of each takes a tenth of a
    second.
    """
    here = turning(pulses)
    east_m = (np.arange(flights) - 0.5 * (flights - 1)) * apart_m
    courses = [replace(here, east_m=here.east_m + one) for one in east_m]
    return tuple(World(course=one, slack_s=0.020, window_hz=60.0) for one in courses)


@lru_cache(maxsize=8)
def _looked_at(each: tuple[World, ...]) -> tuple[list[Places], list[_Floats], NDArray[np.intp]]:
    """Possible places of several flights, their gains, and the places that represent all."""
    places = []
    for one in each:
        course = one.course
        places.append(
            places_around(
                course.poses,
                PATTERNS[course.antenna],
                start_ns=START_NS,
                end_ns=START_NS + ns_from_s(course.duration_s),
                plane=PLANE,
            )
        )
    gains = common_gains(places)
    weights = np.concatenate([pulse_weights(gain) for gain in gains], axis=1)
    return places, gains, distinct(weights)


def searched(
    each: tuple[World, ...], energies: Sequence[SlotEnergies], *, moves: bool = False
) -> JointTrain:
    """Search several flights together."""
    places, gains, chosen = _looked_at(each)
    if moves:
        gains = [one.gain for one in places]
    flights = [
        Listened(energies=energy, gain=gain[chosen], time_s=place.time_s)
        for energy, gain, place in zip(energies, gains, places, strict=True)
    ]
    return search_together(flights, each[0].tag, moves=moves)


def _noise_case(
    flights: int,
    make: Callable[[np.random.Generator, World], Samples],
    what: str,
    *,
    moves: bool = False,
) -> Case:
    name = f"{flights} flights, {what}{', the tag moves' if moves else ''}"
    each = worlds(flights)

    def trial(rng: np.random.Generator, _: int) -> float:
        energies = [one.energies(make(rng, one)) for one in each]
        train = searched(each, energies, moves=moves)
        return math.log(train.hypotheses) + train.log_probability

    return Case(
        name=name,
        trials=1500,
        seconds=0.1 * flights,
        trial=trial,
        rows=lambda outcomes: chance_rows("I6", name, outcomes),
        least=30,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """Result of flights past one tag at rest."""

    enr_db: float
    alone: bool
    """True if any single flight finds the tag, at its share of the false-alarm probability of 1
    %.
    """
    found: bool
    """True if the tag is found when half of the 1 % is for all flights together."""
    held: bool | None
    """True if the 90 % region contains the tag; None if all together do not find it."""
    off_m: float | None


def fly_past(rng: np.random.Generator, each: tuple[World, ...], enr_db: float) -> Flown:
    """Fly several times past a tag; the strongest pulse of all has a given level."""
    truth = each[0].truth(rng)
    energies, singles = [], []
    strongest = [float(one.course.level_db(truth.east_m, truth.north_m).max()) for one in each]
    for one, level in zip(each, strongest, strict=True):
        own = replace(
            truth,
            interval_s=truth.interval_s + rng.uniform(-_UNLIKE_S, _UNLIKE_S),
            first_s=rng.uniform(0.0, truth.interval_s),
        )
        samples = silence(rng, one.course)
        add_pulses(rng, samples, one.pulses(rng, own, enr_db + level - max(strongest)))
        energies.append(one.energies(samples))
        singles.append(one.judge(energies[-1], NOMINAL).train.false_alarm_probability)
    joint = searched(each, energies)
    together = joint.false_alarm_probability <= NOMINAL * _TOGETHER
    alone = min(singles) * len(each)
    held = off_m = None
    if together:
        places, gains, chosen = _looked_at(each)
        heard = []
        for energy, train, trains, place, gain in zip(
            energies, joint.trains, joint.log_trains, places, gains, strict=True
        ):
            pulses = train_pulses(energy, train, gain[chosen[train.place]], place.time_s)
            heard.append(HeardTrain.among(energy, pulses, place, rates=1, log_trains=trains))
        belief = place_belief(heard)
        held = belief.cells.holds(*from_middle(belief, truth.east_m, truth.north_m), 0.9)
        east_m, north_m = PLANE.to_local(belief.latitude_deg, belief.longitude_deg)
        off_m = math.hypot(float(east_m) - truth.east_m, float(north_m) - truth.north_m)
    return Flown(
        enr_db=enr_db,
        alone=alone <= NOMINAL,
        found=together or alone <= NOMINAL * _TOGETHER,
        held=held,
        off_m=off_m,
    )


def _flown_case(name: str, each: tuple[World, ...], *, placed: bool, trials: int) -> Case:
    def trial(rng: np.random.Generator, index: int) -> Flown:
        level = 8.0 if placed else _LEVELS_DB[index % len(_LEVELS_DB)]
        return fly_past(rng, each, level)

    def rows(outcomes: Sequence[Flown]) -> list[Row]:
        if not placed:
            return [
                level_row("I6", f"{name}, {way}", None, points)
                for way, points in (
                    ("each evaluated alone", [(one.enr_db, one.alone) for one in outcomes]),
                    ("evaluated together", [(one.enr_db, one.found) for one in outcomes]),
                )
            ]
        held = [float(one.held) for one in outcomes if one.held is not None]
        off_m = [one.off_m for one in outcomes if one.off_m is not None]
        bar = {"least": 0.86, "most": 0.94}
        return [
            measured("I6", name, "90 % region holds", held, share, **bar),
            measured("I6", name, "median error, m", off_m, median),
        ]

    return Case(
        name=name,
        trials=trials,
        seconds=0.35 * len(each),
        trial=trial,
        rows=rows,
        least=len(_LEVELS_DB),
    )


I6 = Experiment(
    name="I6",
    title="Several flights together",
    cases=(
        _noise_case(2, white, "white noise"),
        _noise_case(2, white, "white noise", moves=True),
        _noise_case(4, tilted, "noise tilted by 6 dB"),
        _flown_case("3 flights of 100 pulses", worlds(3), placed=False, trials=300),
        _flown_case(
            "2 flights of 100 pulses 1 km apart, 8 dB",
            worlds(2, 1000.0),
            placed=True,
            trials=400,
        ),
    ),
)
