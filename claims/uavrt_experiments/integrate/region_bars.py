"""I8: how often regions of whole-flight searches contain the tag.

One simulated world draws errors as the estimator assumes them; the others do not. No constant
of the estimator may be chosen by these worlds.
"""

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from uavrt.core.units import wrap_degrees_180
from uavrt.localization.antenna import PATTERNS, AntennaPattern
from uavrt.localization.position.tuning import COMMON
from uavrt.localization.tuning import FLIGHT
from uavrt.localization.whole_flight.ground_cells import Cells
from uavrt.localization.whole_flight.heard_train import HeardTrain, train_pulses
from uavrt.localization.whole_flight.train_place import place_belief
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.figures import measured, share
from uavrt_experiments.integrate.flights import (
    RATE_HZ,
    Course,
    add_pulses,
    lawnmower,
    looked_at,
    passing,
    silence,
    stops,
    turning,
)
from uavrt_experiments.integrate.place import from_middle
from uavrt_experiments.integrate.sensitivity import best_train, narrow_world
from uavrt_experiments.localization.posterior_calibration import LEAST_P
from uavrt_experiments.result import Row

_Floats = NDArray[np.float64]
_LASTING_DB, _ALIKE = 1.0, 0.6
"""Fading that neighbouring pulses share [dB], and its correlation from one to the next."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """Errors of a simulated flight, of its antenna and of its pulses."""

    name: str
    heading_deg: float = 0.0
    """Error of all headings [deg]."""
    heading_sigma_deg: float = 0.0
    fading_db: float = 1.0
    """Standard deviation of each pulse's fading [dB]."""
    lasting_db: float = 0.0
    back_db: float = 0.0
    """Level of the true pattern behind the antenna, relative to the table's [dB]."""
    line_db: float | None = None
    """Noise of a power line on boresight, relative to the receiver's own [dB]."""
    exponent: tuple[float, float] = (2.0, 0.0)
    """Mean and standard deviation of the path loss exponent; values below 2 become 2."""
    walked_m: float = 0.0
    """Distance that the tag walks during the flight, in a random direction [m]."""
    stronger_db: float = 0.0
    """Level of the strongest pulse above that of the course [dB]."""


OWN = Conditions(
    name="own world",
    heading_sigma_deg=COMMON.heading_sigma_deg,
    lasting_db=_LASTING_DB,
    exponent=(2.5, 0.7),
)
OTHER = Conditions(
    name="2 dB of pattern behind, 2° of heading, 2 dB of fading",
    heading_deg=2.0,
    fading_db=2.0,
    back_db=2.0,
)


LINES = tuple(
    replace(OWN, name=f"power line, {line_db:g} dB", line_db=line_db)
    for line_db in (3.0, 6.0, 12.0)
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Regions:
    """Result of locating a tag after a flight."""

    off_deg: float
    arc90_deg: float
    rank: float
    """Posterior probability of all positions that are more probable than the tag's."""
    held50: bool
    held90: bool
    held95: bool
    walked: bool
    """True if the tag seems to have walked; its position is then that at the last pulse."""

    @property
    def held_arc90(self) -> bool:
        """True if the tag's bearing lies in the arc of 90 % probability."""
        return abs(self.off_deg) <= 0.5 * self.arc90_deg


def _near(course: Course, half_m: float) -> Course:
    """Course with the tag anywhere in a square around its middle."""

    def place(rng: np.random.Generator) -> tuple[float, float]:
        east, north = rng.uniform(-half_m, half_m, 2)
        return float(east), float(north)

    return replace(course, tag_at=place)


def _nose_first(course: Course) -> Course:
    """Course with a directional antenna that points along the path."""
    along = np.degrees(np.arctan2(np.gradient(course.east_m), np.gradient(course.north_m)))
    return replace(course, antenna="RA-23K", yaw_deg=along)


COURSES = {
    "turning on the spot": (turning(225), 8.0),
    "8 stops 150 m apart": (_near(stops(8, 28, apart_m=150.0), 700.0), 14.0),
    "4 lanes": (_nose_first(lawnmower(tag="inside", side_m=600.0, legs=4)), 14.0),
    "pass": (_nose_first(passing(225, aside_m=400.0)), 10.0),
}
"""Courses by name, with the level of the strongest pulse [dB]."""


def _with_back(pattern: AntennaPattern, more_db: float) -> AntennaPattern:
    """Pattern with a higher level behind, rising from 60 to 100° off boresight."""
    angle = np.linspace(0.0, 180.0, len(pattern.e_plane_db))
    more = more_db * np.clip((angle - 60.0) / 40.0, 0.0, 1.0)
    return replace(
        pattern, e_plane_db=tuple(float(x) for x in np.asarray(pattern.e_plane_db) + more)
    )


def _rank(cells: Cells, east_m: float, north_m: float) -> float:
    """Probability of all cells denser than a position's, and half of its own cell's."""
    density = cells.probability / cells.area
    bearing = np.degrees(np.arctan2(east_m, north_m))
    turn = np.abs(wrap_degrees_180(cells.bearing_deg - bearing)) / cells.width_deg
    apart = np.abs(np.log(np.hypot(east_m, north_m) / cells.range_m)) / np.log(cells.ratio)
    here = int(np.argmin(np.maximum(turn, apart)))
    likelier = float(cells.probability[density > density[here]].sum())
    return likelier + 0.5 * float(cells.probability[here])


def located(
    rng: np.random.Generator,
    course: Course,
    enr_db: float,
    world: Conditions,
    *,
    noise_known: bool = False,
) -> Regions | None:
    """Fly, search and locate a tag; None if it was not found.

    With `noise_known`, the evaluation receives samples that are divided by a power line's true
    noise.
    """
    heard_by = narrow_world(course)
    pattern = PATTERNS[course.antenna]
    exponent = max(2.0, float(rng.normal(*world.exponent)))
    turned = world.heading_deg + float(rng.normal(0.0, world.heading_sigma_deg))
    true = replace(course, exponent=exponent, yaw_deg=course.yaw_deg + turned)
    truth = heard_by.truth(rng)
    towards = rng.uniform(0.0, 2.0 * math.pi) if world.walked_m else 0.0
    walked_m = world.walked_m * np.array([math.sin(towards), math.cos(towards)])
    part = course.time_s / course.duration_s - 0.5
    true = replace(
        true,
        east_m=course.east_m - walked_m[0] * part,
        north_m=course.north_m - walked_m[1] * part,
    )
    enr_db += world.stronger_db
    sent = replace(heard_by, course=true).pulses(
        rng, truth, enr_db, pattern=_with_back(pattern, world.back_db)
    )
    fading = rng.normal(0.0, world.lasting_db, len(sent))
    for number in range(1, len(sent)):
        fading[number] *= math.sqrt(1.0 - _ALIKE**2)
        fading[number] += _ALIKE * fading[number - 1]
    fading += rng.normal(0.0, world.fading_db, len(sent))
    samples = silence(rng, course)
    over = np.ones(len(course.time_s))
    if world.line_db is not None:
        line = rng.uniform(0.0, 360.0)
        over += 10.0 ** ((world.line_db + pattern.gain_db(line - true.yaw_deg)) / 10.0)
    at_s = np.arange(len(samples)) / RATE_HZ
    noise = np.sqrt(np.interp(at_s, course.time_s, over)).astype(np.float32)
    samples *= noise
    sent = [
        replace(one, enr_db=one.enr_db + float(more))
        for one, more in zip(sent, fading, strict=True)
    ]
    add_pulses(rng, samples, sent)
    energies = heard_by.energies(samples / noise if noise_known else samples)
    if noise_known:
        noise_db = 10.0 * np.log10(np.interp(energies.time_s, course.time_s, over))
        energies = replace(energies, noise_db=noise_db)
    train = best_train(heard_by, energies)
    if not (train.loud or train.false_alarm_probability <= 0.01):
        return None
    places, chosen = looked_at(course)
    pulses = train_pulses(energies, train, places.gain[chosen[train.place]], places.time_s)
    belief = place_belief([HeardTrain.among(energies, pulses, places, rates=1)])
    shift = rng.normal(0.0, FLIGHT.place_sigma_m, 2)
    if belief.walked:
        shift += 0.5 * walked_m
    east_m, north_m = from_middle(belief, truth.east_m + shift[0], truth.north_m + shift[1])
    cells = belief.cells
    bearing = math.degrees(math.atan2(east_m, north_m))
    return Regions(
        off_deg=float(wrap_degrees_180(belief.bearing_deg - bearing)),
        arc90_deg=belief.arc_deg(0.9),
        rank=_rank(cells, east_m, north_m),
        held50=cells.holds(east_m, north_m, 0.5),
        held90=cells.holds(east_m, north_m, 0.9),
        held95=cells.holds(east_m, north_m, 0.95),
        walked=belief.walked,
    )


def _region_case(
    world: Conditions, trials: int, bars: dict[str, tuple[float | None, float | None]]
) -> Case:
    """Case that flies all courses in turn; `bars`: limits by the start of a quantity."""
    names = list(COURSES)

    def trial(rng: np.random.Generator, number: int) -> Regions | None:
        course, enr_db = COURSES[names[number % len(names)]]
        return located(rng, course, enr_db, world)

    def rows(outcomes: Sequence[Regions | None]) -> list[Row]:
        made = []
        for name, each in ((world.name, outcomes), *_by_course(names, world, outcomes)):
            found = outcomes_found(each)
            for quantity, held in (
                ("50 % region holds", [float(one.held50) for one in found]),
                ("90 % region holds", [float(one.held90) for one in found]),
                ("95 % region holds", [float(one.held95) for one in found]),
                ("90 % arc holds", [float(one.held_arc90) for one in found]),
                ("walk recognised", [float(one.walked) for one in found]),
            ):
                least, most = bars.get(quantity[:4], (None, None))
                own = {} if each is not outcomes else {"least": least, "most": most}
                made.append(measured("I8", name, quantity, held, share, **own))
        return made

    return Case(name=world.name, trials=trials, seconds=2.0, trial=trial, rows=rows, least=4)


def _paired_case(world: Conditions) -> Case:
    """Case that evaluates each flight twice, with measured and with known noise."""
    names = [name for name in COURSES if name != "pass"]  # a pass gives two bearings

    def trial(rng: np.random.Generator, number: int) -> tuple[Regions | None, Regions | None]:
        course, enr_db = COURSES[names[number % len(names)]]
        again = copy.deepcopy(rng)
        return (
            located(rng, course, enr_db, world),
            located(again, course, enr_db, world, noise_known=True),
        )

    def rows(outcomes: Sequence[tuple[Regions | None, Regions | None]]) -> list[Row]:
        both = [(abs(a.off_deg), abs(b.off_deg)) for a, b in outcomes if a and b]
        off_deg = np.array(both).reshape(-1, 2)

        def ratio(flights: _Floats) -> _Floats:
            measured_deg, known_deg = np.median(off_deg[flights.astype(np.intp)], axis=-2).T
            return np.asarray(measured_deg / known_deg)

        quantity = "median error of the bearing, over that with known noise"
        return [measured("I8", world.name, quantity, range(len(both)), ratio, most=1.2)]

    return Case(
        name=f"{world.name}, known noise",
        trials=150,
        seconds=4.0,
        trial=trial,
        rows=rows,
        least=6,
    )


def _by_course(
    names: Sequence[str], world: Conditions, outcomes: Sequence[Regions | None]
) -> list[tuple[str, Sequence[Regions | None]]]:
    return [
        (f"{world.name}: {name}", outcomes[number :: len(names)])
        for number, name in enumerate(names)
    ]


def outcomes_found(outcomes: Sequence[Regions | None]) -> list[Regions]:
    """Outcomes of flights in which the tag was found."""
    return [one for one in outcomes if one is not None]


def _rank_case(name: str, world: Conditions, **bar: float) -> Case:
    """Case that tests ranks of true positions after turning (Talts et al. 2018)."""
    course, enr_db = COURSES["turning on the spot"]

    def rows(outcomes: Sequence[Regions | None]) -> list[Row]:
        ranks = [one.rank for one in outcomes_found(outcomes)]
        chance = float(stats.kstest(ranks, "uniform").pvalue)
        return [Row.counted("I8", "chance of the ranks", name, chance, len(ranks), **bar)]

    return Case(
        name=name,
        trials=400,
        seconds=1.0,
        trial=lambda rng, _: located(rng, course, enr_db, world),
        rows=rows,
        least=4,
    )


I8 = Experiment(
    name="I8",
    title="Regions in other worlds",
    cases=(
        _region_case(
            OWN, 300, {"50 %": (0.45, 0.60), "95 %": (0.92, 0.98), "walk": (None, 0.05)}
        ),
        _region_case(
            OTHER, 300, {"50 %": (0.40, None), "95 %": (0.88, None), "walk": (None, 0.05)}
        ),
        *(_region_case(line, 900, {"90 %": (0.86, 0.94)}) for line in LINES),
        *(_paired_case(line) for line in LINES),
        *(
            _region_case(
                replace(
                    OWN,
                    name=f"the tag walks {walked_m:g} m, 10 dB stronger",
                    walked_m=walked_m,
                    stronger_db=10.0,
                ),
                200,
                {},
            )
            for walked_m in (40.0, 100.0, 150.0)
        ),
        _rank_case("ranks, own world", OWN, least=LEAST_P),
        _rank_case("ranks, headings 6° off", replace(OWN, heading_deg=6.0), most=LEAST_P),
    ),
)
