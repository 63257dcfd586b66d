"""Identify the same tags in several logs, by number and frequency together, because logs
without a list number frequencies from 1, and listed numbers are reused.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count, pairwise

import numpy as np

from uavrt.core.messages import PulsePose, Tag
from uavrt.formats.pulses.pulse_log import NUMBERED_BY_FREQUENCY, PulseLog
from uavrt.localization.tuning import FLIGHT

_SAME_HZ = 2_000.0
"""Largest difference between two receivers' measurements of one tag's frequency [Hz]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedTag:
    """Number, name and frequency of a tag."""

    tag_id: int
    frequency_hz: float | None
    """Median of the received frequencies [Hz]; None if the logs contain none."""
    name: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class SameTags:
    """All tags of several logs, each with a unique key."""

    keys: tuple[Mapping[int, int], ...]
    """For each log, a mapping from its tag numbers to keys that are unique over all logs."""
    tags: Mapping[int, NamedTag]
    warnings: tuple[str, ...]

    def keyed(self, number: int, pulse_poses: Iterable[PulsePose]) -> tuple[PulsePose, ...]:
        """Replace the tag numbers of log `number` by unique keys."""
        keys = self.keys[number]
        if all(own == key for own, key in keys.items()):
            return tuple(pulse_poses)
        return tuple(
            replace(one, pulse=replace(one.pulse, tag_id=keys[one.pulse.tag_id]))
            for one in pulse_poses
        )


@dataclass(slots=True, kw_only=True)
class _Group:
    tag_id: int
    frequency_hz: float
    """Median frequency of the tag over all logs [Hz]; NaN if unknown."""
    heard: list["_Heard"] = field(default_factory=list)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Heard:
    log: int
    tag_id: int
    frequency_hz: float
    """Median frequency of the tag in one log [Hz]; NaN if unknown."""
    named: bool
    """True if the tag's number comes from a tag list."""


def same_tags(logs: Sequence[PulseLog], listed: Sequence[Sequence[Tag]]) -> SameTags:
    """Determine which numbers in several logs belong to the same tag; `listed` contains each
    log's tag list.
    """
    heard = [one for number, log in enumerate(logs) for one in _heard(number, log)]
    groups = _listed_groups([one for one in heard if one.named])
    warnings = _reused_numbers(groups)
    numbers = {one.tag_id for one in groups} | {one.tag_id for tags in listed for one in tags}
    groups += _joined(groups, [one for one in heard if not one.named], numbers)
    keys: list[dict[int, int]] = [{} for _ in logs]
    tags: dict[int, NamedTag] = {}
    free = max(numbers | {one.tag_id for one in groups}, default=0)
    for group in groups:
        key = group.tag_id
        if key in tags:
            key = free = free + 1
        for one in group.heard:
            keys[one.log][one.tag_id] = key
        tags[key] = _named(group, listed)
    return SameTags(keys=tuple(keys), tags=tags, warnings=tuple(warnings))


def _heard(number: int, log: PulseLog) -> list[_Heard]:
    frequencies: dict[int, list[float]] = {}
    for one in log.pulse_poses:
        frequencies.setdefault(one.pulse.tag_id, []).append(one.pulse.frequency_hz)
    found = []
    for tag_id, every in sorted(frequencies.items()):
        known = [one for one in every if math.isfinite(one) and one >= FLIGHT.least_tag_hz]
        median_hz = float(np.median(known)) if known else math.nan
        named = log.kind not in NUMBERED_BY_FREQUENCY
        found.append(_Heard(log=number, tag_id=tag_id, frequency_hz=median_hz, named=named))
    return found


def _listed_groups(heard: Sequence[_Heard]) -> list[_Group]:
    """Group the received tags of all logs by number, and separate those of one number whose
    frequencies differ.
    """
    groups: list[_Group] = []
    for tag_id in sorted({one.tag_id for one in heard}):
        own = [one for one in heard if one.tag_id == tag_id]
        known = sorted(
            (one for one in own if math.isfinite(one.frequency_hz)),
            key=lambda one: one.frequency_hz,
        )
        parts = [known[:1]] if known else [[]]
        for before, one in pairwise(known):
            if one.frequency_hz - before.frequency_hz > FLIGHT.other_tag_hz:
                parts.append([])
            parts[-1].append(one)
        parts[0] += [one for one in own if not math.isfinite(one.frequency_hz)]
        groups += [_group(tag_id, part) for part in parts]
    return groups


def _group(tag_id: int, heard: list[_Heard]) -> _Group:
    known = [one.frequency_hz for one in heard if math.isfinite(one.frequency_hz)]
    median_hz = float(np.median(known)) if known else math.nan
    return _Group(tag_id=tag_id, frequency_hz=median_hz, heard=heard)


def _reused_numbers(groups: Sequence[_Group]) -> list[str]:
    """Return warnings about numbers that are used for several tags."""
    found = []
    for tag_id in dict.fromkeys(one.tag_id for one in groups):
        own = [one for one in groups if one.tag_id == tag_id]
        if len(own) > 1:
            at = [f"{one.frequency_hz / 1e6:.4f} MHz" for one in own]
            found.append(
                f"tag {tag_id} is at {at[0]} in some of these and at {' and '.join(at[1:])} in "
                "others: each counts as a separate tag"
            )
    return found


def _joined(
    listed: Sequence[_Group], heard: Sequence[_Heard], taken: Collection[int]
) -> list[_Group]:
    """Match tags of logs without a list to listed tags by frequency; tags without a match get
    new numbers.
    """
    free = (number for number in count(1) if number not in taken)
    new: list[_Group] = []
    for one in sorted(heard, key=lambda each: each.frequency_hz):
        near = [each for each in listed if abs(each.frequency_hz - one.frequency_hz) < _SAME_HZ]
        if near:
            nearest = min(near, key=lambda each: abs(each.frequency_hz - one.frequency_hz))
            nearest.heard.append(one)
            continue
        last = new[-1] if new else None
        if (
            last is not None
            and one.frequency_hz - last.heard[-1].frequency_hz <= _SAME_HZ
            and all(each.log != one.log for each in last.heard)
        ):
            last.heard.append(one)
        else:
            new.append(_group(next(free), [one]))
    return new


def _named(group: _Group, listed: Sequence[Sequence[Tag]]) -> NamedTag:
    names = [
        tag.name
        for one in group.heard
        for tag in listed[one.log]
        if tag.tag_id == one.tag_id and tag.name
    ]
    known = math.isfinite(group.frequency_hz)
    return NamedTag(
        tag_id=group.tag_id,
        frequency_hz=group.frequency_hz if known else None,
        name=names[-1] if names else None,
    )
