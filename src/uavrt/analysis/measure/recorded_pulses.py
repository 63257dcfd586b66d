"""Run the detectors over any source of samples in one thread, as ``uavrt detect`` does: front
end and detectors as in a flight, without sockets between them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from uavrt.config.ghost_places import Receiver
from uavrt.core.clock import monotonic_s
from uavrt.core.errors import ConfigError, UavrtError
from uavrt.core.messages import ChannelBlock, IQBlock, Pulse, SearchReport, Tag
from uavrt.detection.detector import PulseDetector
from uavrt.detection.group import DetectorGroup
from uavrt.detection.modes import OperatingMode
from uavrt.dsp.carriers import Carriers
from uavrt.dsp.clipping import Clipping
from uavrt.dsp.frontend import FrontEnd
from uavrt.dsp.input_check import InputCheck
from uavrt.radio.source import SampleSource

if TYPE_CHECKING:
    from uavrt.detection.coded.coded_detector import CodedDetector

_POLL_S: Final = 0.5
"""Interval at which a reader that waits for data checks whether it should stop [s]."""


def _coded_detector() -> "type[CodedDetector]":
    """Import the coded-tag detector when needed: it loads 22 MB of scipy.special."""
    from uavrt.detection.coded.coded_detector import CodedDetector

    return CodedDetector


class DetectionChain:
    """Converts blocks of radio samples into pulses of all listed tags.

    `frequency_window_hz` is the half-width of the search, limited to the channel. No pulse is
    reported in the absolute frequency ranges `excluded_hz`. `on_channel` is called with each
    block of a channel before it is searched, `on_band` with each block of the radio and its
    decimated block.
    """

    def __init__(
        self,
        tags: Sequence[Tag],
        *,
        sample_rate_hz: float,
        center_frequency_hz: float,
        frequency_window_hz: float = 500.0,
        operating_modes: Mapping[int, OperatingMode] | None = None,
        excluded_hz: Sequence[tuple[float, float]] = (),
        on_channel: Callable[[ChannelBlock], None] | None = None,
        on_band: Callable[[IQBlock, IQBlock], None] | None = None,
    ) -> None:
        if not tags:
            raise ConfigError("there are no tags to search for", remedy="Name a tag file")
        if not frequency_window_hz > 0.0:
            raise ConfigError(
                f"the frequency window of {frequency_window_hz} Hz is not positive",
                remedy="Give --frequency-window in hertz, e.g. 500",
            )
        self.clipping = Clipping()
        self._carriers = Carriers()
        self._input_check = InputCheck(tags, center_frequency_hz)
        self.input_faults: list[str] = []
        """Descriptions of faults in the input samples, each once."""
        self._center_frequency_hz = center_frequency_hz
        self.invalid_samples = 0
        """Number of non-finite channel samples, replaced by zero."""
        self._suspect_s = 0.0
        """Time for which a past non-finite sample still affects the channel filters [s]."""
        self._excluded_hz = tuple(excluded_hz)
        self._on_channel = on_channel
        self.on_band = on_band
        """Callback for each radio block and its decimated copy; not part of saved state."""
        modes = {} if operating_modes is None else operating_modes
        self._front_end = FrontEnd(
            sample_rate_hz=sample_rate_hz,
            center_frequency_hz=center_frequency_hz,
            frequencies_hz=[tag.frequency_hz for tag in tags],
        )
        plan = self._front_end.plan
        self._memory_s = 2.0 * plan.latency_s
        centers_hz = dict(zip(plan.channels_in_use, plan.channel_centers_hz, strict=True))
        detectors: dict[int, list[PulseDetector]] = {}
        codes: dict[int, list[Tag]] = {}
        for tag, channel in zip(tags, plan.frequency_channels, strict=True):
            if tag.coded:
                codes.setdefault(channel, []).append(tag)
                continue
            detectors.setdefault(channel, []).append(
                PulseDetector(
                    tag,
                    sample_rate_hz=plan.channel_rate_hz,
                    center_frequency_hz=centers_hz[channel],
                    frequency_window_hz=frequency_window_hz,
                    operating_mode=modes.get(tag.tag_id, OperatingMode.SEARCH_SOFT_LOCK),
                    excluded_hz=excluded_hz,
                )
            )
        self._group = DetectorGroup(Receiver(center_frequency_hz, sample_rate_hz))
        for channel, some in detectors.items():
            self._group.add(channel, some)
        self._coded: dict[int, CodedDetector] = {}
        for channel, listed in codes.items():
            self._coded[channel] = _coded_detector()(
                listed,
                sample_rate_hz=plan.channel_rate_hz,
                center_frequency_hz=centers_hz[channel],
                frequency_window_hz=frequency_window_hz,
            )

    def process(self, block: IQBlock) -> list[Pulse]:
        """Process the next block; return the pulses whose detection is complete."""
        self.clipping.check(block)
        self.input_faults += self._input_check.check(block)
        self._carriers.check(block, self._center_frequency_hz)
        self._group.carriers_hz = self._carriers.frequencies_hz
        # A value that is no number runs through the filters, and stops here: the detectors'
        # noise levels would never get rid of it.
        with np.errstate(invalid="ignore", over="ignore"):
            band = self._front_end.decimate(block)
            values = np.ascontiguousarray(band.samples).view(np.float32)
            # One product of the whole band costs less than a look at each of 64 channels.
            if not np.isfinite(np.dot(values, values)):
                self._suspect_s = self._memory_s + len(values) / band.sample_rate_hz
            channels = self._front_end.channelize(band)
        bursts: list[Pulse] = []
        suspect = self._suspect_s > 0.0
        if self.on_band is not None and not suspect:
            self.on_band(block, band)
        self._suspect_s -= len(band.samples) / band.sample_rate_hz
        for channel in channels:
            if suspect:
                channel = self._finite(channel)
            if self._on_channel is not None:
                self._on_channel(channel)
            number = channel.channel
            if number in self._group:
                self._group.put(number, channel.samples, channel.time_ns)
            if self._coded and (coded := self._coded.get(number)) is not None:
                bursts += coded.process(channel.samples, channel.time_ns)
        return self._reported(self._group.collect() + bursts)

    def _finite(self, channel: ChannelBlock) -> ChannelBlock:
        good = np.isfinite(channel.samples)
        if good.all():
            return channel
        self.invalid_samples += int(np.count_nonzero(~good))
        return replace(channel, samples=np.where(good, channel.samples, np.complex64(0.0)))

    def flush(self) -> list[Pulse]:
        """End the stream; return the pulses of all groups that are complete."""
        bursts = [pulse for coded in self._coded.values() for pulse in coded.flush()]
        return self._reported(self._group.flush() + bursts)

    def search_reports(self) -> list[SearchReport]:
        """Reports on searches without a pulse since the last call, one per second and tag."""
        searching: list[PulseDetector | CodedDetector] = [*self._group.detectors]
        searching += self._coded.values()
        return [report for detector in searching for report in detector.search_reports()]

    def _reported(self, pulses: list[Pulse]) -> list[Pulse]:
        """Remove pulses in excluded frequency ranges; mark pulses with receiver clipping."""
        covers = self.clipping.times.covers
        return [
            replace(pulse, clipped=True)
            if covers(pulse.start_time_ns, pulse.end_time_ns)
            else pulse
            for pulse in pulses
            if not any(low <= pulse.frequency_hz <= high for low, high in self._excluded_hz)
        ]


@dataclass(slots=True)
class Searched:
    """Conditions of the search at one tag's frequency, averaged over a run."""

    _reports: int = 0
    _usable: float = 0.0
    _weakest_db: float = 0.0

    def add(self, usable_share: float, weakest_enr_db: float) -> None:
        """Add a report on one second of the search."""
        self._reports += 1
        self._usable += usable_share
        self._weakest_db += weakest_enr_db

    @property
    def usable_share(self) -> float:
        """Share of the time during which no other signal covered the tag's frequency."""
        return self._usable / self._reports

    @property
    def weakest_enr_db(self) -> float:
        """Mean energy of a pulse over the noise density at which 90 % of groups are detected
        [dB].
        """
        return self._weakest_db / self._reports


@dataclass(slots=True)
class DetectionSummary:
    """Counters of one detection run over a source of samples."""

    samples: int = 0
    samples_lost: int = 0
    samples_unsure: int = 0
    """Number of lost samples, estimated from the arrival times of a live stream; uncertain if
    the receiver's crystal is far off."""
    signal_s: float = 0.0
    """Duration of the searched samples, including lost ones [s]."""
    elapsed_s: float = 0.0
    invalid_samples: int = 0
    stopped: bool = False
    """True if the detection run was stopped before the end of the samples."""
    pulses: dict[int, int] = field(default_factory=dict)
    confirmed: dict[int, int] = field(default_factory=dict)
    ambiguous: dict[int, int] = field(default_factory=dict)
    """Number of each tag's confirmed pulses that may belong to another listed tag."""
    ghosts: dict[tuple[int, int], int] = field(default_factory=dict)
    """Number of pulses that one tag caused as spurious signals in the receiver at another tag's
    frequency, by the pair (tag, causing tag)."""
    clipped: int = 0
    """Number of pulses during which the receiver's converter clipped."""
    clipped_share: float = 0.0
    """Share of the time in which the receiver's converter clipped."""
    input_faults: list[str] = field(default_factory=list)
    searched: dict[int, "Searched"] = field(default_factory=dict)

    @property
    def times_real_time(self) -> float:
        """Processing speed relative to real time [seconds of signal per second]."""
        return self.signal_s / self.elapsed_s if self.elapsed_s > 0.0 else 0.0

    def note(self, reports: Sequence[SearchReport]) -> None:
        """Add the detectors' reports on searched seconds."""
        for report in reports:
            if report.usable_share is not None and report.weakest_enr_db is not None:
                self.searched.setdefault(report.tag_id, Searched()).add(
                    report.usable_share, report.weakest_enr_db
                )

    def withdraw(self, samples: int, sample_rate_hz: float) -> None:
        """Subtract samples that were counted as lost but arrived late from a slow source."""
        unsure = min(samples, self.samples_unsure)
        self.samples_unsure -= unsure
        self.samples_lost -= samples - unsure
        self.signal_s -= samples / sample_rate_hz

    def count(self, pulse: Pulse) -> None:
        """Add a written pulse to the counters."""
        self.pulses[pulse.tag_id] += 1
        self.confirmed[pulse.tag_id] += pulse.confirmed
        self.clipped += pulse.clipped
        if pulse.ghost_of_tag_id is not None:
            pair = pulse.tag_id, pulse.ghost_of_tag_id
            self.ghosts[pair] = self.ghosts.get(pair, 0) + 1
        if pulse.confirmed and pulse.also_possible_tag_ids:
            self.ambiguous[pulse.tag_id] = self.ambiguous.get(pulse.tag_id, 0) + 1


def detect(
    source: SampleSource,
    tags: Sequence[Tag],
    write: Callable[[Sequence[Pulse]], None],
    *,
    frequency_window_hz: float = 500.0,
    operating_modes: Mapping[int, OperatingMode] | None = None,
    excluded_hz: Sequence[tuple[float, float]] = (),
    should_stop: Callable[[], bool] = lambda: False,
    on_progress: Callable[[int, int | None], None] | None = None,
    on_channel: Callable[[ChannelBlock], None] | None = None,
    on_band: Callable[[IQBlock, IQBlock], None] | None = None,
    on_reports: Callable[[Sequence[SearchReport]], None] | None = None,
    summary: DetectionSummary | None = None,
) -> DetectionSummary:
    """Find the pulses of tags in all samples of a source, which the caller closes.

    `write` is called with pulses as soon as they are found, `on_reports` with reports on
    seconds without a pulse; the other settings are those of `DetectionChain`. `should_stop` is
    called at least twice a second. `summary` is updated during the run, so that it is available
    after an error.
    """
    summary = DetectionSummary() if summary is None else summary
    chain = DetectionChain(
        tags,
        sample_rate_hz=source.sample_rate_hz,
        center_frequency_hz=source.center_frequency_hz,
        frequency_window_hz=frequency_window_hz,
        operating_modes=operating_modes,
        excluded_hz=excluded_hz,
        on_channel=on_channel,
        on_band=on_band,
    )
    summary.pulses = {tag.tag_id: 0 for tag in tags}
    summary.confirmed = dict(summary.pulses)
    begun_s = monotonic_s()

    def hand_over(found: list[Pulse]) -> None:
        if found:
            write(found)
        for pulse in found:
            summary.count(pulse)

    fault: UavrtError | None = None
    while not (stopped := should_stop()):
        try:
            block = source.read(_POLL_S)
        except EOFError:
            break
        except UavrtError as error:
            fault = error
            break
        if block is not None:
            hand_over(chain.process(block))
            _account(summary, block)
            summary.elapsed_s = monotonic_s() - begun_s
            if on_progress is not None:
                on_progress(summary.samples, source.total_samples)
        reports = chain.search_reports()
        summary.note(reports)
        if on_reports is not None:
            on_reports(reports)
    hand_over(chain.flush())
    summary.withdraw(getattr(source, "lost_withdrawn", 0), source.sample_rate_hz)
    summary.stopped = stopped
    summary.invalid_samples = chain.invalid_samples
    summary.clipped_share = chain.clipping.share
    summary.input_faults = chain.input_faults
    summary.elapsed_s = monotonic_s() - begun_s
    if fault is not None:
        raise fault
    return summary


def _account(summary: DetectionSummary, block: IQBlock) -> None:
    summary.samples += len(block.samples)
    summary.samples_lost += block.lost_before - block.unsure_before
    summary.samples_unsure += block.unsure_before
    summary.signal_s += (len(block.samples) + block.lost_before) / block.sample_rate_hz
