"""Find strong pulses at any frequency in a band, without a list of tags.

A cell of the spectrogram counts as a pulse (point) if its power exceeds three reference levels.
The level at this frequency at other times excludes carriers. The level at other frequencies at
this time excludes impulses and voice. The level 0.6 to 1.1 kHz away excludes the wide spectrum
at the edges of a strong pulse.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.beeps.band_spectrogram import BandSpectrogram
from uavrt.detection.beeps.tuning import POINTS
from uavrt.dsp.sliding_medians import medians


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Detected pulses of any sender, in order of time."""

    times_s: NDArray[np.float64]
    """(n,) time of each pulse's middle, relative to the first sample [s], within about 2 ms."""
    frequencies_hz: NDArray[np.float64]
    """(n,) frequencies of the pulses from the band's centre [Hz], within about 10 Hz."""
    widths_s: NDArray[np.float64]
    """(n,) lengths of the pulses [s], within about 5 ms; 0 if much shorter than the window."""
    levels_db: NDArray[np.float64]
    """(n,) power of the pulses over the noise in a bandwidth of 94 Hz [dB]."""
    middles_hz: NDArray[np.float64] | None = None
    """(n,) mean frequencies of the pulses' energy from the band's centre [Hz]; less accurate
    than `frequencies_hz`, but also valid if the frequency changes within a pulse."""

    def __len__(self) -> int:
        return self.times_s.size

    def take(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> "Points":
        """Select pulses by a mask or by indices, as a new record."""
        return Points(
            self.times_s[chosen],
            self.frequencies_hz[chosen],
            self.widths_s[chosen],
            self.levels_db[chosen],
            None if self.middles_hz is None else self.middles_hz[chosen],
        )

    def moved(self, times_s: NDArray[np.float64], center_hz: float = 0.0) -> "Points":
        """Copy with new times, and `center_hz` added to frequencies; sorted by time."""
        order = np.argsort(times_s, kind="stable")
        middles_hz = None if self.middles_hz is None else self.middles_hz + center_hz
        frequencies_hz = self.frequencies_hz + center_hz
        moved = Points(times_s, frequencies_hz, self.widths_s, self.levels_db, middles_hz)
        return moved.take(order)


NO_POINTS: Final = Points(*np.zeros((5, 0)))


@dataclass(frozen=True, slots=True, eq=False)
class _Levels:
    """Levels of spectrogram cells: power relative to the usual power at their frequency.

    Levels are computed only when they are read.
    """

    power: NDArray[np.float32]
    """(frames, bins) power of the spectrogram, not yet divided by each bin's usual power."""
    scale: NDArray[np.float32]
    """(bins,) inverse of the usual power in each frequency bin."""

    def around(
        self, row: NDArray[np.intp], column: NDArray[np.intp], rows: range, columns: range
    ) -> NDArray[np.float32]:
        """Levels around each cell, shape (cells, rows, columns); zero beyond the edges."""
        frames, bins = self.power.shape
        at = row[:, None, None] + np.array(rows)[:, None]
        bins_at = column[:, None, None] + np.array(columns)
        inside = (at >= 0) & (at < frames) & (bins_at >= 0) & (bins_at < bins)
        at, bins_at = np.clip(at, 0, frames - 1), np.clip(bins_at, 0, bins - 1)
        return np.where(inside, self.power[at, bins_at] * self.scale[bins_at], np.float32(0.0))


class PointSearch:
    """Finds pulses in a stream of samples.

    `most_cells`: largest number of cells of the spectrogram that are searched at once.
    """

    def __init__(
        self,
        *,
        sample_rate_hz: float,
        low_hz: float,
        high_hz: float,
        most_cells: int = POINTS.most_cells,
    ) -> None:
        self._rate_hz = sample_rate_hz
        self._spectrogram = BandSpectrogram(
            sample_rate_hz=sample_rate_hz, low_hz=low_hz, high_hz=high_hz
        )
        bins = self._spectrogram.bins
        frames = min(POINTS.batch_s / POINTS.hop_s, most_cells / bins)
        self._held = 2 * POINTS.around_frames
        """Number of spectrogram frames repeated from the previous batch at a batch's start."""
        self._power = np.zeros((max(4 * POINTS.around_frames, round(frames)), bins), np.float32)
        self._filled = 0
        self._first_frame = 0
        self._from = 0
        """First spectrogram frame of the batch that is not yet searched for pulses."""
        cells_per_s = bins / POINTS.hop_s
        # The power of noise is exponential: P(x times its median) = 2^-x.
        false_per_s = POINTS.false_per_s * max(
            1.0, bins * self._spectrogram.step_hz / POINTS.false_band_hz
        )
        self._factor = np.log2(max(cells_per_s / false_per_s, 16.0))
        self._samples = np.zeros(0, np.complex64)
        """Samples of the next spectrogram frames; the buffer grows to the largest block."""
        self._held_samples = 0
        self._found: list[NDArray[np.float64]] = []
        self.dropped = 0
        """Number of strong spectrogram cells not examined, because too many came at once."""

    def process(self, samples: NDArray[np.complex64]) -> None:
        """Process the next samples of the stream; none may be missing in between."""
        held = self._held_samples
        self._held_samples = held + samples.size
        if self._held_samples > self._samples.size:
            self._samples = np.resize(self._samples, self._held_samples)
        self._samples[held : self._held_samples] = samples
        self._take_frames(POINTS.least_frames)

    def _take_frames(self, least: int) -> None:
        data, hop = self._samples[: self._held_samples], self._spectrogram.hop
        frames = max(0, data.size - self._spectrogram.length + hop) // hop
        if frames < least:
            return
        done = 0
        while done < frames:
            count = min(frames - done, len(self._power) - self._filled)
            target = self._power[self._filled : self._filled + count]
            self._spectrogram.powers(data[done * hop :], target)
            self._filled += count
            done += count
            if self._filled == len(self._power):
                self._search(len(self._power) - POINTS.around_frames)
        rest = data[frames * hop :].copy()
        self._samples[: rest.size] = rest
        self._held_samples = rest.size

    def finish(self) -> Points:
        """Search the remaining samples and return all detected pulses."""
        self._take_frames(1)
        if self._filled > self._from:
            self._search(self._filled)
        return self.found()

    def found(self, since_s: float = 0.0) -> Points:
        """Return the pulses found since time `since_s` [s]; older pulses are deleted."""
        rows = np.concatenate(self._found) if self._found else np.zeros((0, 5))
        rows = rows[rows[:, 0] >= since_s]
        self._found = [rows]
        return _without_edges(Points(*rows[np.argsort(rows[:, 0], kind="stable")].T))

    def _search(self, until: int) -> None:
        power = self._power[: self._filled]
        usual = medians(power[::2])
        # A frequency with a level near zero (a filter's stop band) never stands out.
        usual = np.maximum(usual, np.float32(1e-6) * np.median(usual) + np.float32(1e-37))
        levels = _Levels(power, 1.0 / usual)
        row, column, over = self._candidates(levels, self._from, until)
        if row.size:
            self._found.append(self._points(levels, row, column, over))
        held = power[-self._held :].copy()
        self._first_frame += self._filled - len(held)
        self._from = until - (self._filled - len(held))
        self._power[: len(held)] = held
        self._filled = len(held)

    def _candidates(
        self, levels: "_Levels", first: int, until: int
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32]]:
        """Frame, bin and relative level of each cell that may be a pulse.

        The level is the ratio to the median of the adjacent frequencies at the same time, where
        that exceeds the usual level.
        """
        bins = levels.power.shape[1]
        segments = max(1, bins // POINTS.segment_bins)
        places = []
        for segment in range(0, segments, 256):  # 16384 bins at a time, which fit the cache
            count = min(256, segments - segment)
            low = segment * POINTS.segment_bins
            high = bins if segment + count == segments else low + count * POINTS.segment_bins
            scale = levels.scale[low:high]
            part = levels.power[first:until, low:high]
            above = np.flatnonzero(part > np.float32(self._factor) / scale)
            row, column = np.divmod(above, high - low)
            # Few segments have such cells; the common rise of the others is not needed.
            own = row * count + np.minimum(column // POINTS.segment_bins, count - 1)
            asked, place = np.unique(own, return_inverse=True)
            if segments == 1:
                rise = np.median(part[asked] * scale, axis=1)
            else:
                size, middle = POINTS.segment_bins, POINTS.segment_bins // 2
                at, segment_at = np.divmod(asked, count)
                whole = part[:, : count * size].reshape(len(part), count, size)
                scales = scale[: count * size].reshape(count, size)
                rise = np.partition(whole[at, segment_at] * scales[segment_at], middle)
                rise = rise[:, middle]
            over = part[row, column] * scale[column]
            over /= np.maximum(rise, np.float32(1.0))[place]
            up = over > self._factor
            places.append((row[up] + first, column[up] + low, over[up]))
        row, column, over = (np.concatenate(one) for one in zip(*places, strict=True))
        if row.size > POINTS.most_candidates:
            self.dropped += row.size - POINTS.most_candidates
            most = np.argpartition(-over, POINTS.most_candidates)[: POINTS.most_candidates]
            row, column, over = row[most], column[most], over[most]
        return row, column, over

    def _points(
        self,
        levels: "_Levels",
        row: NDArray[np.intp],
        column: NDArray[np.intp],
        over: NDArray[np.float32],
    ) -> NDArray[np.float64]:
        def around(rows: range, columns: range) -> NDArray[np.float32]:
            return levels.around(row, column, rows, columns)

        own = levels.power[row, column] * levels.scale[column]
        keep = own >= around(range(-2, 3), range(-4, 5)).max(axis=(1, 2))
        row, column, over, own = row[keep], column[keep], over[keep], own[keep]
        low, high = POINTS.flank_bins
        sides = np.concatenate(
            [around(range(1), range(-high, 1 - low)), around(range(1), range(low, high + 1))],
            axis=2,
        )[:, 0]
        flanks = sides.sum(axis=1) / np.maximum((sides > 0.0).sum(axis=1), 1)
        keep = own >= POINTS.flank_ratio * flanks
        row, column, over, own = row[keep], column[keep], over[keep], own[keep]
        offsets = range(-POINTS.around_frames, POINTS.around_frames + 1)
        near = around(offsets, range(-1, 2)).max(axis=2)
        up = near > 0.25 * own[:, None]
        before, after = (
            np.where(side.all(axis=1), POINTS.around_frames + 1, np.argmin(side, axis=1))
            for side in (up[:, POINTS.around_frames :: -1], up[:, POINTS.around_frames :])
        )
        offset = np.array(offsets)
        during = (offset > -before[:, None]) & (offset < after[:, None])
        weight = np.where(during, near, np.float32(0.0))
        # One point for each pulse, where it is strongest.
        keep = ((before + after) * POINTS.hop_s <= POINTS.longest_s) & (
            weight.max(axis=1) <= own
        )
        row, column, over = row[keep], column[keep], over[keep]
        weight, own = weight[keep], own[keep]
        total = weight.sum(axis=1, dtype=np.float64)
        middle = (weight * offset).sum(axis=1) / total
        width_s = total / own * POINTS.hop_s - 0.375 * POINTS.window_s
        frame, place = self._first_frame + row + middle, column + _peak(levels, row, column)
        spectrogram = self._spectrogram
        bins = range(-POINTS.middle_bins, POINTS.middle_bins + 1)
        energy = levels.around(row, column, range(-2, 3), bins).sum(axis=1)
        mean = column + energy @ np.array(bins) / energy.sum(axis=1)
        return np.stack(
            (
                (frame * spectrogram.hop + 0.5 * spectrogram.length) / self._rate_hz,
                spectrogram.low_hz + spectrogram.step_hz * place,
                np.maximum(width_s, 0.0),
                10.0 * np.log10(over * np.log(2.0)),
                spectrogram.low_hz + spectrogram.step_hz * mean,
            ),
            axis=1,
        )


def _without_edges(points: Points) -> Points:
    """Remove detections that are only the edges of a strong pulse.

    At a frequency df away, edges have at most 1 / (pi df T)^2 of the pulse's power in a window
    of T; twice that amplitude is allowed.
    """
    keep = np.ones(len(points), dtype=bool)
    for at in np.flatnonzero(points.levels_db >= POINTS.strong_db):
        time_s, level_db = points.times_s[at], points.levels_db[at]
        low, high = np.searchsorted(
            points.times_s, (time_s - POINTS.edge_s, time_s + POINTS.edge_s)
        )
        near = slice(int(low), int(high))
        apart_hz = np.abs(points.frequencies_hz[near] - points.frequencies_hz[at])
        apart = np.maximum(np.pi * apart_hz * POINTS.window_s, 1.0)
        weak = points.levels_db[near] <= level_db + 6.0 - 20.0 * np.log10(apart)
        keep[near] &= ~(weak & (points.levels_db[near] < level_db - 6.0))
    return points.take(keep)


def _peak(
    levels: _Levels, at: NDArray[np.intp], column: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Position of a spectral line's peak [bins], by a parabola through log powers."""
    inner = np.clip(column, 1, levels.power.shape[1] - 2)
    near = levels.around(at, inner, range(1), range(-1, 2))[:, 0].astype(np.float64)
    below, here, above = np.log(np.maximum(near, 1e-37)).T
    bend = below - 2.0 * here + above
    shift = np.where(bend < 0.0, 0.5 * (below - above) / np.where(bend < 0.0, bend, 1.0), 0.0)
    return np.asarray(np.clip(shift, -0.5, 0.5) * (inner == column), dtype=np.float64)
