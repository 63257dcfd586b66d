"""Simulated turns, surveys and flights by which constants are screened.

Each judge returns the figures of one trial by name; a trial's generator is the same whatever
the constants are.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.localization.antenna import NULL_DB
from uavrt.localization.bearing.estimate_bearing import estimate_bearing
from uavrt.localization.bearing.turns import find_turns
from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.levels.level_belief import Listening
from uavrt.localization.position.trackers import ParticleTracker, TagPrior
from uavrt.localization.results import Bearing
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.localization.whole_flight.energies.energy_grid import slot_energies
from uavrt.localization.whole_flight.train_judging import judge
from uavrt_experiments.coverage import shadow
from uavrt_experiments.detection.coded import add_burst, some_codes
from uavrt_experiments.detection.signals import START_NS, noise
from uavrt_experiments.integrate import false_alarms, several
from uavrt_experiments.integrate.flights import RATE_HZ
from uavrt_experiments.integrate.region_bars import (
    COURSES,
    OTHER,
    OWN,
    Conditions,
    located,
)
from uavrt_experiments.integrate.sensitivity import fly as searched
from uavrt_experiments.localization.bearing_bars import error_after_learning
from uavrt_experiments.localization.common_error_bars import CASES, Errors, flight, turn
from uavrt_experiments.localization.flight_calibration import surveyed
from uavrt_experiments.localization.misfit_worlds import CREWS, POSITIONS, TURNS
from uavrt_experiments.localization.moving_bars import KINDS, PLANE, stop_and_go
from uavrt_experiments.localization.position_bars import flown_lines
from uavrt_experiments.localization.rotations import (
    RotationCase,
    Trial,
    matched_power,
    trial,
)
from uavrt_experiments.search.terrain import PLANE as HILLS_PLANE
from uavrt_experiments.search.terrain import elevation_of

_Floats = NDArray[np.float64]
Figures = dict[str, float]
"""Figures of a trial. Those in [m], [°] and [nats] are numbers; all others are shares."""
Fly = Callable[[Generator], Figures]
_AREA = Area(west_m=0.0, east_m=600.0, south_m=0.0, north_m=600.0)
_POSE_RATE_HZ = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Judge:
    """A kind of trial, and the number of trials in a screening with 100 runs."""

    fly: Fly
    trials: int


def _of_bearing(found: Bearing) -> Figures:
    low, high = found.interval90_deg or (0.0, 360.0)
    return {
        "90 % arc [°]": float(np.remainder(high - low, 360.0)),
        "accepted": float(found.accepted),
        "ambiguous": float(found.ambiguous),
        "reflection flagged": float(found.multipath_suspected),
    }


def _of_turn(fly: Callable[[Generator], Trial], rng: Generator) -> Figures:
    flown = fly(rng)
    return {
        "error [°]": abs(flown.error_deg),
        "90 % arc holds": float(flown.covered),
        **_of_bearing(flown.bearing),
    }


def _correlated(rng: Generator) -> Trial:
    """Turn with fading whose correlation from pulse to pulse is 0.9."""
    truth = float(rng.uniform(0.0, 360.0))
    found = turn(rng, truth, 400.0, Errors(fading_correlation=0.9))
    return Trial(
        error_deg=float(np.remainder(found.bearing_deg - truth + 180.0, 360.0) - 180.0),
        bearing=found,
    )


def _nothing(rng: Generator) -> Figures:
    """Turn with noise, or with a steady interferer."""
    level = rng.normal(20.0, 2.0, 60)
    power = matched_power(rng, level) if rng.random() < 0.5 else rng.exponential(size=60)
    found = estimate_bearing(np.arange(0.0, 360.0, 6.0), None, matched_power=power)
    return {"taken for a tag": float(found.accepted)}


def _of_circle(miss_m: float, radius50_m: float | None, radius95_m: float | None) -> Figures:
    assert radius50_m is not None
    assert radius95_m is not None
    return {
        "error [m]": miss_m,
        "95 % radius [m]": radius95_m,
        "50 % circle holds": float(miss_m <= radius50_m),
        "95 % circle holds": float(miss_m <= radius95_m),
    }


def _six_bearings(errors: Errors, rng: Generator) -> Figures:
    flown = flight(rng, errors)
    found = flown.position
    return {
        **_of_circle(flown.miss_m, found.radius50_m, found.radius95_m),
        "warned": float(flown.warned),
        "cannot be checked": float(flown.unchecked),
    }


def _misfit(name: str, rng: Generator) -> Figures:
    flown = POSITIONS[name][0](rng)
    found = flown.found
    return {
        **_of_circle(flown.miss_m, found.radius50_m, found.radius95_m),
        "caution shown": float(bool(found.cautions)),
    }


def _survey(rng: Generator) -> Figures:
    found, tag = surveyed(rng)
    plane = TangentPlane(latitude_deg=47.4, longitude_deg=8.5)
    east, north = plane.to_local(found.latitude_deg, found.longitude_deg)
    miss_m = float(np.hypot(float(east) - tag[0], float(north) - tag[1]))
    return _of_circle(miss_m, found.radius50_m, found.radius95_m)


def _over_hills(case: shadow.OverHillsCase, rng: Generator) -> Figures:
    _, found = shadow.fly(rng, case)
    return {
        "error [m]": found.miss_m,
        "95 % radius [m]": found.radius_m,
        "95 % circle holds": float(found.held),
    }


def _crew(world: str, trials: int, rng: Generator) -> Figures:
    each = [
        _of_circle(one.miss_m, one.found.radius50_m, one.found.radius95_m)
        for one in CREWS[world](rng, trials=trials, tags=5)
    ]
    return {name: float(np.mean([one[name] for one in each])) for name in each[0]}


def _path(name: str, rng: Generator) -> Figures:
    followed = KINDS[name](rng)
    return {
        "error [m]": float(np.median(followed.off_m())),
        "50 % circles hold": followed.share_held(50),
        "95 % circles hold": followed.share_held(95),
        "walk recognised": float(any(one.name == "walk" for one in followed.found.cautions)),
    }


def _tracked(speed_m_s: float, weaker_db: float, rng: Generator) -> Figures:
    """Track an animal in flight by 100 pulses along lines over a square of 600 m.

    `weaker_db`: loss of pulses in the western half, unknown to the tracker [dB].
    """
    tracker = ParticleTracker(
        TagPrior(area=_AREA), np.random.default_rng(rng.integers(2**32)), particles=2000
    )
    east, north, time_s = flown_lines(600.0, 150.0)
    walk = stop_and_go(rng, float(time_s[-1]), speed_m_s=speed_m_s).moved(
        *rng.uniform(150.0, 450.0, 2)
    )
    level_db, exponent = rng.normal(45.0, 8.0), max(2.0, rng.normal(3.0, 0.5))
    shadow_db = 0.0
    for number in range(0, len(time_s), 3):
        x, y = walk.at(float(time_s[number]))
        ground = float(np.hypot(x - east[number], y - north[number]))
        slant = float(np.hypot(ground, 40.0))
        shadow_db = 0.4 * shadow_db + rng.normal(0.0, 1.4)
        snr_db = level_db - 10.0 * exponent * np.log10(slant / 100.0) + shadow_db
        snr_db += max(20.0 * np.log10(max(ground / slant, 1e-6)), NULL_DB)
        snr_db += rng.normal(0.0, 4.0) - weaker_db * float(east[number] < 300.0)
        heard = snr_db >= 10.0 and rng.random() >= 0.02
        if rng.random() < 0.02:
            heard, snr_db = True, 10.0 + rng.exponential(3.0)
        tracker.advance_to(float(time_s[number]))
        tracker.listen(
            Listening(
                east_m=float(east[number]),
                north_m=float(north[number]),
                height_m=40.0,
                snr_db=float(snr_db) if heard else None,
            )
        )
    found = tracker.estimate()
    x, y = walk.at(float(time_s[-1]))
    miss_m = float(np.hypot(found.east_m - x, found.north_m - y))
    return _of_circle(miss_m, found.radius50_m, found.radius95_m)


def _tracked_over_a_ridge(rng: Generator) -> Figures:
    """Track a resting tag behind a ridge whose loss is once to twice that of the map."""
    heights = shadow.ridge_land(rng)
    hills = HillLosses(
        elevation_of(heights),
        latitude_deg=HILLS_PLANE.latitude_deg,
        longitude_deg=HILLS_PLANE.longitude_deg,
    )
    area = Area(west_m=-500.0, east_m=500.0, south_m=-500.0, north_m=500.0)
    tracker = ParticleTracker(
        TagPrior(area=area, hills=hills), np.random.default_rng(3), particles=2000
    )
    tag = np.array([rng.uniform(100.0, 400.0)]), np.array([rng.uniform(-200.0, 200.0)])
    factor = rng.uniform(1.0, 2.0)
    for number, north in enumerate(np.arange(-400.0, 401.0, 16.0)):
        here = (-120.0, float(north), 40.0)
        slant = float(np.sqrt((here[0] - tag[0]) ** 2 + (north - tag[1]) ** 2 + 40.0**2)[0])
        lost_db = factor * float(hills.loss_db(here, *tag)[0])
        snr_db = 50.0 - 25.0 * np.log10(slant / 100.0) - lost_db + rng.normal(0.0, 4.0)
        tracker.advance_to(2.0 * number)
        tracker.listen(
            Listening(
                east_m=here[0],
                north_m=here[1],
                height_m=here[2],
                snr_db=snr_db if snr_db >= 10.0 else None,
            )
        )
    found = tracker.estimate()
    miss_m = float(np.hypot(found.east_m - tag[0][0], found.north_m - tag[1][0]))
    return _of_circle(miss_m, found.radius50_m, found.radius95_m)


def _turns_found(rng: Generator) -> Figures:
    """Find four turns between flown paths: in wind, in both directions, and with stops."""
    yaw, east, height = [0.0], [0.0], [0.0]

    def on(
        seconds: float, *, turned_deg: float = 0.0, m_s: float = 0.0, up_m: float = 0.0
    ) -> None:
        steps = max(1, round(seconds * _POSE_RATE_HZ))
        part = np.arange(1, steps + 1) / steps
        yaw.extend(yaw[-1] + turned_deg * part)
        east.extend(east[-1] + m_s * seconds * part)
        height.extend(height[-1] + up_m * part)

    on(20.0, up_m=40.0, turned_deg=rng.uniform(-360.0, 360.0))
    for _ in range(4):
        on(rng.uniform(5.0, 30.0), m_s=8.0)
        on(rng.uniform(2.0, 10.0))
        way = rng.choice([-1.0, 1.0])
        if rng.random() < 0.5:
            drift_m_s = rng.uniform(0.0, 0.4)
            on(rng.uniform(40.0, 70.0), turned_deg=360.0 * way, m_s=drift_m_s)
        else:
            for _ in range(7):
                on(rng.uniform(4.0, 10.0))
                on(2.0, turned_deg=45.0 * way)
            on(8.0)
        on(rng.uniform(2.0, 10.0))
    count = len(yaw)
    wander = np.cumsum(rng.normal(0.0, 0.05, (2, count)), axis=1)
    gusts = 3.0 * np.sin(2.0 * np.pi * (np.arange(count) / 85.0 + rng.random()))
    turns = find_turns(
        START_NS + (np.arange(count) * NANOSECONDS_PER_SECOND / _POSE_RATE_HZ).astype(np.int64),
        np.remainder(np.array(yaw) + gusts + rng.normal(0.0, 0.5, count), 360.0),
        *PLANE.to_geodetic(
            np.array(east) + wander[0] + rng.normal(0.0, 0.1, count),
            wander[1] + rng.normal(0.0, 0.1, count),
        ),
        height_m=np.array(height) + rng.normal(0.0, 0.2, count),
    )
    return {
        "turns found, of four": len(turns) / 4.0,
        "all four found": float(len(turns) == 4),
        "stops found": sum(one.stops for one in turns) / 32.0,
        "yaw in turns [°]": float(sum(abs(one.turned_deg) for one in turns)),
    }


def _region(course: str, world: Conditions, rng: Generator) -> Figures:
    flown, enr_db = COURSES[course]
    found = located(rng, flown, enr_db, world)
    if found is None:
        return {"found": 0.0}
    return {
        "found": 1.0,
        "error [°]": abs(found.off_deg),
        "90 % arc [°]": found.arc90_deg,
        "probability denser than the tag's cell": found.rank,
        "50 % region holds": float(found.held50),
        "90 % region holds": float(found.held90),
        "95 % region holds": float(found.held95),
        "walk recognised": float(found.walked),
    }


def _silent(kind: str, rng: Generator) -> Figures:
    make = {
        "white": false_alarms.white,
        "tilted": false_alarms.tilted,
        "neighbour": false_alarms.neighbour,
        "second": false_alarms.second,
        "impulses": false_alarms.impulses,
    }[kind]
    judged = false_alarms.flown(rng, false_alarms.SHORT, make)
    return {
        "log of expected trains [nats]": max(judged.log_expected, -20.0),
        "false alarm": float(judged.found),
    }


def _weak(rng: Generator) -> Figures:
    """Whether a tag near the limit is found; the levels are those of half the detections."""
    course, enr_db = COURSES["turning on the spot"]
    del enr_db
    return {"found": float(searched(rng, course, rng.uniform(3.0, 5.0)).found)}


def _several(rng: Generator) -> Figures:
    flown = several.fly_past(rng, several.worlds(2, 1000.0), rng.uniform(5.0, 9.0))
    figures = {"found": float(flown.found), "found alone": float(flown.alone)}
    if flown.off_m is not None and flown.held is not None:
        figures |= {"error [m]": flown.off_m, "90 % region holds": float(flown.held)}
    return figures


def _several_silent(moves: bool, rng: Generator) -> Figures:
    each = several.worlds(2)
    energies = [one.energies(false_alarms.white(rng, one)) for one in each]
    train = several.searched(each, energies, moves=moves)
    expected = float(np.log(train.hypotheses)) + train.log_probability
    return {"log of expected trains [nats]": max(expected, -20.0)}


@cache
def _two_codes() -> tuple[Tag, Tag]:
    one, other = some_codes(np.random.default_rng(1), 2)
    return (replace(one, pulse_intervals_s=(3.0,)), replace(other, pulse_intervals_s=(3.0,)))


def _coded(enr_db: tuple[float, float], rng: Generator) -> Figures:
    """Search a channel with bursts of one code for that code and for another."""
    sent, other = _two_codes()
    samples = noise(rng, round(75.0 * RATE_HZ))
    level_db = rng.uniform(*enr_db)
    for number in range(24):
        add_burst(
            samples,
            sent,
            start_s=1.3 + 3.001 * number,
            offset_hz=40.0,
            enr_db=level_db,
            stretch=1e-3 / sum(sent.gaps_s),
            rng=rng,
            sample_rate_hz=RATE_HZ,
        )
    found = []
    for tag in (sent, other):
        energies = slot_energies(
            samples,
            np.ones(len(samples), bool),
            tag=tag,
            start_ns=START_NS,
            sample_rate_hz=RATE_HZ,
            center_frequency_hz=tag.frequency_hz,
            frequency_window_hz=60.0,
        )
        judged = judge(energies, np.ones((1, 2)), np.array([0.0, 75.0]), tag)
        found.append(float(judged.train.false_alarm_probability <= 0.01))
    return {"found": found[0], "other code found": found[1]}


def _learned(rng: Generator) -> Figures:
    return {"error [°]": abs(error_after_learning(rng, RotationCase()))}


JUDGES: dict[str, Judge] = {
    "turn of 60 pulses": Judge(
        fly=partial(_of_turn, partial(trial, case=RotationCase())), trials=100
    ),
    "turn of 8 pulses": Judge(
        fly=partial(_of_turn, partial(trial, case=RotationCase(pulses=8, fading_db=1.0))),
        trials=100,
    ),
    "turn, pulses below the threshold": Judge(
        fly=partial(
            _of_turn,
            partial(trial, case=RotationCase(pulses=30, fading_db=4.0, threshold_db=10.0)),
        ),
        trials=100,
    ),
    "turn, fading of correlation 0.9": Judge(fly=partial(_of_turn, _correlated), trials=60),
    **{
        f"turn, {name}": Judge(fly=partial(_of_turn, TURNS[name]), trials=60)
        for name in ("power line, 12 dB", "pattern 1 dB off", "second path, -3 dB")
    },
    "turn without a tag": Judge(fly=_nothing, trials=100),
    "antenna pattern learned from turns": Judge(fly=_learned, trials=10),
    "turns in a flight": Judge(fly=_turns_found, trials=100),
    **{
        f"six bearings, {name}": Judge(fly=partial(_six_bearings, CASES[name]), trials=trials)
        for name, trials in (
            ("drawn from the priors", 60),
            ("compass + 20°", 20),
            ("tag walks 0.5 m/s", 20),
            ("compass + 20°, on one side", 20),
            ("5 % foreign pulses", 20),
        )
    },
    "survey, drawn from the priors": Judge(fly=_survey, trials=40),
    **{
        name: Judge(fly=partial(_misfit, name), trials=trials)
        for name, trials in (
            ("small survey, positions 3 m off", 40),
            ("survey, power line of 12 dB", 25),
            ("survey, power line of 12 dB, noise unknown", 15),
            ("2 receivers, gains of -40 to 40 dB", 60),
            ("observer displaced by a quarter", 40),
            ("observer displaced by a quarter, as stated", 40),
        )
    },
    **{
        f"survey over {case.name}": Judge(fly=partial(_over_hills, case), trials=trials)
        for case, trials in zip(shadow.CASES[1:], (10, 4), strict=True)
    },
    **{
        f"observer {world}, {trials} test trials": Judge(
            fly=partial(_crew, world, trials), trials=10
        )
        for world, trials in (("displaced by a quarter", 3), ("not displaced", 0))
    },
    **{
        f"path by {name}": Judge(fly=partial(_path, name), trials=trials)
        for name, trials in (
            ("six turns, steady, 0.5 m/s", 20),
            ("survey, stop and go, 1 m/s", 5),
            ("survey, out of its area, 1 m/s", 5),
        )
    },
    "tracker, animal stops and goes": Judge(fly=partial(_tracked, 0.5, 0.0), trials=60),
    "tracker, half the pulses 10 dB weaker": Judge(fly=partial(_tracked, 0.0, 10.0), trials=40),
    "tracker, tag behind a ridge": Judge(fly=_tracked_over_a_ridge, trials=30),
    "region, own world, turning": Judge(
        fly=partial(_region, "turning on the spot", OWN), trials=15
    ),
    "region, own world, stops": Judge(
        fly=partial(_region, "8 stops 150 m apart", OWN), trials=4
    ),
    "region, other pattern and fading, turning": Judge(
        fly=partial(_region, "turning on the spot", OTHER), trials=10
    ),
    "region, power line of 3 dB, turning": Judge(
        fly=partial(_region, "turning on the spot", replace(OWN, line_db=3.0)), trials=8
    ),
    "region, 15 dB stronger, turning": Judge(
        fly=partial(_region, "turning on the spot", replace(OWN, stronger_db=15.0)), trials=8
    ),
    **{
        f"whole flight, {kind}, no tag": Judge(fly=partial(_silent, kind), trials=25)
        for kind in ("white", "tilted", "neighbour", "second", "impulses")
    },
    "weak tag, turning": Judge(fly=_weak, trials=12),
    "two flights": Judge(fly=_several, trials=4),
    "two flights, no tag": Judge(fly=partial(_several_silent, False), trials=15),
    "two flights, no tag, it may move": Judge(fly=partial(_several_silent, True), trials=15),
    "coded tag, weak": Judge(fly=partial(_coded, (1.0, 4.0)), trials=6),
    "coded tag, strong": Judge(fly=partial(_coded, (12.0, 30.0)), trials=6),
}
"""Judges by name."""
