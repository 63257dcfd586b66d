"""A tag beside a transmitter of digital voice, whose signal is no Gaussian noise."""

import made
import numpy as np
import pytest
from streams import Samples, add_pulses

from uavrt.core.messages import Pulse
from uavrt.detection.detector import PulseDetector
from uavrt.dsp.frontend import FrontEnd
from uavrt_experiments.detection.interference import impulses
from uavrt_experiments.detection.neighbours import Neighbour
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    TruePulse,
    noise,
)
from uavrt_experiments.detection.trials import compare, detect, detect_blocks

RATE_HZ = 48000.0
CHANNEL_HZ = 3750.0
SECONDS = 40.0
SYMBOLS_PER_S = 4800.0
DEVIATION_HZ = 650.0
"""Half the distance between the frequencies of two symbols."""


def digital_voice(
    rng: np.random.Generator, count: int, level_db: float, slot_s: float
) -> Samples:
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
    return made.train(rng, SECONDS, 14.0, interval_s=1.27, offset_hz=offset_hz, jitter_s=0.005)


def searched(samples: Samples, center_hz: float) -> tuple[list[Pulse], PulseDetector]:
    """Filter the tag's channel out of a band, and search it."""
    front_end = FrontEnd(
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=center_hz,
        frequencies_hz=[THESIS_TAG.frequency_hz],
    )
    blocks = [
        (block.samples, block.time_ns)
        for first in range(0, len(samples), 4800)
        for block in front_end.process(
            made.iq_block(samples[first : first + 4800], first, RATE_HZ, START_NS)
        )
    ]
    return detect_blocks(
        blocks,
        THESIS_TAG,
        sample_rate_hz=front_end.plan.channel_rate_hz,
        center_frequency_hz=front_end.plan.channel_centers_hz[0],
        frequency_window_hz=500.0,
    )


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
    samples = noise(rng, round(21.0 * RATE_HZ))
    samples += digital_voice(rng, len(samples), level_db, slot_s)
    _, detector = searched(samples, THESIS_TAG.frequency_hz - offset_hz)
    shares = [one.usable_share for one in detector.search_reports()]
    known = [share for share in shares if share is not None]
    assert np.mean(known) == pytest.approx(free, abs=0.05)


@pytest.mark.parametrize(
    ("offset_hz", "level_db", "slot_s"), [(7000.0, 50.0, 0.0), (6500.0, 50.0, 0.03)]
)
def test_a_tag_of_14_db_beside_digital_voice_is_found(
    offset_hz: float, level_db: float, slot_s: float
) -> None:
    # Of 32 pulses 28 were found beside steady voice, and 20 beside slots of 30 ms.
    rng = np.random.default_rng(48)
    center_hz = THESIS_TAG.frequency_hz - offset_hz
    samples = noise(rng, round(SECONDS * RATE_HZ))
    samples += digital_voice(rng, len(samples), level_db, slot_s)
    truth = train(rng, offset_hz + 37.0)
    add_pulses(samples, truth, rate_hz=RATE_HZ, rng=rng)
    pulses, _ = searched(samples, center_hz)
    heard = compare(pulses, truth, THESIS_TAG, center_frequency_hz=center_hz)
    assert heard.matched >= 0.9 * heard.true
    assert heard.false_confirmed == 0


def test_impulses_beside_a_neighbour_cost_few_pulses() -> None:
    # Hidden in the neighbour's power they were not seen: 46 of 63 pulses were found.
    rng = np.random.default_rng(1)
    samples = noise(rng, round(SECONDS * CHANNEL_HZ))
    samples += Neighbour(edge_hz=1000.0, level_db=30.0)(rng, len(samples))
    truth = train(rng, 20.0)
    add_pulses(samples, truth, rng=rng)
    samples += impulses(rng, len(samples), per_s=5.0, level_db=30.0, length_s=0.002)
    pulses, detector = detect(samples, THESIS_TAG, frequency_window_hz=500.0)
    heard = compare(pulses, truth, THESIS_TAG)
    assert heard.matched >= 0.8 * heard.true
    assert heard.false_confirmed == 0
    assert detector.counters.samples_blanked > SECONDS * 5.0 * 0.002 * CHANNEL_HZ * 0.5
