"""Detectors fed together find what each finds alone, whatever happens to their streams."""

from dataclasses import dataclass, replace

import made
import numpy as np
import pytest
from depth import share
from numpy.typing import NDArray

from uavrt.core.messages import Pulse, Tag
from uavrt.detection.detector import PulseDetector
from uavrt.detection.group import DetectorGroup
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, make_samples

RATE_HZ = 3750.0
CENTER_HZ = THESIS_TAG.frequency_hz
DURATION_S = 30.0
BLOCK = 328


@dataclass(frozen=True, slots=True)
class Channel:
    """Its centre, samples and tags, and the blocks that come: first sample, time [s]."""

    center_hz: float
    samples: NDArray[np.complex64]
    tags: list[Tag]
    blocks: list[tuple[int, float]]


def center_hz(number: int) -> float:
    return CENTER_HZ + 3000.0 * number


def tags_of(number: int) -> list[Tag]:
    """Three tags of a channel: other intervals, other K, a second rate, no two rings alike.

    Their bands do not overlap: none has a say in what is another's.
    """
    usual = replace(
        THESIS_TAG,
        tag_id=10 * number + 2,
        frequency_hz=center_hz(number) + 60.0,
        pulse_intervals_s=(1.254 + 0.011 * number,),
    )
    other = replace(usual, tag_id=10 * number + 4, frequency_hz=center_hz(number) - 150.0)
    special = replace(
        usual,
        tag_id=10 * number + 6,
        frequency_hz=center_hz(number) + 250.0,
        k=(1, 5, 3, 8)[number],
    )
    if number == 2:
        special = replace(special, pulse_intervals_s=(1.3, 0.65))
    return [usual, other, special]


def channel(number: int) -> Channel:
    rng = np.random.default_rng(970 + number)
    tags = tags_of(number)
    pulses = [
        pulse
        for index, tag in enumerate(tags)
        for pulse in made.train(
            rng,
            DURATION_S,
            (12.0, 14.0, 16.0, 18.0)[number] - 2.0 * index,
            interval_s=tag.pulse_intervals_s[0],
            offset_hz=tag.frequency_hz - center_hz(number) + 10.0,
            jitter_s=0.004,
        )
    ]
    samples = make_samples(rng, pulses, duration_s=DURATION_S, sample_rate_hz=RATE_HZ)
    firsts = list(range(0, len(samples), BLOCK))
    if number == 1:  # holes, short and long
        firsts = [f for i, f in enumerate(firsts) if i % 61 not in (10, 11) or 120 < i < 170]
    if number == 2:  # one block overtakes another
        for at in range(20, len(firsts) - 1, 47):
            firsts[at], firsts[at + 1] = firsts[at + 1], firsts[at]
    if number == 3:  # its receiver starts late, and its clock jumps
        firsts = firsts[25:]
    jump_s = 60.0 if number == 3 else 0.0
    times = [f / RATE_HZ + (jump_s if f > len(samples) // 2 else 0.0) for f in firsts]
    return Channel(center_hz(number), samples, tags, list(zip(firsts, times, strict=True)))


def detectors(line: Channel) -> list[PulseDetector]:
    return [
        made.detector(
            tag,
            RATE_HZ,
            center_frequency_hz=line.center_hz,
            frequency_window_hz=90.0,
            operating_mode="freqSearchHardLock" if tag.tag_id == 2 else "freqSearchSoftLock",
        )
        for tag in line.tags
    ]


def fed_together(
    lines: list[Channel], collect_every: int
) -> tuple[list[Pulse], list[PulseDetector]]:
    group = DetectorGroup()
    for number, line in enumerate(lines):
        group.add(number, detectors(line))
    found = []
    for at in range(max(len(line.blocks) for line in lines)):
        for number, line in enumerate(lines):
            if at < len(line.blocks):
                first, time_s = line.blocks[at]
                block = line.samples[first : first + BLOCK]
                group.put(number, block, START_NS + round(time_s * 1e9))
        if at % collect_every == 0:
            found += group.collect()
    return found + group.flush(), group.detectors


@pytest.mark.parametrize("collect_every", share([3, 1], 2))
def test_detectors_fed_together_find_the_pulses_of_detectors_alone(collect_every: int) -> None:
    lines = [channel(number) for number in range(4)]
    together, members = fed_together(lines, collect_every)
    at = 0
    for line in lines:
        for alone in detectors(line):
            found = []
            for first, time_s in line.blocks:
                block = line.samples[first : first + BLOCK]
                found += alone.process(block, START_NS + round(time_s * 1e9))
            found += alone.flush()
            assert [p for p in together if p.tag_id == alone.tag.tag_id] == found
            assert members[at].counters == alone.counters
            assert members[at].search_reports() == alone.search_reports()
            at += 1
    assert len(together) > 150
    assert sum(detector.counters.restarts for detector in members) == 3
