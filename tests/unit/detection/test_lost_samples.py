"""Lost samples make no pulses and do not change those near them."""

import functools

import made
import numpy as np
from depth import count
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from streams import start_s

from uavrt.core.messages import Pulse
from uavrt.dsp.frontend import FrontEnd
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    TruePulse,
    add_pulse,
    noise,
)

RATE_HZ = 60_000.0
CENTER_HZ = THESIS_TAG.frequency_hz - 6_000.0
DURATION_S = 12.0
ENR_DB = 30.0
WIDTH_S = THESIS_TAG.pulse_width_s
STARTS_S = tuple((0.5 + 1.254 * np.arange(9)).tolist())
SWEPT_S = STARTS_S[5]


@functools.cache
def samples() -> NDArray[np.complex64]:
    x = noise(np.random.default_rng(5), round(DURATION_S * RATE_HZ))
    for at_s in STARTS_S:
        pulse = TruePulse(start_s=at_s, offset_hz=6_040.0, enr_db=ENR_DB)
        add_pulse(x, pulse, sample_rate_hz=RATE_HZ, width_s=WIDTH_S, phase=0.0)
    return x


def found(*gaps_s: tuple[float, float]) -> list[Pulse]:
    """Detect with the samples of some stretches lost."""
    x = samples()
    front = FrontEnd(
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=CENTER_HZ,
        frequencies_hz=[THESIS_TAG.frequency_hz],
    )
    detector = made.detector(
        THESIS_TAG,
        front.plan.channel_rate_hz,
        center_frequency_hz=front.plan.channel_centers_hz[0],
    )
    pulses: list[Pulse] = []
    step, lost, at = round(0.1 * RATE_HZ), 0, 0
    edges = [round(edge * RATE_HZ) for gap in sorted(gaps_s) for edge in gap]
    while at < len(x):
        ahead = [edge for edge in edges if edge > at]
        end = min([at + step, len(x), *ahead])
        if (len(edges) - len(ahead)) % 2:
            lost += end - at
        else:
            block = made.iq_block(x[at:end], at, RATE_HZ, START_NS, lost_before=lost)
            for part in front.process(block):
                pulses += detector.process(part.samples, part.time_ns)
            lost = 0
        at = end
    return pulses + detector.flush()


def lost_share(begin_s: float, gap_s: tuple[float, float]) -> float:
    """Share of a pulse that lies in a gap, for a pulse beginning at a time."""
    both_s = min(begin_s + WIDTH_S, gap_s[1]) - max(begin_s, gap_s[0])
    return max(both_s, 0.0) / WIDTH_S


@settings(max_examples=count(20, 60), deadline=None, derandomize=True)
@given(
    length_s=st.one_of(st.floats(0.001, 0.1), st.floats(0.1, 2.0)),
    offset_s=st.floats(-0.05, 0.35),
)
@example(length_s=0.08, offset_s=0.07)
@example(length_s=0.206, offset_s=0.2)
@example(length_s=0.5, offset_s=0.49)
def test_a_gap_about_a_pulse_makes_no_pulse_inside_it_nor_one_of_an_absurd_level(
    length_s: float, offset_s: float
) -> None:
    gap_s = (SWEPT_S + WIDTH_S - offset_s, SWEPT_S + WIDTH_S - offset_s + length_s)
    pulses = found(gap_s)
    assert max(pulse.snr_db for pulse in pulses) < ENR_DB + 2.0
    for pulse in pulses:
        assert lost_share(start_s(pulse), gap_s) < 0.6, "a pulse inside of the gap"
        if pulse.detection_status != "subthreshold":
            assert min(abs(start_s(pulse) - s) for s in STARTS_S) < 0.005
    reported_s = [start_s(p) for p in pulses if p.detection_status != "subthreshold"]
    for true_s in STARTS_S:
        if lost_share(true_s, gap_s) == 0.0:
            assert min(abs(one - true_s) for one in reported_s) < 0.003


def test_half_a_pulse_is_measured_as_strong_as_a_whole_one() -> None:
    for gap_s in (
        (SWEPT_S - 0.2, SWEPT_S + 0.5 * WIDTH_S),
        (SWEPT_S + 0.5 * WIDTH_S, SWEPT_S + 0.3),
        (SWEPT_S + 0.3 * WIDTH_S, SWEPT_S + 0.6 * WIDTH_S),
    ):
        pulse = min(found(gap_s), key=lambda p: abs(start_s(p) - SWEPT_S))
        assert abs(start_s(pulse) - SWEPT_S) < 0.003
        assert abs(pulse.snr_db - ENR_DB) < 1.0, gap_s
        assert pulse.confirmed
