"""I4: place of a tag after a whole flight: coverage of the regions, and errors."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, special

from uavrt.core.units import wrap_degrees_180
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.whole_flight.heard_train import HeardTrain, train_pulses
from uavrt.localization.whole_flight.train_place import PlaceBelief, place_belief
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.figures import measured, median, share
from uavrt_experiments.integrate.false_alarms import NOMINAL
from uavrt_experiments.integrate.flights import (
    INTERVAL_S,
    PLANE,
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
from uavrt_experiments.integrate.sensitivity import best_train, narrow_world
from uavrt_experiments.localization.bearing_bars import disturbed
from uavrt_experiments.result import Row

_Floats = NDArray[np.float64]
_MEDIAN_OF_NORMAL = 0.6745
_SECOND_S = 1.1 * INTERVAL_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """Result of locating a tag."""

    held: bool
    """True if the 90 % region contains the tag."""
    arc_held: bool
    off_deg: float
    bound_deg: float
    mirror: bool
    """True if the 95 % region also contains the place mirrored at the line flown."""
    off_m: float
    """Distance of the tag from the nearest of the reported places [m]."""
    bound_m: float
    """Bound of the median error [m]."""
    fading_db: float
    """Fading of single pulses, as reported by the evaluation [dB]."""


def placed(
    rng: np.random.Generator,
    course: Course,
    enr_db: float,
    pattern_db: float,
    second_s: float | None = None,
    fading_db: float = 0.0,
) -> Placed | None:
    """Fly, search and locate a tag; None if it was not found.

    `enr_db`: ENR of the strongest pulse [dB].
    `pattern_db`: difference of the true pattern from the table [dB].
    `second_s`: interval of the tag in the second half of the flight [s].
    `fading_db`: standard deviation of single pulses' levels about the course's [dB].
    """
    world = replace(narrow_world(course), second_s=second_s)
    pattern = PATTERNS[course.antenna]
    if pattern_db:
        pattern = disturbed(rng, pattern, pattern_db)
    truth = world.truth(rng)
    samples = silence(rng, course)
    sent = world.pulses(rng, truth, enr_db, pattern=pattern)
    if fading_db:
        sent = [
            replace(one, enr_db=one.enr_db + float(rng.normal(0.0, fading_db))) for one in sent
        ]
    add_pulses(rng, samples, sent)
    energies = world.energies(samples)
    train = best_train(world, energies)
    if train.false_alarm_probability > NOMINAL:
        return None
    places, chosen = looked_at(course)
    pulses = train_pulses(energies, train, places.gain[chosen[train.place]], places.time_s)
    rates = len(world.tag.pulse_intervals_s)
    heard = HeardTrain.among(energies, pulses, places, rates=rates)
    belief = place_belief([heard])
    east_m, north_m = from_middle(belief, truth.east_m, truth.north_m)
    bearing = math.degrees(math.atan2(east_m, north_m))
    off = abs(float(wrap_degrees_180(belief.bearing_deg - bearing)))
    return Placed(
        held=belief.cells.holds(east_m, north_m, 0.9),
        arc_held=off <= 0.5 * belief.arc_deg(0.9),
        off_deg=off,
        bound_deg=bearing_bound_deg(world, truth, enr_db, heard.mean_noise_energy),
        mirror=belief.cells.holds(*from_middle(belief, -truth.east_m, truth.north_m), 0.95),
        off_m=_nearest_m(belief, truth),
        bound_m=position_bound_m(world, truth, enr_db, heard.mean_noise_energy),
        fading_db=belief.fading_db,
    )


def from_middle(belief: PlaceBelief, east_m: float, north_m: float) -> tuple[float, float]:
    """Convert a place of `PLANE` to coordinates from the middle of a flight."""
    east, north = belief.cells.plane.to_local(*PLANE.to_geodetic(east_m, north_m))
    return float(east), float(north)


def _nearest_m(belief: PlaceBelief, truth: Truth) -> float:
    off = []
    for one in belief.cells.parts():
        east, north = PLANE.to_local([one.latitude_deg], [one.longitude_deg])
        off.append(math.hypot(float(east[0]) - truth.east_m, float(north[0]) - truth.north_m))
    return min(off)


def position_bound_m(world: World, truth: Truth, enr_db: float, mean: float) -> float:
    """Median error of a position [m] by the Cramér-Rao bound, with unknown level and exponent.

    The prior of the path loss exponent is that of the search (2.5 ± 0.7).
    """
    course = world.course
    at_s = np.arange(truth.first_s, course.duration_s, truth.interval_s)

    def gain_db(east_m: float, north_m: float, exponent: float) -> _Floats:
        level = replace(course, exponent=exponent).level_db(east_m, north_m)
        return np.asarray(np.interp(at_s, course.time_s, level))

    here = np.array([truth.east_m, truth.north_m, course.exponent])
    middle = gain_db(*here)
    slopes = [np.ones(len(at_s))]
    for number, step in enumerate((1.0, 1.0, 0.01)):
        change = step * np.eye(3)[number]
        slopes.append((gain_db(*(here + change)) - gain_db(*(here - change))) / (2.0 * step))
    slope = np.stack(slopes, axis=1)
    levels, per_level = _information(round(mean, 1))
    each = np.interp(enr_db + middle - middle.max(), levels, per_level)
    information = slope.T @ (each[:, np.newaxis] * slope)
    information[3, 3] += 0.7**-2
    covariance = np.linalg.inv(information)[1:3, 1:3]
    drawn = np.random.default_rng(0).multivariate_normal((0.0, 0.0), covariance, 4000)
    return float(np.median(np.hypot(*drawn.T)))


def bearing_bound_deg(world: World, truth: Truth, enr_db: float, mean: float) -> float:
    """Cramér-Rao bound of the bearing with unknown level, as a standard deviation [deg]."""
    course = world.course
    pattern = PATTERNS[course.antenna]
    at_s = np.arange(truth.first_s, course.duration_s, truth.interval_s)
    distance = math.hypot(truth.east_m, truth.north_m)
    bearing = math.atan2(truth.east_m, truth.north_m)
    step = math.radians(0.5)

    def gain_db(turned: float) -> _Floats:
        place = distance * math.sin(bearing + turned), distance * math.cos(bearing + turned)
        return np.asarray(np.interp(at_s, course.time_s, course.gain_db(*place, pattern)))

    middle = gain_db(0.0)
    level_db = enr_db + middle - middle.max()
    slope = (gain_db(step) - gain_db(-step)) / 1.0  # dB per degree
    each = np.interp(level_db, *_information(round(mean, 1)))
    about = float(each @ slope) / float(each.sum())
    return float(1.0 / np.sqrt(each @ (slope - about) ** 2))


@lru_cache(maxsize=8)
def _information(mean: float) -> tuple[_Floats, _Floats]:
    """Levels [dB], and Fisher information of a slot's energy on the level [1/dB²]."""
    many = float(
        np.interp(
            mean,
            special.digamma(np.linspace(2, 13, 1101)) + np.euler_gamma,
            np.linspace(1, 12, 1101),
        )
    )
    levels = np.arange(-30.0, 31.0, 1.5)
    energy = np.concatenate((np.linspace(1e-3, 30.0, 600), np.geomspace(30.05, 2500.0, 800)))
    found = []
    for level in levels:
        here, up, down = (
            _density(energy, 10.0 ** ((level + step) / 10.0), many)
            for step in (0.0, 0.05, -0.05)
        )
        slope = (up - down) / 0.1
        found.append(float(integrate.trapezoid(slope**2 / np.maximum(here, 1e-300), energy)))
    return levels, np.array(found)


def _density(energy: _Floats, strength: float, many: float) -> _Floats:
    """Probability density of the largest of several exponentials and a pulse's energy."""
    from scipy.stats import ncx2

    x = 2.0 * np.sqrt(energy * strength)
    pulse = np.exp(x - energy - strength) * special.i0e(x)
    held = ncx2.cdf(2.0 * energy, 2, 2.0 * strength)
    below = -np.expm1(-energy)
    found = below ** (many - 1.0) * pulse
    if many > 1.0:
        found = found + (many - 1.0) * below ** (many - 2.0) * np.exp(-energy) * held
    return np.asarray(found)


def _case(
    course: Course,
    enr_db: float,
    *,
    pattern_db: float = 0.0,
    second_s: float | None = None,
    fading_db: float = 0.0,
    kind: str,
) -> Case:
    wrong = f", pattern {pattern_db:g} dB wrong" if pattern_db else ""
    switched = "" if second_s is None else ", another rate in the second half"
    fades = f", fading by {fading_db:g} dB" if fading_db else ""
    name = f"{course.name}, {enr_db:g} dB{wrong}{switched}{fades}"
    return Case(
        name=name,
        trials=600,
        seconds=1.0,
        trial=lambda rng, _: placed(rng, course, enr_db, pattern_db, second_s, fading_db),
        rows=_rows(name, kind, barred=not (pattern_db or fading_db)),
        least=4,
    )


def _rows(
    name: str, kind: str, *, barred: bool
) -> Callable[[Sequence[Placed | None]], list[Row]]:
    def make(outcomes: Sequence[Placed | None]) -> list[Row]:
        found = [one for one in outcomes if one is not None]
        # What is loud may be reported too carefully: the model's errors limit it, not noise.
        bar = {"least": 0.86} if kind == "loud" else {"least": 0.86, "most": 0.94}
        held = [float(one.arc_held if kind == "bearing" else one.held) for one in found]
        what = "90 % arc holds" if kind == "bearing" else "90 % region holds"
        rows = [measured("I4", name, what, held, share, **bar)]
        if kind == "loud":
            bound = float(np.median([one.bound_m for one in found] or [math.nan]))
            off = [one.off_m for one in found]
            most = 1.3 * bound if barred else None
            what = "median error of the nearest place, m"
            rows.append(measured("I4", name, what, off, median, most=most, bound=bound))
        elif kind == "mirror":
            both = [float(one.mirror) for one in found]
            rows.append(
                measured("I4", name, "95 % region holds the mirror", both, share, least=0.9)
            )
            bound = float(np.median([one.bound_m for one in found] or [math.nan]))
            off = [one.off_m for one in found]
            what = "median error of the nearer place, m"
            rows.append(measured("I4", name, what, off, median, most=1.3 * bound, bound=bound))
        else:
            bound = _MEDIAN_OF_NORMAL * float(
                np.median([one.bound_deg for one in found] or [math.nan])
            )
            errors = [one.off_deg for one in found]
            most = 1.3 * bound if barred else None
            rows.append(
                measured(
                    "I4",
                    name,
                    "median bearing error, °",
                    errors,
                    median,
                    most=most,
                    bound=bound,
                )
            )
        return rows

    return make


I4 = Experiment(
    name="I4",
    title="Where it is",
    cases=(
        _case(turning(), 6.0, kind="bearing"),
        _case(turning(), 6.0, pattern_db=1.5, kind="bearing"),
        _case(turning(50), 12.0, kind="bearing"),
        _case(stops(), 6.0, kind="region"),
        _case(stops(), 6.0, pattern_db=1.5, kind="region"),
        _case(passing(), 5.0, kind="mirror"),
        _case(lawnmower(tag="inside"), 12.0, kind="loud"),
        _case(lawnmower(tag="inside"), 25.0, kind="loud"),
        _case(lawnmower(tag="inside"), 30.0, fading_db=2.5, kind="loud"),
        _case(lawnmower(tag="inside"), 45.0, fading_db=2.5, kind="loud"),
        _case(stops(), 16.0, second_s=_SECOND_S, kind="loud"),
        _case(stops(), 20.0, pattern_db=1.5, kind="loud"),
    ),
)
