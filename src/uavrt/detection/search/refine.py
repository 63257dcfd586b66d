"""Measure time, frequency and energy of single pulses, by local maximum likelihood.

For a rectangular pulse of unknown phase in white noise, the likelihood depends on the squared
magnitude of the matched filter. It is evaluated at every sample and, near the best sample, at a
continuous frequency (Newton's method). By the Cramér–Rao bound, the standard deviation of the
frequency is at least 1.95 Hz for a pulse of 20 ms at 20 dB.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.search.grid import Grid, slide_turns
from uavrt.detection.search.levelling import Leveller
from uavrt.detection.search.tuning import MEASURE
from uavrt.detection.signal.sample_buffer import SampleBuffer


@dataclass(slots=True)
class Measured:
    """Time, frequency and power of one pulse, as measured in the samples."""

    start: float
    """Index of the first sample of the pulse."""
    offset_hz: float
    """Frequency of the pulse from the channel's centre [Hz], at the pulse's middle."""
    power: float
    """Matched-filter power of the pulse over the noise power: ENR + 1 on average."""
    noise: float
    """Noise power of one sample at the pulse's frequency."""
    contrast: float
    """Power of the pulse over the mean power of the windows 1.5 to 3 pulse widths away."""
    received: float = 1.0
    """Share of the pulse's samples that were not lost; `power` is computed for these."""

    @property
    def enr(self) -> float:
        """Energy of the pulse over the noise power density, not in decibels; at least 0.1."""
        return max((self.power - 1.0) / self.received, 0.1)


def timing_error_s(width_s: float, power: float) -> float:
    """Standard deviation of the measured time of a pulse with this power [s]."""
    return 0.08 * width_s * math.sqrt(20.0 / max(power, 4.0))


class Refiner:
    """Measures pulses near expected times and frequencies."""

    def __init__(self, grid: Grid, buffer: SampleBuffer) -> None:
        self._grid = grid
        self._buffer = buffer
        self._window = grid.window
        self.upto = 0
        """Index after the last cleaned sample; pulses are measured only up to there."""
        self.leveller: Leveller | None = None
        """Tracker of the noise level; None if the level is constant."""
        self._moments = _moments(grid.window)
        self._bin_hz = grid.sample_rate_hz / grid.window
        offsets = grid.offsets_hz
        self._lowest_hz = float(offsets[0])
        self._row_hz = float(offsets[1] - offsets[0]) if len(offsets) > 1 else 1.0

    def noise_at(self, offset_hz: float, noise: NDArray[np.float32], start: float) -> float:
        """Noise power of one sample at a frequency, in the window that begins at `start`."""
        # Rows are evenly spaced; numpy.interp, which must search, takes ten times as long.
        at = (offset_hz - self._lowest_hz) / self._row_hz
        if not 0.0 <= at < len(noise):
            # Beyond one edge of the channel continues the other, if that is searched.
            around = at % (self._grid.sample_rate_hz / self._row_hz)
            at = around if around < len(noise) else at
        below = min(max(int(at), 0), len(noise) - 2) if len(noise) > 1 else 0
        share = min(max(at - below, 0.0), 1.0)
        low = float(noise[below])
        if share:
            low += share * (float(noise[below + 1]) - low)
        if self.leveller is not None:
            low *= self.leveller.record.at(below + share, self._grid.column(start))
        return low

    def search(
        self,
        starts: NDArray[np.float64],
        half_width: float,
        offset_hz: float,
        half_band_hz: float,
        noise: NDArray[np.float32],
        *,
        climb: bool = False,
        spread: float = math.inf,
    ) -> list[Measured] | None:
        """Find pulses of one frequency near expected starts; None if samples are not stored.

        `climb`: search further if the peak is at the edge of the searched range. `spread`:
        standard deviation of the starts [samples].
        """
        window, buffer = self._window, self._buffer
        lead = math.ceil(half_width)
        length = window + 2 * lead + 1
        first = np.floor(starts).astype(np.int64) - lead
        if int(first.min()) < buffer.start or int(first.max()) + length > self.upto:
            return None
        count = max(3, 2 * math.ceil(half_band_hz / (0.15 * self._bin_hz)) + 1)
        # Tables of a whole number of 64 samples: few lengths, used again and again.
        frequencies, turns = _turns(
            self._grid.sample_rate_hz, half_band_hz, count, -(-length // 64) * 64
        )
        turns = turns[:, :length]
        power = self._filtered(first, length, offset_hz, turns)
        level = window * np.array(
            [self.noise_at(offset_hz, noise, float(start)) for start in starts]
        )
        if math.isfinite(spread):
            away = (
                first[:, np.newaxis] + np.arange(power.shape[2]) - starts[:, np.newaxis]
            ) / spread
            power -= (0.5 * level)[:, np.newaxis, np.newaxis] * away[:, np.newaxis] ** 2
            np.maximum(power, 0.0, out=power)
        best = power.max(axis=2) / level[:, np.newaxis]
        # The root keeps one strong pulse from deciding for all.
        common = int(np.sqrt(best).sum(axis=0).argmax())
        at = power[:, common].argmax(axis=1)
        edge = (at == 0) | (at == power.shape[2] - 1)
        if climb and edge.any():
            # The peak may be farther: a limited cell scores the same on a strong pulse's flank.
            moved = first + np.where(at == 0, -lead, np.where(edge, lead, 0))
            if int(moved.min()) >= buffer.start and int(moved.max()) + length <= self.upto:
                first = moved
                some = turns[common : common + 1]
                at = self._filtered(first, length, offset_hz, some)[:, 0].argmax(axis=1)
        frequency = offset_hz + float(frequencies[common])
        return [
            self._polish(int(first[index] + at[index]), frequency, noise)
            for index in range(len(starts))
        ]

    def search_broken(
        self,
        start: float,
        half_width: float,
        offset_hz: float,
        half_band_hz: float,
        noise: NDArray[np.float32],
        *,
        spread: float,
    ) -> Measured | None:
        """Find a pulse whose phase is broken by lost samples; parameters as in `search`."""
        window, buffer = self._window, self._buffer
        lead = math.ceil(half_width)
        length = window + 2 * lead + 1
        first = math.floor(start) - lead
        if first < buffer.start or first + length > self.upto:
            return None
        count = max(3, 2 * math.ceil(half_band_hz / (0.15 * self._bin_hz)) + 1)
        _, turns = _turns(self._grid.sample_rate_hz, half_band_hz, count, -(-length // 64) * 64)
        breaks = [(0, round(share * window), window) for share in MEASURE.break_places]
        sums = self._sums(np.array([first]), length, offset_hz, turns[:, :length], breaks)
        size = np.maximum.reduce([(abs(a) + abs(b))[0].max(axis=0) for a, b in sums])
        places = len(size)
        level = self.noise_at(offset_hz, noise, start)
        away = (first + np.arange(places) - start) / spread
        likely = size**2 - 0.5 * window * level * away**2
        best = int(likely.argmax())
        weight = self._weight(first + best)
        return Measured(
            start=float(first + best),
            offset_hz=offset_hz,
            power=max(
                weight * float(size[best]) ** 2 / (window * level) - MEASURE.break_gain, 0.0
            ),
            noise=level,
            contrast=math.inf,
            received=1.0 / weight if weight else 1.0,
        )

    def loses(self, start: float) -> bool:
        """True if samples near a pulse are lost."""
        near = MEASURE.losing_s * self._grid.sample_rate_hz
        return self._buffer.loses(start - near, start + near)

    def _weight(self, start: int) -> float:
        """Factor on a window's power that compensates for lost samples; 0: too many lost."""
        weights = self._buffer.weights(np.array([start]), self._window)
        return 1.0 if weights is None else float(weights[0])

    def powers(
        self,
        first: NDArray[np.int64],
        count: int,
        offset_hz: float,
        half_band_hz: float,
        frequencies: int,
    ) -> tuple[NDArray[np.float64] | None, NDArray[np.int64]]:
        """Matched-filter power (pulses, frequencies, starts), and the shift of each `first`.

        The starts are shifted so that all samples are stored. The power is None if too few
        samples are stored.
        """
        length = self._window + count - 1
        latest = self.upto - length
        if latest < self._buffer.start:
            return None, np.zeros_like(first)
        moved = np.clip(first, self._buffer.start, latest)
        _, turns = _turns(
            self._grid.sample_rate_hz, half_band_hz, frequencies, -(-length // 64) * 64
        )
        return self._filtered(moved, length, offset_hz, turns[:, :length]), moved - first

    def _filtered(
        self,
        first: NDArray[np.int64],
        length: int,
        offset_hz: float,
        turns: NDArray[np.complex128],
    ) -> NDArray[np.float64]:
        """Matched-filter power around a frequency, shape (pulses, frequencies, starts)."""
        ((filtered,),) = self._sums(first, length, offset_hz, turns, [(0, self._window)])
        power = np.asarray(filtered.real**2 + filtered.imag**2)
        starts = first[:, np.newaxis] + np.arange(power.shape[2])
        weights = self._buffer.weights(starts, self._window)
        if weights is not None:
            power *= weights[:, np.newaxis]
        return power

    def _sums(
        self,
        first: NDArray[np.int64],
        length: int,
        offset_hz: float,
        turns: NDArray[np.complex128],
        divisions: Sequence[tuple[int, ...]],
    ) -> list[list[NDArray[np.complex128]]]:
        """Sums over parts of all windows, as by `_part_sums`."""
        stretch = np.stack([self._buffer.view(int(a), int(a) + length) for a in first])
        radian = -2j * np.pi / self._grid.sample_rate_hz * offset_hz
        still = stretch * np.exp(radian * np.arange(length))
        return _part_sums(still, turns, self._window, self._grid.turns, divisions)

    def _polish(self, start: int, offset_hz: float, noise: NDArray[np.float32]) -> Measured:
        """Refine a pulse's frequency at a fixed time by Newton's method; measure its power."""
        window, rate = self._window, self._grid.sample_rate_hz
        x = self._still(start).astype(np.complex128)
        n = self._moments[1].real
        radian = -2.0 * np.pi / rate
        reach_hz = 0.4 * self._bin_hz
        frequency = offset_hz
        zero = first = second = 0j
        for _ in range(MEASURE.newton_steps):
            zero, first, second = self._moments @ (x * np.exp(1j * radian * frequency * n))
            slope = 2.0 * (zero.conjugate() * 1j * radian * first).real
            curve = 2.0 * (
                radian**2 * abs(first) ** 2 - radian**2 * (zero.conjugate() * second).real
            )
            if curve >= 0.0:
                break
            step = max(-0.2 * self._bin_hz, min(0.2 * self._bin_hz, -slope / curve))
            frequency += step
            frequency = max(offset_hz - reach_hz, min(offset_hz + reach_hz, frequency))
            if abs(step) < 0.05:
                break
        zero = complex(np.dot(x, np.exp(1j * radian * frequency * n)))
        level = max(self.noise_at(frequency, noise, start), 1e-30)
        weight = self._weight(start)
        return Measured(
            start=float(start),
            offset_hz=frequency,
            power=weight * abs(zero) ** 2 / (window * level),
            noise=level,
            contrast=math.inf,
            received=1.0 / weight if weight else 1.0,
        )

    def _still(self, start: int) -> NDArray[np.complex64]:
        """Samples of a window, in which the frequency of the tag's pulse does not slide."""
        window, turns = self._buffer.view(start, start + self._window), self._grid.turns
        return window if turns is None else window * turns

    @contextmanager
    def without(self, pulses: Sequence[Measured]) -> Iterator[None]:
        """Context in which known pulses, as best fitted, are removed from the samples.

        Each is subtracted with the best-fitting amplitude at its time and frequency. With an
        error of the start of half a sample, 4e-5 of the energy of a 20 ms pulse remains at 3750
        S/s.
        """
        buffer = self._buffer
        before = []
        for pulse in pulses:
            first = max(round(pulse.start), buffer.start)
            some = buffer.view(first, min(round(pulse.start) + self._window, buffer.end))
            if not len(some):
                continue
            before.append((some, some.copy()))
            radian = 2j * np.pi / self._grid.sample_rate_hz * pulse.offset_hz
            wave = np.exp(radian * np.arange(len(some))).astype(np.complex64)
            if self._grid.turns is not None:
                cut = first - round(pulse.start)
                wave *= self._grid.turns[cut : cut + len(some)].conj()
            some -= wave * (np.vdot(wave, some) / np.float32(len(some)))
        try:
            yield
        finally:
            for some, kept in reversed(before):
                some[:] = kept

    def contrast(self, pulse: Measured) -> float:
        """Power of a pulse over the mean power of four windows around it at its frequency."""
        window = self._window
        start = round(pulse.start)
        around = [start + round(shift * window) for shift in (-3.0, -2.0, 2.0, 3.0)]
        buffer = self._buffer
        n = np.arange(window)
        turn = np.exp((-2j * np.pi / self._grid.sample_rate_hz) * pulse.offset_hz * n)
        powers = [
            weight * abs(complex(np.dot(self._still(a), turn))) ** 2
            for a in around
            if a >= buffer.start and a + window <= self.upto and (weight := self._weight(a))
        ]
        if not powers:
            return math.inf
        mean = sum(powers) / len(powers) / (window * pulse.noise)
        return pulse.power / max(mean, 0.05)

    def is_impulse(self, pulse: Measured, floor: float) -> bool:
        """True for an impulse: most energy is in a quarter of a pulse, or in many rows."""
        if not self._looks_like_impulse(pulse, floor):
            return False
        around = self._floor_around(pulse)
        return around <= floor or self._looks_like_impulse(pulse, around)

    def _floor_around(self, pulse: Measured) -> float:
        """Noise power per sample at a pulse, limited to the range of the levels around it."""
        window, buffer, start = self._window, self._buffer, round(pulse.start)
        sides = []
        for near, far in ((-MEASURE.around_widths, -0.5), (1.5, 1.0 + MEASURE.around_widths)):
            first = max(start + round(near * window), buffer.start)
            last = min(start + round(far * window), self.upto)
            if last - first < window:
                continue
            x = buffer.view(first, last)
            power = x.real**2 + x.imag**2
            power = power[power > 0.0]  # zeros stand for lost samples
            if len(power) >= window // 2:
                sides.append(float(np.median(power)) / math.log(2.0))
        if not sides:
            return 0.0
        # The first moment of a rise, relative to the level before it, looks like an impulse.
        return max(min(sides), min(max(sides), pulse.noise))

    def _looks_like_impulse(self, pulse: Measured, floor: float) -> bool:
        window = self._window
        start = round(pulse.start)
        x = self._buffer.view(start, start + window)
        quarter = window // 4
        energy = np.concatenate(([0.0], np.cumsum(x.real**2 + x.imag**2, dtype=np.float64)))
        burst = float((energy[quarter:] - energy[:-quarter]).max()) - quarter * floor
        whole = float(energy[-1]) - pulse.received * window * floor
        # A pulse of 20 dB has a quarter of its energy there, and noise adds or takes.
        least = (
            MEASURE.burst_sigmas * math.sqrt(quarter) * floor + 0.5 * pulse.power * pulse.noise
        )
        if burst > least and burst > MEASURE.burst_share * whole:
            return True
        narrow = MEASURE.narrow_share * whole
        return (
            whole > MEASURE.wide_sigmas * math.sqrt(window) * floor
            and pulse.power * pulse.noise < narrow
            and self.strongest(pulse)[1] * pulse.noise < narrow
            and float(slide_energies(x, self._grid.sample_rate_hz).max()) < narrow
        )

    def strongest(self, pulse: Measured) -> tuple[float, float]:
        """Frequency and power of the strongest row in the whole channel at a pulse's time.

        Windows half a pulse earlier and later are included, because a window that cuts a strong
        pulse receives as much leakage as one with the whole pulse.
        """
        window, buffer = self._window, self._buffer
        half = window // 2
        size = 2 * window
        starts = [round(pulse.start) + shift for shift in (-half, 0, half)]
        starts = [a for a in starts if a >= buffer.start and a + window <= self.upto]
        spectrum = np.fft.fft(np.stack([self._still(a) for a in starts]), size)
        powers = spectrum.real**2 + spectrum.imag**2
        weights = buffer.weights(np.array(starts), window)
        if weights is not None:
            powers *= weights[:, np.newaxis]
        power = powers.max(axis=0)
        at = int(power.argmax())
        rate = self._grid.sample_rate_hz
        offset = float(np.fft.fftfreq(size, 1.0 / rate)[at])
        return offset, float(power[at]) / (window * pulse.noise)


def _part_sums(
    samples: NDArray[np.complex128],
    turns: NDArray[np.complex128],
    window: int,
    slide: NDArray[np.complex64] | None,
    divisions: Sequence[tuple[int, ...]],
) -> list[list[NDArray[np.complex128]]]:
    """Sums over parts of all windows of `samples`, each (pulses, frequencies, starts).

    `slide`: the grid's `turns`. `divisions`: for each list of the result, the limits between
    the parts of a window.
    """
    if slide is not None:
        # The slide begins with the window, so a running sum cannot serve all starts.
        filters = (turns[:, :window] * slide).T
        windows = np.lib.stride_tricks.sliding_window_view(samples, window, axis=1)
        return [
            [(windows[..., a:b] @ filters[a:b]).swapaxes(1, 2) for a, b in pairwise(limits)]
            for limits in divisions
        ]
    pulses, length = samples.shape
    starts = length + 1 - window
    sums = np.zeros((pulses, len(turns), length + 1), np.complex128)
    np.cumsum(samples[:, np.newaxis, :] * turns[np.newaxis], axis=2, out=sums[..., 1:])
    return [
        [sums[..., b : b + starts] - sums[..., a : a + starts] for a, b in pairwise(limits)]
        for limits in divisions
    ]


def slide_energies(window: NDArray[np.complex64], rate_hz: float) -> NDArray[np.float64]:
    """Largest energy in a window of signals whose frequency slides evenly, for each slide.

    Each row has little of the energy of a sliding pulse, as of a burst of noise.
    """
    length = len(window)
    turns = _slides(length, rate_hz)
    spectrum = np.fft.fft(window * turns, 2 * length)
    return np.asarray((spectrum.real**2 + spectrum.imag**2).max(axis=1)) / length


@lru_cache(maxsize=8)
def _slides(length: int, rate_hz: float) -> NDArray[np.complex64]:
    """`slide_turns` of all slides that are tried, shape (slides, length)."""
    turns = [slide_turns(length, rate_hz, slide_hz) for slide_hz in MEASURE.slides_hz]
    return np.asarray(turns, np.complex64)


@lru_cache(maxsize=4)  # of up to 90 kB; one serves nine of ten calls, rare lengths the rest
def _turns(
    rate_hz: float, half_band_hz: float, count: int, length: int
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    frequencies = np.linspace(-half_band_hz, half_band_hz, count)
    radians = (-2j * np.pi / rate_hz) * frequencies[:, np.newaxis] * np.arange(length)
    return frequencies, np.exp(radians)


@lru_cache(maxsize=8)
def _moments(window: int) -> NDArray[np.complex128]:
    """Powers 0 to 2 of the samples' distances from the window's middle, (3, window)."""
    n = np.arange(window) - (window - 1) / 2.0
    return np.stack((np.ones_like(n), n, n * n)).astype(np.complex128)
