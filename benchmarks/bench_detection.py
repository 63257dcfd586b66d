"""The detector in blocks of 87 ms: one tag, a hundred tags, long integration."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.harness import Case, Table, compare
from uavrt.core.messages import Tag
from uavrt.detection.detector import PulseDetector
from uavrt.detection.group import DetectorGroup
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, make_samples, pulse_train

Samples = NDArray[np.complex64]
RATE_HZ = 7500.0
BLOCK = 653
"""As `uavrt.analysis.measure.recorded_pulses.DetectionChain` feeds them."""
SIGNAL_S = 20.0


def run() -> list[Table]:
    """All tables of this section."""
    long: dict[str, Any] = {"interval_uncertainty_s": 0.000125, "interval_jitter_s": 0.002}
    cases = [
        case("noise, one tag, K = 3", THESIS_TAG, None, 1),
        case("tag of 20 dB, one tag, K = 3", THESIS_TAG, 20.0, 1),
        case("noise, 100 tags, K = 3", THESIS_TAG, None, 100),
        case("noise, 100 tags, K = 3, each alone", THESIS_TAG, None, 100, together=False),
        case("noise, K = 5", replace(THESIS_TAG, k=5), None, 1),
        case("noise, K = 20 narrowed", replace(THESIS_TAG, k=20, **long), None, 1, 100.0),
        case("noise, K = 40 narrowed", replace(THESIS_TAG, k=40, **long), None, 1, 100.0),
        case("noise, K = 3, whole channel", THESIS_TAG, None, 1, math.inf),
    ]
    return [
        compare(
            "Detector, ± 500 Hz unless said, 7500 S/s, blocks of 87 ms",
            cases,
            rounds=5,
            in_a_row=1,
            notes=[
                "Bars: one tag 0.08 %, 100 tags 5.5 %, K = 40 narrowed (± 100 Hz, interval "
                "± 0.125 ms) 0.5 %."
            ],
        )
    ]


def case(
    name: str,
    tag: Tag,
    enr_db: float | None,
    count: int,
    window_hz: float = 500.0,
    *,
    together: bool = True,
) -> Case:
    """Detectors of as many channels, fed as the blocks of a receiver come."""
    rng = np.random.default_rng(1)
    pulses = (
        []
        if enr_db is None
        else pulse_train(
            rng, duration_s=SIGNAL_S, interval_s=1.254, offset_hz=100.0, enr_db=enr_db
        )
    )
    samples = make_samples(rng, pulses, duration_s=SIGNAL_S, sample_rate_hz=RATE_HZ)
    detectors = [
        PulseDetector(
            replace(tag, tag_id=2 * i + 2),
            sample_rate_hz=RATE_HZ,
            center_frequency_hz=tag.frequency_hz - 30.0 * (i % 10),
            frequency_window_hz=window_hz,
        )
        for i in range(count)
    ]
    run = feed_together if together and count > 1 else feed
    return Case(name=name, run=run(detectors, samples), signal_s=SIGNAL_S)


def feed(detectors: list[PulseDetector], samples: Samples) -> Callable[[], object]:
    """Go on with the same samples at later times, without a gap."""
    position = 0

    def go() -> None:
        nonlocal position
        for first in range(0, len(samples), BLOCK):
            block = samples[first : first + BLOCK]
            time_ns = START_NS + round(position / RATE_HZ * 1e9)
            for detector in detectors:
                detector.process(block, time_ns)
            position += len(block)

    return go


def feed_together(detectors: list[PulseDetector], samples: Samples) -> Callable[[], object]:
    """As `feed`, all detectors as a group, as `DetectionChain` does."""
    group = DetectorGroup()
    for channel, detector in enumerate(detectors):
        group.add(channel, [detector])
    position = 0

    def go() -> None:
        nonlocal position
        for first in range(0, len(samples), BLOCK):
            block = samples[first : first + BLOCK]
            time_ns = START_NS + round(position / RATE_HZ * 1e9)
            for channel in range(len(detectors)):
                group.put(channel, block, time_ns)
            group.collect()
            position += len(block)

    return go
