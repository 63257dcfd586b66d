"""Name the trains that were found by comparing them with the listed tags."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

import numpy as np

from uavrt.detection.beeps.trains import Train
from uavrt.messages import Tag

REACH_PPM: Final = 70.0
"""Error of a dongle without a temperature-compensated crystal [ppm]."""
_BESIDE_HZ: Final = 30.0
"""Error of a train's frequency, and of a window's edge [Hz]."""
_CODE_HZ: Final = 1000.0
_LEAST_UNCERTAINTY: Final = 0.01
"""Change of an interval with temperature and battery, as a part of it."""
_POINT_S: Final = 0.001
_LEAST_PULSES: Final = 8
"""Pulses of a stretch that shows a rate of its own."""
_LEAST_PRESENT: Final = 0.7
"""Share of a stretch's pulses that were received; less may be another rate's."""
_MOST_NAMES: Final = 3
_SAME_PPM: Final = 3.0


class Kind(StrEnum):
    """What a train is, seen from the list of tags."""

    LISTED = "listed"
    """A listed tag, as its entry says."""
    OFF_LABEL = "off label"
    """It keeps the interval of a listed tag at another frequency."""
    OTHER_RATE = "other rate"
    """It is at a listed tag's frequency, at another interval."""
    UNLISTED = "unlisted"
    IMAGE = "image"
    """The receiver made it of stronger pulses."""
    NOT_ANIMAL = "not an animal"
    DOUBTFUL = "doubtful"


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedTrain:
    """A train of pulses and which tags it may be."""

    kind: Kind
    frequency_hz: float
    interval_s: float
    pulses: int
    level_db: float
    """Median over the noise in 94 Hz."""
    tags: tuple[Tag, ...] = ()
    """Which may be meant, the most likely first; of an image those of its original."""
    image_of_hz: float | None = None
    reason: str | None = None
    """Why it is doubtful or no animal."""

    @property
    def away_hz(self) -> float | None:
        """Distance from the first tag's listed frequency [Hz]."""
        return self.frequency_hz - self.tags[0].frequency_hz if self.tags else None

    def __str__(self) -> str:
        rate = 60.0 / self.interval_s
        heard = (
            f"{self.level_db:.0f} dB at {self.frequency_hz / 1e6:.6f} MHz, "
            f"{self.pulses} pulses every {1e3 * self.interval_s:.0f} ms ({rate:.0f} a minute)"
        )
        match self.kind:
            case Kind.OFF_LABEL:
                tags = " or ".join(self._away(tag) for tag in self.tags)
                return f"{heard}: {tags}? List it at this frequency"
            case Kind.OTHER_RATE:
                tag = self.tags[0]
                names = f"tag {tag.tag_id} at another rate{self._ratio(tag)}"
                names += "".join(f" or {self._away(other)}" for other in self.tags[1:])
                return f"{heard}: {names}? List this interval"
            case Kind.IMAGE:
                assert self.image_of_hz is not None
                of = f"{self.image_of_hz / 1e6:.6f} MHz"
                of += f" (tag {self.tags[0].tag_id})" if self.tags else ""
                return f"{heard}: an image of {of}, made in the receiver. Reduce its gain"
            case Kind.UNLISTED:
                return f"{heard}: unlisted"
            case Kind.DOUBTFUL if self.tags:
                return f"{heard} at tag {self.tags[0].tag_id}'s frequency: {self.reason}"
            case _:
                return f"{heard}: {self.kind}{f', {self.reason}' if self.reason else ''}"

    def _away(self, tag: Tag) -> str:
        away_hz = self.frequency_hz - tag.frequency_hz
        side = "above" if away_hz > 0.0 else "below"
        far = f"{abs(away_hz):.0f} Hz"
        if abs(away_hz) >= 995.0:
            far = f"{abs(away_hz) / 1e3:.1f} kHz"
        return f"tag {tag.tag_id}, {far} {side} its label"

    def _ratio(self, tag: Tag) -> str:
        twice = any(
            abs(2.0 * self.interval_s - listed_s) <= _LEAST_UNCERTAINTY * listed_s
            for listed_s in tag.pulse_intervals_s
        )
        return ", twice the listed one (mortality)" if twice else ""


def name_trains(
    trains: Sequence[Train], tags: Sequence[Tag], frequency_window_hz: float
) -> list[NamedTrain]:
    """Name trains, the strongest first.

    Parameters
    ----------
    trains : sequence of Train
        At absolute frequencies.
    tags : sequence of Tag
        All that are searched for.
    frequency_window_hz : float
        Half-width of the search around each tag's nominal frequency.
    """
    named = [_name(train, tags, frequency_window_hz) for train in trains]
    heard = {tag.tag_id for one in named if one.kind is Kind.LISTED for tag in one.tags}
    return [_finished(one, heard, named) for one in named]


def shared_offset_ppm(named: Sequence[NamedTrain]) -> float | None:
    """Offset of all tags that are off their label, if it is one: the receiver's own error."""
    off = [
        1e6 * one.away_hz / one.tags[0].frequency_hz
        for one in named
        if one.kind is Kind.OFF_LABEL and one.away_hz is not None
    ]
    if len(off) < 2 or any(one.kind is Kind.LISTED for one in named):
        return None
    return float(np.median(off)) if max(off) - min(off) <= _SAME_PPM else None


def _name(train: Train, tags: Sequence[Tag], window_hz: float) -> NamedTrain:
    interval_s = train.interval_s
    near = _within(train, tags, window_hz + _BESIDE_HZ)
    reach_hz = REACH_PPM * 1e-6 * train.frequency_hz
    kind, names, reason = Kind.UNLISTED, [], train.doubt
    fitting = [tag for tag in _within(train, tags, reach_hz) if _fits(interval_s, tag, train)]
    others_s = [one for one in _rates(train) if not any(_fits(one, t, train) for t in near)]
    if train.image_of_hz is not None:
        kind = Kind.IMAGE
    elif any(
        tag.coded and abs(tag.frequency_hz - train.frequency_hz) <= _CODE_HZ for tag in tags
    ):
        kind = Kind.LISTED
    elif near and not others_s:
        kind, names = Kind.LISTED, [tag for tag in near if _fits(interval_s, tag, train)]
    elif train.together > 1:
        kind, reason = Kind.NOT_ANIMAL, f"at {train.together} frequencies at once"
    elif train.doubt is not None:
        kind, names = Kind.DOUBTFUL, near[:1]
    elif near:
        kind, interval_s = Kind.OTHER_RATE, others_s[0]
        names = [*near[:1], *(tag for tag in fitting if tag not in near)]
    elif fitting:
        kind, names = Kind.OFF_LABEL, fitting
    return NamedTrain(
        kind=kind,
        frequency_hz=train.frequency_hz,
        interval_s=interval_s,
        pulses=len(train.points),
        level_db=train.level_db,
        tags=tuple(names[:_MOST_NAMES]),
        image_of_hz=train.image_of_hz,
        reason=reason,
    )


def _finished(one: NamedTrain, heard: set[int], named: Sequence[NamedTrain]) -> NamedTrain:
    """Leave out the names of tags that beep at their own place; name an image's original."""
    if one.kind is Kind.IMAGE:
        for other in named:
            if other.frequency_hz == one.image_of_hz:
                return replace(one, tags=other.tags)
    if one.kind is Kind.OFF_LABEL:
        left = tuple(tag for tag in one.tags if tag.tag_id not in heard)
        return replace(one, tags=left, kind=Kind.OFF_LABEL if left else Kind.UNLISTED)
    return one


def _within(train: Train, tags: Sequence[Tag], reach_hz: float) -> list[Tag]:
    """Tags that beep, listed within some distance, the nearest first."""

    def away_hz(tag: Tag) -> float:
        return abs(train.frequency_hz - tag.frequency_hz)

    near = [tag for tag in tags if not tag.coded and away_hz(tag) <= reach_hz]
    return sorted(near, key=away_hz)


def _fits(interval_s: float, tag: Tag, train: Train) -> bool:
    allowed_s = 3.0 * min(train.interval_sigma_s, 0.01 * interval_s) + _POINT_S
    return any(
        abs(interval_s - listed_s)
        <= max(tag.interval_uncertainty_s, _LEAST_UNCERTAINTY * listed_s) + allowed_s
        for listed_s in tag.pulse_intervals_s
    )


def _rates(train: Train) -> Iterator[float]:
    """Intervals of a train: that with the most pulses, and others that are certain."""
    yield train.interval_s
    for one in train.beats:
        places = int(one.beat.numbers[-1]) + 1
        enough = max(_LEAST_PULSES, math.ceil(_LEAST_PRESENT * places))
        if one.members.size >= enough and one.beat.interval_s != train.interval_s:
            yield one.beat.interval_s
