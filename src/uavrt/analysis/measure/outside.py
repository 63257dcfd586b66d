"""Find pulses that look like a tag's at a frequency outside every search window.

A tag's crystal may be kilohertz off its label, or the list has a wrong digit; then the search
finds nothing, and nothing says why. Bursts are cheap to find without knowing a tag; those that
repeat at a tag's interval, outside all windows, are reported.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.measure.pulse_search import MERGE_S, WINDOW_S, Bursts, BurstSearch
from uavrt.messages import ChannelBlock, Tag
from uavrt.radio import BlockTimes

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
_LEAKS_DB: Final = 20.0
"""So much stronger than its edges outside of its window is every burst."""
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


@dataclass(slots=True, kw_only=True)
class _Channel:
    """A channel that is looked at, and what has come of it."""

    center_frequency_hz: float
    sample_rate_hz: float
    search: BurstSearch
    times: BlockTimes
    most: float
    """Samples that are looked at."""
    due: float
    """Samples from which on it is time to look."""
    taken: int = 0
    looked: int = 0
    """Samples of those that were looked at."""
    waiting: list[tuple[NDArray[np.complex64], int]] = field(default_factory=list)

    @classmethod
    def of(cls, block: ChannelBlock) -> "_Channel":
        rate_hz = block.sample_rate_hz
        reach_hz = _REACH * rate_hz
        return cls(
            center_frequency_hz=block.center_frequency_hz,
            sample_rate_hz=rate_hz,
            search=BurstSearch(
                sample_rate_hz=rate_hz,
                low_hz=-reach_hz,
                high_hz=reach_hz,
                least_db=LEAST_DB,
                hop_s=_HOP_S,
                glance=True,
            ),
            times=BlockTimes(rate_hz),
            most=_MOST_S * rate_hz,
            due=_AT_ONCE_S * rate_hz,
        )

    def look(self) -> None:
        """Look for bursts in what has come."""
        waiting, self.waiting = self.waiting, []
        for samples, time_ns in waiting:
            self.times.add(self.looked, time_ns)
            self.looked += len(samples)
        if waiting:
            self.search.process(np.concatenate([samples for samples, _ in waiting]))
        at_once = _AT_ONCE_S * self.sample_rate_hz
        self.due = (self.taken // at_once + 1.0) * at_once


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
        self._channels: dict[int, _Channel] = {}

    def add(self, block: ChannelBlock) -> None:
        """Process the next block of a channel.

        They come a thousand times a second for a hundred tags, and nearly all only wait.
        """
        channel = self._channels.get(block.channel)
        if channel is None:
            channel = self._channels[block.channel] = _Channel.of(block)
        if channel.taken >= channel.most:
            return
        channel.waiting.append((block.samples, block.time_ns))
        channel.taken += len(block.samples)
        if channel.taken >= channel.due:
            channel.look()

    def finish(self) -> list[Outsider]:
        """Get what was found, the strongest first, one for each tag."""
        heard = []
        for channel in self._channels.values():
            channel.look()
        start_ns = min((one.times.start_ns for one in self._channels.values()), default=0)
        for channel in self._channels.values():
            center_hz, rate_hz = channel.center_frequency_hz, channel.sample_rate_hz
            bursts = channel.search.finish().placed(channel.times, rate_hz, start_ns)
            there = replace(bursts, frequencies_hz=center_hz + bursts.frequencies_hz)
            heard.append((center_hz, rate_hz, there, self._searched(there)))
        strong = _strong([(bursts, searched) for _, _, bursts, searched in heard])
        best: dict[int, Outsider] = {}
        for center_hz, rate_hz, bursts, searched in heard:
            near = [t for t in self._tags if abs(t.frequency_hz - center_hz) <= rate_hz / 2]
            for found in self._judge(bursts, searched, strong, near):
                known = best.get(found.tag_id)
                if known is None or found.level_db > known.level_db:
                    best[found.tag_id] = found
        return sorted(best.values(), key=lambda found: -found.level_db)

    def _searched(self, bursts: Bursts) -> NDArray[np.bool_]:
        """Which bursts, of absolute frequencies, lie in or beside a window."""
        searched = np.zeros(len(bursts.frequencies_hz), bool)
        for tag in self._tags:
            away_hz = np.abs(bursts.frequencies_hz - tag.frequency_hz)
            searched |= away_hz <= self._window_hz + _BESIDE_HZ
        return searched

    def _judge(
        self,
        bursts: Bursts,
        searched: NDArray[np.bool_],
        strong: Bursts,
        tags: Sequence[Tag],
    ) -> list[Outsider]:
        absolute_hz = bursts.frequencies_hz
        outside = ~searched & (bursts.levels_db >= LEAST_DB)
        outside &= ~_beside_stronger(bursts, searched)
        outside &= ~_edges_of(strong, bursts)
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


def _strong(heard: Sequence[tuple[Bursts, NDArray[np.bool_]]]) -> Bursts:
    """Gather the bursts of all channels that are searched for and strong enough to leak."""
    parts = []
    for bursts, searched in heard:
        chosen = searched & (bursts.levels_db >= LEAST_DB + _LEAKS_DB)
        columns = (bursts.times_s, bursts.frequencies_hz, bursts.levels_db)
        parts.append(np.stack([column[chosen] for column in columns]))
    rows = np.concatenate(parts, axis=1) if parts else np.zeros((3, 0))
    return Bursts(*rows[:, np.argsort(rows[0], kind="stable")])


def _edges_of(strong: Bursts, bursts: Bursts) -> NDArray[np.bool_]:
    """Which bursts are no more than the edges of a strong one, also of another channel.

    Edges of a rectangular pulse have at most 1 / (pi df T)^2 of what its middle has in a window
    of T; twice the amplitude is allowed, for noise.
    """
    edges = np.zeros(len(bursts.times_s), bool)
    if not edges.size:
        return edges
    # So far from it they are as strong as what is told.
    reach_hz = 10.0 ** ((strong.levels_db + 6.0 - LEAST_DB) / 20.0) / (np.pi * WINDOW_S)
    near = strong.frequencies_hz > bursts.frequencies_hz.min() - reach_hz
    near &= strong.frequencies_hz < bursts.frequencies_hz.max() + reach_hz
    columns = (strong.times_s, strong.frequencies_hz, strong.levels_db)
    for time_s, frequency_hz, level_db in np.stack(columns, axis=1)[near].tolist():
        low, high = np.searchsorted(bursts.times_s, [time_s - MERGE_S, time_s + MERGE_S])
        apart = np.pi * np.abs(bursts.frequencies_hz[low:high] - frequency_hz) * WINDOW_S
        leak_db = level_db + 6.0 - 20.0 * np.log10(np.maximum(apart, 1.0))
        edges[low:high] |= bursts.levels_db[low:high] <= leak_db
    return edges


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
