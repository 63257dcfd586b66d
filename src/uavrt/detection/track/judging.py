"""Measure a candidate in the samples, and decide whether it is a group of the tag.

If the energy in a pulse's window is six standard deviations above the noise, one frequency row
must contain 0.35 of it, from the pulse or a stronger signal. Otherwise the candidate is an
impulse. It would be worse to blank longer bursts in the samples: this would also blank pulses,
and pairs of impulses would be missed.
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.search.grid import Grid
from uavrt.detection.search.group_evidence import Evidence, gate
from uavrt.detection.search.hypotheses import Candidate, RateSearch
from uavrt.detection.search.known_pulses import KnownPulses
from uavrt.detection.search.refine import Measured, Refiner
from uavrt.detection.search.tuning import MEASURE
from uavrt.detection.signal.frequency_circle import apart_hz
from uavrt.detection.signal.sample_buffer import SampleBuffer
from uavrt.detection.track.bounds import Bounds
from uavrt.detection.track.other_signals.interval_check import Intervals
from uavrt.detection.track.tracks import Track, independent_cells
from uavrt.detection.track.tuning import FOLLOW, JUDGE
from uavrt.detection.track.two_rates import log_evidence


class Judge:
    """Accepts or rejects the candidates of one detector."""

    def __init__(
        self, bounds: Bounds, *, grid: Grid, buffer: SampleBuffer, refiner: Refiner
    ) -> None:
        tag = bounds.tag
        self._tag = tag
        self._bounds = bounds
        self._grid = grid
        self._buffer = buffer
        self._refiner = refiner
        self._gate = gate(tag)
        self._evidence = Evidence(tag, grid=grid, refiner=refiner) if self._gate < 1.0 else None
        self._intervals = Intervals(bounds, grid=grid, refiner=refiner)

    def suffices(
        self, candidate: Candidate, search: RateSearch, noise: NDArray[np.float32]
    ) -> bool:
        """True if noise makes such candidates less often than the false-alarm rate allows."""
        return self._evidence is None or self._evidence.suffices(candidate, search, noise)

    def known(self, tracks: list[Track]) -> KnownPulses | None:
        """Pulses of confirmed tracks, which need not be detected again; None if none."""
        pulses = [slot.measured for t in tracks if t.confirmed for slot in t.slots]
        return KnownPulses(self._grid, pulses) if pulses else None

    def unexplained(
        self, candidates: list[Candidate], search: RateSearch, known: KnownPulses | None
    ) -> list[Candidate]:
        """Remove the candidates of a search that known pulses explain."""
        if known is None or not candidates:
            return candidates
        explained = known.explain(
            np.array([candidate.columns for candidate in candidates]),
            np.array([candidate.row for candidate in candidates]),
            np.array([candidate.strength for candidate in candidates]),
            reach=search.reach,
        ).tolist()
        return [c for c, is_known in zip(candidates, explained, strict=True) if not is_known]

    def is_new(
        self, candidate: Candidate, search: RateSearch, taken: list[list[Measured]]
    ) -> bool:
        """True if a candidate is not explained by the groups just found."""
        pulses = [pulse for group in taken for pulse in group]
        known = KnownPulses(self._grid, pulses) if pulses else None
        return bool(self.unexplained([candidate], search, known))

    def measure(
        self, candidate: Candidate, search: RateSearch, noise: NDArray[np.float32]
    ) -> list[tuple[int, Measured]] | None:
        """Measure a candidate's pulses, each with its number among the K; None without any."""
        grid = self._grid
        starts = np.array([grid.start(column) for column in candidate.columns])
        half = (search.reach + 1) * grid.hop
        margin = half + grid.window + 2
        kept = (starts >= self._buffer.start) & (starts < self._refiner.upto - margin)
        if not kept.any():
            return None
        # At the stream's first sample the examined stretch is moved, not omitted.
        starts = np.maximum(starts, self._buffer.start + math.ceil(half) + 1)
        starts, offset = starts[kept], float(grid.offsets_hz[candidate.row])
        bin_hz = grid.sample_rate_hz / grid.window
        found: list[Measured] | None = None
        for _ in range(4):
            found = self._refiner.search(starts, half, offset, bin_hz / 4.0, noise, climb=True)
            if found is None:
                return None
            strongest = max(found, key=lambda pulse: pulse.power)
            if strongest.power < JUDGE.strong_power:
                break
            top_hz, power = self._refiner.strongest(strongest)
            apart = apart_hz(top_hz, strongest.offset_hz, grid.sample_rate_hz)
            if (
                bin_hz / 4.0 < abs(apart) < JUDGE.flank_bins * bin_hz
                and power > strongest.power
            ):
                offset = strongest.offset_hz + apart
            elif abs(strongest.offset_hz - offset) < JUDGE.off_row_hz:
                break
            else:
                # Because cells are limited, noise decides among the rows of a strong pulse.
                offset = strongest.offset_hz
        assert found is not None
        places = zip(np.flatnonzero(kept).tolist(), found, strict=True)
        received = [(place, pulse) for place, pulse in places if pulse.power > 0.0]
        return received or None

    def own_pulses(
        self,
        places: list[tuple[int, Measured]],
        search: RateSearch,
        *,
        candidate: Candidate,
        noise: NDArray[np.float32],
        floor: float,
    ) -> tuple[list[tuple[int, Measured]], str | None]:
        """Pulses of a group that are the tag's; or no pulses, and the reason for the rejection.

        In a long group of weak pulses, there is always a pulse near which noise, an impulse or
        another signal is stronger. Such a pulse is excluded, and the others must suffice.
        """
        reason = self._other_train(places, candidate, search, noise)
        if reason is not None:
            return [], reason
        own: list[tuple[int, Measured]] = []
        total, without, flanks = 0.0, candidate.score * search.threshold, 0.0
        for place, pulse in places:
            cause, more = self._stronger_cause(pulse, floor)
            if cause is not None:
                reason = reason or cause
                without -= max(0.0, min(pulse.power, search.limit) - 1.0)
                flanks += more
                continue
            own.append((place, pulse))
            pulse.contrast = self._refiner.contrast(pulse)
            local = pulse.power / pulse.contrast
            total += min(pulse.power / (local if local > 3.0 else 1.0), search.limit)
        least = search.threshold * self._gate
        few = JUDGE.pulses_per_foreign * (len(places) - len(own)) <= len(places)
        if reason is not None and (not few or without < least or flanks > JUDGE.most_flanks):
            return [], reason
        if total < least * 0.97:
            return [], "no contrast with its surroundings"
        return own, None

    def _other_train(
        self,
        places: list[tuple[int, Measured]],
        candidate: Candidate,
        search: RateSearch,
        noise: NDArray[np.float32],
    ) -> str | None:
        """Reason why a group's pulses cannot have the tag's interval; None if they can."""
        if (reason := self._bounds.refusal(places, search.rate)) is not None:
            return reason
        if self._is_the_other_rate([pulse for _, pulse in places], search, noise):
            return "a pulse of the other rate between"
        if len(self._tag.pulse_intervals_s) > 1 and _has_gaps(places):
            return "a pulse of the rate is missing"
        if search.k <= FOLLOW.most_alone:
            return None
        foreign = self._intervals.foreign_places(candidate, search, noise)
        if not foreign.any():
            return None
        without = candidate.score * search.threshold - sum(
            max(0.0, min(pulse.power, search.limit) - 1.0)
            for place, pulse in places
            if foreign[place]
        )
        if without < search.threshold * self._gate:
            return "another tag's interval"
        return None

    def _stronger_cause(self, pulse: Measured, floor: float) -> tuple[str | None, float]:
        """Name of a stronger signal that explains a pulse, or None; and the excess power.

        The excess is the power above that allowed near the pulse [noise powers]; it is 0 if
        there is no such power.
        """
        rate_hz = self._grid.sample_rate_hz
        bin_hz = rate_hz / self._grid.window
        offset, power = self._refiner.strongest(pulse)
        apart = abs(apart_hz(offset, pulse.offset_hz, rate_hz))
        allowed = JUDGE.flank_ratio * max(pulse.power, JUDGE.weak_power)
        if apart < bin_hz / 2.0 and power > allowed:
            return "flank of a stronger pulse", power - allowed
        if pulse.power > JUDGE.weak_power and _leak(power, apart / bin_hz) > pulse.power:
            if self._bounds.off_frequency(offset) and power > JUDGE.flank_ratio * pulse.power:
                return "side lobe of a signal outside the searched band", 0.0
            if apart > bin_hz and power > JUDGE.lobe_ratio * pulse.power:
                return "side lobe of a stronger signal", 0.0
        if pulse.power > JUDGE.loud_power and self._refiner.is_impulse(pulse, floor):
            return "an impulse", 0.0
        return None, 0.0

    def _is_the_other_rate(
        self, group: list[Measured], search: RateSearch, noise: NDArray[np.float32]
    ) -> bool:
        """True if there are pulses between those of a group that show the tag's other rate.

        Every second pulse sent at one rate makes a train of twice the interval.
        """
        if len(self._tag.pulse_intervals_s) < 2 or len(group) < 2:
            return False
        nominal = self._tag.pulse_intervals_s
        scale = (group[-1].start - group[0].start) / (
            max(1, search.k - 1) * nominal[search.rate - 1]
        )
        other = nominal[2 - search.rate] * scale
        strength = min(max(sum(p.enr for p in group) / len(group), 8.0), 30.0)
        width = self._grid.window
        half = self._tag.interval_jitter_s * self._grid.sample_rate_hz + width / 8.0
        # The best of many cells counts: even noise has a likely one.
        half_s = half / self._grid.sample_rate_hz
        cells = independent_cells(self._tag, half_s, MEASURE.track_band_hz)
        price = math.log(FOLLOW.more_cells * cells)
        evidence = 0.0
        at = group[0].start + other
        while at < group[-1].start - width:
            if all(abs(at - p.start) > half + width for p in group):
                found = self._refiner.search(
                    np.array([at]), half, group[0].offset_hz, MEASURE.track_band_hz, noise
                )
                if found is not None:
                    evidence += log_evidence(found[0].power, strength) - price
            at += other
        return evidence > 0.0

    def overlaps(self, track: Track, group: list[Measured]) -> bool:
        """True if a candidate group shares a pulse with a track."""
        return share_a_pulse(group, [s.measured for s in track.slots], self._grid.window)

    def equals(self, track: Track, group: list[Measured]) -> bool:
        """True if a track has all pulses of a candidate group, or all but one."""
        own = [s.measured for s in track.slots]
        shared = sum(share_a_pulse([m], own, self._grid.window) for m in group)
        return shared >= len(group) - 1


def _leak(power: float, apart_bins: float) -> float:
    """Upper limit of the leaked power of a rectangular pulse, at a distance in frequency.

    The leakage is at most 1 / (pi df tp)^2 of the pulse's power; its amplitude is doubled as a
    margin. The limit also holds for a part of a pulse.
    """
    return power if apart_bins < 2.0 / math.pi else 4.0 * power / (math.pi * apart_bins) ** 2


def _has_gaps(places: list[tuple[int, Measured]]) -> bool:
    """True if some pulses of a group are missing.

    This happens if the tag sends at its other pulse interval, so that every second expected
    pulse is absent. In a short group, the weakest pulse is compared with the strongest. In a
    long group of weak pulses, some are low by chance. There, every other expected pulse is
    tested jointly (log likelihood ratio): as strong as the rest, or absent.
    """
    powers = [pulse.power for _, pulse in places]
    if len(places) <= JUDGE.few_pulses:
        return min(powers) < JUDGE.uniformity * min(60.0, max(powers))
    halves = [[m.power for place, m in places if place % 2 == odd] for odd in (0, 1)]
    if not all(halves):
        return False
    for half, between in (halves, halves[::-1]):
        strength = min(max(sum(between) / len(between) - 1.0, 0.1), 60.0)
        if sum(log_evidence(power, strength) for power in half) < 0.0:
            return True
    return False


def share_a_pulse(one: list[Measured], two: list[Measured], window: int) -> bool:
    """True if two groups have simultaneous pulses, at any frequency (a pulse leaks)."""
    return any(abs(a.start - b.start) < 0.75 * window for a in one for b in two)
