"""Detect coded tags in the samples of a channel; the result is one record for each burst.

All codes of a channel are searched together (docs/explanation/coded-tags.md).
"""

import bisect
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Pulse, SearchReport, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.detection.coded.burst_reports import BurstReporter, sighting_of
from uavrt.detection.coded.code_evidence import required_evidence
from uavrt.detection.coded.code_folds import Folds, Found
from uavrt.detection.coded.code_judging import (
    AcceptedBursts,
    Burst,
    decide,
    least_pulses,
    measure,
)
from uavrt.detection.coded.code_tracks import Tracks
from uavrt.detection.coded.foreign_bursts import Foreign
from uavrt.detection.coded.identity import MeasuredBurst, Sightings
from uavrt.detection.coded.limits import limit, sum_limit
from uavrt.detection.coded.slot_cells import CLIP, STEP, Cells
from uavrt.detection.coded.sums import FIELDS, CodeBook, find_seeds, make_code_book
from uavrt.detection.coded.tuning import CELLS, IDENTITY, LIMITS
from uavrt.detection.detector_checks import check_searchable
from uavrt.detection.signal.block_order import Intake
from uavrt.detection.signal.sample_buffer import Counters
from uavrt.detection.signal.signal_cleaning import Cleaner


class CodedDetector:
    """Finds the bursts of coded tags in the samples of a channel."""

    def __init__(
        self,
        tags: Sequence[Tag],
        *,
        sample_rate_hz: float,
        center_frequency_hz: float,
        frequency_window_hz: float = 500.0,
        false_per_hour: float = LIMITS.false_per_hour,
    ) -> None:
        self.tags = tuple(tags)
        self.sample_rate_hz = float(sample_rate_hz)
        self.center_frequency_hz = float(center_frequency_hz)
        for tag in self.tags:
            check_searchable(tag, sample_rate_hz, center_frequency_hz, frequency_window_hz)
        window_hz = min(frequency_window_hz, sample_rate_hz / 2.0)
        self._bandwidth_hz = 2.0 * window_hz
        self._false_per_hour = false_per_hour
        self.counters = Counters()
        self._width_s = min(tag.pulse_width_s for tag in self.tags)
        self._cells = self._make_cells(window_hz)
        column_s = self._cells.column_s
        self._books = [
            make_code_book(tuple(t for t in self.tags if len(t.gaps_s) == n), column_s)
            for n in sorted({len(tag.gaps_s) for tag in self.tags})
        ]
        self._place = {
            tag.tag_id: (book, code)
            for book in self._books
            for code, tag in enumerate(book.tags)
        }
        self._span = max(book.span for book in self._books) + 3 * self._cells.pulse
        self._least = {
            book.pulses: {
                n: max(self._limit(tag, n) for tag in book.tags)
                for n in range(least_pulses(book.pulses), book.pulses + 1)
            }
            for book in self._books
        }
        self._intake = Intake(
            replace(
                self.tags[0],
                pulse_width_s=self._width_s,
                pulse_intervals_s=(2.0,),
                interval_uncertainty_s=0.0,
                interval_jitter_s=0.0,
                k=1,
            ),
            sample_rate_hz=self.sample_rate_hz,
            counters=self.counters,
        )
        self._tracks = Tracks(self.tags)
        self._sightings = Sightings()
        self._reporter = BurstReporter(
            self._tracks,
            sample_rate_hz=self.sample_rate_hz,
            center_frequency_hz=self.center_frequency_hz,
            counters=self.counters,
        )
        self._start()

    def _make_cells(self, window_hz: float) -> Cells:
        center_hz, half_hz = self.center_frequency_hz, 0.5 * self.sample_rate_hz
        low_hz = min(tag.frequency_hz for tag in self.tags) - window_hz - center_hz
        high_hz = max(tag.frequency_hz for tag in self.tags) + window_hz - center_hz
        span_s = max(tag.length_s for tag in self.tags)
        most_s = max(2.0 * tag.k * tag.pulse_intervals_s[0] for tag in self.tags)
        self._kept_s = min(CELLS.kept_s, most_s)
        return Cells(
            sample_rate_hz=self.sample_rate_hz,
            pulse_width_s=self._width_s,
            low_hz=max(low_hz, -half_hz),
            high_hz=min(high_hz, half_hz),
            kept_s=self._kept_s + 4.0 * span_s + 2.0,
            recent_s=4.0 * span_s + 2.0,
        )

    def _limit(self, tag: Tag, pulses: int) -> float:
        return sum_limit(
            tag,
            bandwidth_hz=self._bandwidth_hz,
            bursts=1,
            pulses=pulses,
            false_per_hour=self._false_per_hour,
        )

    def _start(self) -> None:
        self._intake.clear()
        self._cells.restart()
        self._cleaner = Cleaner(
            sample_rate_hz=self.sample_rate_hz,
            pulse_width_s=self._width_s,
            counters=self.counters,
        )
        self._clean = 0
        self._searched = 0
        """Spectrogram column up to which single bursts were searched."""
        self._claims: list[Burst] = []
        self._ahead: list[Burst] = []
        """Accepted bursts in the newest samples, to be decided again with later samples."""
        self._accepted = AcceptedBursts(self._cells)
        self._foreign = Foreign(self._cells, self._span, self._accepted.guard)
        self._folds = [
            Folds(
                *(book, self._cells),
                kept_s=self._kept_s,
                bandwidth_hz=self._bandwidth_hz,
                false_per_hour=self._false_per_hour,
            )
            for book in self._books
        ]
        self._stamps: tuple[list[int], list[int]] = ([], [])

    def process(self, samples: NDArray[np.complex64], time_ns: int) -> list[Pulse]:
        """Process a block of samples; return a record for each burst since the last call."""
        samples = np.ascontiguousarray(samples, np.complex64)
        if len(samples):
            after = self._clean + self._cleaner.margin
            outcome = self._intake.admit(samples, time_ns, after=after)
            if outcome in ("later", "earlier"):
                if outcome == "later":
                    self._finish()
                self._start()
                self._intake.admit(samples, time_ns, after=0)
            self._go_on(last=False)
        return self._reporter.drain()

    def flush(self) -> list[Pulse]:
        """End the stream: search the remaining samples, and return their records."""
        self._finish()
        self._start()
        return self._reporter.drain()

    def search_reports(self) -> list[SearchReport]:
        """Return the search reports since the last call."""
        return self._reporter.drain_reports()

    def _finish(self) -> None:
        buffer, cells = self._intake.buffer, self._cells
        if not buffer.empty:
            beyond = 2 * self._span * cells.hop + cells.length + self._cleaner.margin
            buffer.append_hole(beyond)
            self._go_on(last=True)

    def _go_on(self, *, last: bool) -> None:
        buffer = self._intake.buffer
        step = round(CELLS.step_s * self.sample_rate_hz)
        while True:
            end = buffer.end - self._cleaner.margin
            if end - self._clean < (1 if last else step):
                break
            upto = min(end, self._clean + 2 * step)
            if not last and self._intake.may_be_filled(upto):
                break
            self._cleaner.clean(buffer, self._clean, upto, renew=True)
            self._clean = upto
            first = self._cells.end * self._cells.hop
            self._stamps[0].append(first)
            self._stamps[1].append(buffer.time_ns(first))
            self._cells.push(buffer.view(first, upto))
            self._search(last=last and upto == end)
        if self._stamps[0]:
            self._reporter.searched(buffer.time_ns(self._clean), self._cells)

    def _search(self, *, last: bool) -> None:
        whole = self._cells.end - self._span
        if whole <= self._searched:
            return
        for book in self._books:
            self._claims += self._claimed(book, whole)
        self._claims += self._expected(whole)
        self._decide(self._cells.end if last else whole - self._span, last=last)
        seeds_from, seeds_to = self._searched - self._span, whole - self._span
        self._hide(self._searched, self._cells.end if last else whole)
        rate = self._foreign.per_hour
        for folds in self._folds:
            folds.note(max(seeds_from, 0), seeds_to - max(seeds_from, 0))
            for found in folds.complete(whole, foreign_per_hour=rate, last=last):
                self._report_several(found)
        self._searched = whole
        self._accepted.drop_before(whole - 3 * self._span)

    def _claimed(self, book: CodeBook, whole: int) -> list[Burst]:
        limits = self._least[book.pulses]
        clip = min(CLIP, 255 // book.pulses)
        fewest = least_pulses(book.pulses)
        level = min(0.9 * limits[fewest], 0.95 * clip * STEP * fewest)
        seeds = find_seeds(
            *(self._cells, book, self._searched, whole - self._searched),
            clip=clip,
            level=int(level / STEP),
        )
        return measure(self._cells, book, seeds, limits, self._foreign.per_hour)

    def _expected(self, whole: int) -> list[Burst]:
        cells, found = self._cells, []
        upto_ns = self._time_ns(whole)
        self._tracks.drop_silent(upto_ns)
        for track in self._tracks.alive.values():
            book, code = self._place[track.tag.tag_id]
            limits = {n: limit(n, 1.0, LIMITS.expected_false) for n in self._least[book.pulses]}
            for at_ns, error_s in track.expected(upto_ns):
                middle, half = self._column(at_ns), math.ceil(error_s / cells.column_s)
                first = max(round(middle) - half, self._searched)
                last = min(round(middle) + half + 1, whole)
                if first >= last:
                    continue
                seed = _best_seed(cells, book, code, track.row, first, last)
                rate = self._foreign.per_hour
                found += measure(cells, book, seed, limits, rate, prior=LIMITS.expected_log)
        return found

    def _time_ns(self, column: float) -> int:
        index = column * self._cells.hop
        at = max(0, bisect.bisect_right(self._stamps[0], index) - 1)
        ahead_s = (index - self._stamps[0][at]) / self.sample_rate_hz
        return self._stamps[1][at] + ns_from_s(ahead_s)

    def _column(self, time_ns: int) -> float:
        at = max(0, bisect.bisect_right(self._stamps[1], time_ns) - 1)
        ahead_s = (time_ns - self._stamps[1][at]) / NANOSECONDS_PER_SECOND
        return (self._stamps[0][at] + ahead_s * self.sample_rate_hz) / self._cells.hop

    def _report_several(self, found: Found) -> None:
        required = self._required(self._foreign.per_hour)
        if found.unlisted < required - IDENTITY.doubt_log:
            return
        over = found.energies.mean(axis=1) - 1.0
        # There are no bursts before the tag arrived or after it left.
        own = np.flatnonzero(over >= 0.5 * over.mean())
        strong = np.flatnonzero(over >= LIMITS.least_energy)
        for place in strong[(strong >= own[0]) & (strong <= own[-1])].tolist():
            columns, energies = found.columns[place], found.energies[place]
            if columns[0] < 0:
                continue
            starts_ns = [self._time_ns(float(column)) for column in columns]
            self._reporter.burst(
                found.tag,
                MeasuredBurst(
                    start_ns=starts_ns[0],
                    starts_ns=starts_ns,
                    energies=np.maximum(energies - 1.0, 0.05),
                    offset_hz=float(self._cells.offsets_hz[found.row]),
                    noise=float(self._cells.noise[found.row]),
                    row=found.row,
                    score=found.score,
                ),
                confirmed=found.unlisted >= required and not found.also_possible,
                others=found.also_possible,
            )

    def _decide(self, sure: int, *, last: bool) -> None:
        accepted, lost = decide(
            *(self._claims, self._accepted, self._least),
            before=sure,
            foreign_per_hour=self._foreign.per_hour,
        )
        if lost:
            self.counters.reject("collision with other bursts", lost)
        explained = [
            one
            for one in (*self._accepted.bursts, *accepted)
            if one.unlisted + one.prior >= self._required(self._foreign.per_hour)
        ]
        self._foreign.note(explained, sure)
        new = []
        for burst in accepted:
            if burst.column < sure:
                self._accepted.bursts.append(burst)
                required = 0.0
                if not burst.prior:
                    required = self._required(self._foreign.about(burst))
                new.append(
                    sighting_of(
                        *(burst, self._cells),
                        time_ns=self._time_ns,
                        width_s=self._width_s,
                        tags=self._tracks.tags,
                        required=required,
                    )
                )
        now_ns = self._time_ns(sure)
        for sighting, tag, others in self._sightings.identify(new, now_ns, last=last):
            confirmed = sighting.tag_id is not None
            self._reporter.burst(tag, sighting, confirmed=confirmed, others=others)
        self._claims = [one for one in self._claims if one.column >= sure]
        self._ahead = [one for one in accepted if one.column >= sure]

    def _required(self, foreign_per_hour: float) -> float:
        return required_evidence(foreign_per_hour, self._false_per_hour)

    def _hide(self, first: int, upto: int) -> None:
        cells = self._cells
        recent = cells.recent[:, first - cells.recent_from : upto - cells.recent_from]
        tall = recent.max(axis=0, initial=0.0)
        echo = CELLS.echo_widths * cells.pulse
        for level, reach in ((CELLS.tall, cells.pulse), (CELLS.echoing, echo)):
            for column in (np.flatnonzero(tall > level) + first).tolist():
                cells.hide(column - reach, reach + min(reach + 1, upto - column))
        required = self._required(self._foreign.per_hour)
        for burst in (*self._accepted.bursts, *self._ahead):
            if burst.unlisted + burst.prior < required:
                continue
            for column in burst.columns.tolist():
                begin, end = column - self._accepted.guard, column + self._accepted.guard + 1
                if begin < upto:
                    cells.hide(begin, min(end, upto) - begin)


def _best_seed(
    cells: Cells, book: CodeBook, code: int, row: int, first: int, last: int
) -> NDArray[np.int32]:
    low, high = max(0, row - 1), min(len(cells.recent), row + 2)
    at = np.arange(first, last) - cells.recent_from
    columns = at[None, :, None] + book.offsets[code][:, None, :]
    sums = cells.recent[low:high][:, columns].sum(axis=3)
    place, stretch, column = np.unravel_index(int(sums.argmax()), sums.shape)
    seed = np.zeros((1, FIELDS), np.int32)
    seed[0] = code, low + int(place), int(stretch), first + int(column), 0
    return seed
