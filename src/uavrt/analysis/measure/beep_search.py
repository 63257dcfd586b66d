"""Find what beeps in a recording beside the listed tags, while these are detected.

A tag's crystal may be kilohertz off its label, the list may have a wrong digit or lack a rate,
or the animal is somebody else's. The detector then finds nothing, and nothing says why.
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

_TAGS_BAND: Final = (60.0, 20.0, 60.0)
"""The band of the tags: all of the first minute, then 20 s of each minute [s]."""
_WHOLE_BAND: Final = (20.0, 20.0, 200.0)
"""The band of the radio, where it is wider; this takes 1 % of a core at 3 MS/s [s]."""
_CLEAN: Final = 0.45
"""Half the part of a decimated band that is searched, as a share of its rate."""


class _Band:
    """Searches a band in turns.

    Parameters
    ----------
    turns : (float, float, float)
        Listen for the first seconds, then so many seconds at the end of each period.
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

    def finish(self, receiver: Receiver) -> list[Train]:
        """Return the trains, at absolute frequencies."""
        if self._search is None or not self._heard:
            return []
        points = self._search.finish()
        times_s = self._times.seconds(points.times_s * self._rate_hz, self._times.start_ns)
        points = points.moved(times_s, self.center_hz)
        return find_trains(points, self._heard / self._rate_hz, receiver)[0]


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
    """

    def __init__(
        self, tags: Sequence[Tag], frequency_window_hz: float, receiver: Receiver
    ) -> None:
        self._tags = tuple(tags)
        self._window_hz = frequency_window_hz
        self._receiver = receiver
        self._near = _Band(_TAGS_BAND)
        self._whole = _Band(_WHOLE_BAND)

    def add(self, block: IQBlock, band: IQBlock) -> None:
        """Take the radio's next block, and the same at the rate of the tags' band."""
        center_hz = self._receiver.center_frequency_hz
        decimated = band is not block
        self._near.add(band, center_hz, _CLEAN if decimated else 0.5)
        if decimated:
            self._whole.add(block, center_hz, 0.5)

    def finish(self) -> list[NamedTrain]:
        """Name the trains that were found, the strongest first."""
        near = self._near.finish(self._receiver)
        far = [
            train
            for train in self._whole.finish(self._receiver)
            if abs(train.frequency_hz - self._near.center_hz) > self._near.half_hz
        ]
        trains = sorted([*near, *far], key=lambda train: -train.level_db)
        return name_trains(trains, self._tags, self._window_hz)


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
