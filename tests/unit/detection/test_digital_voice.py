"""A tag beside a transmitter of digital voice, whose signal is no Gaussian noise."""

import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.core.messages import IQBlock
from uavrt.detection.detector import PulseDetector
from uavrt.dsp.frontend import FrontEnd
from uavrt_experiments.detection.interference import impulses
from uavrt_experiments.detection.neighbours import Neighbour
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    TruePulse,
    add_pulse,
    noise,
    pulse_train,
)
from uavrt_experiments.detection.trials import Comparison, compare, detect, detect_blocks

RATE_HZ = 48000.0
CHANNEL_HZ = 3750.0
SECONDS = 40.0
SYMBOLS_PER_S = 4800.0
DEVIATION_HZ = 650.0
"""Half the distance between the frequencies of two symbols."""


def digital_voice(
    rng: np.random.Generator, count: int, *, level_db: float, slot_s: float
) -> NDArray[np.complex64]:
    """Four-level frequency-shift keying 12.5 kHz wide.

    `level_db`: density within 8 kHz over that of the noise.
    `slot_s`: length of the slots, of which every second one is sent; 0: all.
    """
    length = round(RATE_HZ / SYMBOLS_PER_S)
    symbols = rng.choice((-3.0, -1.0, 1.0, 3.0), count // length + 1)
    shape = np.hanning(2 * length + 1)
    frequency_hz = np.convolve(np.repeat(symbols, length), shape / shape.sum(), "same")[:count]
    phase = np.cumsum(DEVIATION_HZ * frequency_hz) * (2.0 * np.pi / RATE_HZ)
    power = 10.0 ** (level_db / 10.0) * 8000.0 / RATE_HZ
    sent = np.ones(count)
    if slot_s:
        sent = (np.arange(count) / (slot_s * RATE_HZ) % 2.0 < 1.0).astype(float)
        ramp = np.hanning(145)
        sent = np.convolve(sent, ramp / ramp.sum(), "same")
    return np.asarray(np.sqrt(power) * sent * np.exp(1j * phase), np.complex64)


def train(rng: np.random.Generator, offset_hz: float) -> list[TruePulse]:
    """Pulses of 14 dB near an offset, with the tag's interval."""
    return pulse_train(
        rng,
        duration_s=SECONDS,
        interval_s=1.27,
        offset_hz=offset_hz,
        enr_db=14.0,
        jitter_s=0.005,
        width_s=0.02,
    )


def channel_of(
    samples: NDArray[np.complex64], center_hz: float
) -> tuple[list[tuple[NDArray[np.complex64], int]], FrontEnd]:
    """Filter the tag's channel out of a band."""
    front_end = FrontEnd(
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=center_hz,
        frequencies_hz=[THESIS_TAG.frequency_hz],
    )
    blocks = [
        (block.samples, block.time_ns)
        for first in range(0, len(samples), 4800)
        for block in front_end.process(
            IQBlock(
                samples=samples[first : first + 4800],
                sample_index=first,
                time_ns=START_NS + round(first / RATE_HZ * 1e9),
                sample_rate_hz=RATE_HZ,
                lost_before=0,
            )
        )
    ]
    return blocks, front_end


def heard_beside_voice(*, offset_hz: float, level_db: float, slot_s: float) -> Comparison:
    """Search for a tag at an offset from the middle of a transmission."""
    rng = np.random.default_rng(48)
    center_hz = THESIS_TAG.frequency_hz - offset_hz
    samples = noise(rng, round(SECONDS * RATE_HZ))
    samples += digital_voice(rng, len(samples), level_db=level_db, slot_s=slot_s)
    truth = train(rng, offset_hz + 37.0)
    for one in truth:
        add_pulse(samples, one, sample_rate_hz=RATE_HZ, width_s=0.02, phase=rng.uniform(0, 6))
    blocks, front_end = channel_of(samples, center_hz)
    pulses, _ = detect_blocks(
        blocks,
        THESIS_TAG,
        sample_rate_hz=front_end.plan.channel_rate_hz,
        center_frequency_hz=front_end.plan.channel_centers_hz[0],
        frequency_window_hz=500.0,
    )
    return compare(pulses, truth, THESIS_TAG, center_frequency_hz=center_hz)


@pytest.mark.parametrize(
    ("offset_hz", "level_db", "slot_s", "free"),
    [
        (0.0, 20.0, 0.0, 0.0),
        (0.0, 35.0, 0.0, 0.0),
        (1200.0, 25.0, 0.0, 0.0),
        (0.0, 35.0, 0.7, 0.5),
        (7000.0, 50.0, 0.0, 1.0),
    ],
)
def test_voice_on_the_frequency_of_the_tag_is_counted_steady_or_in_slots(
    offset_hz: float, level_db: float, slot_s: float, free: float
) -> None:
    # A level that is never left was taken for that of noise: 100 % usable.
    rng = np.random.default_rng(49)
    samples = noise(rng, round(28.0 * RATE_HZ))
    samples += digital_voice(rng, len(samples), level_db=level_db, slot_s=slot_s)
    blocks, front_end = channel_of(samples, THESIS_TAG.frequency_hz - offset_hz)
    plan = front_end.plan
    detector = PulseDetector(
        THESIS_TAG,
        sample_rate_hz=plan.channel_rate_hz,
        center_frequency_hz=plan.channel_centers_hz[0],
    )
    for block, time_ns in blocks:
        detector.process(block, time_ns)
    shares = [one.usable_share for one in detector.search_reports()]
    assert np.mean([share for share in shares if share is not None]) == pytest.approx(
        free, abs=0.05
    )


@pytest.mark.parametrize(
    ("offset_hz", "level_db", "slot_s"), [(7000.0, 50.0, 0.0), (6500.0, 50.0, 0.03)]
)
def test_a_tag_of_14_db_beside_digital_voice_is_found(
    offset_hz: float, level_db: float, slot_s: float
) -> None:
    # Of 32 pulses 28 were found beside steady voice, and 20 beside slots of 30 ms.
    heard = heard_beside_voice(offset_hz=offset_hz, level_db=level_db, slot_s=slot_s)
    assert heard.matched >= 0.9 * heard.true
    assert heard.false_confirmed == 0


def test_impulses_beside_a_neighbour_cost_few_pulses() -> None:
    # Hidden in the neighbour's power they were not seen: 46 of 63 pulses were found.
    rng = np.random.default_rng(1)
    samples = noise(rng, round(SECONDS * CHANNEL_HZ))
    samples += Neighbour(edge_hz=1000.0, level_db=30.0)(rng, len(samples))
    truth = train(rng, 20.0)
    for one in truth:
        add_pulse(
            samples, one, sample_rate_hz=CHANNEL_HZ, width_s=0.02, phase=rng.uniform(0, 6)
        )
    samples += impulses(rng, len(samples), per_s=5.0, level_db=30.0, length_s=0.002)
    pulses, detector = detect(samples, THESIS_TAG, frequency_window_hz=500.0)
    heard = compare(pulses, truth, THESIS_TAG)
    assert heard.matched >= 0.8 * heard.true
    assert heard.false_confirmed == 0
    assert detector.counters.samples_blanked > SECONDS * 5.0 * 0.002 * CHANNEL_HZ * 0.5
