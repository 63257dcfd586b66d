"""The search for coded tags on one channel, in blocks of 87 ms: one code, fifty, 500."""

import numpy as np

from benchmarks.harness import Case, Table, compare
from uavrt.detection.coded import CodedDetector
from uavrt_experiments.detection.coded import RATE_HZ, WINDOW_HZ, add_burst, some_codes
from uavrt_experiments.detection.signals import START_NS, noise

BLOCK = 655
SIGNAL_S = 20.0


def run() -> list[Table]:
    """All tables of this section."""
    return [
        compare(
            "Coded tags on one channel, ± 500 Hz, 7500 S/s, blocks of 87 ms",
            [
                case("noise, one code", 1),
                case("noise, 50 codes", 50),
                case("noise, 500 codes", 500),
                case("ten tags of 20 dB, 500 codes", 500, senders=10),
            ],
            rounds=2,
            in_a_row=1,
            notes=["Bar: 500 codes 10 %."],
        )
    ]


def case(name: str, codes: int, *, senders: int = 0) -> Case:
    """One channel's search, with the first few of the codes on air."""
    rng = np.random.default_rng(1)
    tags = some_codes(rng, codes)
    samples = noise(rng, round(SIGNAL_S * RATE_HZ))
    for tag in tags[:senders]:
        at_s, offset_hz = rng.uniform(0.0, 5.0), rng.uniform(-WINDOW_HZ, WINDOW_HZ)
        while at_s + tag.length_s < SIGNAL_S:
            add_burst(
                *(samples, tag),
                start_s=at_s,
                offset_hz=offset_hz,
                enr_db=20.0,
                stretch=0.0,
                rng=rng,
            )
            at_s += tag.pulse_intervals_s[0]
    detector = CodedDetector(
        tags,
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=tags[0].frequency_hz,
        frequency_window_hz=WINDOW_HZ,
    )
    position = 0

    def go() -> None:
        nonlocal position
        for first in range(0, len(samples), BLOCK):
            block = samples[first : first + BLOCK]
            detector.process(block, START_NS + round(position / RATE_HZ * 1e9))
            position += len(block)

    return Case(name=name, run=go, signal_s=SIGNAL_S)
