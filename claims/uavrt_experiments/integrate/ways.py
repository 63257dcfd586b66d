"""I7: evaluation from samples or from energies kept in flight; and strong tags."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavrt.detection.detector import PulseDetector
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies
from uavrt.localization.whole_flight.energies.growing import GrowingEnergies
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.signals import START_NS
from uavrt_experiments.integrate.false_alarms import NOMINAL
from uavrt_experiments.integrate.flights import (
    RATE_HZ,
    Samples,
    World,
    add_pulses,
    silence,
    turning,
)
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import share_of

_PIECE_S = 7.0
_WORLD = World(course=turning(100), slack_s=0.020, window_hz=60.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Two:
    """Results of two methods on one flight."""

    first: bool
    second: bool


def _heard(rng: np.random.Generator, enr_db: float) -> Samples:
    samples = silence(rng, _WORLD.course)
    add_pulses(rng, samples, _WORLD.pulses(rng, _WORLD.truth(rng), enr_db))
    return samples


def samples_and_energies(rng: np.random.Generator) -> Two:
    """Evaluate a flight near the detection level from samples, and from energies kept in
    flight.
    """
    samples = _heard(rng, rng.uniform(2.0, 8.0))
    growing = GrowingEnergies(
        _WORLD.tag,
        start_ns=START_NS,
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=_WORLD.tag.frequency_hz,
        frequency_window_hz=_WORLD.window_hz,
    )
    piece = round(_PIECE_S * RATE_HZ)
    for end in range(piece, len(samples) + piece, piece):
        growing.take(samples[:end], np.ones(min(end, len(samples)), bool), START_NS)
    kept = growing.energies()
    whole = _WORLD.energies(samples).between(0, len(kept.heard))
    return Two(first=_found(whole), second=_found(kept))


def ordinary_and_whole(rng: np.random.Generator) -> Two:
    """Search for a strong tag by groups of three, as in flight, and over the whole flight."""
    samples = _heard(rng, rng.uniform(13.0, 30.0))
    tag = _WORLD.tag
    detector = PulseDetector(tag, sample_rate_hz=RATE_HZ, center_frequency_hz=tag.frequency_hz)
    heard = [*detector.process(samples, START_NS), *detector.flush()]
    return Two(
        first=any(one.detection_status == "confirmed" for one in heard),
        second=_found(_WORLD.energies(samples)),
    )


def _found(energies: SlotEnergies) -> bool:
    return _WORLD.judge(energies, NOMINAL).train.false_alarm_probability <= NOMINAL


def _same(outcomes: Sequence[Two]) -> list[Row]:
    same = [one.first == one.second for one in outcomes]
    text = f"{sum(one.first for one in outcomes)} found from samples"
    case = "turning on the spot, 100 pulses, 2 to 8 dB"
    return [_share("same verdict from samples and from energies kept", case, same, 0.9, text)]


def _no_loss(outcomes: Sequence[Two]) -> list[Row]:
    both = [one.second for one in outcomes if one.first]
    text = f"{len(both)} of {len(outcomes)} found by groups of three"
    case = "turning on the spot, 100 pulses, 13 to 30 dB"
    what = "of those found by groups of three, found in the whole flight"
    return [_share(what, case, both, 0.98, text)]


def _share(what: str, case: str, good: Sequence[bool], least: float, note: str) -> Row:
    return Row.with_interval(
        "I7", what, case, share_of(sum(good), len(good)), len(good), least=least, note=note
    )


I7 = Experiment(
    name="I7",
    title="Methods that must agree",
    cases=(
        Case(
            name="samples and energies",
            trials=360,
            seconds=0.3,
            trial=lambda rng, _: samples_and_energies(rng),
            rows=_same,
            least=4,
        ),
        Case(
            name="strong tags",
            trials=360,
            seconds=0.4,
            trial=lambda rng, _: ordinary_and_whole(rng),
            rows=_no_loss,
            least=4,
        ),
    ),
)
