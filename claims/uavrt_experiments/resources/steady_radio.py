"""Cheap stand-in for a radio's program: noise, and pulses of many tags.

``python -m uavrt_experiments.resources.steady_radio --tags 100 --center-frequency-hz 148.7e6``,
and the arguments of ``airspy_rx``, which it ignores. Writes complex float32 at 3 MS/s, paced.
Every fourth tag beeps. It serves to measure the cost of the rest; `uavrt.simulation.airspy_rx`
simulates a world.
"""

import argparse
import os
import sys
import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag

RATE_HZ = 3_000_000
BLOCK = 65_536
NOISE = 1 << 22
WIDTH_S, INTERVAL_S = 0.020, 1.254
PULSE_ENR = 100.0
"""ENR of each pulse as a power ratio, 20 dB."""
NOISE_RMS = 0.01


def steady_tags(count: int, center_frequency_hz: float) -> tuple[Tag, ...]:
    """Tags like the thesis's, spread over the channels.

    Up to 101 are 2390 Hz apart within ± 120 kHz; more repeat the frequencies, each time shifted
    by a third of that.
    """
    return tuple(
        Tag(
            tag_id=2 * number,
            frequency_hz=center_frequency_hz
            - 120e3
            + (number * 37 % 101) * 2390.0
            + (number // 101) * 797.0,
            pulse_width_s=WIDTH_S,
            pulse_intervals_s=(INTERVAL_S,),
            interval_uncertainty_s=0.06,
            interval_jitter_s=0.01,
            k=3,
        )
        for number in range(1, count + 1)
    )


class SteadySignal:
    """Noise cut at random places from a long piece, with pulses of every fourth tag."""

    def __init__(self, tags: int, center_frequency_hz: float) -> None:
        self._random = np.random.default_rng(7)
        noise = self._random.standard_normal((NOISE, 2), np.float32) * np.float32(NOISE_RMS)
        self._noise = noise.view(np.complex64)[:, 0]
        time_s = np.arange(round(WIDTH_S * RATE_HZ)) / RATE_HZ
        # ENR = amplitude² · width · rate / variance of the complex noise.
        amplitude = np.sqrt(PULSE_ENR * 2 * NOISE_RMS**2 / (WIDTH_S * RATE_HZ))
        self._pulses: list[tuple[int, NDArray[np.complex64]]] = []
        for number, tag in enumerate(steady_tags(tags, center_frequency_hz)):
            if number % 4 == 0:
                turn = 2j * np.pi * (tag.frequency_hz - center_frequency_hz) * time_s
                phase = (number + 1) * 345_678 % round(INTERVAL_S * RATE_HZ)
                self._pulses.append((phase, (amplitude * np.exp(turn)).astype(np.complex64)))

    def block(self, number: int) -> memoryview:
        """Get the bytes of one block."""
        place = int(self._random.integers(NOISE - BLOCK))
        samples = self._noise[place : place + BLOCK].copy()
        start, interval = number * BLOCK, round(INTERVAL_S * RATE_HZ)
        for phase, pulse in self._pulses:
            before = (start - phase) // interval
            for beep in (before, before + 1):
                offset = beep * interval + phase - start
                first, last = max(offset, 0), min(offset + len(pulse), BLOCK)
                if first < last:
                    samples[first:last] += pulse[first - offset : last - offset]
        return samples.view(np.uint8).data


def main(arguments: Sequence[str]) -> int:
    """Write samples until the reader ends."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False, add_help=False)
    parser.add_argument("--tags", type=int, required=True)
    parser.add_argument("--center-frequency-hz", type=float, required=True)
    given, _ = parser.parse_known_args(arguments)
    signal = SteadySignal(given.tags, given.center_frequency_hz)
    began_s, number = time.monotonic(), 0
    while True:
        view = signal.block(number)
        number += 1
        time.sleep(max(0.0, began_s + number * BLOCK / RATE_HZ - time.monotonic()))
        try:
            while view:
                view = view[os.write(1, view) :]
        except BrokenPipeError:
            return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
