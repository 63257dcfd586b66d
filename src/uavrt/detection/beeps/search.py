"""Find unlisted beeps in a stream while the listed tags are detected.

A tag's crystal may be kilohertz off its label, the list may have a wrong digit or lack a rate,
or the animal may belong to another study. The detector then finds nothing and gives no reason.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from uavrt.config.ghost_places import Receiver
from uavrt.detection.beeps.gaps import gapped_tags
from uavrt.detection.beeps.naming import name_trains
from uavrt.detection.beeps.points import NO_POINTS, PointSearch
from uavrt.detection.beeps.trains import Train, find_trains
from uavrt.dsp.block_times import BlockTimes
from uavrt.messages import Beep, BeepKind, IQBlock, Tag, keep_beep
from uavrt.units import ns_from_s

_TAGS_BAND: Final = (60.0, 20.0, 90.0)
"""Turns in the tags' band: the first minute, then 20 s of every 90 [s]."""
_TAGS_BAND_LIVE: Final = (60.0, 45.0, 90.0)
_WHOLE_BAND: Final = (20.0, 20.0, 300.0)
"""Turns in the radio's band, if wider; .8 % of a core at 3 MS/s [s]."""
_WHOLE_BAND_LIVE: Final = (20.0, 20.0, 540.0)
_CELLS_LIVE: Final = 4_000_000
"""Cells searched at once in flight: .7 s at 3 MS/s, in 15 MiB."""
_RECENT_S: Final = 300.0
"""Duration of a live stream that is searched for trains."""
_MOST_POINTS: Final = 6000
"""Most points searched for trains while a stream runs: the strongest ones."""
_NEWS_S: Final = 5.0
_LEAST_LIVE: Final = 8
"""Least pulses of a train that is named while a stream runs."""
_CLEAN: Final = 0.45
"""Half-width of a decimated band that is searched, as a share of its rate."""


class _Band:
    """Searches a band in turns.

    `turns`: seconds to receive at the start, and at the end of each period.
    """

    def __init__(self, turns: tuple[float, float, float], *, live: bool) -> None:
        self._live = live
        self._first_s, self._listen_s, self._period_s = turns
        self._search: PointSearch | None = None
        self._rate_hz = 1.0
        self._times = BlockTimes(1.0)
        self._taken_s = 0.0
        self.received = 0
        """Number of samples received in turns."""
        self.center_hz = 0.0
        self.half_hz = 0.0
        self.points = NO_POINTS
        """Points at absolute frequencies, as of the last search for trains."""

    def due(self, block: IQBlock) -> bool:
        """Count a block's time; return whether it lies in a turn."""
        at_s = self._taken_s
        self._taken_s += len(block.samples) / block.sample_rate_hz
        turn_s = at_s % self._period_s
        return at_s < self._first_s or turn_s >= self._period_s - self._listen_s

    def take(self, block: IQBlock, center_hz: float, share: float) -> None:
        """Search a block of a turn."""
        rate_hz = block.sample_rate_hz
        if self._search is None:
            self.center_hz, self.half_hz = center_hz, share * rate_hz
            self._search = PointSearch(
                sample_rate_hz=rate_hz,
                low_hz=-self.half_hz,
                high_hz=self.half_hz,
                **({"most_cells": _CELLS_LIVE} if self._live else {}),
            )
            self._rate_hz = rate_hz
            self._times = BlockTimes(rate_hz)
        self._times.add(self.received, block.time_ns)
        self.received += len(block.samples)
        self._search.process(block.samples)

    @property
    def start_ns(self) -> int:
        """Time of the first sample [ns]."""
        return self._times.start_ns

    @property
    def dropped(self) -> int:
        """Strong cells not examined because there were too many at once."""
        return 0 if self._search is None else self._search.dropped

    def trains(self, receiver: Receiver, *, ended: bool) -> list[Train]:
        """Return the trains so far, at absolute frequencies; during a stream, recent ones."""
        if self._search is None or not self.received:
            return []
        since_s = max(0.0, self.received / self._rate_hz - _RECENT_S)
        points = self._search.finish() if ended else self._search.found(since_s)
        if not ended and len(points) > _MOST_POINTS:
            points = points.take(np.sort(np.argsort(points.levels_db)[-_MOST_POINTS:]))
        times_s = self._times.seconds(points.times_s * self._rate_hz, self._times.start_ns)
        self.points = points = points.moved(times_s, self.center_hz)
        span_s = self.received / self._rate_hz
        return find_trains(points, span_s if ended else min(span_s, _RECENT_S), receiver)[0]


class BeepSearch:
    """Names all senders of beeps.

    `receiver`: centre and rate of the radio. `live`: report while the stream runs, at a lower
    cost.
    """

    def __init__(
        self,
        tags: Sequence[Tag],
        frequency_window_hz: float,
        receiver: Receiver,
        *,
        live: bool = False,
    ) -> None:
        self._tags = tuple(tags)
        self._window_hz = frequency_window_hz
        self._receiver = receiver
        self._near = _Band(_TAGS_BAND_LIVE if live else _TAGS_BAND, live=live)
        self._whole = _Band(_WHOLE_BAND_LIVE if live else _WHOLE_BAND, live=live)
        self._next_ns: int | None = None
        self._received = (0, 0)
        self._known: list[Beep] = []

    def add(self, block: IQBlock, band: IQBlock) -> None:
        """Add the radio's next block, and the same at the rate of the tags' band."""
        self.take(*self.due(block, band))

    def due(self, block: IQBlock, band: IQBlock) -> tuple[IQBlock | None, IQBlock | None]:
        """Choose which of both is searched now, and count their time."""
        decimated = band is not block
        near = band.samples.size > 0 and self._near.due(band)
        whole = decimated and self._whole.due(block)
        return block if whole else None, band if near else None

    def take(self, block: IQBlock | None, band: IQBlock | None) -> None:
        """Search the blocks that are due."""
        center_hz, rate_hz = self._receiver.center_frequency_hz, self._receiver.sample_rate_hz
        if band is not None:
            decimated = band.sample_rate_hz < 0.99 * rate_hz
            self._near.take(band, center_hz, _CLEAN if decimated else 0.5)
        if block is not None:
            self._whole.take(block, center_hz, 0.5)

    def finish(self) -> list[Beep]:
        """Name the trains, the strongest first; for a stream, only new ones."""
        found = self._found(ended=True)
        return [one for one in found if keep_beep(self._known, one)]

    def news(self, now_ns: int) -> list[Beep]:
        """Name the trains of a live stream that are new, or have doubled their pulses."""
        if self._next_ns is None:
            self._next_ns = now_ns + ns_from_s(_NEWS_S)
        received = (self._near.received, self._whole.received)
        if now_ns < self._next_ns or received == self._received:
            return []
        self._next_ns, self._received = now_ns + ns_from_s(_NEWS_S), received
        news = [one for one in self._found(ended=False) if one.pulses >= self._wanted(one)]
        for one in news:
            keep_beep(self._known, one)
        return news

    @property
    def dropped(self) -> int:
        """Cells of the spectrum not examined because there were too many strong ones."""
        return self._near.dropped + self._whole.dropped

    def _wanted(self, one: Beep) -> int:
        return max([_LEAST_LIVE, *(2 * old.pulses for old in self._known if old.same_as(one))])

    def _found(self, *, ended: bool) -> list[Beep]:
        near = self._near.trains(self._receiver, ended=ended)
        far = [
            train
            for train in self._whole.trains(self._receiver, ended=ended)
            if abs(train.frequency_hz - self._near.center_hz) > self._near.half_hz
        ]
        named = name_trains(
            sorted([*near, *far], key=lambda train: -train.level_db),
            self._tags,
            self._window_hz,
            center_hz=self._receiver.center_frequency_hz,
            start_ns=self._near.start_ns,
        )
        certain = [one for one in named if one.kind is not BeepKind.DOUBTFUL]
        named_ids = {tag_id for one in certain for tag_id in one.tag_ids}
        silent = [tag for tag in self._tags if tag.tag_id not in named_ids and not tag.coded]
        start_ns = self._near.start_ns
        gapped = gapped_tags(self._near.points, silent, self._window_hz, start_ns)
        explained = {one.tag_ids for one in gapped}
        return [one for one in named if one.tag_ids not in explained] + gapped
