"""Strong carriers that stay in a radio's band."""

from collections.abc import Sequence

import made
import numpy as np
import pytest

from uavrt.dsp.carriers import Carriers
from uavrt_experiments.detection.signals import START_NS, noise

CENTER_HZ = 148_700_000.0


def check(
    carriers: Carriers,
    rate_hz: float,
    tones: Sequence[tuple[float, float, float | None]],
    *,
    from_s: float = 0.0,
    block_s: float = 0.087,
) -> Carriers:
    """Look at 6 s of noise with tones: offset [Hz], level over the noise [dB], interval [s].

    With an interval it is a tag's pulses of 20 ms, else a carrier.
    """
    rng = np.random.default_rng(4)
    count, first = round(block_s * rate_hz), round(from_s * rate_hz)
    for at in range(round(6.0 / block_s)):
        n = np.arange(at * count, (at + 1) * count) + first
        samples = noise(rng, count)
        for offset_hz, level_db, interval_s in tones:
            on = 1.0 if interval_s is None else (n / rate_hz % interval_s) < 0.02
            turn = 2.0 * np.pi * offset_hz / rate_hz * n
            samples += (10.0 ** (level_db / 20.0) * on * np.exp(1j * turn)).astype(np.complex64)
        carriers.check(made.iq_block(samples, int(n[0]), rate_hz, START_NS), CENTER_HZ)
    return carriers


@pytest.mark.parametrize("rate_hz", [96_000.0, 768_000.0])
def test_strong_carriers_are_found_within_hertz_the_strongest_first(rate_hz: float) -> None:
    tones = [(-11_003.0, 30.0, None), (7_017.0, 40.0, None)]
    found = check(Carriers(), rate_hz, tones).frequencies_hz
    assert [hz - CENTER_HZ for hz in found] == pytest.approx([7_017.0, -11_003.0], abs=4.0)


@pytest.mark.parametrize("interval_s", [0.71, 0.97, 1.254])
def test_a_tags_pulses_are_no_carrier(interval_s: float) -> None:
    assert check(Carriers(), 96_000.0, [(20_300.0, 40.0, interval_s)]).frequencies_hz == ()


def test_neither_noise_nor_the_receivers_own_offset_is_a_carrier() -> None:
    assert check(Carriers(), 96_000.0, [(0.0, 40.0, None)]).frequencies_hz == ()


def test_a_carrier_that_ends_is_forgotten() -> None:
    carriers = check(Carriers(), 96_000.0, [(7_000.0, 40.0, None)])
    before = len(carriers.frequencies_hz)
    check(carriers, 96_000.0, [], from_s=6.0)
    assert (before, len(carriers.frequencies_hz)) == (1, 0)
