"""Manage the tracks of one detector, from candidates to reported pulses."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from uavrt.detection.modes import OperatingMode
from uavrt.detection.search.grid import make_grid
from uavrt.detection.search.hypotheses import Candidate, RateSearch
from uavrt.detection.search.refine import Measured, Refiner
from uavrt.detection.signal.sample_buffer import Counters, SampleBuffer
from uavrt.detection.track.bounds import Bounds
from uavrt.detection.track.chance import BurstRates
from uavrt.detection.track.following import Follower
from uavrt.detection.track.judging import Judge, share_a_pulse
from uavrt.detection.track.other_signals.other_bursts import Bursts
from uavrt.detection.track.pulse_reporting import Reporter
from uavrt.detection.track.search_band import SearchBand
from uavrt.detection.track.tracks import Track
from uavrt.detection.track.transmitters.train_senders import Senders
from uavrt.detection.track.tuning import BAND
from uavrt.detection.track.unlocked import drop_old, join_group


class SearchWindow:
    """Search around one frequency: its band, the test of candidates, and its tracks."""

    def __init__(self, bounds: Bounds, buffer: SampleBuffer, batch_s: float) -> None:
        self.bounds, self._buffer, self._batch_s = bounds, buffer, batch_s
        self.grid = grid = make_grid(
            sample_rate_hz=bounds.sample_rate_hz,
            pulse_width_s=bounds.tag.pulse_width_s,
            offset_hz=bounds.home_hz,
            half_width_hz=bounds.half_width_hz,
            slide_hz=bounds.tag.frequency_slide_hz,
        )
        self.refiner = refiner = Refiner(grid, buffer)
        self.judge = Judge(bounds, grid=grid, buffer=buffer, refiner=refiner)
        self.follower = Follower(bounds, grid=grid, buffer=buffer, refiner=refiner)

    def restart(self) -> None:
        """Begin again with a new band, without a noise estimate."""
        self.band = SearchBand(
            grid=self.grid, buffer=self._buffer, bounds=self.bounds, batch_s=self._batch_s
        )
        self.refiner.leveller = self.band.leveller

    def take_over(self, before: "SearchWindow", upto: int) -> None:
        """Continue the search of another window from sample `upto` on."""
        self.follower.epoch_ns = before.follower.epoch_ns
        self.refiner.upto = upto
        self.restart()
        self.band.take_over(before.band, upto)

    def find_again(self, track: Track) -> None:
        """Correct the frequency of a track whose pulses were found with another slide.

        The filter for a constant frequency finds a sliding pulse at any part of its slide.
        """
        start = np.array([track.slots[-1].measured.start])
        band_hz = 0.5 * abs(self.grid.slide_hz)
        found = self.refiner.search(
            start, 0.5 * self.grid.window, track.offset_hz, band_hz, self.band.noise
        )
        if found is not None:
            track.offset_hz = track.steady_hz = found[0].offset_hz


class Tracking:
    """Manages the tracks of one tag's detector, from candidates to reported pulses."""

    def __init__(
        self,
        mode: OperatingMode,
        window: SearchWindow,
        buffer: SampleBuffer,
        reporter: Reporter,
        *,
        center_frequency_hz: float,
        counters: Counters,
    ) -> None:
        self._mode, self._window, self._buffer = mode, window, buffer
        self._reporter, self._counters = reporter, counters
        self._center_hz = center_frequency_hz
        self.senders: Senders[Any] | None = None
        """Assigns tracks to tags, together with the detectors of overlapping bands."""
        self.restart(window)

    def restart(self, window: SearchWindow, tracks: Sequence[Track] = ()) -> None:
        """Begin again in a window, with the given tracks."""
        self._window, self.tracks = window, list(tracks)
        self._bursts: Bursts | None = None
        self._suppresses = False
        """True if the band suppresses candidates that known pulses explain."""

    def move(self, window: SearchWindow) -> None:
        """Continue in another window, with the tracks that lie in it."""
        before, self._window = self._window, window
        if window.grid.slide_hz != before.grid.slide_hz:
            for track in self.tracks:
                window.find_again(track)
        self.tracks = [t for t in self.tracks if not window.bounds.left_by(t)]

    @property
    def _now_s(self) -> float:
        return self._window.follower.seconds(self._window.refiner.upto)

    def conclude(
        self, results: list[tuple[RateSearch, list[Candidate]]], upto: int, *, floor: float
    ) -> None:
        """Test the candidates up to index `upto`, follow the tracks and report pulses."""
        window = self._window
        self._bursts = None
        for search, found in results:
            if found:
                self._consider(found, search, floor)
        if self._mode is OperatingMode.ALL_NEVER_LOCK:
            drop_old(self.tracks, self._now_s)
        elif self.tracks or self._suppresses:
            window.follower.follow(
                self.tracks,
                upto,
                self._settle,
                noise=window.band.noise,
                floor=floor,
                around=self._around,
            )
            known = window.judge.known(self.tracks)
            self._suppresses = known is not None
            window.band.suppress(known)

    def _consider(self, found: list[Candidate], search: RateSearch, floor: float) -> None:
        window, judge = self._window, self._window.judge
        taken: list[list[Measured]] = []
        untracked = self._mode is OperatingMode.ALL_NEVER_LOCK
        known = None if untracked else judge.known(self.tracks)
        for candidate in judge.unexplained(found, search, known):
            if not judge.is_new(candidate, search, taken):
                continue
            if not judge.suffices(candidate, search, window.band.noise):
                continue
            places = judge.measure(candidate, search, window.band.noise)
            if places is None:
                continue
            group = [pulse for _, pulse in places]
            if any(share_a_pulse(group, other, window.grid.window) for other in taken):
                continue
            taken.append(group)
            clash = [t for t in self.tracks if judge.overlaps(t, group)]
            if any(t.confirmed or judge.equals(t, group) for t in clash) and not untracked:
                continue
            places, reason = judge.own_pulses(
                places,
                search,
                candidate=candidate,
                noise=window.band.noise,
                floor=floor,
            )
            if reason is not None:
                self._counters.reject(reason)
                continue
            pulses = [
                (place, window.follower.seconds(m.start), self._buffer.time_ns(m.start), m)
                for place, m in places
            ]
            if untracked:
                track = join_group(
                    self.tracks,
                    pulses,
                    rate=search.rate,
                    sample_rate_hz=self._buffer.sample_rate_hz,
                    around=self._around,
                )
                if track is not None:
                    self._reporter.report(track)
                if track is not None or clash:
                    continue  # these are known pulses, at a frequency to which they leak
            self._begin(pulses, candidate, held=bool(clash))

    def _begin(
        self,
        pulses: list[tuple[int, float, int, Measured]],
        candidate: Candidate,
        *,
        held: bool,
    ) -> None:
        track = Track(
            tag=self._window.bounds.tag,
            rate=candidate.rate,
            offset_hz=0.0,
            score=max(1.0, candidate.score),
        )
        track.begin(pulses, self._around)
        track.clashing = held
        if self.senders is not None:
            track.held = True  # until the assignment is decided
        elif self._mode is not OperatingMode.ALL_NEVER_LOCK:
            track.held = held or self.owner() is not None
        self._counters.tracks += 1
        self.tracks.append(track)
        self._reporter.report(track)
        if len(self.tracks) > BAND.most_tracks:
            self.tracks.remove(
                min(
                    self.tracks,
                    key=lambda t: (t.confirmed, not t.held, min(t.odds, 0.0), t.score),
                )
            )

    def _around(self, track: Track, found: Measured) -> BurstRates:
        if self._bursts is None:
            known = [
                (slot.measured.start, slot.measured.offset_hz, math.inf)
                for t in self.tracks
                if t.sure
                for slot in t.received
            ]
            if self.senders is not None:
                center_hz = self._center_hz
                times_ns, how = self.senders.confirmed_pulses.at_frequencies(
                    lambda hz: self._window.bounds.on_frequency(hz - center_hz)
                )
                offsets_hz = (how[:, 0] - center_hz).tolist()
                indices = self._buffer.indices(times_ns).tolist()
                known += zip(indices, offsets_hz, how[:, 1].tolist(), strict=True)
            self._bursts = self._window.band.bursts(known)
        return self._bursts.around(track, found)

    def _settle(self) -> None:
        if self.senders is not None:
            for track in self.tracks:
                # Groups just confirmed are assigned to tags first.
                if track.confirmed == track.confirmed_at_assignment:
                    self._reporter.report(track)
        elif self.tracks:
            self._reporter.settle(self.tracks, self._window.bounds.home_hz, self._now_s)

    def owner(self) -> Track | None:
        """The track that is the tag's; None if no confirmed track is."""
        if self.senders is None:
            return self._reporter.owner(self.tracks, self._window.bounds.home_hz, self._now_s)
        tags = (t for t in self.tracks if t.confirmed and t.ghost_of is None)
        return next((t for t in tags if not (t.held or t.dead)), None)
