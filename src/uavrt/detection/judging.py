"""Candidates measured on the samples: is it a group of the tag, or something else."""

import math

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.bounds import Bounds
from uavrt.detection.circle import apart_hz
from uavrt.detection.evidence import Evidence, gate
from uavrt.detection.grid import Grid
from uavrt.detection.known import KnownPulses
from uavrt.detection.refine import TRACK_BAND_HZ, Measured, Refiner
from uavrt.detection.rivals import log_evidence
from uavrt.detection.samples import SampleBuffer
from uavrt.detection.search import Candidate, RateSearch
from uavrt.detection.tracks import Track

_UNIFORMITY = 0.3
_STRONG = 30.0
_OFF_ROW_HZ = 8.0
_FLANK_RATIO = 2.0
"""Half a pulse earlier or later a pulse has a quarter of its power, and so it has 35 Hz beside
its frequency. Twice as much there is another tag's: of another interval or frequency."""
_FLANK_BINS = 1.9
"""A strong pulse's cells are at their limit far from its row, and partly beside it in time:
from so far the top is gone to. One group in twenty of 50 dB was measured on the flank, 6 dB
low; what is further away is refused as a side lobe."""


class Judge:
    """Judges the candidates of one detector.

    Parameters
    ----------
    bounds : Bounds
    grid : Grid
    buffer : SampleBuffer
    refiner : Refiner
    """

    def __init__(
        self, bounds: Bounds, *, grid: Grid, buffer: SampleBuffer, refiner: Refiner
    ) -> None:
        tag = bounds.tag
        self._tag = tag
        self._bounds = bounds
        self._grid = grid
        self._buffer = buffer
        self._refiner = refiner
        self._evidence = Evidence(tag, grid=grid, refiner=refiner)

    def suffices(
        self, candidate: Candidate, search: RateSearch, noise: NDArray[np.float32]
    ) -> bool:
        """Whether a candidate near the search's threshold is likelier than noise."""
        return self._evidence.suffices(candidate, search, noise)

    def known(self, tracks: list[Track]) -> KnownPulses | None:
        """Get the pulses of confirmed tracks: they need not be found again."""
        pulses = [slot.measured for t in tracks if t.confirmed for slot in t.slots]
        return KnownPulses(self._grid, pulses) if pulses else None

    def unexplained(
        self, candidates: list[Candidate], search: RateSearch, known: KnownPulses | None
    ) -> list[Candidate]:
        """Leave out the candidates of a search that known pulses explain."""
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
        """Whether the groups just taken leave a candidate of a search unexplained."""
        pulses = [pulse for group in taken for pulse in group]
        known = KnownPulses(self._grid, pulses) if pulses else None
        return bool(self.unexplained([candidate], search, known))

    def measure(
        self, candidate: Candidate, search: RateSearch, noise: NDArray[np.float32]
    ) -> list[tuple[int, Measured]] | None:
        """Measure a candidate's pulses, with their places among the K."""
        grid = self._grid
        starts = np.array([grid.start(column) for column in candidate.columns])
        half = (search.reach + 1) * grid.hop
        margin = half + grid.window + 2
        kept = (starts >= self._buffer.start) & (starts < self._refiner.upto - margin)
        if not kept.any():
            return None
        # Beside the stream's first sample the stretch looked at is moved, not given up.
        starts = np.maximum(starts, self._buffer.start + math.ceil(half) + 1)
        starts, offset = starts[kept], float(grid.offsets_hz[candidate.row])
        bin_hz = grid.sample_rate_hz / grid.window
        found: list[Measured] | None = None
        for _ in range(4):
            found = self._refiner.search(starts, half, offset, bin_hz / 4.0, noise, climb=True)
            if found is None:
                return None
            strongest = max(found, key=lambda pulse: pulse.power)
            if strongest.power < _STRONG:
                break
            top_hz, power = self._refiner.strongest(strongest)
            apart = apart_hz(top_hz, strongest.offset_hz, grid.sample_rate_hz)
            if bin_hz / 4.0 < abs(apart) < _FLANK_BINS * bin_hz and power > strongest.power:
                offset = strongest.offset_hz + apart
            elif abs(strongest.offset_hz - offset) < _OFF_ROW_HZ:
                break
            else:
                # The limit on a cell lets noise choose among the rows of a strong pulse.
                offset = strongest.offset_hz
        assert found is not None
        return list(zip(np.flatnonzero(kept).tolist(), found, strict=True))

    def refusal(
        self,
        places: list[tuple[int, Measured]],
        search: RateSearch,
        *,
        noise: NDArray[np.float32],
        floor: float,
    ) -> str | None:
        """Why a group above the threshold is no tag, or None."""
        if (reason := self._bounds.refusal(places, search.rate)) is not None:
            return reason
        group = [pulse for _, pulse in places]
        rate_hz = self._grid.sample_rate_hz
        bin_hz = rate_hz / self._grid.window
        total = 0.0
        least = _UNIFORMITY * min(60.0, max(pulse.power for pulse in group))
        if self._is_the_other_rate(group, search, noise):
            return "a pulse of the other rate between"
        for pulse in group:
            offset, power = self._refiner.strongest(pulse)
            apart = abs(apart_hz(offset, pulse.offset_hz, rate_hz))
            if power > _FLANK_RATIO * pulse.power and self._bounds.off_frequency(offset):
                return "side lobe of a signal outside"
            if apart < bin_hz / 2.0 and power > _FLANK_RATIO * max(pulse.power, 4.0):
                return "flank of a stronger pulse"
            if apart > bin_hz and pulse.power > 4.0:
                # A rectangular pulse elsewhere leaks at most 1 / (pi df tp)^2; double margin.
                leak = 4.0 * power / (math.pi * apart / bin_hz) ** 2
                if power > 3.0 * pulse.power and leak > pulse.power:
                    return "side lobe of a stronger signal"
            if pulse.power > 8.0 and self._refiner.is_impulse(pulse, floor):
                return "an impulse"
            if len(self._tag.pulse_intervals_s) > 1 and pulse.power < least:
                return "a pulse of the rate is missing"
            pulse.contrast = self._refiner.contrast(pulse)
            if pulse.contrast <= 0.0:
                continue  # its samples are lost: nothing there, nothing beside it to compare
            local = pulse.power / pulse.contrast
            total += min(pulse.power / (local if local > 3.0 else 1.0), search.limit)
        if total < search.threshold * gate(search.k) * 0.97:
            return "no contrast with its surroundings"
        return None

    def _is_the_other_rate(
        self, group: list[Measured], search: RateSearch, noise: NDArray[np.float32]
    ) -> bool:
        """Whether the tag's other rate has pulses between those of the group.

        Every second pulse of a rate is a train of twice the interval; the pulses between give
        it away.
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
        evidence = 0.0
        at = group[0].start + other
        while at < group[-1].start - width:
            if all(abs(at - p.start) > half + width for p in group):
                found = self._refiner.search(
                    np.array([at]), half, group[0].offset_hz, TRACK_BAND_HZ, noise
                )
                if found is not None:
                    evidence += log_evidence(found[0].power, strength)
            at += other
        return evidence > 0.0

    def overlaps(self, track: Track, group: list[Measured]) -> bool:
        """Whether a group has a pulse of a track."""
        return share_a_pulse(group, [s.measured for s in track.slots], self._grid.window)

    def equals(self, track: Track, group: list[Measured]) -> bool:
        """Whether at most one pulse of the group is new to the track."""
        own = [s.measured for s in track.slots]
        shared = sum(share_a_pulse([m], own, self._grid.window) for m in group)
        return shared >= len(group) - 1


def share_a_pulse(one: list[Measured], two: list[Measured], window: int) -> bool:
    """Whether two groups have a pulse at the same time, at whatever frequency it leaks to."""
    return any(abs(a.start - b.start) < 0.75 * window for a in one for b in two)
