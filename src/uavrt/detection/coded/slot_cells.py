"""Compute the pulse energy at every instant and frequency of a channel, relative to the noise.

The matched filter of a rectangular pulse is a sum over its samples, computed at several
frequencies. All codes use its output. Past cells are stored in one byte each.
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.coded.tuning import CELLS

STEP = 0.25
"""Resolution of the cells' energies when stored as bytes [noise energies]."""
CLIP = 63
"""Maximum energy of a cell stored as a byte [`STEP`]; the sum of four fits a byte."""
NEUTRAL = round(1.0 / STEP)
"""Stored value of a spectrogram cell with the mean energy of noise [`STEP`]."""
UNIT = 16.0
"""Amplitude of the noise in samples that are stored as integers in a range of ±127."""


class Cells:
    """Computes and stores the energy cells of one channel."""

    def __init__(
        self,
        *,
        sample_rate_hz: float,
        pulse_width_s: float,
        low_hz: float,
        high_hz: float,
        kept_s: float,
        recent_s: float,
    ) -> None:
        self.length = max(2, round(pulse_width_s * sample_rate_hz))
        """Number of samples in a pulse of the channel's tags."""
        self.sample_rate_hz = sample_rate_hz
        self.hop = max(1, int(pulse_width_s * sample_rate_hz / CELLS.columns_per_pulse))
        """Number of samples from one spectrogram column to the next."""
        self.column_s = self.hop / sample_rate_hz
        self.pulse = max(1, round(pulse_width_s / self.column_s))
        """Number of spectrogram columns in a pulse."""
        spacing_hz = CELLS.row_spacing / pulse_width_s
        rows = max(1, math.ceil((high_hz - low_hz) / spacing_hz)) + 1
        self.offsets_hz = np.linspace(low_hz, high_hz, rows)
        self.rows_of_a_bin = min(rows - 1, math.ceil(1.0 / CELLS.row_spacing))
        """Number of rows on each side of a pulse's frequency that show it: within 1/width."""
        self._turns = -2j * np.pi * self.offsets_hz[:, None] / sample_rate_hz
        self._kept = math.ceil(kept_s / self.column_s)
        self._recent = math.ceil(recent_s / self.column_s)
        self.restart()

    def restart(self) -> None:
        """Delete all stored cells; columns are counted from zero again."""
        rows = len(self.offsets_hz)
        self.base = 0
        """Number of the first stored spectrogram column, counted from the stream's start."""
        self.end = 0
        """Number of the spectrogram column after the newest one."""
        self.kept = np.full((rows, self._kept + self._kept // 4 + 4096), NEUTRAL, np.uint8)
        self.past = np.zeros((self.kept.shape[1] * self.hop, 2), np.int8)
        """Stored samples from column `base` on, real and imaginary; the noise has amplitude
        `UNIT`."""
        self.recent = np.zeros((rows, 0), np.float32)
        """(rows, columns) newest spectrogram cells, up to column `end` [noise energies]."""
        self._medians: list[NDArray[np.float64]] = []
        self.noise = np.ones(rows)
        """(rows,) mean noise energy of a cell, for each frequency row."""
        self.shape = np.ones(rows)
        """(rows,) noise of each row over the median of all rows, averaged over ten seconds."""

    @property
    def recent_from(self) -> int:
        """First column stored in full precision."""
        return self.end - self.recent.shape[1]

    def push(self, samples: NDArray[np.complex64]) -> int:
        """Add samples and compute the complete columns; return their number."""
        count = (len(samples) - self.length) // self.hop + 1
        if count <= 0:
            return 0
        used = samples[: (count - 1) * self.hop + self.length]
        turned = used[None] * np.exp(self._turns * np.arange(len(used)))
        total = np.zeros((len(turned), len(used) + 1), np.complex128)
        np.cumsum(turned, axis=1, out=total[:, 1:])
        sums = (total[:, self.length :] - total[:, : -self.length])[:, :: self.hop]
        energy = (sums.real**2 + sums.imag**2) / self.length
        self._level(energy)
        cells = (energy / self.noise[:, None]).astype(np.float32)
        self.recent = np.concatenate((self.recent, cells), axis=1)[:, -self._recent :]
        self._keep(cells, samples[: count * self.hop])
        self.end += count
        return count

    def _level(self, energy: NDArray[np.float64]) -> None:
        received = energy[:, energy.max(axis=0) > 0.0]
        if received.shape[1] < 4 * self.pulse:
            return
        now = np.median(received, axis=1) / math.log(2.0)
        self._medians = [*self._medians, now][-CELLS.noise_pieces :]
        usual = np.median(self._medians, axis=0)
        self.shape = usual / max(float(np.median(usual)), 1e-30)
        self.noise = np.maximum(np.maximum(usual, CELLS.least_rise * now), 1e-30)

    def _keep(self, cells: NDArray[np.float32], samples: NDArray[np.complex64]) -> None:
        over = cells.shape[1] - self.kept.shape[1]
        if over > 0:
            self.base, cells = self.end + over, cells[:, over:]
            samples = samples[over * self.hop :]
        used, count = max(0, self.end - self.base), cells.shape[1]
        if used + count > self.kept.shape[1]:
            stay = min(used, self._kept)
            if stay + count > self.kept.shape[1]:
                stay = max(0, self.kept.shape[1] - count)
            self.kept[:, :stay] = self.kept[:, used - stay : used].copy()
            first, behind = (used - stay) * self.hop, used * self.hop
            self.past[: stay * self.hop] = self.past[first:behind].copy()
            self.kept[:, stay:] = NEUTRAL
            self.base, used = self.end - stay, stay
        bytes_ = np.minimum(np.rint(cells / STEP), CLIP).astype(np.uint8)
        self.kept[:, used : used + count] = bytes_
        unit = UNIT / math.sqrt(float(np.median(self.noise)))
        pairs = samples.view(np.float32).reshape(-1, 2) * unit
        first = used * self.hop
        np.clip(np.rint(pairs), -127.0, 127.0, out=pairs)
        self.past[first : first + len(pairs)] = pairs

    def hide(self, column: int, columns: int) -> None:
        """Replace the stored cells of some columns by noise, in all rows."""
        first = max(0, column - self.base)
        self.kept[:, first : max(first, column + columns - self.base)] = NEUTRAL
