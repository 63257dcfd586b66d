"""Search a stream for unlisted senders while the listed tags are being detected.

A tag's crystal may be kilohertz off its label, the list may be wrong, or the animal may be of
another study; then only this search shows why the detector finds nothing.
"""

from collections.abc import Sequence

import numpy as np

from uavrt.config.ghost_places import Receiver
from uavrt.core.messages import Beep, BeepKind, IQBlock, Tag, keep_beep
from uavrt.core.units import ns_from_s
from uavrt.detection.beeps.beep_points import NO_POINTS, PointSearch
from uavrt.detection.beeps.beep_trains import Searched, Train, find_trains
from uavrt.detection.beeps.gaps import gapped_tags
from uavrt.detection.beeps.naming import name_trains
from uavrt.detection.beeps.tuning import LISTENING
from uavrt.dsp.block_times import BlockTimes


class _Band:
    """Searches a band for senders during a part of each period; `turns` [s]: time searched at
    the start, time searched in each period, length of the period.
    """

    def __init__(self, turns: tuple[float, float, float], *, live: bool) -> None:
        self._live = live
        self._first_s, self._listen_s, self._period_s = turns
        self._search: PointSearch | None = None
        self._rate_hz = 1.0
        self._times = BlockTimes(1.0)
        self._taken_s = 0.0
        self.received = 0
        """Number of samples of this band that were searched."""
        self.center_hz = 0.0
        self.half_hz = 0.0
        self.points = NO_POINTS
        """Pulses of the band, at absolute frequencies, from the last search for trains."""
        self._searched: list[Searched] = []

    def due(self, block: IQBlock) -> bool:
        """Count the time of a block; returns True if the block must be searched."""
        at_s = self._taken_s
        self._taken_s += len(block.samples) / block.sample_rate_hz
        wide = block.sample_rate_hz > LISTENING.wide_hz
        listen_s = min(self._listen_s, LISTENING.wide_live_s) if wide else self._listen_s
        return at_s < self._first_s or at_s % self._period_s >= self._period_s - listen_s

    def take(self, block: IQBlock, center_hz: float, share: float) -> None:
        rate_hz = block.sample_rate_hz
        if self._search is None:
            self.center_hz, self.half_hz = center_hz, share * rate_hz
            self._search = PointSearch(
                sample_rate_hz=rate_hz,
                low_hz=-self.half_hz,
                high_hz=self.half_hz,
                **({"most_cells": LISTENING.live_cells} if self._live else {}),
            )
            self._rate_hz = rate_hz
            self._times = BlockTimes(rate_hz)
        self._times.add(self.received, block.time_ns)
        self.received += len(block.samples)
        self._search.process(block.samples)

    @property
    def start_ns(self) -> int:
        return self._times.start_ns

    @property
    def dropped(self) -> int:
        return 0 if self._search is None else self._search.dropped

    def trains(self, receiver: Receiver, *, ended: bool) -> list[Train]:
        """Return the trains of pulses found so far, at absolute frequencies.

        In a live stream only recent pulses are searched.
        """
        if self._search is None or not self.received:
            return []
        since_s = max(0.0, self.received / self._rate_hz - LISTENING.recent_s)
        points = self._search.finish() if ended else self._search.found(since_s)
        if not ended and len(points) > LISTENING.most_points:
            points = points.take(
                np.sort(np.argsort(points.levels_db)[-LISTENING.most_points :])
            )
        times_s = self._times.seconds(points.times_s * self._rate_hz, self._times.start_ns)
        self.points = points = points.moved(times_s, self.center_hz)
        span_s = self.received / self._rate_hz
        return find_trains(
            points,
            span_s if ended else min(span_s, LISTENING.recent_s),
            receiver,
            None if ended else self._searched,
        )[0]


class BeepSearch:
    """Finds and identifies all senders of regular pulses.

    `receiver`: centre and rate of the radio. `live`: report while the stream runs.
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
        self._near = _Band(
            LISTENING.tags_band_live_s if live else LISTENING.tags_band_s, live=live
        )
        self._whole = _Band(
            LISTENING.whole_band_live_s if live else LISTENING.whole_band_s, live=live
        )
        self._next_ns: int | None = None
        self._received = (0, 0)
        self._known: list[Beep] = []

    def add(self, block: IQBlock, band: IQBlock) -> None:
        """Add the radio's next block, as received and as decimated to the tags' band."""
        self.take(*self.due(block, band))

    def due(self, block: IQBlock, band: IQBlock) -> tuple[IQBlock | None, IQBlock | None]:
        """Choose whether the whole band or the tags' band is searched now; count the time."""
        decimated = band is not block
        near = band.samples.size > 0 and self._near.due(band)
        whole = decimated and self._whole.due(block)
        return block if whole else None, band if near else None

    def take(self, block: IQBlock | None, band: IQBlock | None) -> None:
        """Search the blocks chosen by `due`."""
        center_hz, rate_hz = self._receiver.center_frequency_hz, self._receiver.sample_rate_hz
        if band is not None:
            decimated = band.sample_rate_hz < 0.99 * rate_hz
            self._near.take(band, center_hz, LISTENING.clean_share if decimated else 0.5)
        if block is not None:
            self._whole.take(block, center_hz, 0.5)

    def finish(self) -> list[Beep]:
        """End the search; return senders not reported yet, the strongest first."""
        found = self._found(ended=True)
        return [one for one in found if keep_beep(self._known, one)]

    def news(self, now_ns: int) -> list[Beep]:
        """Return senders that are new or have twice as many pulses as when last reported."""
        if self._next_ns is None:
            self._next_ns = now_ns + ns_from_s(LISTENING.report_every_s)
        received = (self._near.received, self._whole.received)
        if now_ns < self._next_ns or received == self._received:
            return []
        self._next_ns, self._received = now_ns + ns_from_s(LISTENING.report_every_s), received
        news = [one for one in self._found(ended=False) if one.pulses >= self._wanted(one)]
        for one in news:
            keep_beep(self._known, one)
        return news

    @property
    def dropped(self) -> int:
        """Number of spectrogram cells not examined because too many were strong."""
        return self._near.dropped + self._whole.dropped

    def _wanted(self, one: Beep) -> int:
        return max(
            [
                LISTENING.live_pulses,
                *(2 * old.pulses for old in self._known if old.same_as(one)),
            ]
        )

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
