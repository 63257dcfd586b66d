"""I2, I3: weakest level at which a tag is found; drift, gaps and losses.

The search of a flight of 400 pulses takes ten seconds. For a detection curve only the cells
near the true train are searched, and the chance is that of the whole search.
"""

import math
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavrt.localization.whole_flight.drifting import search_drifting
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies
from uavrt.localization.whole_flight.flight_judgement import (
    FoldedTrain,
    Weights,
    chance,
    hypotheses_of,
    low_rank_weights,
    pulse_weights,
)
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.integrate.false_alarms import NOMINAL
from uavrt_experiments.integrate.flights import (
    INTERVAL_S,
    RATE_HZ,
    Course,
    Truth,
    World,
    add_pulses,
    lawnmower,
    looked_at,
    passing,
    silence,
    stops,
    turning,
)
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import level_for, share_of

WHOLE = {"slack_s": 0.060, "window_hz": 500.0}
"""Full search: ± 60 ms, ± 500 Hz."""
NARROW = {"slack_s": 0.002, "window_hz": 60.0}
"""Narrow search around the truth."""
_BELOW_DB = (-2.0, -1.25, -0.5, 0.25)
"""Levels of the curve relative to the required one [dB]."""
_ABOVE_DB = (0.0, 1.5, 3.0, 4.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """Result of one flight past a tag."""

    enr_db: float
    found: bool
    known: bool | None = None
    """True if the tag is found with known place and path loss; None: not computed."""


def narrow_world(course: Course) -> World:
    """World with a search around the truth only."""
    return World(course=course, **NARROW)


def best_train(
    world: World, energies: SlotEnergies, drift: float = 0.0, weights: Weights | None = None
) -> FoldedTrain:
    """The most likely train of a narrow search, by default over all places.

    Its chance is that of the whole search.
    """
    if weights is None:
        places, chosen = looked_at(world.course)
        weights = low_rank_weights(places.gain[chosen], places.time_s, energies, INTERVAL_S)
    train = search_drifting(energies, weights, world.tag, drift)
    if train.loud:
        return train
    here = hypotheses_of(energies, weights, world.tag)
    whole = hypotheses_of(
        energies, weights, replace(world.tag, interval_uncertainty_s=WHOLE["slack_s"])
    )
    wider = WHOLE["window_hz"] / world.window_hz
    hypotheses = train.hypotheses * wider * whole / here
    return replace(
        train,
        hypotheses=hypotheses,
        false_alarm_probability=chance(train.log_probability, hypotheses),
    )


def best_known(
    world: World, energies: SlotEnergies, truth: Truth, enr_db: float
) -> FoldedTrain:
    """The most likely train with the weights of the true place, path loss and level.

    No other place is counted, and intervals only to the extent that they differ over the part
    of the flight in which its pulses count. This bounds any search for a tag of unknown place.
    """
    course = world.course
    gain = 10.0 ** (0.1 * course.gain_db(truth.east_m, truth.north_m))
    weight = pulse_weights(gain, 10.0 ** (0.1 * enr_db))
    weights = Weights.over(
        weight[np.newaxis], np.ones((1, 1)), course.time_s, energies, INTERVAL_S
    )
    return best_train(world, energies, weights=weights)


def fly(
    rng: np.random.Generator,
    course: Course,
    enr_db: float,
    *,
    drift: float = 0.0,
    searched_drift: float = 0.0,
    lost: bool = False,
    missing: bool = False,
    second_s: float | None = None,
    known: bool = False,
) -> Heard:
    """Fly past a tag whose strongest pulse has a given level.

    `drift`, `searched_drift`: relative change of the interval over the flight: the tag's, and
    the largest searched.
    `lost`: true if 5 % of the samples are lost, a tenth of a second at a time.
    `missing`: true if a fifth of the flight is missing, in stretches of 20 s.
    `second_s`: interval in the flight's second half [s].
    `known`: true to evaluate also with known place.
    """
    world = replace(narrow_world(course), second_s=second_s)
    samples = silence(rng, course)
    truth = world.truth(rng)
    drifts = drift * rng.choice((-1.0, 1.0))
    add_pulses(rng, samples, world.pulses(rng, truth, enr_db, drift=drifts))
    there = np.ones(len(samples), bool)
    if lost:
        for first in rng.integers(0, len(samples) - 375, len(samples) // 7500):
            there[first : first + 375] = False
    if missing:
        for first in range(0, len(samples), round(100.0 * RATE_HZ)):
            late = first + round(rng.uniform(0.0, 80.0) * RATE_HZ)
            there[late : late + round(20.0 * RATE_HZ)] = False
    samples[~there] = 0.0
    energies = world.energies(samples, there)
    train = best_train(world, energies, searched_drift)
    best = best_known(world, energies, truth, enr_db) if known else None
    return Heard(
        enr_db=enr_db,
        found=train.false_alarm_probability <= NOMINAL,
        known=None if best is None else best.false_alarm_probability <= NOMINAL,
    )


def _curve(
    course: Course,
    most_db: float,
    *,
    name: str = "",
    barred: bool = True,
    seconds: float = 0.5,
    below_db: Sequence[float] = _BELOW_DB,
    known: bool = False,
    **kinds: float | bool,
) -> Case:
    levels = [most_db + below for below in below_db]
    case = course.name + name

    def trial(rng: np.random.Generator, index: int) -> Heard:
        level = levels[index % len(levels)]
        return fly(rng, course, level, known=known, **kinds)  # type: ignore[arg-type]

    def rows(outcomes: Sequence[Heard]) -> list[Row]:
        found = [(one.enr_db, one.found) for one in outcomes]
        bar_db = most_db if barred else None
        made = [level_row("I3" if kinds else "I2", case, bar_db, found)]
        if known:
            verdicts = [(one.enr_db, bool(one.known)) for one in outcomes]
            made.append(level_row("I2", f"{case}, place known to the search", None, verdicts))
        return made

    return Case(
        name=case, trials=600, seconds=seconds, trial=trial, rows=rows, least=2 * len(levels)
    )


def level_row(
    experiment: str, case: str, most_db: float | None, flown: Sequence[tuple[float, bool]]
) -> Row:
    """Row with the level at which half of the flights find a tag, from (level, found)."""
    points = [
        (level, sum(found for at, found in flown if at == level), count)
        for level, count in sorted(Counter(at for at, _ in flown).items())
    ]
    figure, low, high, _ = level_for(points, 0.5)
    counts = ", ".join(f"{hits}/{count} at {level:g} dB" for level, hits, count in points)
    return Row.with_interval(
        experiment,
        "ENR of the strongest pulse for Pd .5, dB",
        case,
        (figure, low, high),
        len(flown),
        most=most_db,
        note=counts,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Both:
    """Results of the narrow search and of the full one."""

    narrow: bool
    whole: bool


def _both(rng: np.random.Generator, _: int) -> Both:
    course = turning(60)
    world = World(course=course, slack_s=0.06, window_hz=150.0, spread_s=0.0016, spread_hz=48.0)
    samples = silence(rng, course)
    add_pulses(rng, samples, world.pulses(rng, world.truth(rng), rng.uniform(5.0, 10.0)))
    whole = world.judge(world.energies(samples), NOMINAL).train
    near = narrow_world(course)
    found = best_train(near, near.energies(samples))
    log_wider = math.log(WHOLE["window_hz"] / world.window_hz)
    limit = chance(found.log_probability, found.hypotheses / math.exp(log_wider))
    return Both(narrow=limit <= NOMINAL, whole=whole.false_alarm_probability <= NOMINAL)


def _agreement(outcomes: Sequence[Both]) -> list[Row]:
    same = sum(one.narrow == one.whole for one in outcomes)
    return [
        Row.with_interval(
            "I2",
            "same verdict of narrow and whole search",
            "turning on the spot, 60 pulses, 5 to 10 dB, ± 150 Hz",
            share_of(same, len(outcomes)),
            len(outcomes),
            least=0.9,
            note=f"{sum(one.whole for one in outcomes)} found",
        )
    ]


I2 = Experiment(
    name="I2",
    title="Sensitivity to weak tags",
    cases=(
        _curve(turning(), 3.2),
        _curve(stops(), 3.3),
        _curve(passing(exponent=2.0), 1.9),
        _curve(passing(exponent=4.0), 2.9),
        _curve(lawnmower(exponent=2.0), 0.9, seconds=0.7),
        _curve(lawnmower(exponent=4.0), 2.4, seconds=0.7),
        _curve(lawnmower(exponent=4.0, tag="midway"), 4.6, seconds=1.5, known=True),
        _curve(
            lawnmower(exponent=4.0, tag="inside", legs=6),
            4.6,
            barred=False,
            seconds=1.5,
            below_db=_ABOVE_DB,
            known=True,
        ),
        Case(
            name="narrow and whole search",
            trials=150,
            seconds=0.6,
            trial=_both,
            rows=_agreement,
            least=4,
        ),
    ),
)


def _ratio(rng: np.random.Generator, _: int) -> float:
    """Ratio of the CPU time of a search with drift to that of one without."""
    course = turning()
    world = World(course=course, slack_s=0.060, window_hz=250.0)
    samples = silence(rng, course)
    took = []
    places, chosen = looked_at(course)  # 0.4 s that neither of the two is charged with
    for drift in (0.0, 0.01):
        began = time.process_time()
        energies = world.energies(samples)
        weights = low_rank_weights(places.gain[chosen], places.time_s, energies, INTERVAL_S)
        search_drifting(energies, weights, world.tag, drift)
        took.append(time.process_time() - began)
    return took[1] / took[0]


def _ratio_rows(outcomes: Sequence[float]) -> list[Row]:
    return [
        Row.counted(
            "I3",
            "CPU time over that without drift",
            "drift of up to 1 %, ± 250 Hz, ± 60 ms, 400 pulses",
            float(np.median(outcomes)),
            len(outcomes),
            most=5.0,
        )
    ]


I3 = Experiment(
    name="I3",
    title="Drift and losses",
    cases=(
        _curve(
            turning(), 4.2, name=", drift 1 %", drift=0.01, searched_drift=0.01, seconds=3.0
        ),
        _curve(turning(), 3.5, name=", 5 % lost", lost=True),
        _curve(turning(), 4.2, name=", a fifth missing, 20 s at a time", missing=True),
        _curve(
            turning(),
            5.2,
            name=", half at another rate",
            second_s=1.1 * INTERVAL_S,
            seconds=0.7,
        ),
        Case(
            name="time of drift",
            trials=3,
            seconds=40.0,
            trial=_ratio,
            rows=_ratio_rows,
            alone=True,
        ),
    ),
)
