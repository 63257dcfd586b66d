"""Measure unknown tags in a recording, as in ``uavrt tags measure``.

The first pass finds all periodic pulse signals in the band (`uavrt.detection.beeps`). The
second pass creates a narrow channel around each signal, fits each pulse (`pulse_fit`), and
measures the gaps of bursts (`coded_bursts`).
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.measure.coded_bursts import (
    LONGEST_PULSE_S,
    BurstPulses,
    MeasuredCode,
    find_codes,
)
from uavrt.analysis.measure.measure_pulses import PulseWindow, measure_pulses
from uavrt.analysis.measure.measured_tag import MeasuredTag
from uavrt.config.ghost_places import Receiver
from uavrt.core.errors import ConfigError, UavrtError, UsageError
from uavrt.core.messages import ChannelBlock, IQBlock
from uavrt.core.units import ns_from_s
from uavrt.detection.beeps.beep_points import Points, PointSearch
from uavrt.detection.beeps.beep_trains import Train, find_trains
from uavrt.detection.beeps.tuning import INTERVALS
from uavrt.dsp.block_times import BlockTimes
from uavrt.dsp.frontend import FrontEnd
from uavrt.dsp.plan import ONE_CHANNEL_RATE_HZ, usable_half_span_hz
from uavrt.radio.source import SampleSource

WINDOW_HZ: Final = 2000.0
MARGIN_S: Final = 0.100
"""Analysed time on each side of a pulse's middle [s]; its outer half is only noise."""
_MOST_SUSPECTS: Final = 8
"""Maximum number of frequencies searched for coded tags; each takes 2 % of a core."""
_SUSPECTS_APART_HZ: Final = 500.0
_CODE_HZ: Final = 1000.0
"""Frequency distance from a coded tag below which short pulses are that tag's [Hz]."""
_SAME_INTERVAL_S: Final = 0.002
"""Interval difference below which a periodic signal is part of coded bursts [s]."""
_LEAST_ALIKE: Final = 0.6
"""Minimum share of a signal's pulses of one width and frequency; less is doubtful."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DoubtfulTrain:
    """A periodic signal that may not be a tag, with the reason for the doubt."""

    frequency_hz: float
    interval_s: float
    pulses: int
    level_db: float
    reason: str

    def __str__(self) -> str:
        return (
            f"doubtful: {self.frequency_hz / 1e6:.6f} MHz every "
            f"{1e3 * self.interval_s:.0f} ms, {self.pulses} pulses, "
            f"{self.level_db:.0f} dB: {self.reason}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """All uncoded and coded tags measured in a recording."""

    tags: tuple[MeasuredTag, ...]
    """Uncoded tags, sorted by number of pulses, largest first."""
    codes: tuple[MeasuredCode, ...]
    """Coded tags, sorted by number of bursts, largest first."""
    doubtful: tuple[DoubtfulTrain, ...]


def measure_tags(
    open_source: Callable[[], SampleSource],
    *,
    frequency_hz: float | None = None,
    window_hz: float = WINDOW_HZ,
    on_progress: Callable[[float], None] | None = None,
    on_fault: Callable[[UavrtError], None] | None = None,
) -> Measurement:
    """Find and measure all tags in a recording, which `open_source` opens twice.

    Without `frequency_hz` the whole band is searched; otherwise `window_hz` on both sides of
    it. `on_fault` is called with the reason if the recording cannot be read to its end; without
    `on_fault` that error is raised.
    """
    if not window_hz > 0.0:
        raise ConfigError(
            f"a window of {window_hz} Hz is not positive",
            remedy="Give --window as a positive number of hertz",
        )
    report = on_progress or (lambda _part: None)
    with closing(open_source()) as source:
        blocks = _blocks(source, lambda p: report(0.5 * p), on_fault)
        points, start_ns, span_s = _search(source, blocks, frequency_hz, window_hz)
        center_hz, rate_hz = source.center_frequency_hz, source.sample_rate_hz
    trains, bursts_hz = find_trains(points, span_s, Receiver(0.0, rate_hz))
    half_span_hz = 0.5 * rate_hz
    if rate_hz > ONE_CHANNEL_RATE_HZ:
        half_span_hz = usable_half_span_hz(
            band_rate_hz=rate_hz, decimated=False, mode="default"
        )
    reasons = [_doubt(train, half_span_hz, center_hz) for train in trains]
    clear = [one for one, reason in zip(trains, reasons, strict=True) if reason is None]
    hinted_hz = [] if frequency_hz is None else [frequency_hz - center_hz]
    suspects_hz = _suspects([*hinted_hz, *bursts_hz], half_span_hz)
    codes: list[MeasuredCode] = []
    tags: list[MeasuredTag] = []
    doubts = [(one, reason) for one, reason in zip(trains, reasons, strict=True) if reason]
    if clear or suspects_hz:
        with closing(open_source()) as source:
            again = None if on_fault is None else lambda _fault: None  # reported already
            blocks = _blocks(source, lambda p: report(0.5 + 0.5 * p), again)
            windows, pulses_s = _cut(source, blocks, clear, suspects_hz, start_ns)
        for suspect_hz, (middles_s, widths_s) in zip(suspects_hz, pulses_s, strict=True):
            if not _of_code(center_hz + suspect_hz, codes):
                codes += find_codes(middles_s, widths_s, center_hz + suspect_hz)
        for train, cut in zip(clear, windows, strict=True):
            measured = _measured(train, cut, center_hz)
            if isinstance(measured, MeasuredTag):
                tags += [] if _in_bursts(measured, codes) else [measured]
            else:
                doubts.append((train, measured))
    doubtful = tuple(
        DoubtfulTrain(
            frequency_hz=center_hz + train.frequency_hz,
            interval_s=train.interval_s,
            pulses=len(train.points),
            level_db=train.level_db,
            reason=reason,
        )
        for train, reason in doubts
        if not _of_code(center_hz + train.frequency_hz, codes)
    )
    if not tags and not codes:
        listed = "".join(f"; {one}" for one in doubtful)
        raise UsageError(
            f"no regular pulses in {span_s:.0f} s ({len(points)} pulses found{listed})",
            remedy="Record at least ten pulses with the tag a few metres away, and without "
            "overloading the receiver; --frequency and --window make the search finer",
        )
    return Measurement(
        tags=tuple(sorted(tags, key=lambda tag: -tag.pulses)),
        codes=tuple(sorted(codes, key=lambda code: -code.bursts)),
        doubtful=doubtful,
    )


def _doubt(train: Train, half_span_hz: float, center_hz: float) -> str | None:
    """Reason why a periodic signal is probably not a tag; None if it probably is one."""
    if train.image_of_hz is not None:
        original_mhz = (center_hz + train.image_of_hz) / 1e6
        return f"an image of {original_mhz:.6f} MHz, made in the receiver: reduce its gain"
    if train.together > 1:
        return (
            f"received at {train.together} frequencies at once: a device, not an animal's tag"
        )
    if abs(train.frequency_hz) > half_span_hz:
        return "at the band's edge, where nothing can be measured: tune the radio nearer"
    return train.doubt


def _suspects(offsets_hz: Sequence[float], half_span_hz: float) -> list[float]:
    """Choose a limited number of frequencies in the band, well apart, to search for codes."""
    chosen: list[float] = []
    for offset_hz in offsets_hz:
        apart = all(abs(offset_hz - other_hz) >= _SUSPECTS_APART_HZ for other_hz in chosen)
        if apart and abs(offset_hz) <= half_span_hz:
            chosen.append(offset_hz)
    return chosen[:_MOST_SUSPECTS]


def _of_code(frequency_hz: float, codes: Sequence[MeasuredCode]) -> bool:
    return any(abs(frequency_hz - code.frequency_hz) < _CODE_HZ for code in codes)


def _in_bursts(tag: MeasuredTag, codes: Sequence[MeasuredCode]) -> bool:
    """True if each pulse of a periodic signal is part of a burst of a coded tag."""
    return any(
        _of_code(tag.frequency_hz, [code])
        and abs(rate.interval_s - code.burst_interval_s) <= _SAME_INTERVAL_S
        for code in codes
        for rate in tag.rates
    )


def _measured(
    train: Train, windows: Sequence[PulseWindow], center_hz: float
) -> MeasuredTag | str:
    if len(windows) < INTERVALS.fewest_pulses:
        return "its pulses are cut off by gaps or by the recording's ends"
    tag = measure_pulses(train.beats, windows, center_hz + train.frequency_hz)
    if tag.pulse_width_s <= LONGEST_PULSE_S:
        return "its pulses are as short as a coded tag's"
    if not tag.rates or tag.pulses < _LEAST_ALIKE * len(windows):
        return "its pulses differ in width or frequency"
    return tag


# --- first pass -----------------------------------------------------------------------------


def _search(
    source: SampleSource,
    blocks: Iterator[IQBlock],
    frequency_hz: float | None,
    window_hz: float,
) -> tuple[Points, int, float]:
    """Search the band, or a part of it; return the pulses, the reference of their times [ns]
    and the duration [s].
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
                f"{frequency_hz / 1e6:.6f} MHz is outside this recording, which covers "
                f"{source.center_frequency_hz / 1e6:.6f} MHz ± {rate_hz / 2e3:.1f} kHz",
                remedy="Correct --frequency, in hertz",
            )
    search = PointSearch(sample_rate_hz=rate_hz, low_hz=low_hz, high_hz=high_hz)
    times = BlockTimes(rate_hz)
    samples = 0
    for block in blocks:
        times.add(samples, block.time_ns)
        search.process(block.samples)
        samples += len(block.samples)
    points = search.finish()
    points = points.moved(times.seconds(points.times_s * rate_hz, times.start_ns))
    return points, times.start_ns, samples / rate_hz


def _blocks(
    source: SampleSource,
    report: Callable[[float], None],
    on_fault: Callable[[UavrtError], None] | None,
) -> Iterator[IQBlock]:
    """Yield a recording's blocks up to its end or to the first fault."""
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


# --- second pass ----------------------------------------------------------------------------


def _cut(
    source: SampleSource,
    blocks: Iterator[IQBlock],
    trains: Sequence[Train],
    suspects_hz: Sequence[float],
    start_ns: int,
) -> tuple[list[list[PulseWindow]], list[tuple[NDArray[np.float64], NDArray[np.float64]]]]:
    """Extract samples around pulses from a narrow channel; find the pulses of bursts."""
    center_hz = source.center_frequency_hz
    offsets_hz = [*(train.frequency_hz for train in trains), *suspects_hz]
    front_end = FrontEnd(
        sample_rate_hz=source.sample_rate_hz,
        center_frequency_hz=center_hz,
        frequencies_hz=[center_hz + offset_hz for offset_hz in offsets_hz],
    )
    rate_hz = front_end.plan.channel_rate_hz
    cutters = [_Cutter(one, center_hz + one.frequency_hz, rate_hz, start_ns) for one in trains]
    codes = [BurstPulses(center_hz + offset_hz, rate_hz) for offset_hz in suspects_hz]
    channel_takers: list[_Cutter | BurstPulses] = [*cutters, *codes]
    takers: dict[int, list[_Cutter | BurstPulses]] = {}
    for number, taker in zip(front_end.plan.frequency_channels, channel_takers, strict=True):
        takers.setdefault(number, []).append(taker)
    for block in blocks:
        for channel in front_end.process(block):
            for taker in takers[channel.channel]:
                taker.process(channel)
    return [cutter.windows for cutter in cutters], [code.finish() for code in codes]


class _Cutter:
    def __init__(
        self, train: Train, frequency_hz: float, rate_hz: float, start_ns: int
    ) -> None:
        self._pending = deque(
            (start_ns + ns_from_s(time_s), place)
            for place, time_s in enumerate(train.points.times_s)
        )
        self._frequency_hz = frequency_hz
        self._apart_hz = train.points.frequencies_hz - train.frequency_hz
        self._rate_hz = rate_hz
        self._margin = round(MARGIN_S * rate_hz)
        self._times = BlockTimes(rate_hz)
        self._held = np.zeros(0, np.complex64)
        self.windows: list[PulseWindow] = []

    def process(self, block: ChannelBlock) -> None:
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
            _, burst = self._pending.popleft()
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
