"""The pulse detector of one tag: samples of a channel in, pulses out.

A pure stage. Samples are gathered for a quarter of a second, cleaned of impulses, turned into
a spectrogram, searched for groups of K pulses; a group begins a track, a track finds the pulses
that follow; every pulse is reported once (docs/explanation/detection.md).
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.grid import Spectrogram, make_grid
from uavrt.detection.lines import LineCanceller
from uavrt.detection.modes import LOCK_HALF_WIDTH_HZ, OperatingMode
from uavrt.detection.noise import RowNoise
from uavrt.detection.refine import Measured, Refiner
from uavrt.detection.report import Reporter
from uavrt.detection.samples import (
    BACKWARD_RESTART_BLOCKS,
    Counters,
    SampleBuffer,
    blank_impulses,
)
from uavrt.detection.search import Candidate, RateSearch, jitter_reach
from uavrt.detection.thresholds import (
    decision_interval_s,
    decision_span_s,
    effective_hypotheses,
    spread,
    threshold,
)
from uavrt.detection.tracks import Slot, Track, log_evidence
from uavrt.errors import ConfigError
from uavrt.messages import Pulse, SearchReport, Tag

BATCH_S = 0.25
"""Samples gathered before the search goes on: latency against NumPy's price of a call."""
NOISE_STRIDE = 4
"""Of the columns, eight to a pulse, every fourth tells the noise as much as all."""
_TRACK_BAND_HZ = 20.0
_MAXIMUM_TRACKS = 12
_UNIFORMITY = 0.3
_LINES_EVERY = 10
_LEARN_BATCHES = 3
"""The noise is followed so many batches at a time: a call costs more than its data."""
_MEDIAN = math.log(2.0)
"""Median of an exponential over its mean."""
_STRONG = 30.0
_OFF_ROW_HZ = 8.0
_SAMPLE_LIMIT_FACTOR = 4.0


class PulseDetector:
    """Finds one tag's pulses in the samples of a channel.

    Parameters
    ----------
    tag : Tag
        What to look for.
    sample_rate_hz : float
        Rate of the channel's samples, anything that holds the pulse's spectrum.
    center_frequency_hz : float
        Frequency of the channel's centre, absolute.
    frequency_window_hz : float
        Half-width of the search around the tag's nominal frequency; at or above half the
        sample rate: the whole channel.
    operating_mode : OperatingMode or str
        What to do with a frequency once found.

    Raises
    ------
    ConfigError
        The tag lies outside the channel, or a number makes no sense.
    """

    def __init__(
        self,
        tag: Tag,
        *,
        sample_rate_hz: float,
        center_frequency_hz: float,
        frequency_window_hz: float = 500.0,
        operating_mode: OperatingMode | str = OperatingMode.SEARCH_SOFT_LOCK,
    ) -> None:
        self.tag = tag
        self.sample_rate_hz = float(sample_rate_hz)
        self.center_frequency_hz = float(center_frequency_hz)
        self.operating_mode = OperatingMode(operating_mode)
        _check(tag, self.sample_rate_hz, self.center_frequency_hz, frequency_window_hz)
        self._nominal_hz = tag.frequency_hz - self.center_frequency_hz
        if self.operating_mode is OperatingMode.KNOWN_HARD_LOCK:
            frequency_window_hz = min(frequency_window_hz, LOCK_HALF_WIDTH_HZ)
        elif self.operating_mode is OperatingMode.ALL_NEVER_LOCK:
            frequency_window_hz = math.inf
        self.frequency_window_hz = frequency_window_hz
        self.counters = Counters()
        self._grid = make_grid(
            sample_rate_hz=self.sample_rate_hz,
            pulse_width_s=tag.pulse_width_s,
            offset_hz=self._nominal_hz,
            half_width_hz=frequency_window_hz,
        )
        longest = max(tag.pulse_intervals_s) + tag.interval_uncertainty_s
        keep_s = (tag.k + 1) * longest + tag.interval_jitter_s + 1.0
        self._buffer = SampleBuffer(
            sample_rate_hz=self.sample_rate_hz,
            keep=math.ceil(keep_s * self.sample_rate_hz) + self._grid.window,
            tolerance_s=tag.pulse_width_s / 8.0,
        )
        self._longest_hole_s = keep_s
        self._refiner = Refiner(self._grid, self._buffer)
        self._batch = round(BATCH_S * self.sample_rate_hz)
        self._flank = max(2, round(0.35 * tag.pulse_width_s * self.sample_rate_hz))
        self._short = max(2, round(0.05 * tag.pulse_width_s * self.sample_rate_hz))
        self._reporter = Reporter(
            tag,
            center_frequency_hz=self.center_frequency_hz,
            sample_rate_hz=self.sample_rate_hz,
            counters=self.counters,
        )
        self._start()

    def _start(self) -> None:
        """(Re)start everything that hangs on unbroken samples."""
        grid, tag = self._grid, self.tag
        self._buffer.clear()
        self._noise = RowNoise(
            column_s=grid.hop_s * NOISE_STRIDE,
            independent_per_s=1.0 / tag.pulse_width_s,
            circular=self.frequency_window_hz >= self.sample_rate_hz / 2.0,
        )
        bandwidth = min(2.0 * self.frequency_window_hz, self.sample_rate_hz)
        self._searches = []
        for rate, interval_s in enumerate(tag.pulse_intervals_s, start=1):
            reach_s = jitter_reach(tag.interval_jitter_s, grid.hop_s) * grid.hop_s
            interval_time_s = decision_interval_s(tag, rate)
            first_s = decision_span_s(tag, rate)
            begun_s = min(first_s - (tag.k - 1) * interval_s, interval_time_s)
            steady, first = (
                threshold(
                    k=tag.k,
                    hypotheses=effective_hypotheses(
                        k=tag.k,
                        bandwidth_hz=bandwidth,
                        time_s=time_s,
                        pulse_width_s=tag.pulse_width_s,
                        uncertainty_s=tag.interval_uncertainty_s,
                        reach_s=reach_s,
                    ),
                    spread=spread(reach_s=reach_s, pulse_width_s=tag.pulse_width_s),
                    expected_false=tag.false_alarm_probability / len(tag.pulse_intervals_s),
                )
                for time_s in (interval_time_s, begun_s)
            )
            self._searches.append(
                RateSearch(
                    rows=grid.rows,
                    hop_s=grid.hop_s,
                    interval_s=interval_s,
                    uncertainty_s=tag.interval_uncertainty_s,
                    jitter_s=tag.interval_jitter_s,
                    k=tag.k,
                    threshold=steady,
                    rate=rate,
                    first_threshold=first,
                    first_columns=math.ceil(first_s / grid.hop_s),
                )
            )
        self._first_noise_s = min(max(1.0, (tag.k - 1) * min(tag.pulse_intervals_s)), 6.0)
        self._waiting: list[NDArray[np.float32]] = []
        self._learnt: list[NDArray[np.float32]] = []
        self._spectrogram = Spectrogram(grid)
        self._lines = LineCanceller(self.sample_rate_hz)
        self._batches = 0
        self._column = 0
        self._clean = 0
        self._floor = 0.0
        self._tracks: list[Track] = []
        self._stale_blocks = 0
        self._epoch_ns = 0

    def reset(self) -> None:
        """Forget samples, tracks and locks; counters and group numbers go on."""
        self._start()

    def process(self, samples: NDArray[np.complex64], time_ns: int) -> list[Pulse]:
        """Take a block of samples.

        Parameters
        ----------
        samples : ndarray of complex64, shape (n,)
            Samples at `sample_rate_hz`, centred on `center_frequency_hz`; any number of them.
        time_ns : int
            Time at the antenna of the first sample [ns, UTC]. Time that the samples before do
            not fill is lost samples; times a little off are a slow clock.

        Returns
        -------
        list of Pulse
            Pulses found since the last call, in the order of finding.
        """
        samples = np.ascontiguousarray(samples, np.complex64)
        if not len(samples) or not self._admit(samples, time_ns):
            return self._reporter.drain()
        while self._buffer.end - self._clean >= self._batch + self._flank + self._short:
            self._advance(self._clean + self._batch)
        return self._reporter.drain()

    def flush(self) -> list[Pulse]:
        """End the stream: search what is left and report all groups that are complete.

        Returns
        -------
        list of Pulse
        """
        if not self._buffer.empty:
            self._advance(self._buffer.end, last=True)
        pulses = self._reporter.drain()
        self._start()
        return pulses

    def search_reports(self) -> list[SearchReport]:
        """Take the reports of stretches searched since the last call, one a second."""
        return self._reporter.drain_reports()

    def other_signals(self) -> list[Track]:
        """Tracks with the tag's interval that are not the tag: further from its frequency."""
        return [t for t in self._tracks if t.confirmed and t.held]

    # --- ingest -----------------------------------------------------------------------------

    def _admit(self, samples: NDArray[np.complex64], time_ns: int) -> bool:
        """Put a block in its place; False when it is refused."""
        buffer, counters = self._buffer, self.counters
        if buffer.empty:
            self._epoch_ns = time_ns
        else:
            late_s = buffer.deviation_ns(time_ns) * 1e-9
            if late_s > self._longest_hole_s:
                counters.restarts += 1
                self._start()
                self._epoch_ns = time_ns
            elif late_s >= self.tag.pulse_width_s / 8.0:
                count = round(late_s * self.sample_rate_hz)
                counters.samples_lost += count
                buffer.append_hole(count)
            elif late_s <= -self.tag.pulse_width_s / 8.0:
                overlap = round(-late_s * self.sample_rate_hz)
                if buffer.fill_hole(samples, time_ns, self._clean + self._flank):
                    counters.samples_lost -= len(samples)
                    counters.samples += len(samples)
                    return False
                if overlap >= len(samples):
                    counters.blocks_stale += 1
                    self._stale_blocks += 1
                    if self._stale_blocks < BACKWARD_RESTART_BLOCKS:
                        return False
                    counters.restarts += 1
                    self._start()
                    self._epoch_ns = time_ns
                else:
                    samples = samples[overlap:]
                    time_ns += round(overlap / self.sample_rate_hz * 1e9)
        self._stale_blocks = 0
        counters.samples += len(samples)
        buffer.append(samples, time_ns)
        return True

    # --- the search -------------------------------------------------------------------------

    def _advance(self, upto: int, *, last: bool = False) -> None:
        """Clean, transform and search the samples up to an index."""
        grid, buffer = self._grid, self._buffer
        if upto <= self._clean and not last:
            return
        self._cancel_lines(self._clean, upto)
        self._blank(self._clean, upto)
        self._refiner.upto = upto
        self._clean = upto
        first = self._spectrogram.needed()
        stretch = buffer.view(max(0, first), upto)
        if first < 0 or last:
            ends = np.zeros(grid.reach + grid.window if last else 0, np.complex64)
            stretch = np.concatenate((np.zeros(max(0, -first), np.complex64), stretch, ends))
        power = self._spectrogram.push(stretch)
        begin, self._column = self._column, self._column + len(power)
        if len(power):
            self._learn(power, begin, last=last)
        if not self._noise.ready:
            return
        level = self._noise.level
        blocks, self._waiting = self._waiting, []
        for search in self._searches:
            found: list[Candidate] = []
            for block in blocks:
                found += search.push(block, level)
            if last:
                found += search.finish(level)
            self._consider(found, search)
        self._follow(upto, last=last)
        self._reporter.searched(self._searched_ns(upto), self._noise.level, self._score())

    def _searched_ns(self, upto: int) -> int:
        return self._buffer.time_ns(upto)

    def _score(self) -> float:
        """Best statistic of the stretch over its threshold."""
        best = max(search.best for search in self._searches)
        for search in self._searches:
            search.best = 0.0
        return min(best, 0.999)

    def _cancel_lines(self, first: int, last: int) -> None:
        """Subtract carriers from [first, last)."""
        new = self._buffer.view(max(first, self._buffer.start), last)
        self._batches += 1
        if self._batches % _LINES_EVERY == 0 or self._batches == 3:
            self._lines.find(new)
        self._lines.subtract(new)

    def _blank(self, first: int, last: int) -> None:
        """Zero impulses in [first, last), looking a flank to either side."""
        buffer, margin = self._buffer, self._flank + self._short
        low = max(buffer.start, first - margin)
        high = min(buffer.end, last + margin)
        stretch = buffer.view(low, high)
        if not len(stretch):
            return
        if self._floor <= 0.0 or self._column % 7 == 0:
            power = stretch.real**2 + stretch.imag**2
            self._floor = float(np.median(power))
        if self._floor > 0.0:
            self.counters.samples_blanked += blank_impulses(
                stretch,
                floor=self._floor,
                short=self._short,
                flank=self._flank,
                first=first - low,
                last=last - low,
            )

    def _learn(self, power: NDArray[np.float32], begin: int, *, last: bool) -> None:
        """Feed the noise with columns that hold no lost samples; queue all for the search."""
        self._waiting.append(power)
        whole = power
        if self._buffer.holes:
            whole = power[self._whole_columns(begin, len(power))]
        if self._noise.ready:
            self._learnt.append(whole[::NOISE_STRIDE])
            if len(self._learnt) >= _LEARN_BATCHES:
                self._noise.update(np.concatenate(self._learnt))
                self._learnt.clear()
            return
        gathered = sum(len(block) for block in self._waiting) * self._grid.hop_s
        if gathered >= self._first_noise_s or last:
            if len(self._waiting) > 1:
                self._waiting = [np.concatenate(self._waiting)]
            everything = self._waiting[0]
            if self._buffer.holes:
                start = begin + len(power) - len(everything)
                everything = everything[self._whole_columns(start, len(everything))]
            if len(everything) >= 16 * NOISE_STRIDE:
                self._noise.start(everything[::NOISE_STRIDE])

    def _whole_columns(self, begin: int, count: int) -> NDArray[np.bool_]:
        grid = self._grid
        whole = np.ones(count, np.bool_)
        for low, high in self._buffer.holes:
            first = (low - grid.window - grid.reach) // grid.hop - begin
            whole[max(0, first) : max(0, (high + grid.reach) // grid.hop + 1 - begin)] = False
        return whole

    def _consider(self, found: list[Candidate], search: RateSearch) -> None:
        """Turn candidates into groups; several candidates of the same pulses are one."""
        taken: list[list[Measured]] = []
        for candidate in found:
            if self._explained(candidate, search, taken):
                continue
            places = self._measure(candidate, search)
            if places is None:
                continue
            group = [pulse for _, pulse in places]
            if any(_share_a_pulse(group, other, self._grid.window) for other in taken):
                continue
            taken.append(group)
            owner = self._reporter.owner(self._tracks, self._nominal_hz, self._now_s())
            clash = [t for t in self._tracks if self._overlaps(t, group)]
            if any(t.confirmed for t in clash) or any(self._equals(t, group) for t in clash):
                continue
            reason = self._refusal(group, search)
            if reason is not None:
                self.counters.reject(reason)
                continue
            track = Track(
                tag=self.tag,
                rate=search.rate,
                offset_hz=0.0,
                score=candidate.score,
            )
            track.begin(
                [
                    (place, self._seconds(m.start), self._buffer.time_ns(m.start), m)
                    for place, m in places
                ]
            )
            track.held = bool(clash) or owner is not None
            self.counters.tracks += 1
            self._tracks.append(track)
            self._reporter.report(track)
            if len(self._tracks) > _MAXIMUM_TRACKS:
                self._tracks.remove(
                    min(self._tracks, key=lambda t: (t.confirmed, not t.held, t.score))
                )

    def _explained(
        self, candidate: Candidate, search: RateSearch, taken: list[list[Measured]]
    ) -> bool:
        """Whether a group or a confirmed track has one of a candidate's pulses already."""
        grid = self._grid
        bin_hz = self.sample_rate_hz / grid.window
        near = (search.reach + 1) * grid.hop + 0.75 * grid.window
        offset = float(grid.offsets_hz[candidate.row])
        known = [m for group in taken for m in group]
        known += [s.measured for t in self._tracks if t.confirmed for s in t.slots]
        for measured in known:
            apart = abs(measured.offset_hz - offset) / bin_hz
            leak = measured.power / max(1.0, math.pi * apart / 2.0) ** 2
            if (apart < 1.5 or leak > 0.2 * candidate.strength) and any(
                abs(grid.start(column) - measured.start) < near for column in candidate.columns
            ):
                return True
        return False

    def _measure(
        self, candidate: Candidate, search: RateSearch
    ) -> list[tuple[int, Measured]] | None:
        """Measure a candidate's pulses, with their places among the K."""
        grid = self._grid
        starts = np.array([grid.start(column) for column in candidate.columns])
        half = (search.reach + 1) * grid.hop
        margin = half + grid.window + 2
        kept = (starts > self._buffer.start + half) & (starts < self._refiner.upto - margin)
        if not kept.any():
            return None
        offset = float(grid.offsets_hz[candidate.row])
        found: list[Measured] | None = None
        for _ in range(3):
            found = self._refiner.search(
                starts[kept],
                half,
                offset,
                self.sample_rate_hz / grid.window / 4.0,
                self._noise.level,
                climb=True,
            )
            if found is None:
                return None
            strongest = max(found, key=lambda pulse: pulse.power)
            if strongest.power < _STRONG or abs(strongest.offset_hz - offset) < _OFF_ROW_HZ:
                break
            # The limit on a cell lets noise choose among the rows of a strong pulse.
            offset = strongest.offset_hz
        assert found is not None
        return list(zip(np.flatnonzero(kept).tolist(), found, strict=True))

    def _refusal(self, group: list[Measured], search: RateSearch) -> str | None:
        """Why a group above the threshold is no tag, or None."""
        bin_hz = self.sample_rate_hz / self._grid.window
        total = 0.0
        floor = _UNIFORMITY * min(60.0, max(pulse.power for pulse in group))
        if self._is_the_other_rate(group, search):
            return "a pulse of the other rate between"
        for pulse in group:
            offset, power = self._refiner.strongest(pulse)
            apart = abs(offset - pulse.offset_hz)
            apart = min(apart, self.sample_rate_hz - apart)
            if apart > bin_hz and pulse.power > 4.0:
                # A rectangular pulse elsewhere leaks at most 1 / (pi df tp)^2; double margin.
                leak = 4.0 * power / (math.pi * apart / bin_hz) ** 2
                if power > 3.0 * pulse.power and leak > pulse.power:
                    return "side lobe of a stronger signal"
            if pulse.power > 8.0 and self._refiner.is_impulse(pulse, self._floor / _MEDIAN):
                return "an impulse"
            if len(self.tag.pulse_intervals_s) > 1 and pulse.power < floor:
                return "a pulse of the rate is missing"
            pulse.contrast = self._refiner.contrast(pulse)
            local = pulse.power / pulse.contrast
            total += min(pulse.power / (local if local > 3.0 else 1.0), search.limit)
        if total < search.threshold * 0.97:
            return "no contrast with its surroundings"
        return None

    def _is_the_other_rate(self, group: list[Measured], search: RateSearch) -> bool:
        """Whether the tag's other rate has pulses between those of the group.

        Every second pulse of a rate is a train of twice the interval; the pulses between give
        it away.
        """
        if len(self.tag.pulse_intervals_s) < 2 or len(group) < 2:
            return False
        nominal = self.tag.pulse_intervals_s
        scale = (group[-1].start - group[0].start) / (
            max(1, search.k - 1) * nominal[search.rate - 1]
        )
        other = nominal[2 - search.rate] * scale
        strength = min(max(sum(p.enr for p in group) / len(group), 8.0), 30.0)
        width = self._grid.window
        half = self.tag.interval_jitter_s * self.sample_rate_hz + width / 8.0
        evidence = 0.0
        at = group[0].start + other
        while at < group[-1].start - width:
            if all(abs(at - p.start) > half + width for p in group):
                found = self._refiner.search(
                    np.array([at]), half, group[0].offset_hz, _TRACK_BAND_HZ, self._noise.level
                )
                if found is not None:
                    evidence += log_evidence(found[0].power, strength)
            at += other
        return evidence > 0.0

    def _overlaps(self, track: Track, group: list[Measured]) -> bool:
        return _share_a_pulse(group, [s.measured for s in track.slots], self._grid.window)

    def _equals(self, track: Track, group: list[Measured]) -> bool:
        """Whether at most one pulse of the group is new to the track."""
        own = [s.measured for s in track.slots]
        shared = sum(_share_a_pulse([m], own, self._grid.window) for m in group)
        return shared >= len(group) - 1

    # --- tracks -----------------------------------------------------------------------------

    def _seconds(self, index: float) -> float:
        return (self._buffer.time_ns(index) - self._epoch_ns) * 1e-9

    def _now_s(self) -> float:
        return self._seconds(self._clean)

    def _follow(self, upto: int, *, last: bool) -> None:
        """Look where the tracks expect their next pulses."""
        for track in self._tracks:
            while not track.dead and self._step(track, upto):
                if len(self.tag.pulse_intervals_s) > 1 and track.confirmed:
                    self._follow_rival(track, upto)
                self._reporter.settle(self._tracks, self._nominal_hz, self._now_s())
        self._reporter.settle(self._tracks, self._nominal_hz, self._now_s())
        self._tracks = [t for t in self._tracks if not t.dead]

    def _follow_rival(self, track: Track, upto: int) -> None:
        """Let the other rate look for its pulses up to the same time, and compare."""
        rival = track.rival
        while rival is not None and rival.time_s < track.time_s and not rival.dead:
            if not self._step(rival, upto):
                break
        if rival is not None and rival.dead:
            track.rival = None
        track.settle_rivalry()

    def _step(self, track: Track, upto: int) -> bool:
        """Test a track's next slot when its samples are there."""
        grid = self._grid
        time_s, half_s = track.expected()
        spread_s = track.spread_s()
        half = half_s * self.sample_rate_hz
        start = self._buffer.index(self._epoch_ns + round(time_s * 1e9))
        if start + half + grid.window + 3 > upto:
            return False
        begin, end = math.floor(start), math.ceil(start) + grid.window
        if self._buffer.lost_between(begin, end) > grid.window // 2:
            track.skip()
            return True
        band = _TRACK_BAND_HZ
        found = self._refiner.search(
            np.array([start]),
            half,
            track.offset_hz,
            band,
            self._noise.level,
            spread=spread_s * self.sample_rate_hz,
        )
        if found is None:
            track.skip()
            return True
        measured = found[0]
        if measured.power > 8.0 and self._refiner.is_impulse(measured, self._floor / _MEDIAN):
            track.skip()
            return True
        track.step(
            Slot(
                number=0,
                time_s=self._seconds(measured.start),
                time_ns=self._buffer.time_ns(measured.start),
                measured=measured,
                volume=track.volume(half_s, band),
            )
        )
        return True


def _share_a_pulse(one: list[Measured], two: list[Measured], window: int) -> bool:
    """Whether two groups have a pulse at the same time, at whatever frequency it leaks to."""
    return any(abs(a.start - b.start) < 0.75 * window for a in one for b in two)


def _check(tag: Tag, rate_hz: float, center_hz: float, window_hz: float) -> None:
    """Refuse what cannot be searched."""
    if not rate_hz > 0.0 or not math.isfinite(rate_hz):
        raise ConfigError(f"a sample rate of {rate_hz} Hz", remedy="Give a positive rate")
    if not window_hz > 0.0:
        raise ConfigError(
            f"a frequency window of {window_hz} Hz", remedy="Give a positive half-width"
        )
    if abs(tag.frequency_hz - center_hz) > rate_hz / 2.0:
        raise ConfigError(
            f"tag {tag.tag_id} at {tag.frequency_hz:.0f} Hz is not in the channel of "
            f"{rate_hz:.0f} Hz around {center_hz:.0f} Hz",
            remedy="Choose the channel that holds the tag",
        )
    if tag.k < 1 or not 0.0 < tag.false_alarm_probability < 1.0:
        raise ConfigError(
            f"tag {tag.tag_id} has k = {tag.k}, false alarms {tag.false_alarm_probability}",
            remedy="k is 1 or more, the false-alarm probability lies between 0 and 1",
        )
    if tag.pulse_width_s * rate_hz < 4.0:
        raise ConfigError(
            f"a pulse of {tag.pulse_width_s} s is shorter than 4 samples",
            remedy="Use a higher channel rate",
        )
    if min(tag.pulse_intervals_s) - tag.interval_uncertainty_s <= 2.0 * tag.pulse_width_s:
        raise ConfigError(
            f"tag {tag.tag_id} has an interval shorter than two pulses",
            remedy="Correct its interval, uncertainty or pulse width",
        )
