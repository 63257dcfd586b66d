"""Short bursts of carrier anywhere in a band, without knowing any tag.

Every frequency bin is compared with its own usual level: a carrier that is always there is no
burst, nor is the noise of another part of the band. What rises in most of the band at once is
an impulse (ignition, a motor). A cell that rises is joined with those around it; the strongest
cell stands for the burst.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from uavrt.dsp import medians, transform_columns
from uavrt.radio import BlockTimes

WINDOW_S: Final = 0.016
"""Hann window, for pulses of 8 to 50 ms: it loses 3 dB of one of 16 ms, 1 dB of one of 30."""
HOP_S: Final = 0.004
BATCH_S: Final = 2.0
"""Stretch over which a bin's usual level is its median."""
MOST_CELLS_AT_ONCE: Final = 6_000_000
"""24 MiB of levels, and some three times that while they are searched: at 3 MS/s, 0.5 s."""
FALSE_CELLS_PER_S: Final = 3.0
"""Cells that noise may raise in a second, over the whole band; the fold sorts them out."""
WIDE_FRACTION: Final = 0.25
"""With more of the bins up at one instant, it is an impulse."""
MERGE_S: Final = 0.060
SIDE_DB: Final = 25.0
SIDE_HZ: Final = 20_000.0
"""A cell so far below a stronger burst, so near to it and at the same time, is the burst's own
keying: the flanks of a rectangular pulse spread."""
MOST_CELLS: Final = 20_000
_STANDS_OUT: Final = 0.7
"""Windows with so much of the energy of the weakest burst looked for are looked at."""
_HANN: Final = 2.0 / 3.0
"""Signal to noise of a carrier behind a Hann window over that behind a rectangular one."""
_LEVEL_CHANGE: Final = 1.25
"""The bins' usual levels are measured again when the band's changes so much."""
_MOST_TILT: Final = 1.5
"""With steady carriers so strong every window is transformed: beside their energy that of a
burst does not stand out."""
_QUIET_EVERY: Final = 32
"""Of the windows that do not stand out one in so many is looked at: a carrier that has begun
since is in all of them."""


@dataclass(frozen=True, slots=True, eq=False)
class Bursts:
    """Bursts found, in order of time."""

    times_s: NDArray[np.float64]
    """(n,) their middles, since sample 0; or since the time that they were placed by."""
    frequencies_hz: NDArray[np.float64]
    """(n,) relative to the band's centre, to about a tenth of a bin (60 Hz / 10)."""
    levels_db: NDArray[np.float64]
    """(n,) over the noise in a cell."""

    def placed(self, times: BlockTimes, sample_rate_hz: float, since_ns: int) -> "Bursts":
        """Put them at the times of the samples, counted from some time."""
        times_s = times.seconds(self.times_s * sample_rate_hz, since_ns)
        order = np.argsort(times_s, kind="stable")
        return Bursts(times_s[order], self.frequencies_hz[order], self.levels_db[order])


class BurstSearch:
    """Finds bursts in a stream of samples.

    Parameters
    ----------
    sample_rate_hz : float
        Of the band.
    low_hz, high_hz : float
        What to search, relative to the band's centre.
    least_db : float
        Weaker bursts are passed over.
    hop_s : float
        From one window to the next: of what is found, times are known to half of it.
    glance : bool
        Once the bins' usual levels are known, transform only windows that have more energy
        than others: cheap, for bursts of at least `least_db` that are a rarity.
    """

    def __init__(
        self,
        *,
        sample_rate_hz: float,
        low_hz: float,
        high_hz: float,
        least_db: float = 0.0,
        hop_s: float = HOP_S,
        glance: bool = False,
    ) -> None:
        self._rate_hz = sample_rate_hz
        length = max(16, round(WINDOW_S * sample_rate_hz))
        self._hop = max(4, round(hop_s * sample_rate_hz))
        self._size = _fast_length(length)
        self._window = np.hanning(length + 2)[1:-1].astype(np.float32)
        frequencies = np.fft.fftfreq(self._size, 1.0 / sample_rate_hz)
        inside = np.flatnonzero((frequencies >= low_hz) & (frequencies <= high_hz))
        self._bins = inside[np.argsort(frequencies[inside])]
        self._low_hz = float(frequencies[self._bins[0]]) if self._bins.size else 0.0
        self._step_hz = sample_rate_hz / self._size
        batch = min(BATCH_S / hop_s, MOST_CELLS_AT_ONCE / max(self._bins.size, 1))
        self._batch = max(64, round(batch))
        cells_per_s = self._bins.size / hop_s
        # Exponential noise: P(level > x times the mean) = exp(-x); its median is ln 2.
        by_noise = np.log(max(cells_per_s / FALSE_CELLS_PER_S, np.e))
        self._factor = max(by_noise, 10.0 ** (least_db / 10.0)) / np.log(2.0)
        signal = 10.0 ** (least_db / 10.0) / (_HANN * length)
        self._stands_out = 1.0 + _STANDS_OUT * signal if glance else 0.0
        """Of the usual energy of a window."""
        self._usual: NDArray[np.float32] | None = None
        """Usual level of each bin, if it was measured where glances suffice."""
        self._energy = 0.0
        """Usual energy of a window there."""
        self._tail = np.zeros(0, np.complex64)
        self._frames: list[NDArray[np.float32]] = []
        self._count = 0
        self._first_frame = 0
        self._found: list[NDArray[np.float64]] = []

    def process(self, samples: NDArray[np.complex64]) -> None:
        """Take the next samples; missing ones are left out."""
        data = np.concatenate((self._tail, samples))
        length, hop = self._window.size, self._hop
        frames = (data.size - length) // hop + 1 if data.size >= length else 0
        if self._stands_out and frames and self._glance(data, frames):
            self._first_frame += frames
        else:
            # Some 4 MiB of windows at a time.
            step = max(1, (1 << 19) // length)
            for first in range(0, frames, step):
                count = min(step, frames - first)
                windows = sliding_window_view(data[first * hop :], length)[: count * hop : hop]
                self._frames.append(self._power(windows))
                self._count += count
        self._tail = data[frames * hop :].copy()
        if self._count >= self._batch:
            self._search()

    def _power(self, windows: NDArray[np.complex64]) -> NDArray[np.float32]:
        """Power of the bins, shape (windows, bins)."""
        framed = np.zeros((len(windows), self._size), np.complex64)
        np.multiply(windows, self._window, out=framed[:, : self._window.size])
        part = transform_columns(framed.T)[self._bins].T
        return np.asarray(part.real**2 + part.imag**2)

    def _glance(self, data: NDArray[np.complex64], frames: int) -> bool:
        """Look at the windows that stand out, if that suffices here."""
        length, hop = self._window.size, self._hop
        parts = np.ndarray((frames, 2 * length), np.float32, data, 0, (8 * hop, 4))
        energy = np.einsum("ij,ij->i", parts, parts)
        middle = frames // 2
        usual = float(np.partition(energy, middle)[middle])
        before = self._energy
        if self._usual is None or not before / _LEVEL_CHANGE < usual < before * _LEVEL_CHANGE:
            self._usual, self._energy = None, usual
            return False
        up = energy >= self._stands_out * usual
        chosen = up.copy()
        chosen[middle % _QUIET_EVERY :: _QUIET_EVERY] = True
        at = np.flatnonzero(chosen)
        power = self._power(parts[at].view(np.complex64))
        levels = self._usual * np.float32(usual / before)
        if (power[~up[at]] > levels * np.float32(self._factor)).any():
            self._usual, self._energy = None, usual
            return False
        self._judge(power, self._first_frame + at, levels)
        return True

    def finish(self) -> Bursts:
        """Search what is left, and get everything."""
        if self._count:
            self._search()
        rows = np.concatenate(self._found) if self._found else np.zeros((0, 3))
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        # A burst across the edge of two batches has been found in both.
        keep = np.ones(len(rows), dtype=bool)
        for k in range(1, len(rows)):
            before = rows[k - 1]
            close = rows[k, 0] - before[0] < MERGE_S
            if close and abs(rows[k, 1] - before[1]) < 2.5 * self._step_hz:
                keep[k if before[2] >= rows[k, 2] else k - 1] = False
        return Bursts(*rows[keep].T)

    def _search(self) -> None:
        """Search all windows that wait."""
        power = np.concatenate(self._frames)
        self._frames, self._count = [], 0
        first, self._first_frame = self._first_frame, self._first_frame + len(power)
        usual = medians(power)
        # A bin whose level is next to nothing (a filter's stop band, zeros) is never up.
        usual = np.maximum(usual, np.float32(1e-6) * np.median(usual) + np.float32(1e-37))
        self._usual = usual if np.mean(usual) < _MOST_TILT * np.median(usual) else None
        self._judge(power, first + np.arange(len(power)), usual)

    def _judge(
        self, power: NDArray[np.float32], frames: NDArray[np.intp], usual: NDArray[np.float32]
    ) -> None:
        """Find the bursts in some windows: powers (windows, bins), and which they are."""
        up = power > (usual * np.float32(self._factor))
        up[np.count_nonzero(up, axis=1) > WIDE_FRACTION * up.shape[1]] = False
        # Several times as fast as np.nonzero, where next to nothing is up.
        row, column = np.divmod(np.flatnonzero(up), up.shape[1])
        if not row.size:
            return
        level = power[row, column] / usual[column]
        strongest = np.argsort(-level, kind="stable")[:MOST_CELLS]
        at = frames[row]
        kept = self._strongest(at[strongest], column[strongest], level[strongest])
        chosen = strongest[kept]
        between = _peak(power, row[chosen], column[chosen])
        self._found.append(
            np.stack(
                (
                    at[chosen] * self._hop / self._rate_hz
                    + self._window.size / 2 / self._rate_hz,
                    self._low_hz + self._step_hz * (column[chosen] + between),
                    10.0 * np.log10(level[chosen] * np.log(2.0)),
                ),
                axis=1,
            )
        )

    def _strongest(
        self,
        at: NDArray[np.intp],
        column: NDArray[np.intp],
        level: NDArray[np.float32],
    ) -> list[int]:
        """Of cells in falling order of level, those that are not part of a stronger burst."""
        merge = MERGE_S * self._rate_hz / self._hop
        sides = SIDE_HZ / self._step_hz
        weak = 10.0 ** (-SIDE_DB / 10.0)
        kept: list[int] = []
        free = np.ones(at.size, dtype=bool)
        for k in range(at.size):
            if not free[k]:
                continue
            kept.append(k)
            same_time = np.abs(at - at[k]) <= merge
            distance = np.abs(column - column[k])
            own = (distance <= 3) | ((distance <= sides) & (level < weak * level[k]))
            free &= ~(same_time & own)
        return kept


def _fast_length(least: int) -> int:
    """The next length that has no prime factor above 11: quick to transform."""
    length = least
    while True:
        rest = length
        for prime in (2, 3, 5, 7, 11):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return length
        length += 1


def _peak(
    power: NDArray[np.float32], at: NDArray[np.intp], column: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Place of a spectral line between bins, by a parabola through the logarithms [bins]."""
    last = power.shape[1] - 1
    inner = np.clip(column, 1, last - 1)
    below, here, above = (
        np.log(np.maximum(power[at, inner + d].astype(np.float64), 1e-37)) for d in (-1, 0, 1)
    )
    bend = below - 2.0 * here + above
    shift = np.where(bend < 0.0, 0.5 * (below - above) / np.where(bend < 0.0, bend, 1.0), 0.0)
    return np.asarray(np.clip(shift, -0.5, 0.5) * (inner == column), dtype=np.float64)
