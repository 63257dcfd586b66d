"""Identify the sender of a burst from the bursts before and after it.

A code and a burst interval define a tag. Tags with an identical code differ only in their
intervals. A burst that may come from an unlisted code is assigned to the listed tag if other
bursts lie whole burst intervals away and the joint evidence suffices.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.detection.coded.code_evidence import evidence_in_step
from uavrt.detection.coded.tuning import IDENTITY

_TRIED = math.log(IDENTITY.steps)
"""Log of the number of time ranges that are compared; it is subtracted from the best
log-likelihood, because the best of several is chosen."""


def in_step(
    at_s: float,
    others_s: NDArray[np.float64],
    tag: Tag,
    timing_s: float,
    most: int = IDENTITY.steps,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
    """Find bursts at whole multiples of the burst interval before and after time `at_s`.

    Returns, for each multiple, the expected time [s], the log-likelihood gained by a burst
    there (0: none), and the index of the nearest of `others_s`.
    """
    steps = np.concatenate((np.arange(-most, 0), np.arange(1, most + 1)))
    interval_s = tag.pulse_intervals_s[0]
    expected_s: NDArray[np.float64] = np.asarray(at_s + steps * interval_s, np.float64)
    if not len(others_s):
        return expected_s, np.zeros(len(steps)), np.zeros(len(steps), np.intp)
    window_s = timing_s + np.abs(steps) * tag.interval_uncertainty_s
    off_s = np.abs(others_s - expected_s[:, None])
    gains = np.log(np.maximum(interval_s / (2.0 * window_s), 1.0))
    found = off_s.min(axis=1) <= window_s
    return expected_s, np.where(found, gains, 0.0), off_s.argmin(axis=1)


def likeliest(
    at_s: float,
    tags: Sequence[Tag],
    others_s: Sequence[NDArray[np.float64]],
    *,
    searched_s: tuple[float, float],
    timing_s: float,
) -> list[int]:
    """Indices of the tags whose burst interval fits a burst at `at_s`, the best first."""
    scores = []
    for tag, times_s in zip(tags, others_s, strict=True):
        expected_s, gains, _ = in_step(at_s, times_s, tag, timing_s)
        searched = (expected_s >= searched_s[0]) & (expected_s <= searched_s[1])
        scores.append(
            float(gains.sum() - IDENTITY.missed_log * (searched & (gains == 0.0)).sum())
        )
    if max(scores) <= 0.0:
        return list(range(len(tags)))
    order = sorted(range(len(tags)), key=lambda place: -scores[place])
    return [place for place in order if scores[place] > scores[order[0]] - IDENTITY.clear_log]


@dataclass(slots=True, kw_only=True)
class MeasuredBurst:
    """Time, frequency and strength of a burst."""

    start_ns: int
    starts_ns: list[int]
    """Start times of the burst's received pulses [ns]."""
    energies: NDArray[np.float64]
    """Energies of the burst's received pulses [noise energies]."""
    offset_hz: float
    noise: float
    row: int
    score: float


@dataclass(slots=True, kw_only=True)
class Sighting(MeasuredBurst):
    """A burst that was detected by itself, not by a sum, with the evidence for its sender."""

    tags: tuple[Tag, ...]
    """Tags that may have sent the burst, the likeliest first."""
    hit: tuple[int, ...]
    """Ids of tags with bursts that overlap too many pulses of this burst."""
    alone: NDArray[np.float64]
    """Log-likelihood ratio of each pulse of the code to noise or another burst's pulse."""
    good: NDArray[np.bool_]
    unlisted: float
    """Log-likelihood ratio of the listed code to unlisted codes."""
    required: float
    """Log-likelihood ratio required to identify the burst's sender."""
    reported: bool = False
    tag_id: int | None = None
    """Id of the tag that sent the burst; None until it is identified."""

    def seconds_to(self, time_ns: int) -> float:
        """Time from the burst's start to a given time [s]."""
        return (time_ns - self.start_ns) / NANOSECONDS_PER_SECOND

    def age_in_intervals(self, now_ns: int) -> float:
        """Time since the burst, in units of the longest interval of its possible tags."""
        return self.seconds_to(now_ns) / max(tag.pulse_intervals_s[0] for tag in self.tags)

    def may_be(self, tag: Tag) -> bool:
        """True if a tag may have sent the burst."""
        return self.tag_id == tag.tag_id if self.tag_id else tag in self.tags


class Sightings:
    """The bursts of the last few burst intervals, and their senders."""

    def __init__(self) -> None:
        self._by_tag: dict[int, list[Sighting]] = {}
        self._waiting: list[Sighting] = []
        self._begun_ns = 0

    def identify(
        self, new: Sequence[Sighting], now_ns: int, *, last: bool
    ) -> list[tuple[Sighting, Tag, tuple[int, ...]]]:
        """Add new bursts; return the bursts to report, with their senders.

        Each comes with the ids of other possible tags; `Sighting.tag_id` is set if the sender
        is confirmed.
        """
        self._begun_ns = self._begun_ns or now_ns
        concerned = self._waiting
        for tag in {tag for one in new for tag in one.tags}:
            kept = [
                one
                for one in self._by_tag.get(tag.tag_id, [])
                if one.age_in_intervals(now_ns) <= IDENTITY.steps + 1
            ]
            concerned = concerned + kept
            own = [one for one in new if tag in one.tags]
            self._by_tag[tag.tag_id] = kept + own
        self._waiting = []
        found: list[tuple[Sighting, Tag, tuple[int, ...]]] = []
        for one in {id(one): one for one in (*concerned, *new)}.values():
            if one.tag_id is not None:
                continue
            possible = self._possible(one, now_ns)
            if len(possible) == 1 and self._suffices(one, possible[0], now_ns):
                one.tag_id = possible[0].tag_id
            elif one.unlisted < one.required - IDENTITY.doubt_log:
                continue
            elif (
                len(one.tags) > 1
                and one.age_in_intervals(now_ns) < IDENTITY.wait_intervals
                and not last
            ):
                self._waiting.append(one)
                continue
            if not one.reported:
                others = (*(tag.tag_id for tag in possible[1:]), *one.hit)
                found.append((one, possible[0], others))
                one.reported = True
        return found

    def _others(self, one: Sighting, tag: Tag) -> list[Sighting]:
        return [
            other
            for other in self._by_tag.get(tag.tag_id, [])
            if other is not one
            and other.may_be(tag)
            and abs(other.row - one.row) <= IDENTITY.rows
        ]

    def _possible(self, one: Sighting, now_ns: int) -> list[Tag]:
        if len(one.tags) == 1:
            return list(one.tags)
        places = likeliest(
            0.0,
            one.tags,
            [_times_s(self._others(one, tag), one) for tag in one.tags],
            searched_s=(one.seconds_to(self._begun_ns), one.seconds_to(now_ns)),
            timing_s=IDENTITY.timing_s,
        )
        return [one.tags[place] for place in places]

    def _suffices(self, one: Sighting, tag: Tag, now_ns: int) -> bool:
        if one.hit:
            return False
        if one.unlisted >= one.required:
            return True
        others = self._others(one, tag)
        expected_s, gains, which = in_step(0.0, _times_s(others, one), tag, IDENTITY.timing_s)
        searched = expected_s >= one.seconds_to(self._begun_ns)
        searched &= expected_s <= one.seconds_to(now_ns)
        for most in range(1, IDENTITY.steps + 1):
            near = slice(IDENTITY.steps - most, IDENTITY.steps + most)
            if not gains[near].any():
                continue
            summed = [
                one,
                *(others[place] for place in which[near][gains[near] > 0.0].tolist()),
            ]
            # Either one unlisted tag is in step by chance, or bursts of several tags are.
            by_one = evidence_in_step(
                np.stack([each.alone for each in summed]),
                np.stack([each.good for each in summed]),
            )
            by_one += float(gains[near].max()) - _TRIED
            by_one -= IDENTITY.missed_log * float((searched & (gains == 0.0))[near].sum())
            by_several = one.unlisted + max(each.unlisted for each in summed[1:])
            if min(by_one, by_several) >= one.required:
                return True
        return False


def _times_s(others: Sequence[Sighting], one: Sighting) -> NDArray[np.float64]:
    return np.array([one.seconds_to(other.start_ns) for other in others])
