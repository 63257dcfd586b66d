"""Measure unknown tags: the engine of ``uavrt tags measure``.

First pass: bursts anywhere in the band (`pulse_search`), gathered by frequency; those that keep
a beat are a tag (`beats`). Second pass: a narrow channel about each, every pulse fitted by
itself (`pulse_fit`); then frequency, width and intervals with their uncertainties.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.measure.beats import FEWEST, FoundBeat, find_beats
from uavrt.analysis.measure.coded_bursts import may_be_bursts
from uavrt.analysis.measure.measure_pulses import PulseWindow, measure_pulses
from uavrt.analysis.measure.measured_tag import MeasuredTag
from uavrt.analysis.measure.pulse_search import SIDE_HZ, Bursts, BurstSearch
from uavrt.dsp import FrontEnd
from uavrt.errors import ConfigError, UavrtError, UsageError
from uavrt.messages import ChannelBlock, IQBlock
from uavrt.radio import BlockTimes, SampleSource
from uavrt.units import ns_from_s

WINDOW_HZ: Final = 2000.0
GATHER_HZ: Final = 150.0
"""Bursts so near to each other in frequency may be one tag, warming up."""
MARGIN_S: Final = 0.100
"""Kept before and after a burst's middle; the outer halves of it are noise alone."""
ECHO_S: Final = 0.1
ECHO_DB: Final = 6.0
FAR_ECHO_DB: Final = 30.0
"""A weaker burst at the same time as a tag's pulse is its flank, 6 dB down within 20 kHz and
30 dB down anywhere (overload, mirror image); or another tag, whose next pulse comes alone."""
MOST_BEATS: Final = 8
STRAYS: Final = 2
"""Bursts of a beat so few within another's time do not make two tags."""


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """A tag after the first pass."""

    frequency_hz: float
    """Relative to the band's centre."""
    times_s: NDArray[np.float64]
    bursts_hz: NDArray[np.float64]
    """(n,) frequency of each burst, relative to the band's centre."""
    beats: tuple[FoundBeat, ...]


def measure_tags(
    open_source: Callable[[], SampleSource],
    *,
    frequency_hz: float | None = None,
    window_hz: float = WINDOW_HZ,
    on_progress: Callable[[float], None] | None = None,
    on_fault: Callable[[UavrtError], None] | None = None,
    on_bursts: Callable[[Sequence[float]], None] | None = None,
) -> tuple[MeasuredTag, ...]:
    """Find and measure all tags in a recording.

    Parameters
    ----------
    open_source : callable
        Opens the recording; called twice.
    frequency_hz : float, optional
        Where to look; None: in the whole band.
    window_hz : float
        Half-width of the search about it.
    on_progress : callable, optional
        Takes the part that is done, 0 to 1.
    on_fault : callable, optional
        Takes, once, what keeps the recording from being read to its end; what was read till
        then is measured. Without it that is raised.
    on_bursts : callable, optional
        Takes, once, the frequencies [Hz] where pulses come by twos or more without a beat that
        was found: bursts of a coded tag may, whose interval is up to a minute.

    Returns
    -------
    tuple of MeasuredTag
        The one with the most pulses first.

    Raises
    ------
    UsageError
        Nothing that beats like a tag.
    UavrtError
        The recording cannot be read.
    """
    if not window_hz > 0.0:
        raise ConfigError(f"a window of {window_hz} Hz", remedy="Give --window in hertz")
    report = on_progress or (lambda _part: None)
    with closing(open_source()) as source:
        blocks = _blocks(source, lambda p: report(0.5 * p), on_fault)
        bursts, start_ns, span_s = _search(source, blocks, frequency_hz, window_hz)
        center_hz = source.center_frequency_hz
    found, others_hz = _gather(bursts, span_s)
    if on_bursts is not None:
        on_bursts([center_hz + other_hz for other_hz in others_hz])
    if not found:
        raise _nothing(bursts, span_s)
    with closing(open_source()) as source:
        again = None if on_fault is None else lambda _fault: None  # told already
        blocks = _blocks(source, lambda p: report(0.5 + 0.5 * p), again)
        windows = _cut(source, blocks, found, start_ns)
    measured = [
        measure_pulses(one.beats, cut, center_hz + one.frequency_hz)
        for one, cut in zip(found, windows, strict=True)
        if len(cut) >= FEWEST
    ]
    if not measured:  # too near to the recording's ends, or to holes in it
        raise _nothing(bursts, span_s)
    return tuple(sorted(measured, key=lambda tag: -tag.pulses))


def _nothing(bursts: Bursts, span_s: float) -> UsageError:
    return UsageError(
        f"nothing in {span_s:.0f} s beats like a tag ({bursts.times_s.size} bursts seen)",
        remedy="Record at least ten pulses with the tag a few metres away, and without "
        "overloading the receiver; --frequency and --window make the search finer",
    )


# --- first pass -----------------------------------------------------------------------------


def _search(
    source: SampleSource,
    blocks: Iterator[IQBlock],
    frequency_hz: float | None,
    window_hz: float,
) -> tuple[Bursts, int, float]:
    """Bursts of the whole band or about a frequency; relative to the band's centre.

    They count from the time that comes second [ns]; the third is how much was heard.
    """
    rate_hz = source.sample_rate_hz
    if frequency_hz is None:
        low_hz, high_hz = -rate_hz / 2, rate_hz / 2
    else:
        offset_hz = frequency_hz - source.center_frequency_hz
        low_hz = max(offset_hz - window_hz, -rate_hz / 2)
        high_hz = min(offset_hz + window_hz, rate_hz / 2)
        if not high_hz > low_hz:
            raise ConfigError(
                f"{frequency_hz / 1e6:.6f} MHz is not in this recording, "
                f"{source.center_frequency_hz / 1e6:.6f} MHz ± {rate_hz / 2e3:.1f} kHz",
                remedy="Correct --frequency, in hertz",
            )
    search = BurstSearch(sample_rate_hz=rate_hz, low_hz=low_hz, high_hz=high_hz)
    times = BlockTimes(rate_hz)
    samples = 0
    for block in blocks:
        times.add(samples, block.time_ns)
        search.process(block.samples)
        samples += len(block.samples)
    bursts = search.finish().placed(times, rate_hz, times.start_ns)
    return bursts, times.start_ns, samples / rate_hz


def _blocks(
    source: SampleSource,
    report: Callable[[float], None],
    on_fault: Callable[[UavrtError], None] | None,
) -> Iterator[IQBlock]:
    """Read a recording to its end, or as far as it goes."""
    done = 0
    while True:
        try:
            block = source.read()
        except EOFError:
            return
        except UavrtError as fault:
            if on_fault is None or not done:
                raise
            on_fault(fault)
            return
        if block is not None:
            yield block
            done += len(block.samples)
            report(done / source.total_samples if source.total_samples else 0.0)


def _gather(bursts: Bursts, span_s: float) -> tuple[list[_Found], list[float]]:
    """Group bursts of one frequency; keep those that beat, and where others come by twos."""
    free = np.ones(bursts.times_s.size, dtype=bool)
    found: list[_Found] = []
    refused: list[float] = []
    by_twos: list[float] = []
    while free.sum() >= FEWEST:
        center_hz = _densest(bursts, free, refused)
        if center_hz is None:
            break
        near = np.flatnonzero(free & (np.abs(bursts.frequencies_hz - center_hz) <= GATHER_HZ))
        times_s = bursts.times_s[near]
        beats = find_beats(times_s, span_s, MOST_BEATS)
        if not beats:
            refused.append(center_hz)
            if may_be_bursts(times_s):
                by_twos.append(float(np.median(bursts.frequencies_hz[near])))
            continue
        for group in _of_one_tag(beats, times_s):
            members = np.sort(np.concatenate([beat.members for beat in group]))
            found.append(
                _Found(
                    float(np.median(bursts.frequencies_hz[near[members]])),
                    times_s,
                    bursts.frequencies_hz[near],
                    tuple(group),
                )
            )
            taken = near[members]
            free[taken] = False
            _drop_echoes(bursts, taken, free)
    return found, by_twos


def _drop_echoes(bursts: Bursts, taken: NDArray[np.intp], free: NDArray[np.bool_]) -> None:
    """Remove what accompanies a tag's pulses: their flanks, spread over the band.

    A weaker burst at the same time is such a one: near by, or anywhere if it is far weaker. So
    is any of the same frequency.
    """
    place = np.searchsorted(bursts.times_s[taken], bursts.times_s)
    for neighbour in (place - 1, place):
        mate = taken[np.clip(neighbour, 0, taken.size - 1)]
        together = np.abs(bursts.times_s - bursts.times_s[mate]) <= ECHO_S
        below_db = bursts.levels_db[mate] - bursts.levels_db
        distance_hz = np.abs(bursts.frequencies_hz - bursts.frequencies_hz[mate])
        flank = (below_db > ECHO_DB) & (distance_hz <= SIDE_HZ)
        spread = below_db > FAR_ECHO_DB
        free &= ~(together & (flank | spread | (distance_hz <= GATHER_HZ)))


def _densest(bursts: Bursts, free: NDArray[np.bool_], refused: list[float]) -> float | None:
    """Frequency about which most free bursts lie, strong ones counting for more."""
    frequencies = bursts.frequencies_hz[free]
    order = np.argsort(frequencies)
    ordered = frequencies[order]
    weight = np.concatenate(([0.0], np.cumsum(np.maximum(bursts.levels_db[free][order], 0.0))))
    low = np.searchsorted(ordered, ordered - GATHER_HZ / 2)
    high = np.searchsorted(ordered, ordered + GATHER_HZ / 2, side="right")
    merit = np.where(high - low >= FEWEST, weight[high] - weight[low], 0.0)
    for center_hz in refused:
        merit[np.abs(ordered - center_hz) <= GATHER_HZ / 2] = 0.0
    best = int(np.argmax(merit))
    return float(ordered[best]) if merit[best] > 0.0 else None


def _of_one_tag(
    beats: Sequence[FoundBeat], times_s: NDArray[np.float64]
) -> list[list[FoundBeat]]:
    """A tag beats at one interval at a time: beats that overlap in time are several tags."""
    groups: list[list[FoundBeat]] = []
    for beat in beats:
        for group in groups:
            if not any(_overlap(times_s[beat.members], times_s[one.members]) for one in group):
                group.append(beat)
                break
        else:
            groups.append([beat])
    return groups


def _overlap(first_s: NDArray[np.float64], second_s: NDArray[np.float64]) -> bool:
    """Whether both beat at a time; a false burst or two make a beat seem longer than it is."""
    inside = (
        int(((one >= other[0]) & (one <= other[-1])).sum())
        for one, other in ((first_s, second_s), (second_s, first_s))
    )
    return min(inside) > STRAYS


# --- second pass ----------------------------------------------------------------------------


def _cut(
    source: SampleSource, blocks: Iterator[IQBlock], found: Sequence[_Found], start_ns: int
) -> list[list[PulseWindow]]:
    """Cut the samples about each burst out of a narrow channel."""
    center_hz = source.center_frequency_hz
    front_end = FrontEnd(
        sample_rate_hz=source.sample_rate_hz,
        center_frequency_hz=center_hz,
        frequencies_hz=[center_hz + one.frequency_hz for one in found],
    )
    rate_hz = front_end.plan.channel_rate_hz
    cutters = [_Cutter(one, center_hz + one.frequency_hz, rate_hz, start_ns) for one in found]
    channels = front_end.plan.frequency_channels
    for block in blocks:
        for channel in front_end.process(block):
            for cutter, number in zip(cutters, channels, strict=True):
                if number == channel.channel:
                    cutter.process(channel)
    return [cutter.windows for cutter in cutters]


class _Cutter:
    """Cuts the windows of one tag out of the stream of its channel."""

    def __init__(
        self, found: _Found, frequency_hz: float, rate_hz: float, start_ns: int
    ) -> None:
        members = np.sort(np.concatenate([beat.members for beat in found.beats]))
        self._pending = [(start_ns + ns_from_s(found.times_s[k]), int(k)) for k in members]
        self._frequency_hz = frequency_hz
        self._apart_hz = found.bursts_hz - found.frequency_hz
        self._rate_hz = rate_hz
        self._margin = round(MARGIN_S * rate_hz)
        self._times = BlockTimes(rate_hz)
        self._held = np.zeros(0, np.complex64)
        self.windows: list[PulseWindow] = []

    def process(self, block: ChannelBlock) -> None:
        """Take the channel's next block."""
        if block.lost_before:
            self._held = self._held[:0]
        self._times.add(block.sample_index, block.time_ns)
        held = np.concatenate((self._held, block.samples))
        first = block.sample_index - len(self._held)
        end = first + len(held)
        while self._pending:
            middle = round(self._times.index(self._pending[0][0]))
            if middle + self._margin > end:
                break
            _, burst = self._pending.pop(0)
            low = middle - self._margin - first
            if low >= 0:
                # The clock may be corrected within the window: its middle counts.
                begin_ns = self._times.time_ns(middle) - ns_from_s(self._margin / self._rate_hz)
                self.windows.append(
                    PulseWindow(
                        held[low : middle + self._margin - first].copy(),
                        begin_ns,
                        self._rate_hz,
                        self._frequency_hz - block.center_frequency_hz,
                        float(self._apart_hz[burst]),
                        burst,
                    )
                )
        # Where the clock is set forward, the next burst comes earlier than it seems now.
        needed = end - 2 * self._margin
        if self._pending:
            needed = min(needed, round(self._times.index(self._pending[0][0])) - self._margin)
        self._held = held[max(0, needed - first) :].copy()
