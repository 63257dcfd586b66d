"""Search one band of frequencies: its spectrogram, its noise, and a search for each rate."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.detection.search.anchors import AnchorSearch
from uavrt.detection.search.grid import Grid, Spectrogram
from uavrt.detection.search.group_evidence import gate
from uavrt.detection.search.hypotheses import Candidate, RateSearch, best_first
from uavrt.detection.search.known_pulses import KnownPulses
from uavrt.detection.search.levelling import SLOT, Leveller
from uavrt.detection.search.noise import RowNoise
from uavrt.detection.search.rate_hypotheses import make_searches
from uavrt.detection.search.thresholds import weakest_enr_db, young_margin
from uavrt.detection.search.tuning import THRESHOLDS
from uavrt.detection.signal.sample_buffer import SampleBuffer
from uavrt.detection.track.bounds import Bounds
from uavrt.detection.track.other_signals.other_bursts import Bursts, Known
from uavrt.detection.track.tuning import BAND

NOISE_STRIDE = SLOT
"""Step between columns for the noise estimate [columns]; a pulse covers eight."""


class _LostColumns:
    """Finds the columns affected by lost samples and impulses."""

    def __init__(self, grid: Grid, buffer: SampleBuffer) -> None:
        self._grid, self._buffer = grid, buffer

    @property
    def any(self) -> bool:
        return bool(self._buffer.lost or self._buffer.blanked)

    def _weights(self, begin: int, count: int) -> NDArray[np.float64] | None:
        first = np.arange(begin, begin + count) * self._grid.hop
        return self._buffer.weights(first, self._grid.window)

    def weigh(self, power: NDArray[np.float32], begin: int) -> None:
        """Scale columns with lost samples, in place, to the noise of complete columns."""
        weights = self._weights(begin, len(power)) if self._buffer.lost else None
        if weights is not None:
            power *= weights.astype(np.float32)[:, np.newaxis]

    def whole(self, begin: int, count: int) -> NDArray[np.bool_]:
        """True for columns from `begin` on that have enough samples to show the noise."""
        weights = self._weights(begin, count)
        received = np.ones(count, np.bool_) if weights is None else weights > 0.0
        # A window with 7 ms removed has a third less noise: five such in a second gave 3 % too
        # little noise, and 2.5 times the false groups.
        clean = self._without(self._buffer.lost, begin, count)
        clean &= self._without(self._buffer.blanked, begin, count)
        return clean if clean.sum() > BAND.least_clean * received.sum() else received

    def _without(
        self, stretches: list[tuple[int, int]], begin: int, count: int
    ) -> NDArray[np.bool_]:
        """(count,) True for spectrogram columns with no sample of the given stretches."""
        grid = self._grid
        whole = np.ones(count, np.bool_)
        for low, high in reversed(stretches):
            end = (high + grid.reach) // grid.hop + 1 - begin
            if end <= 0:
                break  # stretches are in order of time
            whole[max(0, (low - grid.window - grid.reach) // grid.hop - begin) : end] = False
        return whole


class SearchBand:
    """Searches one band of frequencies in a stream, in pieces of at most `batch_s`."""

    def __init__(
        self, *, grid: Grid, buffer: SampleBuffer, bounds: Bounds, batch_s: float
    ) -> None:
        tag, half_width_hz = bounds.tag, bounds.half_width_hz
        self._grid = grid
        self._buffer = buffer
        self._batch = round(batch_s * grid.sample_rate_hz)
        self._lost = _LostColumns(grid, buffer)
        self._spectrogram = Spectrogram(grid)
        self._noise = RowNoise(
            column_s=grid.hop_s * NOISE_STRIDE,
            independent_per_s=1.0 / tag.pulse_width_s,
            circular=half_width_hz >= grid.sample_rate_hz / 2.0,
        )
        self._searches = make_searches(tag, grid, half_width_hz)
        self._gate = gate(tag)
        for search in self._searches:
            search.own_margin = self._gate
        steady = self._searches[0]
        self.leveller = Leveller(
            rows=grid.rows,
            keep=max(search.span for search in self._searches)
            + math.ceil(BAND.kept_s / grid.hop_s),
            steepness=steady.threshold / steady.k,
            circular=half_width_hz >= grid.sample_rate_hz / 2.0,
        )
        """Tracks the noise level of the search, relative to the row noise in `noise`."""
        self.anchor_searches = [s for s in self._searches if isinstance(s, AnchorSearch)]
        self._bursts = Bursts(grid, tag.pulse_width_s)
        # The cells of all rates are the same.
        self._searches[0].pass_on = self._bursts.add
        self._begun = 0
        self._excluded = bounds.excluded_rows(grid.offsets_hz)
        self._unsure = False
        """True while the noise estimate is uncertain: for ten seconds in a narrow band."""
        self._learnt: list[NDArray[np.float32]] = []
        self._column = 0
        self._received_s = 0.0
        self._first_noise_s = _needed_noise_s(tag, self._searches)

    @property
    def noise(self) -> NDArray[np.float32]:
        """(rows,) noise power of each frequency row while the receiver's noise level is 1."""
        return self._noise.level

    @property
    def noise_now(self) -> NDArray[np.float32]:
        """(rows,) noise power of each row in the newest columns."""
        return self._noise.level * self.leveller.rows_now

    def note_cleaning(self, *, many_lines: bool, whitened: bool) -> None:
        """Set whether many carriers are removed, and whether the noise is whitened."""
        for search in self.anchor_searches:
            if search.null is not None:
                search.null.coloured = many_lines or whitened
        if many_lines != self._noise.ragged:
            self._noise.ragged = many_lines
            self._trust_noise(always=self._noise.ready)

    def advance(
        self, upto: int, *, last: bool
    ) -> list[tuple[RateSearch, list[Candidate]]] | None:
        """Search samples up to an index; return candidates by rate (None: noise unknown)."""
        power = self._columns(self._spectrogram, upto, last=last)
        was_ready = self._noise.ready
        if was_ready and len(power):
            whole = self._lost.whole(self._column, len(power)) if self._lost.any else None
            self.leveller.level(power.T, self.noise, self._column, whole)
            self._noise.only_rises = self.leveller.uneven
        self._take(power, last=last)
        if not self._noise.ready:
            return None
        level = self._noise.level
        results = []
        for search in self._searches:
            found: list[Candidate] = []
            for block in (power,) if was_ready else self._from_the_start(upto, last=last):
                if len(self._excluded):
                    block[:, self._excluded] = 0.0
                found += search.push(block, level)
            if last:
                found += search.finish(level)
            results.append((search, best_first(found)))
        return results

    def suppress(self, pulses: KnownPulses | None) -> None:
        """From the next step on, suppress the candidates that known pulses explain."""
        for search in self._searches:
            search.known = pulses

    def _take(self, power: NDArray[np.float32], *, last: bool) -> None:
        begin, self._column = self._column, self._column + len(power)
        if len(power):
            self._learn(power, begin, last=last)

    def bursts(self, known: Sequence[Known]) -> Bursts:
        """Bursts of other transmitters so far; pulses in `known` are excluded."""
        search = self._searches[0]
        self._bursts.update(
            search.open_anchors(),
            self._noise.level,
            now_column=search.columns,
            begin_column=self._begun,
            known=known,
        )
        return self._bursts

    def score(self) -> float:
        """Highest ratio of a sum to its threshold since the last call, at most 0.999."""
        best = max(search.best for search in self._searches)
        for search in self._searches:
            search.best = 0.0
        return min(best, 0.999)

    def weakest_enr_db(self) -> float:
        """Energy-to-noise ratio at which 90 % of groups reach the present threshold [dB]."""
        search = self._searches[0]
        return weakest_enr_db(search.k, search.threshold * search.margin / self._gate)

    def take_over(self, other: "SearchBand", upto: int) -> None:
        """Begin in the middle of a stream with the noise estimate of a wider band."""
        grid = self._grid
        column = 8 * math.ceil((upto + grid.reach) / grid.hop / 8.0)
        self._column = self._begun = column
        self._spectrogram.consumed = column * grid.hop // grid.decimation
        offsets = other._grid.offsets_hz
        level = np.interp(grid.offsets_hz, offsets, other.noise_now).astype(np.float32)
        self._noise.take_over(other._noise, level)
        self._received_s = other._received_s
        for search in self._searches:
            search.begin_at(column)

    def _columns(
        self, spectrogram: Spectrogram, upto: int, *, last: bool
    ) -> NDArray[np.float32]:
        """Next spectrogram columns up to a sample index; zeros follow after the last sample."""
        first = spectrogram.needed()
        if first >= upto:
            return np.zeros((0, self._grid.rows), np.float32)
        stretch = self._buffer.view(max(0, first), upto)
        begin = spectrogram.begun
        if first < 0 or last:
            ends = np.zeros(self._grid.reach + self._grid.window if last else 0, np.complex64)
            stretch = np.concatenate((np.zeros(max(0, -first), np.complex64), stretch, ends))
        power = spectrogram.push(stretch)
        self._lost.weigh(power, begin)
        return power

    def _from_the_start(self, upto: int, *, last: bool) -> Iterator[NDArray[np.float32]]:
        """Compute all spectrogram columns from stored samples once the noise can be estimated.

        Until then no columns are stored, which saves 0.3 MB.
        """
        grid, at = self._grid, self._buffer.start
        spectrogram = Spectrogram(grid)
        if at:
            column = 8 * math.ceil((at + grid.reach) / grid.hop / 8.0)
            spectrogram.consumed = column * grid.hop // grid.decimation
            yield np.zeros((column, grid.rows), np.float32)
        while at < upto:
            at = min(at + self._batch, upto)
            if at == upto or at > spectrogram.needed() + grid.window:
                yield self._columns(spectrogram, at, last=last and at == upto)

    @property
    def _noise_is_known(self) -> bool:
        return self._noise.ready and self._received_s >= BAND.young_s

    def _learn(self, power: NDArray[np.float32], begin: int, *, last: bool) -> None:
        whole = power
        if self._lost.any:
            whole = power[self._lost.whole(begin, len(power))]
        self._learnt.append(whole[::NOISE_STRIDE].copy())
        known = self._noise_is_known
        self._received_s += len(whole) * self._grid.hop_s
        if known:
            if len(self._learnt) >= BAND.noise_batches:
                self._noise.update(np.concatenate(self._learnt))
                self._learnt.clear()
                self._trust_noise()
            return
        if self._received_s < self._first_noise_s and not last:
            return
        everything = np.concatenate(self._learnt)
        if len(everything) >= 16:
            self._noise.start(everything)
            self._unsure = True
            self._trust_noise()
            if self._received_s >= BAND.young_s:
                self._learnt.clear()

    def _trust_noise(self, *, always: bool = False) -> None:
        """Raise the threshold as long as the noise estimate is less accurate than usual."""
        if not (self._unsure or always):
            return
        error = self._noise.relative_error
        more = BAND.many_lines_margin if self._noise.ragged else 1.0
        for search in self._searches:
            search.own_margin = self._gate * young_margin(search.threshold, error) * more
        self._unsure = error > THRESHOLDS.noise_error


def _needed_noise_s(tag: Tag, searches: list[RateSearch]) -> float:
    """Earliest time at which a group can reach a threshold and the noise is needed [s].

    A cell adds at most the limit to a sum, so several pulses are needed to reach the threshold.
    """
    soonest_s = min(
        (math.ceil(search.threshold / search.limit) - 1)
        * (interval_s - tag.interval_uncertainty_s)
        for search, interval_s in zip(searches, tag.pulse_intervals_s, strict=True)
    )
    return min(max(soonest_s, BAND.least_noise_s), BAND.young_s) - BAND.delay_s
