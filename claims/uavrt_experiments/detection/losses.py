"""E9: lost, repeated, reordered frames, irregular clocks; the first pulses of a stream."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.detection.search.thresholds import decision_interval_s
from uavrt_experiments.detection import original
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, TruePulse
from uavrt_experiments.detection.tracking import flight_rows
from uavrt_experiments.detection.trials import (
    RATE_HZ,
    Comparison,
    Flight,
    Samples,
    blocks_of,
    compare,
    detect,
    detect_blocks,
)
from uavrt_experiments.detection.unsaid import UNSAID_CASES
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import quantile, share_of

Frames = list[tuple[Samples, int]]
Disturb = Callable[[np.random.Generator, Frames], Frames]
FRAME = 1024
"""Number of samples in a datagram of the original's channelizer: 273 ms."""
FLIGHT_FRAME = 326
"""Number of samples in a block of our own channelizer at 3750 S/s: 87 ms."""
_ENR_DB = 16.0
_DURATION_S = 180.0
_SHORT_S = 60.0
_HOLE_S = 3.0
_JUMP_S = 1000.0
_SLEW = 200e-6


def lose(share: float) -> Disturb:
    """Drop random frames."""
    return lambda rng, frames: [f for f in frames if rng.uniform() >= share]


def repeat(share: float) -> Disturb:
    """Repeat random frames."""
    return lambda rng, frames: [
        f for frame in frames for f in (frame,) * (1 + (rng.uniform() < share))
    ]


def reorder(share: float) -> Disturb:
    """Swap frames with the ones that follow them."""

    def disturb(rng: np.random.Generator, frames: Frames) -> Frames:
        frames = list(frames)
        at = 0
        while at + 1 < len(frames):
            if rng.uniform() < share:
                frames[at], frames[at + 1] = frames[at + 1], frames[at]
                at += 1
            at += 1
        return frames

    return disturb


def hole(at_s: float) -> Disturb:
    """Drop the frames of three seconds, from a given time on."""
    low = START_NS + ns_from_s(at_s)
    return lambda rng, frames: [f for f in frames if not low <= f[1] < low + ns_from_s(_HOLE_S)]


def stamp_backwards(rng: np.random.Generator, frames: Frames) -> Frames:
    """Stamp a frame in the middle half a second too early."""
    at = len(frames) // 2
    wrong = (frames[at][0], frames[at][1] - 500_000_000)
    return [*frames[:at], wrong, *frames[at + 1 :]]


def stamp_jump(at_s: float) -> Disturb:
    """Set the clock 1000 s forward at a given time."""
    at = START_NS + ns_from_s(at_s)
    return lambda rng, frames: [
        (s, t + ns_from_s(_JUMP_S) if t >= at else t) for s, t in frames
    ]


def slew(rng: np.random.Generator, frames: Frames) -> Frames:
    """Stamp the frames with a clock that runs 200 ppm fast."""
    return [(s, START_NS + round((t - START_NS) * (1.0 + _SLEW))) for s, t in frames]


def _jumped(at_s: float) -> Callable[[TruePulse], float]:
    edge = math.ceil(at_s * RATE_HZ / FRAME) * FRAME / RATE_HZ
    return lambda pulse: pulse.start_s + (_JUMP_S if pulse.start_s >= edge else 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbed:
    """A flight with disturbed frames."""

    disturb: Disturb
    frame: int = FRAME
    when: Callable[[TruePulse], float] = lambda pulse: pulse.start_s
    """Time of a pulse on the clock of the frames [s]."""
    duration_s: float = _DURATION_S

    def fly(self, rng: np.random.Generator) -> Comparison:
        """Run one flight and compare the reports with the truth; lost pulses are counted."""
        flight = Flight(enr_db=_ENR_DB, duration_s=self.duration_s)
        samples, truth = flight.samples(rng)
        frames = self.disturb(rng, list(blocks_of(samples, block=self.frame)))
        pulses, _ = detect_blocks(frames, flight.tag)
        stamped = [replace(pulse, start_s=self.when(pulse)) for pulse in truth]
        return compare(pulses, stamped, flight.tag)


def _case(
    name: str,
    disturbed: Callable[[float], Disturbed],
    *,
    loss: Callable[[float], float] = lambda _: 0.0,
    published: float | None = None,
) -> Case:
    """Case with disturbed frames; the share that they lose may depend on their length."""

    def flights_of(duration_s: float, least: int) -> Case:
        flown = replace(disturbed(duration_s), duration_s=duration_s)
        return Case(
            name=name,
            trials=12,
            least=least,
            seconds=0.5,
            trial=lambda rng, _: flown.fly(rng),
            rows=lambda flights: flight_rows(
                flights,
                experiment="E9",
                case=f"{_ENR_DB:g} dB, {name}",
                least=1.0 - loss(duration_s) - 0.03,
                most_false=0.0,
                original=published,
            ),
        )

    return replace(flights_of(_DURATION_S, 3), short=flights_of(_SHORT_S, 1))


def _lost_case(percent: int) -> Case:
    share = percent / 100.0
    return _case(
        f"{percent} % of the frames lost",
        lambda _: Disturbed(disturb=lose(share)),
        loss=lambda _: share,
        published=original.RECALL_LOST_FRAMES.get(float(percent)),
    )


def _after_a_hole() -> Case:
    """Time from the end of a hole to the first pulse confirmed after it [s]."""
    tag = THESIS_TAG

    def trial(
        rng: np.random.Generator, _: int, *, at_s: float = 90.0, after_s: float = 30.0
    ) -> float:
        flight = Flight(enr_db=_ENR_DB, duration_s=at_s + after_s)
        samples, _truth = flight.samples(rng)
        frames = hole(at_s)(rng, list(blocks_of(samples, block=FRAME)))
        pulses, _detector = detect_blocks(frames, tag)
        end_ns = START_NS + round((at_s + _HOLE_S) * NANOSECONDS_PER_SECOND)
        after = [p.start_time_ns - end_ns for p in pulses if p.confirmed]
        return min((ns * 1e-9 for ns in after if ns >= 0), default=30.0)

    def rows(times_s: Sequence[float]) -> list[Row]:
        return [
            Row.with_interval(
                "E9",
                "first pulse confirmed after a hole, s (95 % of streams)",
                f"{_ENR_DB:g} dB, hole of 3 s",
                quantile(times_s, 0.95),
                len(times_s),
                most=2.0 * decision_interval_s(tag),
            )
        ]

    full = Case(name="after a hole", trials=60, least=6, seconds=0.35, trial=trial, rows=rows)
    # Of one stream alone nothing is known of the time that 95 % keep.
    brief = partial(trial, at_s=25.0, after_s=15.0)
    return replace(full, short=replace(full, least=2, trial=brief))


def _deafness() -> Case:
    """Case for the detection of the very first pulse of a stream, and the delay of the first
    report.
    """

    def trial(rng: np.random.Generator, _: int) -> float:
        flight = Flight(enr_db=20.0, duration_s=12.0)
        samples, truth = flight.samples(rng)
        pulses, _detector = detect(samples, flight.tag)
        found = compare(pulses, truth, flight.tag).found
        heard = [t.start_s for t, seen in zip(truth, found, strict=True) if seen]
        return min(heard, default=flight.duration_s) - truth[0].start_s

    def rows(deaf_s: Sequence[float]) -> list[Row]:
        count = len(deaf_s)
        missed = sum(time > 0.0 for time in deaf_s)
        mean = float(np.mean(deaf_s))
        return [
            Row.with_interval(
                "E9",
                "streams whose first pulse is missed",
                "start-up, 20 dB, whole channel",
                share_of(missed, count),
                count,
                most=0.01,
                original=1.0,
                note=f"deaf for {mean:.3f} s on the average; the original 2.6 to 13 s",
            )
        ]

    return Case(name="start-up", trials=600, least=10, seconds=0.03, trial=trial, rows=rows)


E9 = Experiment(
    name="E9",
    title="Data loss, clocks, start-up",
    cases=(
        *(_lost_case(percent) for percent in (1, 5, 10)),
        _case(
            "a hole of 3 s",
            lambda duration_s: Disturbed(disturb=hole(duration_s / 2.0)),
            loss=lambda duration_s: _HOLE_S / duration_s,
            published=0.97,
        ),
        _case("5 % repeated", lambda _: Disturbed(disturb=repeat(0.05))),
        _case("5 % of 273 ms swapped", lambda _: Disturbed(disturb=reorder(0.05))),
        _case(
            "5 % of 87 ms swapped",
            lambda _: Disturbed(disturb=reorder(0.05), frame=FLIGHT_FRAME),
        ),
        _case("a stamp of the past", lambda _: Disturbed(disturb=stamp_backwards)),
        _case(
            "clock set 1000 s forward",
            lambda duration_s: Disturbed(
                disturb=stamp_jump(duration_s / 2.0), when=_jumped(duration_s / 2.0)
            ),
        ),
        _case(
            "clock 200 ppm fast",
            lambda _: Disturbed(disturb=slew, when=lambda pulse: pulse.start_s * (1.0 + _SLEW)),
        ),
        _after_a_hole(),
        _deafness(),
        *UNSAID_CASES,
    ),
)
