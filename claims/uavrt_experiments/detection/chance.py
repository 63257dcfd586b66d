"""E18: random bursts of other transmitters, without a tag and with one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavrt.core.messages import Pulse
from uavrt.detection.detector import PulseDetector
from uavrt.detection.group import DetectorGroup
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.on_air import Hopper, Samples, Scene, Slots, Voice
from uavrt_experiments.detection.signals import THESIS_TAG, TruePulse, noise
from uavrt_experiments.detection.tracking import FALSE_CONFIRMED, count_row, recall_row
from uavrt_experiments.detection.trials import (
    RATE_HZ,
    WHOLE_CHANNEL_HZ,
    Comparison,
    Flight,
    blocks_of,
    compare,
    detect,
)
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import count_interval

STRETCH_S = 200.0
_SHORT_STRETCH_S = 15.0
_SHORT_ALONE_S = 50.0
"""Duration of the short form with one tag, absent or present [s]."""
_INTERVALS_S = (1.05, 1.254, 1.4, 1.63, 1.9)
"""Intervals of the absent tags [s], known to ± 60 ms."""
_WINDOWS_HZ = (500.0, WHOLE_CHANNEL_HZ)
_TAG_HZ = 100.0
_TAG_DB = 14.0
_COVERED = 0.3
"""Share of a pulse's energy in a simultaneous burst above which the pulse counts as covered."""
_COVERED_AT_ITS_FREQUENCY = 0.05
_MOST_CONFIRMED = 3.0
"""Largest allowed number of confirmed pulses of five absent tags in 200 s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Absent:
    """Number of reports of an absent tag."""

    pulses: int
    confirmed: int


def absent_tag(
    scene: Scene, rng: np.random.Generator, index: int, stretch_s: float = STRETCH_S
) -> Absent:
    """Search a stretch of bursts for one of the absent tags."""
    tag = replace(THESIS_TAG, pulse_intervals_s=(_INTERVALS_S[index % len(_INTERVALS_S)],))
    count = round(stretch_s * RATE_HZ)
    samples = noise(rng, count) + scene(rng, count)
    window_hz = _WINDOWS_HZ[index % len(_WINDOWS_HZ)]
    pulses, _ = detect(samples, tag, frequency_window_hz=window_hz)
    return Absent(
        pulses=sum(p.detection_status != "subthreshold" for p in pulses),
        confirmed=sum(p.confirmed for p in pulses),
    )


def absent_together(
    scene: Scene, rng: np.random.Generator, index: int, stretch_s: float = STRETCH_S
) -> Absent:
    """Search a stretch of bursts for all absent tags at once, listed at one frequency."""
    count = round(stretch_s * RATE_HZ)
    samples = noise(rng, count) + scene(rng, count)
    group = DetectorGroup()
    group.add(
        0,
        [
            PulseDetector(
                replace(THESIS_TAG, tag_id=2 * place + 2, pulse_intervals_s=(interval_s,)),
                sample_rate_hz=RATE_HZ,
                center_frequency_hz=THESIS_TAG.frequency_hz,
                frequency_window_hz=_WINDOWS_HZ[index % len(_WINDOWS_HZ)],
            )
            for place, interval_s in enumerate(_INTERVALS_S)
        ],
    )
    pulses: list[Pulse] = []
    for block, time_ns in blocks_of(samples):
        group.put(0, block, time_ns)
        pulses += group.collect()
    pulses += group.flush()
    return Absent(
        pulses=sum(p.detection_status != "subthreshold" for p in pulses),
        confirmed=sum(p.confirmed for p in pulses),
    )


def tag_among_bursts(
    scene: Scene, rng: np.random.Generator, index: int, stretch_s: float = STRETCH_S
) -> Comparison:
    """Search for a tag among bursts; only pulses that no burst covers count as true."""
    flight = Flight(
        enr_db=_TAG_DB,
        duration_s=stretch_s,
        offset_hz=_TAG_HZ,
        frequency_window_hz=_WINDOWS_HZ[index % len(_WINDOWS_HZ)],
    )
    samples, truth = flight.samples(rng)
    bursts = scene(rng, len(samples))
    samples += bursts
    pulses, _ = detect(samples, flight.tag, frequency_window_hz=flight.frequency_window_hz)
    all_of_it = compare(pulses, truth, flight.tag)
    free = [at for at, pulse in enumerate(truth) if not _is_covered(bursts, pulse)]
    return Comparison(
        true=len(free),
        confirmed=sum(all_of_it.sure[at] for at in free),
        matched=sum(all_of_it.found[at] for at in free),
        false=all_of_it.false,
        false_confirmed=all_of_it.false_confirmed,
    )


def _is_covered(bursts: Samples, pulse: TruePulse) -> bool:
    first = round(pulse.start_s * RATE_HZ)
    some = bursts[first : first + round(THESIS_TAG.pulse_width_s * RATE_HZ)]
    wave = np.exp(2j * np.pi * pulse.offset_hz / RATE_HZ * np.arange(len(some)))
    energy = 10.0 ** (pulse.enr_db / 10.0)
    at_its_frequency = abs(complex(np.vdot(wave, some))) ** 2 / len(some)
    whole = float(np.sum(some.real**2 + some.imag**2))
    return bool(
        whole > _COVERED * energy or at_its_frequency > _COVERED_AT_ITS_FREQUENCY * energy
    )


def _absent_case(name: str, scenes: Sequence[Scene], original: float) -> Case:
    tags = len(_INTERVALS_S)

    def rows(outcomes: Sequence[Absent]) -> list[Row]:
        return [
            _per_scene([o.confirmed for o in outcomes], name, _MOST_CONFIRMED, original),
            _per_scene([o.pulses for o in outcomes], name, None, None),
        ]

    full = Case(
        name=f"{name}, alone",
        trials=2 * tags * len(scenes),
        least=2,
        seconds=3.0,
        trial=lambda rng, index: absent_tag(scenes[index % len(scenes)], rng, index),
        rows=rows,
    )
    brief = replace(
        full,
        least=1,
        trial=lambda rng, index: absent_tag(scenes[0], rng, index, _SHORT_ALONE_S),
    )
    return replace(full, short=brief)


def _together_case(name: str, scenes: Sequence[Scene], original: float) -> Case:
    """Case with all absent tags in one search; each trial is a scene, not a tag."""

    def rows(outcomes: Sequence[Absent]) -> list[Row]:
        counts = [o.confirmed for o in outcomes]
        low, high = count_interval(counts)
        return [
            Row.with_interval(
                "E18",
                f"pulses confirmed of five absent tags of one frequency in {STRETCH_S:g} s",
                name,
                (sum(counts) / len(counts), low, high),
                len(counts),
                most=_MOST_CONFIRMED,
                original=original,
                note=f"{sum(counts)} in all",
            )
        ]

    full = Case(
        name=f"{name}, alone, listed at one frequency",
        trials=2 * len(scenes),
        least=len(scenes),
        seconds=12.0,
        trial=lambda rng, index: absent_together(scenes[index % len(scenes)], rng, index),
        rows=rows,
    )
    brief = replace(
        full,
        least=1,
        trial=lambda rng, index: absent_together(
            scenes[0], rng, index, stretch_s=_SHORT_STRETCH_S
        ),
    )
    return replace(full, short=brief)


def _per_scene(
    counts: Sequence[int], name: str, most: float | None, original: float | None
) -> Row:
    """Sum the counts of single tags over the tags of a scene."""
    share = len(_INTERVALS_S) / len(counts)
    low, high = count_interval(counts)
    what = "pulses" if most is None else "pulses confirmed"
    return Row.with_interval(
        "E18",
        f"{what} of five absent tags in {STRETCH_S:g} s",
        name,
        (share * sum(counts), share * low, share * high),
        len(counts),
        most=most,
        original=original,
        note=f"{sum(counts)} in all",
    )


def _tag_case(name: str, scenes: Sequence[Scene]) -> Case:
    case = f"tag of {_TAG_DB:g} dB, {name}, pulses that no burst covers"

    def rows(flights: Sequence[Comparison]) -> list[Row]:
        return [
            recall_row(flights, experiment="E18", case=case, least=0.95),
            count_row(
                [f.false_confirmed for f in flights],
                experiment="E18",
                quantity=FALSE_CONFIRMED,
                case=case,
                most=_MOST_CONFIRMED,
            ),
        ]

    full = Case(
        name=f"{name}, beside a tag",
        trials=4 * len(scenes),
        least=2,
        seconds=3.0,
        trial=lambda rng, index: tag_among_bursts(scenes[index % len(scenes)], rng, index),
        rows=rows,
    )
    brief = replace(
        full,
        least=1,
        trial=lambda rng, index: tag_among_bursts(scenes[0], rng, index, _SHORT_ALONE_S),
    )
    return replace(full, short=brief)


_SCENES: dict[str, tuple[tuple[Scene, ...], float]] = {
    "hopper": (
        (Hopper(3.0), Hopper(6.0), Hopper(6.0, dwell_s=(0.018, 0.022)), Hopper(15.0)),
        4.0,
    ),
    "slots of a frame": (
        (
            Slots(0.060, slot_s=0.015, busy=0.05),
            Slots(0.040, slot_s=0.00667, busy=0.10),
            Slots(0.060, slot_s=0.020, busy=0.10),
            Slots(0.060, slot_s=0.030, busy=0.10),
            Slots(0.060, slot_s=0.020, busy=0.03, users=3),
        ),
        2.0,
    ),
    "speech": (
        (
            Voice(1.0, over_s=8.0, syllable_s=(0.015, 0.060)),
            Voice(3.0, syllable_s=(0.015, 0.060)),
            Voice(3.0),
        ),
        3.0,
    ),
}
"""Scenes with bursts of 20 to 35 dB, and the pulses that the original confirmed in a similar
one."""

E18 = Experiment(
    name="E18",
    title="Random bursts on air",
    cases=tuple(
        case
        for name, (scenes, original) in _SCENES.items()
        for case in (
            _absent_case(name, scenes, original),
            _together_case(name, scenes, original),
            _tag_case(name, scenes),
        )
    ),
)
