"""Measure a pulse received through an antenna switch: complex amplitude of each antenna, and
noise.

If the switch stays at each position for 0.25 ms, a pulse of 20 ms contains 80 visits to
positions. The mean sample of each visit has a phase. The coherent sum of one position's visits
is that antenna's amplitude, and their scatter gives the noise.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import UsageError
from uavrt.localization.bearing.tuning import SIMPLE
from uavrt.localization.number_kinds import Guard

_Floats = NDArray[np.float64]
_Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchSchedule:
    """Position of the antenna switch as a function of the sample number."""

    positions: int
    dwell_samples: int
    """Number of samples for which the switch stays at each position, including the settling
    time."""
    settle_samples: int = 0
    """Number of samples ignored after each change of the antenna switch's position."""
    first_sample: int = 0
    """Index of a sample at which the antenna switch changes to position 0."""

    def __post_init__(self) -> None:
        if self.positions < 2:
            raise UsageError(
                f"the antenna switch has {self.positions} positions",
                remedy="Give two or more positions",
            )
        if not 0 <= self.settle_samples < self.dwell_samples:
            raise UsageError(
                f"the settling time of {self.settle_samples} samples must be at least 0 and "
                f"shorter than the {self.dwell_samples} samples at each position",
                remedy="Set a shorter settling time, or a longer stay",
            )

    def visits(self, first_sample: int, count: int) -> NDArray[np.intp]:
        """Number of the visit to a switch position at each sample, shape (count,); negative
        while the switch settles.
        """
        index = first_sample - self.first_sample + np.arange(count)
        visit, within = np.divmod(index, self.dwell_samples)
        visit -= int(visit[0]) // self.positions * self.positions
        return np.where(within < self.settle_samples, -1, visit).astype(np.intp)

    def selected(self, first_sample: int, count: int) -> NDArray[np.intp]:
        """Position of the switch at each sample, shape (count,); negative while the switch
        settles.
        """
        visit = self.visits(first_sample, count)
        return np.where(visit < 0, -1, visit % self.positions).astype(np.intp)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SwitchedPulse:
    """Measured amplitudes and noise of one pulse that was received through an antenna
    switch.
    """

    amplitudes: _Complex
    """Complex amplitude at each switch position, with an arbitrary common phase, shape
    (positions,)."""
    counts: _Floats
    """Number of samples averaged for the amplitude at each switch position, shape
    (positions,)."""
    noise_power: float
    """Noise power of one sample, computed from the scatter between visits to the same switch
    position."""
    frequency_hz: float
    """Refined frequency of the pulse's carrier, relative to the samples' centre [Hz]."""

    @property
    def snr_db(self) -> float:
        """Energy of the pulse over the noise density, from all switch positions together
        [dB].
        """
        energy = float(np.sum(self.counts * np.abs(self.amplitudes) ** 2))
        excess = energy / self.noise_power - len(self.counts)
        return float(10.0 * np.log10(max(excess, 1e-3)))


def measure_switched_pulse(
    samples: NDArray[np.complex64],
    schedule: SwitchSchedule,
    *,
    first_sample: int,
    frequency_hz: float,
    sample_rate_hz: float,
    frequency_error_hz: Guard[float] = 15.0,
) -> SwitchedPulse:
    """Measure the amplitude of a pulse at each position of the antenna switch.

    `samples` (n,): the pulse, from its first to its last sample. `schedule`: position of the
    switch at each sample. `first_sample`: number of `samples[0]` in the schedule.
    `frequency_hz`: carrier of the pulse in the samples, from the detector.
    `frequency_error_hz`: largest error of the carrier, within which it is searched; an error of
    10 Hz rotates the phase by a fifth of a cycle over 20 ms. Raises `UsageError` if a position
    was visited less than twice during the pulse.
    """
    visit = schedule.visits(first_sample, len(samples))
    valid = visit >= 0
    visits = int(visit.max(initial=0)) + 1
    count = np.bincount(visit[valid], minlength=visits).astype(np.float64)
    whole = count > 0.5 * (schedule.dwell_samples - schedule.settle_samples)
    times_visited = np.bincount(
        np.flatnonzero(whole) % schedule.positions, minlength=schedule.positions
    )
    if times_visited.min() < 2:
        raise UsageError(
            "the antenna switch does not reach every position during the pulse",
            remedy="Switch faster, so that each pulse includes every position several times",
        )
    time_s = np.arange(len(samples)) / sample_rate_hz
    still = samples * np.exp(-2j * np.pi * frequency_hz * time_s)
    used = valid & whole[np.maximum(visit, 0)]
    sums = np.bincount(visit[used], still.real[used], visits) + 1j * np.bincount(
        visit[used], still.imag[used], visits
    )
    middle_s = np.bincount(visit[used], time_s[used], visits) / np.maximum(count, 1.0)
    seen = np.flatnonzero(whole)
    position = seen % schedule.positions
    return _fitted(
        sums[seen],
        count[seen],
        middle_s[seen],
        np.eye(schedule.positions)[position],
        frequency_hz,
        frequency_error_hz,
    )


def _fitted(
    sums: _Complex,
    counts: _Floats,
    middle_s: _Floats,
    at_position: _Floats,
    frequency_hz: float,
    frequency_error_hz: float,
) -> SwitchedPulse:
    """Fit the carrier and the amplitudes to visits (v,); `at_position` (v, p) is 1 at each
    visit's position.
    """
    steps = max(1, round(frequency_error_hz / SIMPLE.carrier_step_hz))
    error_hz = np.arange(-steps, steps + 1) * SIMPLE.carrier_step_hz
    turned = sums * np.exp(-2j * np.pi * error_hz[:, None] * middle_s)
    weight = counts @ at_position
    power = np.sum(np.abs(turned @ at_position) ** 2 / weight, axis=1)
    best = int(np.argmax(power))
    amplitudes = (turned[best] @ at_position) / weight
    left = turned[best] / counts - at_position @ amplitudes
    freedom = len(sums) - at_position.shape[1]
    noise = float(np.sum(counts * np.abs(left) ** 2)) / freedom
    return SwitchedPulse(
        amplitudes=np.asarray(amplitudes),
        counts=weight,
        noise_power=max(noise, 1e-30),
        frequency_hz=frequency_hz + float(error_hz[best]),
    )
