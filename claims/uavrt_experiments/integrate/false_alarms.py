"""I1: false alarms of flights without the tag, at the nominal rate."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.interference import coloured_noise
from uavrt_experiments.detection.signals import noise
from uavrt_experiments.integrate.flights import (
    INTERVAL_S,
    RATE_HZ,
    Samples,
    Truth,
    World,
    add_pulses,
    lawnmower,
    passing,
    turning,
)
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import Z95, Interval, poisson_interval

NOMINAL = 0.01
_SECOND = "second tag of 0 to 12 dB on the frequency"
SHORT = World(course=turning(100), slack_s=0.020, window_hz=60.0)
"""A search that takes a tenth of a second: 100 pulses, ± 20 ms, ± 60 Hz."""
_PASS = replace(SHORT, course=passing(100, speed_m_s=40.0))
_LANES = replace(SHORT, course=lawnmower(speed_m_s=40.0))
"""Lanes over the usual ground at four times the real speed, so with a fourth of the pulses."""
_STILL = replace(SHORT, course=replace(passing(100, speed_m_s=0.0), name="in one place"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Chance:
    """Result of evaluating a flight without its tag."""

    log_expected: float
    """Logarithm of the expected number of equally unlikely trains in noise."""
    found: bool
    """True if the tag is reported as found at the nominal probability."""


def flown(
    rng: np.random.Generator,
    world: World,
    make: Callable[[np.random.Generator, World], Samples],
    most_drift: float = 0.0,
) -> Chance:
    """Evaluate a flight without the tag."""
    judged = world.judge(world.energies(make(rng, world)), NOMINAL, most_drift)
    train = judged.train
    return Chance(
        log_expected=math.log(train.hypotheses) + train.log_probability,
        found=train.false_alarm_probability <= NOMINAL,
    )


def white(rng: np.random.Generator, world: World) -> Samples:
    """White noise."""
    return noise(rng, round(world.course.duration_s * RATE_HZ))


def tilted(rng: np.random.Generator, world: World) -> Samples:
    """Noise that rises by 6 dB from one edge of the channel to the other."""
    return coloured_noise(rng, round(world.course.duration_s * RATE_HZ), tilt_db=6.0)


def humming(rng: np.random.Generator, world: World) -> Samples:
    """Noise that rises by 6 dB over the channel, with lines of hum."""
    count = round(world.course.duration_s * RATE_HZ)
    return coloured_noise(rng, count, tilt_db=6.0, hum=True)


def neighbour(rng: np.random.Generator, world: World) -> Samples:
    """A neighbour 30 dB above a tag of 2 dB, 500 Hz away, with the tag's interval."""
    samples = white(rng, world)
    other = Truth(
        east_m=0.0,
        north_m=2000.0,
        interval_s=INTERVAL_S + rng.uniform(-0.015, 0.015),
        offset_hz=500.0,
        first_s=rng.uniform(0.0, INTERVAL_S),
    )
    add_pulses(rng, samples, world.pulses(rng, other, 32.0))
    return samples


def second(rng: np.random.Generator, world: World) -> Samples:
    """Another tag on the frequency, of 0 to 12 dB, at 1.13 to 1.16 of the interval."""
    samples = white(rng, world)
    east, north = world.course.tag_at(rng)
    other = Truth(
        east_m=east,
        north_m=north,
        interval_s=INTERVAL_S * rng.uniform(1.13, 1.16),
        offset_hz=rng.uniform(-40.0, 40.0),
        first_s=rng.uniform(0.0, INTERVAL_S),
    )
    add_pulses(rng, samples, world.pulses(rng, other, rng.uniform(0.0, 12.0)))
    return samples


def impulses(rng: np.random.Generator, world: World) -> Samples:
    """Impulses of one sample, one in 200 ms, of up to 40 dB in the window of a pulse."""
    samples = white(rng, world)
    count = rng.poisson(5.0 * world.course.duration_s)
    at = rng.integers(0, len(samples), count)
    amplitude = np.sqrt(75.0 * 10.0 ** (rng.uniform(0.0, 40.0, count) / 10.0))
    samples[at] += (amplitude * np.exp(2j * np.pi * rng.random(count))).astype(np.complex64)
    return samples


def gumbel_share(log_expected: Sequence[float], nominal: float = NOMINAL) -> Interval:
    """False alarms over nominal by the Gumbel law of the best trains, and their 95 % interval.

    If all chances are right, the following value has Gumbel's law of location 0 and scale 1:
    minus the logarithm of the expected number of trains as unlikely. Location and scale are
    fitted by maximum likelihood; the interval is by the delta method.
    """
    from scipy.stats import gumbel_r

    values = -np.asarray(log_expected)
    location, scale = gumbel_r.fit(values)
    at = (-math.log(-math.log1p(-nominal)) - location) / scale
    share = -math.expm1(-math.exp(-at))
    # Asymptotic covariance of location and scale (Johnson, Kotz & Balakrishnan 1995, § 22.9).
    n = len(values)
    variance = (1.1087 + 0.6079 * at**2 + 2.0 * 0.2570 * at) / n
    half = Z95 * math.sqrt(variance)
    low, high = (share * math.exp(-half), share * math.exp(half))
    return share / nominal, low / nominal, high / nominal


def _case(
    name: str,
    make: Callable[[np.random.Generator, World], Samples],
    world: World = SHORT,
    *,
    most_drift: float = 0.0,
    seconds: float = 0.12,
) -> Case:
    return Case(
        name=name,
        trials=2000,
        seconds=seconds,
        trial=lambda rng, _: flown(rng, world, make, most_drift),
        rows=_rows(name),
        least=30,
    )


def _rows(name: str) -> Callable[[Sequence[Chance]], list[Row]]:
    """Make the rows of a case; only trains of noise follow Gumbel's law, not those of a tag."""

    def make(outcomes: Sequence[Chance]) -> list[Row]:
        count = sum(one.found for one in outcomes)
        if name == _SECOND:
            return [_counted("I1", name, count, len(outcomes), least=0.7, most=1.4)]
        return chance_rows("I1", name, [one.log_expected for one in outcomes], count)

    return make


def chance_rows(
    experiment: str, name: str, log_expected: Sequence[float], found: int | None = None
) -> list[Row]:
    """Rows with false alarms by Gumbel's law, and counted, by default at the nominal chance."""
    if found is None:
        found = sum(-math.expm1(-math.exp(one)) <= NOMINAL for one in log_expected)
    fitted = Row.with_interval(
        experiment,
        "false alarms / nominal 1 % per flight, Gumbel fit",
        name,
        gumbel_share(log_expected),
        len(log_expected),
        least=0.7,
        most=1.4,
    )
    return [fitted, _counted(experiment, name, found, len(log_expected))]


def _counted(
    experiment: str,
    name: str,
    count: int,
    flights: int,
    least: float | None = None,
    most: float | None = None,
) -> Row:
    fewest, top = poisson_interval(count)
    expected = NOMINAL * flights
    return Row.with_interval(
        experiment,
        "false alarms / nominal 1 % per flight, counted",
        name,
        (count / expected, fewest / expected, top / expected),
        flights,
        least=least,
        most=most,
        note=f"{count} flights",
    )


I1 = Experiment(
    name="I1",
    title="False alarms of a flight without the tag",
    cases=(
        _case("white noise", white),
        _case("noise tilted by 6 dB", tilted),
        _case("neighbour + 30 dB, 500 Hz away", neighbour),
        _case(_SECOND, second),
        _case("tilted noise with hum", humming),
        _case("5 impulses a second of up to 40 dB", impulses),
        _case("white noise, in one place, hears all round", white, _STILL),
        _case("white noise, a straight pass", white, _PASS, seconds=0.15),
        _case("white noise, 5 lanes over 2 km square", white, _LANES, seconds=0.6),
        _case("white noise, drift of up to 1 %", white, most_drift=0.01, seconds=0.45),
    ),
)
