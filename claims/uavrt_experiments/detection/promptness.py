"""E16: delay of records after their groups, and CPU of a detector."""

import math
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavrt.core.messages import Tag
from uavrt.core.units import ns_from_s
from uavrt.detection.detector import PulseDetector
from uavrt_experiments.detection import original
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.integration import long_tag
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    TruePulse,
    make_samples,
    noise,
    pulse_train,
)
from uavrt_experiments.detection.trials import BLOCK_SAMPLES, Emission, emissions
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import quantile, share_of

_RATE_HZ = 7500.0
"""Sample rate of a channel in flight [Hz]."""
_LIMIT_S = 0.5
_PERCENT = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Latencies:
    """Latency of each group: the time from the end of its last pulse to its record."""

    first_s: float | None
    """Latency of the first group [s]; None: no group was found."""
    later_s: tuple[float, ...]


def group_latencies(
    records: Sequence[Emission], tag: Tag, truth: Sequence[TruePulse]
) -> Latencies:
    """Latency of each group [s]: the record of its last pulse, counted from the group's end.

    A group ends with its K-th place. If its last places contain only noise (a strong pulse may
    make up for two weak terms of the sum), it is complete only then. If its first places do, as
    for a tag that begins to send, the group is one or two pulses, which may be below the
    threshold alone. The first group is therefore the tag's first K received pulses; noise may
    be reported before.
    """
    near_s = 0.75 * tag.pulse_width_s
    heard = [
        one
        for one in records
        if one.pulse.detection_status != "subthreshold"
        and any(abs(_end_s(one) - tag.pulse_width_s - t.start_s) <= near_s for t in truth)
    ]
    last: dict[tuple[int, int], Emission] = {}
    for record in heard:
        key = (record.pulse.rate, record.pulse.group_sequence)
        if key not in last or record.pulse.end_time_ns > last[key].pulse.end_time_ns:
            last[key] = record
    values = []
    for record in list(last.values())[1:]:
        missing = tag.k - record.pulse.group_index
        values.append(record.at_s - _end_s(record) - missing * tag.pulse_intervals_s[0])
    first = sorted(heard, key=_end_s)[: tag.k]
    # Of a group that the stream's end cut off nothing is known.
    return Latencies(
        first_s=max(one.at_s for one in first) - _end_s(first[-1]) if first else None,
        later_s=tuple(value for value in values if value > 0.0),
    )


def _end_s(record: Emission) -> float:
    return (record.pulse.end_time_ns - START_NS) * 1e-9


def _latency_case(name: str, *, enr_db: float, silent_s: float, barred: bool) -> Case:
    """Case with streams whose tag sends from the start, or later."""

    def trial(rng: np.random.Generator, _: int) -> Latencies:
        duration_s = silent_s + 15.0
        truth = pulse_train(
            rng,
            duration_s=duration_s,
            interval_s=1.254,
            offset_hz=100.0,
            enr_db=enr_db,
            jitter_s=0.005,
            first_s=silent_s + rng.uniform(0.0, 1.254),
        )
        samples = make_samples(rng, truth, duration_s=duration_s, sample_rate_hz=_RATE_HZ)
        records = emissions(
            samples, THESIS_TAG, sample_rate_hz=_RATE_HZ, frequency_window_hz=500.0
        )
        return group_latencies(records, THESIS_TAG, truth)

    def rows(streams: Sequence[Latencies]) -> list[Row]:
        first = [s.first_s for s in streams if s.first_s is not None]
        later = [value for s in streams for value in s.later_s]
        return [
            row
            for values, what in ((first, "first group"), (later, "later groups"))
            for row in _latency_rows(values, f"{name}, {what}", barred=barred)
        ]

    return Case(name=name, trials=300, least=10, seconds=0.05, trial=trial, rows=rows)


def _latency_rows(values: Sequence[float], case: str, *, barred: bool) -> list[Row]:
    if not values:
        return []
    late = sum(value > _LIMIT_S for value in values)
    middle = quantile(values, 0.5)
    most = quantile(values, 0.99)
    return [
        Row.with_interval(
            "E16",
            "last pulse of a group to its record, s (99 %)",
            case,
            (most[0], most[1], most[2]),
            len(values),
            most=_LIMIT_S if barred else None,
            original=original.LATENCY_S,
            note=f"median {middle[0]:.2f}, longest {max(values):.2f}",
        ),
        Row.with_interval(
            "E16", "groups later than 0.5 s", case, share_of(late, len(values)), len(values)
        ),
    ]


def _cost_case(
    name: str,
    tag: Tag,
    *,
    most: float | None,
    count: int = 1,
    frequency_window_hz: float = 500.0,
    published: float | None = None,
    signal_s: float = 20.0,
    seconds: float = 0.05,
) -> Case:
    """Case for the CPU time of detectors at the real-time rate, in a process without other
    work.
    """

    def trial(rng: np.random.Generator, _: int) -> float:
        samples = noise(rng, round(2.0 * signal_s * _RATE_HZ))
        detectors = [
            PulseDetector(
                tag,
                sample_rate_hz=_RATE_HZ,
                center_frequency_hz=tag.frequency_hz - 30.0 * (i % 10),
                frequency_window_hz=frequency_window_hz,
            )
            for i in range(count)
        ]
        half = len(samples) // 2
        spent = 0.0
        for first in range(0, len(samples), BLOCK_SAMPLES):
            block = samples[first : first + BLOCK_SAMPLES]
            time_ns = START_NS + ns_from_s(first / _RATE_HZ)
            begun = time.process_time()
            for detector in detectors:
                detector.process(block, time_ns)
            # The first half fills caches and starts the searches.
            spent += (time.process_time() - begun) * (first >= half)
        return _PERCENT * spent / signal_s

    def rows(values: Sequence[float]) -> list[Row]:
        return [
            Row.with_interval(
                "E16",
                "cost, % of one core",
                name,
                (statistics.median(values), min(values), max(values)),
                len(values),
                most=most,
                original=published,
                note="median, least and most; needs a quiet machine",
            )
        ]

    return Case(
        name=f"cost: {name}",
        trials=7,
        least=3,
        seconds=seconds,
        trial=trial,
        rows=rows,
        alone=True,
    )


E16 = Experiment(
    name="E16",
    title="Latency and cost",
    cases=(
        _latency_case("20 dB, sending from the start", enr_db=20.0, silent_s=0.0, barred=True),
        _latency_case("20 dB, silent for 10 s", enr_db=20.0, silent_s=10.0, barred=True),
        _latency_case("10 dB, silent for 10 s", enr_db=10.0, silent_s=10.0, barred=False),
        _cost_case(
            "one tag, K = 3", THESIS_TAG, most=0.08, published=original.COST_ONE_TAG_PERCENT
        ),
        _cost_case("100 tags, K = 3", THESIS_TAG, count=100, most=5.5, seconds=4.0),
        _cost_case(
            "K = 40, ± 100 Hz, interval ± 0.125 ms",
            long_tag(40, 0.002),
            most=0.5,
            frequency_window_hz=100.0,
            signal_s=60.0,
            seconds=0.6,
        ),
        _cost_case(
            "K = 8, whole channel",
            replace(THESIS_TAG, k=8),
            most=None,
            frequency_window_hz=math.inf,
            seconds=0.6,
        ),
    ),
)
