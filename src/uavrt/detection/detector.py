"""Detect the pulses of one tag: samples of a channel in, pulses out.

Samples are collected for up to 0.44 s. Carriers and impulses are removed, and a spectrogram is
computed and searched for groups of K pulses. A group begins a track, which predicts the
following pulses. Every pulse is reported once (docs/explanation/detection.md).
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Pulse, SearchReport, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.detection.detector_checks import check_searchable
from uavrt.detection.modes import LOCK_HALF_WIDTH_HZ, OperatingMode
from uavrt.detection.signal.block_order import Intake, LongestBlock
from uavrt.detection.signal.frequency_circle import apart_hz, in_channel_hz
from uavrt.detection.signal.sample_buffer import Counters
from uavrt.detection.signal.signal_cleaning import Cleaner
from uavrt.detection.track.bounds import Bounds
from uavrt.detection.track.frequency_slide import SlideEstimate
from uavrt.detection.track.pulse_reporting import Reporter
from uavrt.detection.track.search_band import SearchBand
from uavrt.detection.track.tracking import SearchWindow, Tracking
from uavrt.detection.track.tracks import Track

BATCH_S = 0.44
"""Maximum time for which samples are collected before the search continues [s]. Five blocks of
87.4 ms take 0.437 s. A pulse is reported 0.04 s after its end at the earliest."""
_FIRST_STEP = 0.7639
"""Longest wait for the first search, as a share of `BATCH_S`; three blocks of samples suffice
to estimate the noise."""


class PulseDetector:
    """Finds one tag's pulses in the samples of a channel.

    Parameters
    ----------
    tag : Tag
        Tag to search for.
    sample_rate_hz : float
        Rate of the channel's samples, more than the width of the pulse's spectrum.
    center_frequency_hz : float
        Absolute frequency of the channel's centre.
    frequency_window_hz : float
        Half-width of the search around the tag's nominal frequency; at or above half the
        sample rate: the whole channel.
    operating_mode : OperatingMode or str
        Use of a frequency once it is found.
    excluded_hz : sequence of (float, float)
        Absolute bands, limits included, in which no signal is the tag.

    Raises
    ------
    ConfigError
        The tag is outside of the channel, or a number is impossible.
    """

    def __init__(
        self,
        tag: Tag,
        *,
        sample_rate_hz: float,
        center_frequency_hz: float,
        frequency_window_hz: float = 500.0,
        operating_mode: OperatingMode | str = OperatingMode.SEARCH_SOFT_LOCK,
        excluded_hz: Sequence[tuple[float, float]] = (),
    ) -> None:
        self.tag = tag
        self.sample_rate_hz = float(sample_rate_hz)
        self.center_frequency_hz = float(center_frequency_hz)
        self.operating_mode = OperatingMode(operating_mode)
        check_searchable(
            tag, self.sample_rate_hz, self.center_frequency_hz, frequency_window_hz
        )
        self._nominal_hz = tag.frequency_hz - self.center_frequency_hz
        if self.operating_mode is OperatingMode.KNOWN_HARD_LOCK:
            frequency_window_hz = min(frequency_window_hz, LOCK_HALF_WIDTH_HZ)
        elif self.operating_mode is OperatingMode.ALL_NEVER_LOCK:
            frequency_window_hz = math.inf
        self.frequency_window_hz = frequency_window_hz
        self._excluded_hz = tuple(
            (low - center_frequency_hz, high - center_frequency_hz) for low, high in excluded_hz
        )
        self.counters = Counters()
        self.locked_frequency_hz: float | None = None
        """Absolute frequency of a hard lock [Hz], until `reset`; None if not locked."""
        self._longest = LongestBlock()
        self._intake = Intake(tag, sample_rate_hz=self.sample_rate_hz, counters=self.counters)
        self._buffer = self._intake.buffer
        self.slide = SlideEstimate(tag, self._buffer)
        self._batch = round(BATCH_S * self.sample_rate_hz)
        self._reporter = Reporter(
            tag,
            center_frequency_hz=self.center_frequency_hz,
            sample_rate_hz=self.sample_rate_hz,
            counters=self.counters,
        )
        self._window = self._window_at(self._nominal_hz, self.frequency_window_hz)
        self.tracking = Tracking(
            *(self.operating_mode, self._window, self._buffer, self._reporter),
            center_frequency_hz=self.center_frequency_hz,
            counters=self.counters,
        )
        self._start()

    def _window_at(self, home_hz: float, half_width_hz: float) -> SearchWindow:
        bounds = Bounds(
            tag=replace(self.tag, frequency_slide_hz=self.slide.hz),
            home_hz=home_hz,
            half_width_hz=half_width_hz,
            sample_rate_hz=self.sample_rate_hz,
            excluded_hz=self._excluded_hz,
        )
        return SearchWindow(bounds, self._buffer, BATCH_S)

    def _start(self, epoch_ns: int = 0, tracks: tuple[Track, ...] = ()) -> None:
        self._intake.clear()
        self._window.restart()
        self._cleaner = Cleaner(
            sample_rate_hz=self.sample_rate_hz,
            pulse_width_s=self.tag.pulse_width_s,
            counters=self.counters,
            band_hz=(self._window.bounds.home_hz, self._window.bounds.half_width_hz),
        )
        self._advances = 0
        self._clean = 0
        # All tags of a flight at the same block: shared work is done once, with warm caches.
        # 100 tags cost 40 % less than spread over five blocks, and take 20 ms of 87 ms.
        self._patience = round(self._batch * _FIRST_STEP)
        self.tracking.restart(self._window, tracks)
        self._window.follower.epoch_ns = epoch_ns

    def reset(self) -> None:
        """Clear samples, tracks and the locked frequency; keep counters and group numbers."""
        self.locked_frequency_hz = None
        self.slide = SlideEstimate(self.tag, self._buffer)
        self._window = self._window_at(self._nominal_hz, self.frequency_window_hz)
        self._start()

    def process(self, samples: NDArray[np.complex64], time_ns: int) -> list[Pulse]:
        """Process a block of samples.

        Parameters
        ----------
        samples : ndarray of complex64, shape (n,)
            Samples at `sample_rate_hz`, centred on `center_frequency_hz`; any number of them.
        time_ns : int
            Time at the antenna of the first sample [ns, UTC]. A gap after the previous samples
            counts as lost samples; a small deviation counts as a slow clock.

        Returns
        -------
        list of Pulse
            Pulses found since the last call, in the order of finding.
        """
        length = self.take(samples, time_ns)
        while (upto := self.next_step(length)) is not None:
            self._advance(upto)
        return self.drain()

    def take_all(self, blocks: Sequence[tuple[NDArray[np.complex64], int]]) -> None:
        """Add several blocks without searching."""
        count = 0 if self._intake.stale_blocks else self._buffer.extend(blocks)
        for samples, _ in blocks[:count]:
            self._longest.note(len(samples))
            self.counters.samples += len(samples)
        for samples, time_ns in blocks[count:]:
            self.take(samples, time_ns)

    def take(self, samples: NDArray[np.complex64], time_ns: int) -> int:
        """Add a block without searching; return its length, 0 if refused. A `DetectorGroup`
        calls this, `next_step`, `advance` and `drain` separately.
        """
        self._longest.note(len(samples))
        if not self._intake.stale_blocks and self._buffer.extend(((samples, time_ns),)):
            self.counters.samples += len(samples)
            return len(samples)
        samples = np.ascontiguousarray(samples, np.complex64)
        if not len(samples):
            return 0
        if self._buffer.empty:
            self._window.follower.epoch_ns = time_ns
        after = self._clean + self._cleaner.margin
        outcome = self._intake.admit(samples, time_ns, after=after)
        if outcome in ("later", "earlier"):
            if outcome == "later":
                self._advance(self._buffer.end)
                if self.tracking.senders is not None:
                    self.tracking.senders.settle()
                self._start(time_ns, self._window.follower.carried(self.tracks))
            else:
                self._start(time_ns)
            outcome = self._intake.admit(samples, time_ns, after=0)
        return len(samples) if outcome == "taken" else 0

    def next_step(self, length: int) -> int | None:
        """Index up to which the samples can be searched after a new block; None: wait for more.

        `length`: length of the new block [samples]. The search must not wait for another block
        if that would make it late.
        """
        fresh = self._buffer.end - self._clean - self._cleaner.margin
        if not length or fresh <= self._patience - self._longest.length:
            return None
        fresh = min(fresh, self._batch)
        if fresh <= 0 or self._intake.may_be_filled(self._clean + fresh + self._cleaner.margin):
            return None
        return self._clean + fresh

    def samples_to_wait(self) -> int:
        """Number of samples that can be added before a search may be due; 0: check always."""
        if self._intake.stale_blocks or self._buffer.empty or self._buffer.holes:
            return 0
        fresh = self._buffer.end - self._clean - self._cleaner.margin
        return max(0, self._patience - fresh)

    def drain(self) -> list[Pulse]:
        """Return the pulses found since the last call."""
        return self._reporter.drain()

    def flush(self) -> list[Pulse]:
        """End the stream: search the remaining samples, and return the remaining pulses."""
        self.search_rest()
        return self.report_rest()

    def search_rest(self) -> None:
        """Search the remaining samples; first part of `flush`, for a `DetectorGroup`."""
        if not self._buffer.empty:
            # A track searches slightly beyond its expected pulse, where there are no samples.
            beyond_s = 3.0 * self.tag.interval_uncertainty_s + self.tag.interval_jitter_s
            beyond = math.ceil(beyond_s * self.sample_rate_hz) + 2 * self._window.grid.window
            self._buffer.append_hole(beyond)
            self._advance(self._buffer.end, last=True)

    def report_rest(self) -> list[Pulse]:
        """Report all complete groups, and reset; second part of `flush`."""
        if not self._buffer.empty:
            for track in self.tracks:
                self._reporter.report(track, last=True)
        pulses = self._reporter.drain()
        self._start()
        return pulses

    def search_reports(self) -> list[SearchReport]:
        """Return the search reports since the last call, one a second."""
        return self._reporter.drain_reports()

    @property
    def tracks(self) -> list[Track]:
        """All tracks in the searched band, including those of other tags."""
        return self.tracking.tracks

    @property
    def band(self) -> SearchBand:
        """The band that is searched at present."""
        return self._window.band

    @property
    def now_s(self) -> float:
        """Time up to which samples were searched [s], on the time scale of the tracks."""
        return self._window.follower.seconds(self._clean)

    @property
    def half_width_hz(self) -> float:
        """Half-width of the search around the nominal frequency [Hz]."""
        return min(self.frequency_window_hz, self.sample_rate_hz / 2.0)

    def absolute_hz(self, track: Track) -> float:
        """Absolute frequency of a track [Hz]; of its aliases, the one nearest to the tag's."""
        away_hz = apart_hz(track.offset_hz, self._nominal_hz, self.sample_rate_hz)
        return self.tag.frequency_hz + away_hz

    def may_be_at(self, frequency_hz: float) -> bool:
        """True if a signal at this absolute frequency may be the tag's."""
        offset_hz = frequency_hz - self.center_frequency_hz
        return self._window.bounds.off_frequency(offset_hz) is None

    def time_ns(self, time_s: float) -> float:
        """Convert a time on the scale of the tracks to absolute time [ns]."""
        return self._window.follower.epoch_ns + NANOSECONDS_PER_SECOND * time_s

    def report(self, track: Track) -> None:
        """Report a track's pulses, unless the track is doubtful or another is the tag's."""
        self._reporter.report(track)

    def other_signals(self) -> list[Track]:
        """Confirmed tracks that have the tag's interval but are not taken for the tag."""
        return [t for t in self.tracks if t.confirmed and t.held]

    def _advance(self, upto: int, *, last: bool = False) -> None:
        if upto > self._clean or last:
            self.clean(upto)
            self.search(last=last)

    def clean(self, upto: int) -> None:
        """Clean the samples up to an index, as returned by `next_step`; `search` follows."""
        renew = self._advances % 6 == 1 or self.band.leveller.unsteady
        self._cleaner.clean(self._buffer, self._clean, upto, renew=renew)
        self.band.note_cleaning(
            many_lines=self._cleaner.many_lines, whitened=self._cleaner.whitening
        )
        self._advances += 1
        self._window.refiner.upto = upto
        self._clean = upto
        self._patience = self._batch

    def search(self, *, last: bool = False) -> None:
        """Search the cleaned samples, follow tracks, and report pulses."""
        upto = self._clean
        results = self.band.advance(upto, last=last)
        if results is None:
            return
        self.tracking.conclude(results, upto, floor=self._cleaner.mean_floor)
        if self.operating_mode is OperatingMode.SEARCH_HARD_LOCK:
            self._lock()
        follows = self.operating_mode is not OperatingMode.ALL_NEVER_LOCK
        if follows and self.slide.add(self.tracking.owner(), upto):
            self._change_window(self._window.bounds.home_hz, self._window.bounds.half_width_hz)
        self._reporter.searched(self._buffer.time_ns(upto), self.band, self._cleaner.occupancy)

    def _lock(self) -> None:
        """Lock to the frequency of the tag once two of its groups were received."""
        owner = self.tracking.owner()
        if owner is None or owner.number < 2 * self.tag.k - 1 or owner.since_accepted:
            return
        rate_hz, found_hz = self.sample_rate_hz, owner.offset_hz
        off_hz = abs(apart_hz(found_hz, self._window.bounds.home_hz, rate_hz))
        if self.locked_frequency_hz is not None and off_hz < 0.5 * LOCK_HALF_WIDTH_HZ:
            return
        found_hz = in_channel_hz(found_hz, nominal_hz=self._nominal_hz, sample_rate_hz=rate_hz)
        self.locked_frequency_hz = self.center_frequency_hz + found_hz
        self._change_window(found_hz, min(self.frequency_window_hz, LOCK_HALF_WIDTH_HZ))

    def _change_window(self, home_hz: float, half_width_hz: float) -> None:
        """Continue the search in another band, or with another filter."""
        before, self._window = self._window, self._window_at(home_hz, half_width_hz)
        self._window.take_over(before, self._clean)
        self.tracking.move(self._window)
