"""Find pulses that look like a tag's at a frequency outside every search window.

A tag's crystal may be kilohertz off its label, or the list has a wrong digit; then the search
finds nothing, and nothing says why. Bursts are cheap to find without knowing a tag; those that
repeat at a tag's interval, outside all windows, are reported.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.measure.pulse_search import MERGE_S, Bursts, BurstSearch
from uavrt.messages import ChannelBlock, Tag

LEAST_DB: Final = 15.0
"""Weaker bursts are too often those of noise or of somebody else."""
_LEAST_PULSES: Final = 4
_SAME_HZ: Final = 100.0
_BESIDE_HZ: Final = 100.0
"""So near a window its own search would find it."""
_REACH: Final = 0.3
"""Share of a channel's rate from its centre: beyond, the next channel hears it better."""
_MOST_S: Final = 600.0
"""So much of each channel is looked at."""
_MISSED: Final = 4
_HOP_S: Final = 0.008
"""Half a window: every burst fills one, but for half a decibel."""
_AT_ONCE_S: Final = 2.0
"""So much of a channel is transformed at once: a hundred channels in pieces of 0.1 s are twenty
times as many calls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outsider:
    """A signal with a tag's interval outside of all windows."""

    tag_id: int
    frequency_hz: float
    away_hz: float
    """From the tag's listed frequency."""
    level_db: float
    """Median over the noise, in a band of 90 Hz."""
    pulses: int

    def __str__(self) -> str:
        side = "above" if self.away_hz > 0.0 else "below"
        window_hz = 100.0 * np.ceil((abs(self.away_hz) + 200.0) / 100.0)
        return (
            f"{self.level_db:.0f} dB, {abs(self.away_hz) / 1e3:.1f} kHz {side} tag "
            f"{self.tag_id}, {self.pulses} pulses at its interval, outside of the search: "
            f"wider --frequency-window? ({window_hz:.0f} would reach it)"
        )


class OutsideSearch:
    """Looks for tags' pulses beside their windows.

    Parameters
    ----------
    tags : sequence of Tag
        All that are searched for.
    frequency_window_hz : float
        Half-width of each search.
    """

    def __init__(self, tags: Sequence[Tag], frequency_window_hz: float) -> None:
        self._tags = tuple(tags)
        self._window_hz = frequency_window_hz
        self._channels: dict[int, tuple[float, float, BurstSearch]] = {}
        self._taken: dict[int, int] = {}
        self._waiting: dict[int, list[NDArray[np.complex64]]] = {}

    def add(self, block: ChannelBlock) -> None:
        """Process the next block of a channel."""
        rate_hz = block.sample_rate_hz
        if block.channel not in self._channels:
            reach_hz = _REACH * rate_hz
            search = BurstSearch(
                sample_rate_hz=rate_hz,
                low_hz=-reach_hz,
                high_hz=reach_hz,
                least_db=LEAST_DB,
                hop_s=_HOP_S,
            )
            self._channels[block.channel] = (block.center_frequency_hz, rate_hz, search)
        taken = self._taken.get(block.channel, 0)
        if taken < _MOST_S * rate_hz:
            self._taken[block.channel] = now = taken + len(block.samples)
            self._waiting.setdefault(block.channel, []).append(block.samples.copy())
            if now // (_AT_ONCE_S * rate_hz) > taken // (_AT_ONCE_S * rate_hz):
                self._look(block.channel)

    def _look(self, channel: int) -> None:
        """Look for bursts in what has come of a channel."""
        waiting = self._waiting.pop(channel, None)
        if waiting:
            self._channels[channel][2].process(np.concatenate(waiting))

    def finish(self) -> list[Outsider]:
        """Get what was found, the strongest first, one for each tag."""
        best: dict[int, Outsider] = {}
        for channel, (center_hz, rate_hz, search) in self._channels.items():
            self._look(channel)
            bursts = search.finish()
            near = [t for t in self._tags if abs(t.frequency_hz - center_hz) <= rate_hz / 2]
            for found in self._judge(bursts, center_hz, near):
                known = best.get(found.tag_id)
                if known is None or found.level_db > known.level_db:
                    best[found.tag_id] = found
        return sorted(best.values(), key=lambda found: -found.level_db)

    def _judge(self, bursts: Bursts, center_hz: float, tags: Sequence[Tag]) -> list[Outsider]:
        absolute_hz = center_hz + bursts.frequencies_hz
        searched = np.zeros(len(absolute_hz), bool)
        for tag in self._tags:
            away_hz = np.abs(absolute_hz - tag.frequency_hz)
            searched |= away_hz <= self._window_hz + _BESIDE_HZ
        outside = ~searched & (bursts.levels_db >= LEAST_DB)
        outside &= ~_beside_stronger(bursts, searched)
        found: list[Outsider] = []
        left = outside.copy()
        while left.any():
            strongest = int(np.argmax(np.where(left, bursts.levels_db, -np.inf)))
            frequency_hz = float(absolute_hz[strongest])
            same = left & (np.abs(absolute_hz - frequency_hz) <= _SAME_HZ)
            left &= ~same
            found.extend(
                Outsider(
                    tag_id=tag.tag_id,
                    frequency_hz=frequency_hz,
                    away_hz=frequency_hz - tag.frequency_hz,
                    level_db=float(np.median(bursts.levels_db[same])),
                    pulses=int(np.count_nonzero(same)),
                )
                for tag in tags
                if _has_interval(bursts.times_s[same], tag)
            )
        return found


def _beside_stronger(bursts: Bursts, searched: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which bursts come with a stronger one that is searched for: its own keying."""
    beside = np.zeros(len(searched), bool)
    times = bursts.times_s
    for at in np.flatnonzero(searched).tolist():
        low, high = np.searchsorted(times, [times[at] - MERGE_S, times[at] + MERGE_S])
        beside[low:high] |= bursts.levels_db[low:high] < bursts.levels_db[at]
    return beside


def _has_interval(times_s: NDArray[np.float64], tag: Tag) -> bool:
    """Whether most bursts follow one another at a tag's interval, some missing."""
    if len(times_s) < _LEAST_PULSES:
        return False
    gaps_s = np.diff(np.sort(times_s))
    fitting = 0
    for gap_s in gaps_s.tolist():
        for interval_s in tag.pulse_intervals_s:
            count = round(gap_s / interval_s)
            allowed_s = count * tag.interval_uncertainty_s + tag.interval_jitter_s + 0.01
            if 1 <= count <= _MISSED and abs(gap_s - count * interval_s) <= allowed_s:
                fitting += 1
                break
    return fitting >= max(_LEAST_PULSES - 1, 0.6 * len(gaps_s))
