"""Compare the detected trains of pulses with the listed tags to identify their senders."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from uavrt.config.tags.tag_corrections import (
    LEAST_UNCERTAINTY,
    keeps_interval,
    shared_offset_ppm,
)
from uavrt.core.messages import Beep, BeepKind, Tag, mirrored_reason
from uavrt.core.units import ns_from_s
from uavrt.detection.beeps.beep_trains import Train
from uavrt.detection.beeps.tuning import NAMING

_MAYBE_MIRRORED = (BeepKind.OFF_LABEL, BeepKind.OTHER_RATE, BeepKind.UNLISTED)


def name_trains(
    trains: Sequence[Train],
    tags: Sequence[Tag],
    frequency_window_hz: float,
    *,
    center_hz: float | None = None,
    start_ns: int = 0,
) -> list[Beep]:
    """Identify trains as listed tags, their images, or unlisted senders.

    `trains`: at absolute frequencies. `center_hz`: radio frequency, to recognise tags mirrored
    about it because I and Q are swapped; None: not checked.
    """
    named = [_name(train, tags, frequency_window_hz, start_ns) for train in trains]
    listed_ids = _listed_ids(named)
    finished = [_finished(one, listed_ids, named) for one in named]
    if center_hz is None:
        return finished
    return _with_mirrored(finished, trains, tags, frequency_window_hz, center_hz)


def _name(train: Train, tags: Sequence[Tag], window_hz: float, start_ns: int) -> Beep:
    interval_s = train.interval_s
    near = _within(train, tags, window_hz + NAMING.edge_hz)
    reach_hz = NAMING.reach_ppm * 1e-6 * train.frequency_hz
    kind, names, reason = BeepKind.UNLISTED, list[Tag](), train.doubt or ""
    fitting = [tag for tag in _within(train, tags, reach_hz) if _fits(interval_s, tag, train)]
    others_s = [one for one in _rates(train) if not any(_fits(one, t, train) for t in near)]
    if train.image_of_hz is not None:
        kind = BeepKind.IMAGE
    elif any(
        tag.coded and abs(tag.frequency_hz - train.frequency_hz) <= NAMING.code_hz
        for tag in tags
    ):
        kind = BeepKind.LISTED
    elif near and not others_s:
        kind, names = BeepKind.LISTED, [tag for tag in near if _fits(interval_s, tag, train)]
    elif train.together > 1:
        kind, reason = BeepKind.NOT_ANIMAL, f"at {train.together} frequencies at once"
    elif train.doubt is not None:
        kind, names = BeepKind.DOUBTFUL, near[:1]
    elif near:
        kind, interval_s = BeepKind.OTHER_RATE, others_s[0]
        # Prefer tags that change to this rate, or whose missing pulses would look like it.
        names = [
            one for one in near if _fits(interval_s, one, train, NAMING.interval_ratios)
        ] or near
        reason = _twice(interval_s, names[0])
        others = [tag for tag in _within(train, tags, reach_hz) if tag not in near]
        names = [*names, *(tag for tag in others if keeps_interval(tag, interval_s))]
    elif fitting:
        kind, names = BeepKind.OFF_LABEL, fitting
    names = names[: NAMING.most_names]
    return Beep(
        kind=kind,
        time_ns=start_ns + ns_from_s(float(train.points.times_s[-1])),
        frequency_hz=train.frequency_hz,
        interval_s=interval_s,
        jitter_s=train.jitter_s,
        pulses=len(train.points),
        level_db=train.level_db,
        tag_ids=tuple(tag.tag_id for tag in names),
        offsets_hz=tuple(train.frequency_hz - tag.frequency_hz for tag in names),
        image_of_hz=train.image_of_hz,
        reason=reason,
    )


def _finished(one: Beep, listed_ids: set[int], named: Sequence[Beep]) -> Beep:
    """Complete a result by the results for all trains.

    A tag that was also found at its own frequency is dropped from the possible tags of a train.
    An image gets the tags of its source.
    """
    if one.kind is BeepKind.IMAGE:
        for other in named:
            if other.frequency_hz == one.image_of_hz:
                return replace(one, tag_ids=other.tag_ids, offsets_hz=other.offsets_hz)
    if one.kind is BeepKind.OFF_LABEL:
        left = [place for place, tag_id in enumerate(one.tag_ids) if tag_id not in listed_ids]
        return replace(
            one,
            tag_ids=tuple(one.tag_ids[place] for place in left),
            offsets_hz=tuple(one.offsets_hz[place] for place in left),
            kind=BeepKind.OFF_LABEL if left else BeepKind.UNLISTED,
        )
    return one


def _with_mirrored(
    found: list[Beep],
    trains: Sequence[Train],
    tags: Sequence[Tag],
    window_hz: float,
    center_hz: float,
) -> list[Beep]:
    """Recognise tags at the mirror frequency about the radio's centre (I and Q swapped).

    I and Q are not swapped if a tag is received at its own frequency, or if a common error of
    the receiver explains why several tags are off frequency. If many tags are off their listed
    frequencies, mirror frequencies prove nothing, because some then fit by chance. If a train
    may also belong to a tag that is off its label or sends at another rate, a second mirrored
    train is required.
    """
    there = [
        _mirrored_tags(one, train, tags, window_hz, center_hz)
        for one, train in zip(found, trains, strict=True)
    ]
    shared = shared_offset_ppm(found) is not None
    plain = (BeepKind.LISTED, BeepKind.OFF_LABEL) if shared else (BeepKind.LISTED,)
    if any(
        one.kind in plain and one.tag_ids and not near
        for one, near in zip(found, there, strict=True)
    ):
        return found
    listed_ids = _listed_ids(found)
    pairs = [
        (one, near[0] if near and _is_mirrored(one, near[0], center_hz, listed_ids) else None)
        for one, near in zip(found, there, strict=True)
    ]
    count = len({tag.tag_id for _, tag in pairs if tag})
    others = sum(one.kind is BeepKind.OFF_LABEL and not tag for one, tag in pairs)
    if count < NAMING.least_mirrored * (count + others):
        return found
    alone = any(tag and one.kind is BeepKind.UNLISTED for one, tag in pairs)
    certain = alone or (count > 1 and not shared)
    return [_as_mirrored(one, tag, certain=certain) if tag else one for one, tag in pairs]


def _mirrored_tags(
    one: Beep, train: Train, tags: Sequence[Tag], window_hz: float, center_hz: float
) -> list[Tag]:
    there = replace(train, frequency_hz=2.0 * center_hz - train.frequency_hz)
    near = _within(there, tags, window_hz + NAMING.edge_hz)
    return [tag for tag in near if _fits(one.interval_s, tag, train)]


def _is_mirrored(one: Beep, tag: Tag, center_hz: float, listed_ids: set[int]) -> bool:
    """True if a silent tag's mirror frequency explains a train far better than its label."""
    away_hz = abs(one.frequency_hz - tag.frequency_hz)
    off_hz = abs(2.0 * center_hz - one.frequency_hz - tag.frequency_hz)
    silent = one.kind in _MAYBE_MIRRORED and tag.tag_id not in listed_ids
    return silent and off_hz <= NAMING.mirror_share * away_hz


def _as_mirrored(one: Beep, tag: Tag, *, certain: bool) -> Beep:
    if not certain:
        return replace(one, reason=one.reason or mirrored_reason(tag.tag_id))
    away_hz = (one.frequency_hz - tag.frequency_hz,)
    ids = (tag.tag_id,)
    return replace(one, kind=BeepKind.MIRRORED, tag_ids=ids, offsets_hz=away_hz, reason="")


def _listed_ids(named: Sequence[Beep]) -> set[int]:
    return {tag_id for one in named if one.kind is BeepKind.LISTED for tag_id in one.tag_ids}


def _twice(interval_s: float, tag: Tag) -> str:
    twice = any(
        abs(2.0 * interval_s - listed_s) <= LEAST_UNCERTAINTY * listed_s
        for listed_s in tag.pulse_intervals_s
    )
    return "twice the listed one (mortality)" if twice else ""


def _within(train: Train, tags: Sequence[Tag], reach_hz: float) -> list[Tag]:
    def away_hz(tag: Tag) -> float:
        return abs(train.frequency_hz - tag.frequency_hz)

    near = [tag for tag in tags if not tag.coded and away_hz(tag) <= reach_hz]
    return sorted(near, key=away_hz)


def _fits(interval_s: float, tag: Tag, train: Train, ratios: Sequence[float] = (1.0,)) -> bool:
    allowed_s = 3.0 * min(train.interval_sigma_s, 0.01 * interval_s) + NAMING.timing_s
    return any(keeps_interval(tag, ratio * interval_s, ratio * allowed_s) for ratio in ratios)


def _rates(train: Train) -> Iterator[float]:
    """Reliably measured pulse intervals of a train [s], beginning with that of most pulses."""
    yield train.interval_s
    for one in train.beats:
        places = int(one.beat.numbers[-1]) + 1
        enough = max(NAMING.least_pulses, math.ceil(NAMING.least_present * places))
        if one.members.size >= enough and one.beat.interval_s != train.interval_s:
            yield one.beat.interval_s
