"""Detect samples that a radio lost silently, from the arrival times of the others.

A loss makes everything after it late, for good and by one amount. A machine that is held up
makes a few arrivals late, and catches up: what it held comes at once. Jitter makes single ones
late. What follows distinguishes the three::

    late |            : :  :.: : :    a loss: late by one amount, at the pace of the samples
         |        :
         |     :    :                 a stall: then all at once, each less late than the last
         |__:_.__:_._:_:___________

Arrivals are gathered in cells of 20 ms, of which the least late counts. A stretch of cells that
are all late, come at the pace of the samples and lie level, is a loss once it is too long for
the jitter as it has been so far: with exponential jitter of mean u, n cells are all later than
c with probability exp(-n c / u). While losses happen, half of that evidence is enough.

A lateness that rises evenly, faster than by any crystal, means a source slower than real
time: a slow disk, network or computer before the pipe. Nothing is lost then, and arrival times
are not used. Until that is known, only a clear step counts as a loss in a pipe.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

CELL_S: Final = 0.020
"""Shortest stretch of which one lateness is kept [s]; USB transfers are 5 to 65 ms."""
SLOWEST_RATE: Final = 75e-6
"""Largest rate error of crystals; beyond it there are small losses."""
_UNSEEN_S: Final = 0.010
HALVED_S: Final = 0.036
"""Length up to which a loss near a transfer is placed half before it and half after [s]. So no
sample is off by more than half of it."""
_CELLS: Final = 100
"""Number of cells kept: two seconds."""
_WINDOW_S: Final = 1.0
"""Longest stretch that is judged [s], or this many cells where writes are long. rtl_sdr's own
writes are half a second at 250 kS/s."""
_WINDOW_CELLS: Final = 6
_LEAST_CELLS: Final = 3
"""Least number of late cells of a loss; two stalls in a row make fewer."""
_NEWEST: Final = 4
"""Number of newest cells that show the present level."""
_QUIET_S: Final = 1.0
"""Time after a loss in which arrivals may still be late by its remainder [s]."""
_EVIDENCE: Final = 14.0
"""Logarithm of the odds against jitter: 1 in 10⁶ of 40 mostly dependent stretches a second."""
_EVIDENCE_KNOWN: Final = 7.0
"""Logarithm of the odds against jitter within `_KNOWN_S` of a loss."""
_KNOWN_S: Final = 10.0
_FLOOR_S: Final = 0.002
"""Smallest lateness above the jitter that counts as a loss [s]; the crystal drifts by less."""
_LEVEL_S: Final = 0.006
_LEVEL_SLOPE: Final = 0.06
"""Slope above which the lateness is a program falling behind, not a loss."""
_CLIMB_S: Final = 0.35
_LEVEL_AFTER_CLIMB_S: Final = 1.5
_QUESTION_S: Final = 0.008
"""Lateness above which a cell may be the first after a loss [s]."""
_QUESTION_ENDS_S: Final = 0.35
_SHARP: Final = 0.6
"""Share of the lateness that came within `_BEFORE_S`: a step, which no crystal makes."""
_BEFORE_S: Final = 0.5
_SURE_SHARE: Final = 0.0008
"""Share of `_SHARE_S` lost that no crystal explains: none is 800 ppm slow."""
_SHARE_S: Final = 30.0
_EARLY_CELLS: Final = 12
_PACE_BIN_S: Final = 0.25
"""Stretch of which the least delay is kept to measure the source's pace [s]."""
_UNSETTLED_BINS: Final = 2
"""Newest bins left out: a stall there may not have been made up yet."""
_PACE_SPANS: Final = ((5.0, 0.4), (10.0, 0.7))
"""Spans over which the pace is measured [s], and the scatter below which it is even. At 0.9 to
0.995 times real time it is 0.1 to 0.5 and 0.1 to 0.9, also on a loaded computer. Losses of 1 to
15 % of the samples scatter by at least 0.54 and 0.93, those of 5 ms by twice that."""
_UNEVEN: Final = 3.0
"""Scatter over its limit from which the delays rise by steps."""
_SLOW_RATE: Final = 0.003
"""Least rise of the delay of a slow source, as a share of the time."""
_SCATTER_S: Final = 0.0005
_SCATTER_SHARE: Final = 0.002
"""Unit of the scatter: seconds plus a share of the rise."""
_STEP: Final = 2.0
"""Least height of a step over the rise of the delays before and after it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """A stretch of lost samples."""

    duration_s: float
    since_s: float
    """Start of the late arrivals [nominal seconds]."""
    sharp: bool
    """Whether it came within half a second: a step, not a drift."""
    inside_s: float
    """Length of the first late arrival if the loss must lie within it; 0: before it."""
    sure: bool
    """False for a slow drift that a crystal far off its rate would show as well."""


@dataclass(slots=True)
class _Cell:
    begin_s: float
    end_s: float
    late_s: float
    fresh: bool
    """True if it arrived in real time; False while the sender was sending a backlog."""
    single: bool
    """Whether it arrived at once."""

    @property
    def length_s(self) -> float:
        return self.end_s - self.begin_s


class SourcePace:
    """Judges whether a source is slower than real time, from the delays of its samples."""

    def __init__(self) -> None:
        self._delays: deque[tuple[float, float]] = deque()
        """Place and size of the least delay of each bin [s], not corrected for losses."""
        self.slow = False
        """Whether the delays have risen evenly: the source is slower than real time."""
        self.stepped = self.still = False
        """Whether the delays have risen by steps; or do not rise now."""

    def measure(self, received_s: float, arrived_s: float) -> None:
        """Take a delay; judge whenever a bin is full.

        `received_s`: seconds of samples that have arrived.
        """
        delay_s, delays = arrived_s - received_s, self._delays
        if delays and int(received_s / _PACE_BIN_S) == int(delays[-1][0] / _PACE_BIN_S):
            if delay_s < delays[-1][1]:
                delays[-1] = (received_s, delay_s)
            return
        for span_s, limit in _PACE_SPANS:
            if not delays or received_s - delays[0][0] < span_s:
                break
            rise, scatter = self._line(received_s - span_s)
            self.still = rise < _SLOW_RATE
            self.stepped = self.stepped or scatter >= _UNEVEN * limit
            self.slow = self.slow or (not self.still and scatter <= limit)
        if delays and delays[0][0] < received_s - _PACE_SPANS[-1][0] - _PACE_BIN_S:
            delays.popleft()
        delays.append((received_s, delay_s))

    def _line(self, begin_s: float) -> tuple[float, float]:
        """Rise of the delays for each second, and their scatter about a line, relative.

        A delay that is made up later is a stall. Of the rest, the line takes the earliest 70 %.
        """
        settled = [point for point in self._delays if point[0] >= begin_s]
        at_s, delay_s = np.array(settled).T
        delay_s = np.minimum.accumulate(delay_s[::-1])[::-1][:-_UNSETTLED_BINS]
        at_s = at_s[:-_UNSETTLED_BINS] - begin_s
        if len(at_s) < _LEAST_CELLS or delay_s[-1] - delay_s[0] < 0.5 * _SLOW_RATE * at_s[-1]:
            return 0.0, 0.0
        taken = np.ones(len(at_s), bool)
        for _ in range(3):
            x, y = at_s[taken], delay_s[taken]
            rise = float((x - x.mean()) @ y / ((x - x.mean()) @ (x - x.mean())))
            rest_s = delay_s - y.mean() - rise * (at_s - x.mean())
            scatter_s = float(rest_s[taken].std())
            taken = rest_s <= np.quantile(rest_s, 0.7)
        return rise, scatter_s / (_SCATTER_S + _SCATTER_SHARE * rise * float(at_s[-1]))


class LossFinder:
    """Judges the lateness of arrivals; pure.

    Lateness is measured from the lower envelope of all arrivals, in seconds of the nominal
    rate. The caller adds losses found to the nominal seconds of what follows.

    `may_be_slow`: the writer may be slower than real time; a radio never is.
    """

    def __init__(self, *, may_be_slow: bool = False) -> None:
        self.pace = SourcePace() if may_be_slow else None
        """Pace of a source that may be slower than real time."""
        self.jitter_s = 0.005
        """Mean lateness of the cells from jitter [s]."""
        self.question_s: float | None = None
        """Nominal seconds at which arrivals began to be so late that there may be a loss."""
        self._falls = 0
        self._usual_s = 0.001
        """Usual least lateness of four cells [s]; the envelope is that of many more."""
        self._cells: deque[_Cell] = deque(maxlen=_CELLS)
        self._from: tuple[float, float] | None = None
        self._lowest_s = math.inf
        self._newest_at_s = 0.0
        self._late_from_s: float | None = None
        """Start of the present late arrivals [nominal seconds]; None if not late."""
        self._known_until_s = -math.inf
        self._loss_at_s = -math.inf
        self._slow: deque[tuple[float, float]] = deque()
        self._found_s = 0.0
        self._began_s: float | None = None

    def expect(self, at_s: float) -> None:
        """Note the radio's own report that it is losing samples."""
        self._known_until_s = at_s + _KNOWN_S

    def put(self, at_s: float, arrived_s: float, late_s: float) -> Loss | None:
        """Add an arrival; get the loss that it proves.

        `at_s`: nominal seconds up to which the samples are here, lost ones counted.
        `arrived_s`: when that was, on a clock [s]. `late_s`: lateness.
        """
        since_s, self._newest_at_s = self._newest_at_s, at_s
        if self._from is None:
            self._from = (at_s, arrived_s)
            self._began_s = at_s
            return None
        if not self._is_late(late_s):
            self._late_from_s = None
        elif self._late_from_s is None:
            self._late_from_s = since_s
        if self.pace is not None:
            self.pace.measure(at_s - self._found_s, arrived_s)
        single = self._lowest_s == math.inf
        self._lowest_s = min(self._lowest_s, late_s)
        begin_s, before_s = self._from
        if at_s - begin_s < CELL_S:
            return None
        cell = _Cell(
            begin_s=begin_s,
            end_s=at_s,
            late_s=self._lowest_s,
            fresh=arrived_s - before_s >= 0.5 * (at_s - begin_s),
            single=single,
        )
        self._learn_jitter(cell)
        self._cells.append(cell)
        self._from = (at_s, arrived_s)
        self._lowest_s = math.inf
        self._ask(cell)
        self._learn_usual()
        loss = self._judge()
        if loss is None or not self._is_credible(loss):
            return None
        self._take(loss)
        return loss

    def early_s(self) -> float:
        """Time by which two arrivals in a second were earlier than the envelope [s]; or 0."""
        if len(self._cells) < 2:
            return 0.0
        newest = [
            self._cells[-1 - at].late_s for at in range(min(_EARLY_CELLS, len(self._cells)))
        ]
        second_s = sorted(newest)[1]
        if second_s > -max(_FLOOR_S, 1.5 * self.jitter_s):
            return 0.0
        return second_s

    def shift(self, seconds: float) -> None:
        """Note that the envelope has moved, so that lateness falls by this."""
        for cell in self._cells:
            cell.late_s -= seconds

    def skip(self, seconds: float) -> None:
        """Note that nominal seconds have been left out."""
        if self._from is not None:
            self._from = (self._from[0] + seconds, self._from[1])
        self._newest_at_s += seconds
        if self._late_from_s is not None:
            self._late_from_s += seconds
        if self.question_s is not None:
            self.question_s += seconds

    def _is_credible(self, loss: Loss) -> bool:
        """Whether the source has lost samples, and is not just slow: the delay made a step."""
        pace = self.pace
        if pace is None or pace.slow or pace.stepped or (pace.still and not loss.sharp):
            return pace is None or not pace.slow
        late_s = [cell.late_s for cell in self._cells]
        count = sum(cell.begin_s >= loss.since_s for cell in self._cells)
        after_s, before_s = late_s[-count:], late_s[-2 * count : -count]
        half = count // 2
        rises_s = sum(
            max(min(part[-half:]) - min(part[:half]), 0.0)
            for part in (before_s, after_s)
            if part
        )
        return min(after_s) - min(before_s, default=0.0) >= _STEP * rises_s

    def _learn_jitter(self, cell: _Cell) -> None:
        """Track the mean fall from cell to cell: losses make none, jitter its mean."""
        if not cell.fresh or not self._cells or not self._cells[-1].fresh:
            return
        if self.question_s is not None:
            return  # what falls now may be a program that catches up
        fall_s = self._cells[-1].late_s - cell.late_s
        if fall_s <= 0.0:
            return
        self._falls += 1
        gain = max(0.03, 1.0 / (self._falls + 8))
        self.jitter_s += gain * (min(fall_s, 3.0 * self.jitter_s + 0.001) - self.jitter_s)
        self.jitter_s = min(max(self.jitter_s, 0.0003), 0.010)

    def _newest_s(self, count: int) -> float:
        return min(self._cells[at].late_s for at in range(-count, 0))

    def _learn_usual(self) -> None:
        """Track the least lateness of a few cells while nothing is lost."""
        quiet = self._cells[-1].end_s > self._loss_at_s + _QUIET_S
        if quiet and self.question_s is None and len(self._cells) >= _NEWEST:
            self._usual_s += 0.02 * (self._newest_s(_NEWEST) - self._usual_s)
        self._usual_s = min(max(self._usual_s, 0.0), self.jitter_s)

    def _ask(self, cell: _Cell) -> None:
        """Open or close the question whether a loss lies before the late cells."""
        if not self._is_late(cell.late_s):
            self.question_s = None
        elif self.question_s is None:
            self.question_s = cell.begin_s if self._late_from_s is None else self._late_from_s
        elif cell.end_s - self.question_s > _QUESTION_ENDS_S:
            self.question_s = math.inf

    def _is_late(self, late_s: float) -> bool:
        """Whether this lateness may be the first after a loss."""
        return late_s > max(_QUESTION_S, 5.0 * self.jitter_s)

    @property
    def asking(self) -> bool:
        """Whether the next few arrivals will show if there was a loss."""
        return self.question_s is not None and self.question_s < math.inf

    @property
    def may_ask(self) -> bool:
        """Whether the next arrivals of an unfinished cell may open such a question."""
        return self.question_s is None and self._late_from_s is not None

    def _judge(self) -> Loss | None:
        """Judge all stretches of cells up to the newest."""
        cells, jitter_s = self._cells, self.jitter_s
        end_s = cells[-1].end_s
        needed = _EVIDENCE_KNOWN if end_s < self._known_until_s else _EVIDENCE
        window_s = max(_WINDOW_S, _WINDOW_CELLS * (end_s - cells[-1].begin_s))
        least_s = 2.0 * jitter_s
        lowest_s, fresh, best, best_score = math.inf, 0, 0, needed
        for count in range(1, len(cells) + 1):
            cell = cells[-count]
            lowest_s = min(lowest_s, cell.late_s)
            if lowest_s <= least_s + _FLOOR_S or end_s - cell.begin_s > window_s:
                break
            fresh += cell.fresh
            score = (lowest_s - least_s) * fresh / jitter_s
            if fresh < _LEAST_CELLS or score < best_score:
                continue
            known = needed < _EVIDENCE
            span_s = end_s - cell.begin_s
            if (known or span_s >= _least_span_s(lowest_s)) and self._level(count):
                best, best_score = count, score
        if not best or not self._has_turned(best):
            return None
        return self._loss(best)

    def _has_turned(self, count: int) -> bool:
        """Whether the lateness has been level for long enough after a long climb.

        A program that falls behind and catches up is level for a moment, at the top.
        """
        cells = list(self._cells)
        lowest_s = min(cell.late_s for cell in cells[-count:])
        first = len(cells) - count
        while first and cells[first - 1].late_s >= lowest_s:
            first -= 1
        low_s = 2.0 * self.jitter_s + _FLOOR_S
        low = first
        while low and cells[low - 1].late_s > low_s:
            low -= 1
        climb_s = cells[first].begin_s - cells[low].begin_s
        level_s = cells[-1].end_s - cells[first].begin_s
        return climb_s <= _CLIMB_S or level_s >= min(0.5 * climb_s, _LEVEL_AFTER_CLIMB_S)

    def _level(self, count: int) -> bool:
        """Whether the newest cells agree, and neither fall nor climb."""
        cells = [self._cells[at] for at in range(-count, 0)]
        if len(self._agreeing(count)) < _LEAST_CELLS:
            return False
        half = count // 2
        rise_s = min(c.late_s for c in cells[half:]) - min(c.late_s for c in cells[:half])
        span_s = cells[-1].end_s - cells[0].end_s
        fall_s = _FLOOR_S + 2.0 * self.jitter_s
        return -fall_s <= rise_s <= _LEVEL_S + _LEVEL_SLOPE * span_s

    def _agreeing(self, count: int) -> list[_Cell]:
        """The newest cells at the pace of the samples and near the least late one."""
        cells = [self._cells[at] for at in range(-count, 0)]
        near_s = min(c.late_s for c in cells) + _LEVEL_S + 2.0 * self.jitter_s
        near_s += _LEVEL_SLOPE * (cells[-1].end_s - cells[0].end_s)
        return [c for c in cells if c.fresh and c.late_s <= near_s]

    def _loss(self, count: int) -> Loss:
        """Measure the loss that the newest cells show."""
        cells = self._cells
        lowest_s = min(cells[at].late_s for at in range(-count, 0))
        # The present level: more may have been lost since the stretch began.
        newest_s = min(c.late_s for c in self._agreeing(count)[-_NEWEST:])
        first = cells[-count]
        duration_s = newest_s - self._usual_s
        before_s = max(_BEFORE_S, 2.5 * (first.end_s - first.begin_s))
        before = [
            c.late_s
            for c in cells
            if first.begin_s - before_s <= c.begin_s < first.begin_s and c.fresh
        ]
        sharp = (
            bool(before) and lowest_s - sorted(before)[len(before) // 2] >= _SHARP * lowest_s
        )
        return Loss(
            duration_s=duration_s,
            since_s=first.begin_s,
            sharp=sharp,
            inside_s=self._inside_s(first, duration_s) if sharp else 0.0,
            sure=sharp or self._is_much(duration_s),
        )

    def _inside_s(self, first: _Cell, duration_s: float) -> float:
        """Length of the transfer that contains the loss; 0 if whole transfers were dropped.

        Whole ones make the loss a multiple of their length. A loss inside may be anywhere; its
        end is taken, which keeps the samples before the loss at their true time.
        """
        length_s = first.end_s - first.begin_s
        if not first.single or length_s <= 0.0:
            return 0.0
        rest = math.remainder(duration_s, length_s)
        whole = duration_s > HALVED_S and abs(rest) <= max(0.001, 1.5 * self.jitter_s)
        return 0.0 if whole else length_s

    def _is_much(self, duration_s: float) -> bool:
        """True if the samples lost in the last 30 s exceed what a clock-rate error explains."""
        now_s = self._cells[-1].end_s
        while self._slow and self._slow[0][0] < now_s - _SHARE_S:
            self._slow.popleft()
        began_s = self._began_s if self._began_s is not None else now_s
        lost_s = duration_s + sum(lost for _, lost in self._slow)
        return lost_s > _SURE_SHARE * min(_SHARE_S, max(now_s - began_s, 5.0))

    def _take(self, loss: Loss) -> None:
        """Continue after a loss: its cells no longer count as late."""
        now_s = self._cells[-1].end_s
        self._found_s += loss.duration_s
        self._slow.append((now_s, loss.duration_s))
        for cell in self._cells:
            if cell.begin_s >= loss.since_s:
                cell.late_s -= loss.duration_s
        self.question_s = self._late_from_s = None
        self._loss_at_s = now_s
        self.expect(now_s)


def most_lost(unsure: int, *, samples: int, sample_rate_hz: float) -> int:
    """Upper bound of losses beyond those that are sure.

    `unsure`: samples lost unless the crystal is far off its rate. `samples`: length of the
    stream: a small share of it looks like any crystal. `sample_rate_hz`: of the stream; the
    losses since the last gap are not seen yet.
    """
    return unsure + round(SLOWEST_RATE * samples + _UNSEEN_S * sample_rate_hz)


def _least_span_s(lowest_s: float) -> float:
    """Least duration of a first lateness that is a loss; neighbours have similar jitter."""
    return 0.5 * min(max(0.0, (0.015 - lowest_s) / 0.010), 1.0)
