"""Find what beeps in a recording beside the listed tags, while these are detected.

A tag's crystal may be kilohertz off its label, the list may have a wrong digit or lack a rate,
or the animal may belong to another study. The detector then finds nothing and gives no reason.
"""

from collections.abc import Sequence
from typing import Final

from uavrt.config import Receiver
from uavrt.detection.beeps import (
    Kind,
    NamedTrain,
    PointSearch,
    Train,
    find_trains,
    name_trains,
    shared_offset_ppm,
)
from uavrt.messages import IQBlock, Tag
from uavrt.radio import BlockTimes
from uavrt.units import ns_from_s

_TAGS_BAND: Final = (60.0, 20.0, 90.0)
"""The band of the tags: the first minute, then 20 s of every 90; .4 % of a core [s]."""
_WHOLE_BAND: Final = (20.0, 20.0, 300.0)
"""The band of the radio, where it is wider; .8 % of a core at 3 MS/s [s]."""
_RECENT_S: Final = 300.0
"""Samples of a live stream, those of turns, in which trains are searched for."""
_NEWS_S: Final = 30.0
_LEAST_LIVE: Final = 8
"""Pulses of a train that is named while a stream runs."""
_SAME_HZ: Final = 300.0
_CLEAN: Final = 0.45
"""Half the part of a decimated band that is searched, as a share of its rate."""


class _Band:
    """Searches a band in turns.

    Parameters
    ----------
    turns : (float, float, float)
        Listen for this many seconds at the start, and at the end of each period.
    """

    def __init__(self, turns: tuple[float, float, float]) -> None:
        self._first_s, self._listen_s, self._period_s = turns
        self._search: PointSearch | None = None
        self._rate_hz = 1.0
        self._times = BlockTimes(1.0)
        self._taken = 0
        self._heard = 0
        self.center_hz = 0.0
        self.half_hz = 0.0

    def add(self, block: IQBlock, center_hz: float, share: float) -> None:
        """Take the next block; skip it outside of a turn."""
        rate_hz = block.sample_rate_hz
        if self._search is None:
            self.center_hz, self.half_hz = center_hz, share * rate_hz
            self._search = PointSearch(
                sample_rate_hz=rate_hz, low_hz=-self.half_hz, high_hz=self.half_hz
            )
            self._rate_hz = rate_hz
            self._times = BlockTimes(rate_hz)
        at_s = self._taken / rate_hz
        self._taken += len(block.samples)
        turn_s = at_s % self._period_s
        if at_s >= self._first_s and turn_s < self._period_s - self._listen_s:
            return
        self._times.add(self._heard, block.time_ns)
        self._heard += len(block.samples)
        self._search.process(block.samples)

    def trains(self, receiver: Receiver, *, ended: bool) -> list[Train]:
        """Return the trains so far, at absolute frequencies; while it runs, recent ones."""
        if self._search is None or not self._heard:
            return []
        since_s = max(0.0, self._heard / self._rate_hz - _RECENT_S)
        points = self._search.finish() if ended else self._search.found(since_s)
        times_s = self._times.seconds(points.times_s * self._rate_hz, self._times.start_ns)
        points = points.moved(times_s, self.center_hz)
        span_s = self._heard / self._rate_hz
        return find_trains(points, span_s if ended else min(span_s, _RECENT_S), receiver)[0]


class BeepSearch:
    """Names everything that beeps.

    Parameters
    ----------
    tags : sequence of Tag
        All that are searched for.
    frequency_window_hz : float
        Half-width of each tag's search.
    receiver : Receiver
        Centre and rate of the radio.
    live : bool
        Search the band of the tags alone, and report while the stream runs.
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
        self._near = _Band(_TAGS_BAND)
        self._whole = None if live else _Band(_WHOLE_BAND)
        self._next_ns: int | None = None
        self._named: list[NamedTrain] = []

    def add(self, block: IQBlock, band: IQBlock) -> None:
        """Take the radio's next block, and the same at the rate of the tags' band."""
        center_hz = self._receiver.center_frequency_hz
        decimated = band is not block
        self._near.add(band, center_hz, _CLEAN if decimated else 0.5)
        if decimated and self._whole is not None:
            self._whole.add(block, center_hz, 0.5)

    def finish(self) -> list[NamedTrain]:
        """Name the trains that were found, the strongest first."""
        near = self._near.trains(self._receiver, ended=True)
        whole = [] if self._whole is None else self._whole.trains(self._receiver, ended=True)
        far = [
            train
            for train in whole
            if abs(train.frequency_hz - self._near.center_hz) > self._near.half_hz
        ]
        trains = sorted([*near, *far], key=lambda train: -train.level_db)
        named = name_trains(trains, self._tags, self._window_hz)
        return [one for one in named if self._is_new(one)]

    def news(self, now_ns: int) -> list[NamedTrain]:
        """Name the trains of a live stream that were not named yet, about twice a minute."""
        if self._next_ns is None:
            self._next_ns = now_ns + ns_from_s(_NEWS_S)
        if now_ns < self._next_ns:
            return []
        self._next_ns = now_ns + ns_from_s(_NEWS_S)
        trains = self._near.trains(self._receiver, ended=False)
        named = name_trains(trains, self._tags, self._window_hz)
        new = [one for one in named if one.pulses >= _LEAST_LIVE and self._is_new(one)]
        self._named += new
        return new

    def _is_new(self, one: NamedTrain) -> bool:
        return not any(
            one.kind is other.kind and abs(one.frequency_hz - other.frequency_hz) < _SAME_HZ
            for other in self._named
        )


def words_of_beeps(named: Sequence[NamedTrain]) -> list[str]:
    """Describe what is not as listed, one line each."""
    lines = [
        str(one)
        for one in named
        if one.kind is not Kind.LISTED and (one.tags or one.kind is not Kind.DOUBTFUL)
    ]
    ppm = shared_offset_ppm(named)
    if ppm is not None:
        lines.append(f"all tags are {ppm:+.0f} ppm off their labels: the receiver's own error")
    return lines
