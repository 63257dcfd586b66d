"""Detect silently lost samples from the arrival times of the other samples.

A loss makes all later samples late, permanently and by one amount. A computer that is briefly
busy makes a few arrivals late (a stall); then the buffered samples arrive at once. Jitter
delays single arrivals. The pattern of later arrivals distinguishes these three causes::

    late |            : :  :.: : :    a loss: late by one amount, at the pace of the samples
         |        :
         |     :    :                 a stall: then all at once, each less late than the last
         |__:_.__:_._:_:___________

Arrivals are grouped in periods of 20 ms (cells), each with its smallest lateness. Consecutive
cells that are equally late count as a loss if the present jitter is unlikely to cause as many.
With exponential jitter of mean u, n cells are all later than c with the probability
exp(-n c / u). For 10 s after a loss, half of the evidence shows a further loss.

A lateness that rises evenly, faster than any clock error, shows that the source is slower than
real time: a slow disk, network or computer before the pipe. Then nothing is lost, and arrival
times are not used. Until this is certain, only a clear step counts as a loss in a pipe.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

CELL_S: Final = 0.020
"""Minimum length of a cell [s]: a period for which the smallest lateness of arrivals is stored.
USB transfers last 5 to 65 ms."""
SLOWEST_RATE: Final = 75e-6
"""Greatest relative amount by which the clock of a radio may be slow; arrivals that become
later more quickly than this show lost samples."""
_UNSEEN_S: Final = 0.010
HALVED_S: Final = 0.036
"""Longest loss at the edge of a transfer that is placed half before and half after the edge
[s], so that no sample's time is wrong by more than half of the loss."""
_CELLS: Final = 100
"""Number of stored cells (periods of 20 ms, each with its smallest lateness of arrivals): two
seconds."""
_WINDOW_S: Final = 1.0
"""Longest period of late arrivals that is examined for a loss [s]. The period is extended to
`_WINDOW_CELLS` cells if the radio's program writes long blocks at once; by default rtl_sdr
writes half a second at 250 kS/s."""
_WINDOW_CELLS: Final = 6
_LEAST_CELLS: Final = 3
"""Minimum number of late cells (periods of 20 ms or more) that shows a loss; two stalls make
fewer cells late."""
_NEWEST: Final = 4
"""Number of newest cells (periods of 20 ms or more) that determine the present lateness of
arrivals."""
_QUIET_S: Final = 1.0
"""Time after a loss in which the usual lateness is not updated, because arrivals may still show
a further part of the loss [s]."""
_EVIDENCE: Final = 14.0
"""Log odds above which late arrivals count as a loss and not as jitter: a false alarm in one of
10⁶ tests. There are 40 mostly dependent tests a second."""
_EVIDENCE_KNOWN: Final = 7.0
"""Log odds above which late arrivals count as a loss and not as jitter within `_KNOWN_S` after
a known loss."""
_KNOWN_S: Final = 10.0
_FLOOR_S: Final = 0.002
"""Minimum lateness of arrivals above jitter that shows a loss [s]; clock drift causes less."""
_LEVEL_S: Final = 0.006
_LEVEL_SLOPE: Final = 0.06
"""Rise of the lateness with time [s/s] above which the radio's program is slow and no samples
are lost."""
_CLIMB_S: Final = 0.35
_LEVEL_AFTER_CLIMB_S: Final = 1.5
_SUSPECT_S: Final = 0.008
"""Lateness of arrivals above which a loss of samples is suspected [s]."""
_SUSPECT_MAX_S: Final = 0.35
_SHARP: Final = 0.6
"""Minimum fraction of the lateness that arises within `_BEFORE_S` if samples were lost in one
step; a smaller fraction shows a drift."""
_BEFORE_S: Final = 0.5
_SURE_SHARE: Final = 0.0008
"""Fraction of samples lost in the last `_SHARE_S` that no clock error explains (800 ppm)."""
_SHARE_S: Final = 30.0
_EARLY_CELLS: Final = 12
_PACE_BIN_S: Final = 0.25
"""Length of the periods in which the smallest delay of arrivals is stored to measure a source's
speed [s]."""
_UNSETTLED_BINS: Final = 2
"""Number of newest periods that are ignored when a source's speed is measured, because the
source may still catch up after a stall in them."""
_PACE_SPANS: Final = ((5.0, 0.4), (10.0, 0.7))
"""Pairs of a measuring period for a source's speed [s] and the relative scatter of the delays
below which the delays rise evenly, as those of a slow source do. Sources at 0.9 to 0.995 times
real time have a scatter of 0.1 to 0.5 in the shorter and 0.1 to 0.9 in the longer period, even
on a busy computer. Losses of 1 to 15 % of the samples give at least 0.54 and 0.93."""
_UNEVEN: Final = 3.0
"""Ratio of the delays' scatter to its limit in `_PACE_SPANS` above which delays rise in steps,
as by lost samples."""
_SLOW_RATE: Final = 0.003
"""Rise of arrival delays [s/s] above which a source may be slower than real time."""
_SCATTER_S: Final = 0.0005
_SCATTER_SHARE: Final = 0.002
"""Fraction of the rise of the delays that is added to `_SCATTER_S`. The scatter of the delays
is divided by the sum, which makes it relative."""
_STEP: Final = 2.0
"""Minimum ratio of the step in the delay of arrivals at a loss to the rises of the delay before
and after it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """A gap of lost samples, as inferred from arrival times."""

    duration_s: float
    since_s: float
    """Position in the stream at which the late arrivals begin [s]: number of samples divided by
    the nominal rate."""
    sharp: bool
    """True if the arrivals' delay rose within half a second, as at a step; False for a
    drift."""
    inside_s: float
    """Length of the late transfer if the loss is inside it [s]; 0 if it is before."""
    sure: bool
    """False if the delay of arrivals rose so slowly that a wrong clock rate may explain it."""


@dataclass(slots=True)
class _Cell:
    begin_s: float
    end_s: float
    late_s: float
    fresh: bool
    """True if this period's samples arrived in real time; False while the sender caught up."""
    single: bool
    """True if all samples of this period arrived at once, in one transfer."""

    @property
    def length_s(self) -> float:
        return self.end_s - self.begin_s


class SourcePace:
    """Decides from the delays of samples whether a source is slower than real time."""

    def __init__(self) -> None:
        self._delays: deque[tuple[float, float]] = deque()
        """Nominal time of each period and its smallest delay [s], not corrected for losses."""
        self.slow = False
        """True once arrival delays have risen evenly: the source is slower than real time."""
        self.stepped = self.still = False
        """`stepped`: True if delays rose in steps. `still`: True if delays do not rise now."""

    def measure(self, received_s: float, arrived_s: float) -> None:
        """Add the delay of an arrival; after each period, decide whether the source is slow."""
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
        """Fit a line to the smallest delays of the periods since `begin_s`; return its slope
        [s/s] and the scatter around it, divided by the expected scatter. Unusually late periods
        are excluded.
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
    """Finds lost samples from the lateness of arrivals, relative to the earliest arrivals.

    A position in the stream is given in seconds: number of samples, including lost ones,
    divided by the nominal rate. After a loss, the caller adds its duration to later positions.
    """

    def __init__(self, *, may_be_slow: bool = False) -> None:
        self.pace = SourcePace() if may_be_slow else None
        """Speed of a source that may be slower than real time; None for a radio."""
        self.jitter_s = 0.005
        """Mean lateness of arrivals caused by jitter [s]."""
        self.suspect_s: float | None = None
        """Position at which late arrivals begin and samples may be lost [nominal s]; infinite
        if arrivals have been late for too long, None if they are not late."""
        self._falls = 0
        self._usual_s = 0.001
        """Typical smallest lateness in four cells, relative to the earliest arrivals [s]."""
        self._cells: deque[_Cell] = deque(maxlen=_CELLS)
        self._from: tuple[float, float] | None = None
        self._lowest_s = math.inf
        self._newest_at_s = 0.0
        self._late_from_s: float | None = None
        """Position where the present late arrivals begin [nominal s]; None if there are
        none."""
        self._known_until_s = -math.inf
        self._loss_at_s = -math.inf
        self._slow: deque[tuple[float, float]] = deque()
        self._found_s = 0.0
        self._began_s: float | None = None

    def expect(self, at_s: float) -> None:
        """Register a loss reported by the radio; for 10 s, less evidence shows another."""
        self._known_until_s = at_s + _KNOWN_S

    def put(self, at_s: float, arrived_s: float, late_s: float) -> Loss | None:
        """Add an arrival; return the loss that has become certain, or None.

        `at_s`: position in the stream [s]. `arrived_s`: arrival time on any clock [s].
        `late_s`: delay of the arrival relative to the earliest arrivals [s].
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
        self._suspect(cell)
        self._learn_usual()
        loss = self._judge()
        if loss is None or not self._is_credible(loss):
            return None
        self._take(loss)
        return loss

    def early_s(self) -> float:
        """Lateness of the second-earliest recent arrival if it is clearly negative; else 0 [s].

        A negative value means that the expected arrival times must be corrected.
        """
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
        """Subtract `seconds` from the stored lateness, as expected times were corrected."""
        for cell in self._cells:
            cell.late_s -= seconds

    def skip(self, seconds: float) -> None:
        """Move pending positions by the duration of a gap, `seconds`, that has been counted."""
        if self._from is not None:
            self._from = (self._from[0] + seconds, self._from[1])
        self._newest_at_s += seconds
        if self._late_from_s is not None:
            self._late_from_s += seconds
        if self.suspect_s is not None:
            self.suspect_s += seconds

    def _is_credible(self, loss: Loss) -> bool:
        """True if the delay of arrivals made a step: samples are lost and not only late."""
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
        if not cell.fresh or not self._cells or not self._cells[-1].fresh:
            return
        if self.suspect_s is not None:
            return  # a decrease may mean that the program catches up
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
        quiet = self._cells[-1].end_s > self._loss_at_s + _QUIET_S
        if quiet and self.suspect_s is None and len(self._cells) >= _NEWEST:
            self._usual_s += 0.02 * (self._newest_s(_NEWEST) - self._usual_s)
        self._usual_s = min(max(self._usual_s, 0.0), self.jitter_s)

    def _suspect(self, cell: _Cell) -> None:
        """Record a suspected loss if the newest cell (period of 20 ms) is late enough."""
        if not self._is_late(cell.late_s):
            self.suspect_s = None
        elif self.suspect_s is None:
            self.suspect_s = cell.begin_s if self._late_from_s is None else self._late_from_s
        elif cell.end_s - self.suspect_s > _SUSPECT_MAX_S:
            self.suspect_s = math.inf

    def _is_late(self, late_s: float) -> bool:
        return late_s > max(_SUSPECT_S, 5.0 * self.jitter_s)

    @property
    def undecided(self) -> bool:
        """True if the next few arrivals will show whether samples were lost."""
        return self.suspect_s is not None and self.suspect_s < math.inf

    @property
    def may_suspect(self) -> bool:
        """True if the newest arrivals are late and the next ones may show a possible loss."""
        return self.suspect_s is None and self._late_from_s is not None

    def _judge(self) -> Loss | None:
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
        if not best or not self._has_settled(best):
            return None
        return self._loss(best)

    def _has_settled(self, count: int) -> bool:
        """True if the lateness has been constant for long enough after its rise.

        A stall makes the lateness rise only briefly.
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
        """True if enough of the newest cells are about equally late and show no trend."""
        cells = [self._cells[at] for at in range(-count, 0)]
        if len(self._agreeing(count)) < _LEAST_CELLS:
            return False
        half = count // 2
        rise_s = min(c.late_s for c in cells[half:]) - min(c.late_s for c in cells[:half])
        span_s = cells[-1].end_s - cells[0].end_s
        fall_s = _FLOOR_S + 2.0 * self.jitter_s
        return -fall_s <= rise_s <= _LEVEL_S + _LEVEL_SLOPE * span_s

    def _agreeing(self, count: int) -> list[_Cell]:
        """Newest cells, of `count`, that arrived in real time and are about equally late."""
        cells = [self._cells[at] for at in range(-count, 0)]
        near_s = min(c.late_s for c in cells) + _LEVEL_S + 2.0 * self.jitter_s
        near_s += _LEVEL_SLOPE * (cells[-1].end_s - cells[0].end_s)
        return [c for c in cells if c.fresh and c.late_s <= near_s]

    def _loss(self, count: int) -> Loss:
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
            sure=sharp or self._exceeds_clock_error(duration_s),
        )

    def _inside_s(self, first: _Cell, duration_s: float) -> float:
        """Length of the transfer that contains the loss [s]; 0 if whole transfers were lost.

        A loss of whole transfers is a multiple of their length. A loss inside a transfer is
        placed at the end of the transfer, so that the times of samples before the loss stay
        correct.
        """
        length_s = first.end_s - first.begin_s
        if not first.single or length_s <= 0.0:
            return 0.0
        rest = math.remainder(duration_s, length_s)
        whole = duration_s > HALVED_S and abs(rest) <= max(0.001, 1.5 * self.jitter_s)
        return 0.0 if whole else length_s

    def _exceeds_clock_error(self, duration_s: float) -> bool:
        """True if the losses of the last 30 s are greater than a clock error can explain."""
        now_s = self._cells[-1].end_s
        while self._slow and self._slow[0][0] < now_s - _SHARE_S:
            self._slow.popleft()
        began_s = self._began_s if self._began_s is not None else now_s
        lost_s = duration_s + sum(lost for _, lost in self._slow)
        return lost_s > _SURE_SHARE * min(_SHARE_S, max(now_s - began_s, 5.0))

    def _take(self, loss: Loss) -> None:
        now_s = self._cells[-1].end_s
        self._found_s += loss.duration_s
        self._slow.append((now_s, loss.duration_s))
        for cell in self._cells:
            if cell.begin_s >= loss.since_s:
                cell.late_s -= loss.duration_s
        self.suspect_s = self._late_from_s = None
        self._loss_at_s = now_s
        self.expect(now_s)


def most_lost(unsure: int, *, samples: int, sample_rate_hz: float) -> int:
    """Largest number of samples that may be lost in addition to those certainly lost.

    `unsure`: number of samples counted as lost that may be due to a wrong clock rate.
    `samples`: length of the stream. A loss of less than 75 ppm of the stream looks like a clock
    error, and a loss in the last 10 ms is not detected yet.
    """
    return unsure + round(SLOWEST_RATE * samples + _UNSEEN_S * sample_rate_hz)


def _least_span_s(lowest_s: float) -> float:
    """Minimum duration of late arrivals that shows a loss [s]; less may be jitter."""
    return 0.5 * min(max(0.0, (0.015 - lowest_s) / 0.010), 1.0)
