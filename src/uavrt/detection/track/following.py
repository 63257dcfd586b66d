"""Extend tracks through the samples, pulse by pulse."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from uavrt.core.units import ns_from_s
from uavrt.detection.search.grid import Grid
from uavrt.detection.search.refine import Measured, Refiner
from uavrt.detection.search.tuning import MEASURE
from uavrt.detection.signal.sample_buffer import SampleBuffer
from uavrt.detection.track.bounds import Bounds
from uavrt.detection.track.chance import QUIET, BurstRates
from uavrt.detection.track.other_signals.masking import (
    hiding,
    is_due,
    stronger_tracks,
    strongest_first,
)
from uavrt.detection.track.tracks import Slot, Track, independent_cells
from uavrt.detection.track.tuning import FOLLOW
from uavrt.detection.track.two_rates import change_rate, decide_rate, lags, start_other_rate


def _quiet(_track: Track, _found: Measured) -> BurstRates:
    """Return burst rates of zero; a module-level function, so that detectors can be pickled."""
    return QUIET


class Follower:
    """Follows the tracks of one detector from pulse to pulse."""

    def __init__(
        self, bounds: Bounds, *, grid: Grid, buffer: SampleBuffer, refiner: Refiner
    ) -> None:
        self._tag = bounds.tag
        self._bounds = bounds
        self._grid = grid
        self._buffer = buffer
        self._refiner = refiner
        self.epoch_ns = 0
        """Absolute time at which the time scale of the tracks is zero [ns, UTC]."""
        self._tracks: list[Track] = []
        self._around: Callable[[Track, Measured], BurstRates] = _quiet

    def seconds(self, index: float) -> float:
        """Time of a sample on the time scale of the tracks [s]."""
        return (self._buffer.time_ns(index) - self.epoch_ns) * 1e-9

    def follow(
        self,
        tracks: list[Track],
        upto: int,
        settle: Callable[[], None],
        *,
        noise: NDArray[np.float32],
        floor: float,
        around: Callable[[Track, Measured], BurstRates],
    ) -> None:
        """Follow tracks up to sample `upto`, and drop those that have ended.

        `settle` is called after each pulse.
        """
        self._tracks = tracks
        self._around = around
        if not tracks:
            return
        for track in strongest_first(tracks):
            while not track.dead and self._step(track, upto, noise=noise, floor=floor):
                self._follow_other_rate(track, upto, settle, noise=noise, floor=floor)
                settle()
            # Samples that the other rate still needed may have arrived now.
            self._follow_other_rate(track, upto, settle, noise=noise, floor=floor)
        settle()
        tracks[:] = [t for t in tracks if not t.dead]

    def carried(self, tracks: list[Track]) -> tuple[Track, ...]:
        """Confirmed tracks that continue after a jump of the clock and must be confirmed again;
        if samples are missing, no pulse fits them, and they end.
        """
        end_s = self.seconds(self._buffer.end)
        kept = tuple(track for track in tracks if track.confirmed and not track.held)
        for track in kept:
            track.doubt(end_s)
        return kept

    def _follow_other_rate(
        self,
        track: Track,
        upto: int,
        settle: Callable[[], None],
        *,
        noise: NDArray[np.float32],
        floor: float,
    ) -> None:
        if len(self._tag.pulse_intervals_s) < 2 or not track.confirmed or track.dead:
            return
        start_other_rate(track)
        for other in track.at_other_rate:
            while not other.dead and lags(track, other):
                if not self._step(other, upto, noise=noise, floor=floor):
                    return
        winner = decide_rate(track)
        if winner is not None:
            settle()  # pulses found at the previous rate
            if self._belongs_to_other(track, winner.last_accepted_s):
                track.dead = True
            else:
                change_rate(track, winner)

    def _belongs_to_other(self, track: Track, time_s: float) -> bool:
        """True if a pulse, the only recent one of a track, belongs to another track."""
        near_s = 0.75 * self._tag.pulse_width_s
        return any(
            abs(slot.time_s - time_s) < near_s
            for other in self._tracks
            if other is not track and other.confirmed and not other.dead
            for slot in other.received
        )

    def _step(
        self, track: Track, upto: int, *, noise: NDArray[np.float32], floor: float
    ) -> bool:
        grid = self._grid
        time_s, half_s = track.expected()
        half = half_s * grid.sample_rate_hz
        start = self._buffer.index(self.epoch_ns + ns_from_s(time_s))
        if start + half + grid.window + 3 > upto:
            return False
        weights = self._buffer.weights(np.array([start]), grid.window)
        if weights is not None and not weights[0]:
            track.skip()
            return True
        others = stronger_tracks(track, self._tracks, sample_rate_hz=grid.sample_rate_hz)
        masked_s = half_s + self._tag.pulse_width_s
        around = {"earliest_s": time_s - masked_s, "latest_s": time_s + masked_s}
        if others and is_due(others, **around):
            return False
        band = MEASURE.track_band_hz
        with self._refiner.without(hiding(track, others, **around)):
            found = self._refiner.search(
                np.array([start]),
                half,
                track.offset_hz,
                band,
                noise,
                spread=track.spread_s() * grid.sample_rate_hz,
            )
            if found is not None and track.confirmed and self._refiner.loses(start):
                found = [self._broken(track, start, half, found[0], noise)]
            if found is not None and found[0].power > 8.0:
                found = None if self._refiner.is_impulse(found[0], floor) else found
        if found is None:
            track.skip()
            return True
        slot = self._slot(track, found[0], half_s)
        if slot.bursts.alike_per_s > 0.0 and track.against_bursts(slot) < 0.0:
            slot = self._weaker_pulse(track, slot, start, half, noise) or slot
        was_confirmed = track.confirmed
        track.interval_open = not was_confirmed and self._bounds.leaves_open(track)
        track.step(slot)
        # Otherwise a stronger signal's flanks pull the track to its frequency or interval.
        if self._bounds.left_by(track):
            track.slots.pop()
            track.confirmed &= was_confirmed
            track.dead = True
        return True

    def _broken(
        self,
        track: Track,
        start: float,
        half: float,
        found: Measured,
        noise: NDArray[np.float32],
    ) -> Measured:
        """Stronger of two measurements of a pulse near losses: with and without phase break."""
        if found.power < FOLLOW.whole_power:
            spread = track.spread_s() * self._grid.sample_rate_hz
            offset_hz, band_hz = track.offset_hz, MEASURE.track_band_hz
            broken = self._refiner.search_broken(
                start, half, offset_hz, band_hz, noise, spread=spread
            )
            if broken is not None and broken.power > found.power:
                return broken
        found.offset_hz = track.offset_hz + FOLLOW.broken_weight * (
            found.offset_hz - track.offset_hz
        )
        return found

    def _slot(self, track: Track, measured: Measured, half_s: float) -> Slot:
        return Slot(
            number=0,
            time_s=self.seconds(measured.start),
            time_ns=self._buffer.time_ns(measured.start),
            measured=measured,
            volume=independent_cells(self._tag, half_s, MEASURE.track_band_hz),
            bursts=self._around(track, measured),
        )

    def _weaker_pulse(
        self, track: Track, burst: Slot, start: float, half: float, noise: NDArray[np.float32]
    ) -> Slot | None:
        """Search before and after a strong burst for the tag's weaker pulse, or return None."""
        at, window = burst.measured.start, self._grid.window
        best: Slot | None = None
        least = 0.0
        with self._refiner.without([burst.measured]):
            for low, high in ((start - half, at - window), (at + window, start + half)):
                if high < low:
                    continue
                found = self._refiner.search(
                    np.array([0.5 * (low + high)]),
                    0.5 * (high - low),
                    track.offset_hz,
                    MEASURE.track_band_hz,
                    noise,
                )
                if found is None:
                    continue
                slot = self._slot(track, found[0], half / self._grid.sample_rate_hz)
                odds = track.against_bursts(slot)
                if odds > least:
                    best, least = slot, odds
        return best
