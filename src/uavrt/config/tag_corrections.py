"""Correct a listed tag by what was measured of it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Final, Literal

from uavrt.messages import Beep, BeepKind, Tag

MEASURED: Final = (BeepKind.LISTED, BeepKind.OFF_LABEL, BeepKind.OTHER_RATE)
"""Senders that correct the list."""
DRIFT: Final = 0.005
"""Change of a measured interval with temperature and battery, as a part of it."""
LEAST_UNCERTAINTY: Final = 0.01
"""Difference from a listed interval that is no other rate, as a part of it."""
_DRIFT_HZ: Final = 100.0
"""Distance from a label that is worth listing [Hz]; a fifth of the usual search."""
_SEARCH_HZ: Final = 530.0
"""Half-width of the usual search, with the error of a measured frequency [Hz]."""
_LEAST_SHARED_PPM: Final = 0.5
"""Smallest offset of all tags that is the receiver's."""
_AGREE_PPM: Final = 1.5
"""Largest difference of a tag from the offset that all share, at most a sixth of that."""
_SHARE: Final = 0.75
"""Least share of the tags that agree; one of four may have drifted by itself."""
_LEAST_JITTER_S: Final = 0.002
_JITTER_SIGMAS: Final = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TagCorrection:
    """What of a tag was corrected, and what was listed before."""

    time_ns: int
    tag_id: int
    what: Literal["frequency", "interval"]
    before: Tag
    after: Tag

    def applied(self, tag: Tag) -> Tag:
        """List what was corrected for an entry that may have changed otherwise."""
        return _listed_as(tag, self.after, self.what)

    def undone(self, tag: Tag, time_ns: int) -> "TagCorrection":
        """Get the correction that lists what was listed before it."""
        after = _listed_as(tag, self.before, self.what)
        return replace(self, time_ns=time_ns, before=tag, after=after)

    def undoes(self, other: "TagCorrection") -> bool:
        """Whether it lists what was listed before another correction."""
        same = (self.tag_id, self.what) == (other.tag_id, other.what)
        return same and self.applied(other.before) == other.before

    def __str__(self) -> str:
        """Write it as a line for the operator."""
        return (
            f"tag {self.tag_id}: {_listed(self.after, self)}, was {_listed(self.before, self)}"
        )


def _listed_as(tag: Tag, other: Tag, what: Literal["frequency", "interval"]) -> Tag:
    """Change one measured property of a tag, and nothing else of its entry."""
    if what == "frequency":
        return replace(tag, frequency_hz=other.frequency_hz)
    return replace(
        tag,
        pulse_intervals_s=other.pulse_intervals_s,
        interval_uncertainty_s=other.interval_uncertainty_s,
        interval_jitter_s=other.interval_jitter_s,
    )


def _listed(tag: Tag, one: TagCorrection) -> str:
    if one.what == "frequency":
        return f"{tag.frequency_hz / 1e6:.6f} MHz"
    intervals = " and ".join(f"{1e3 * interval_s:.1f}" for interval_s in tag.pulse_intervals_s)
    return (
        f"{intervals} ms ± {1e3 * tag.interval_uncertainty_s:.1f} ms, "
        f"jitter {1e3 * tag.interval_jitter_s:.1f} ms"
    )


def corrected_interval(tag: Tag, interval_s: float, jitter_s: float) -> Tag:
    """List a tag with the interval that was measured, in place of the nearest listed one.

    An interval that is none of those listed is added as the second, or replaces the second.

    `interval_s`, `jitter_s`: the interval, and the standard deviation of the pulses about it.
    """
    listed = list(tag.pulse_intervals_s)
    nearest = min(range(len(listed)), key=lambda place: abs(listed[place] - interval_s))
    allowed_s = max(tag.interval_uncertainty_s, 0.02 * listed[nearest])
    measured_s = round(interval_s, 4)
    jitter_s = max(_LEAST_JITTER_S, round(_JITTER_SIGMAS * jitter_s, 4))
    if abs(listed[nearest] - interval_s) <= allowed_s:
        listed[nearest] = measured_s
    else:
        listed = [listed[0], measured_s]
    alone = len(listed) == 1
    return replace(
        tag,
        pulse_intervals_s=tuple(listed),
        # The other rate of a tag that has two was not measured.
        interval_uncertainty_s=(
            round(DRIFT * measured_s, 4) if alone else tag.interval_uncertainty_s
        ),
        interval_jitter_s=jitter_s if alone else max(jitter_s, tag.interval_jitter_s),
    )


def standing_corrections(corrections: Iterable[TagCorrection]) -> list[TagCorrection]:
    """Corrections in order of time, without those that were undone and what undid them."""
    standing: list[TagCorrection] = []
    for one in corrections:
        last = next((x for x in reversed(standing) if x.tag_id == one.tag_id), None)
        if last is not None and one.undoes(last):
            standing.remove(last)
        else:
            standing.append(one)
    return standing


def shared_offset_ppm(found: Iterable[Beep]) -> float | None:
    """Offset that the tags share, if they do: the receiver's own error.

    Two tags, and three of four, show it. Trains that may be of two tags, or of another rate,
    are ignored.
    """
    off = {
        one.tag_ids: 1e6 * one.offsets_hz[0] / (one.frequency_hz - one.offsets_hz[0])
        for one in found
        if one.kind in (BeepKind.OFF_LABEL, BeepKind.LISTED) and len(one.tag_ids) == 1
    }
    if len(off) < 2:
        return None
    shared_ppm = median(off.values())
    agree = sum(_agrees(one, shared_ppm) for one in off.values())
    shared = agree >= max(2.0, _SHARE * len(off)) and abs(shared_ppm) >= _LEAST_SHARED_PPM
    return shared_ppm if shared else None


def _agrees(ppm: float, shared_ppm: float) -> bool:
    return abs(ppm - shared_ppm) <= min(_AGREE_PPM, abs(shared_ppm) / 6.0)


def shared_offset_in_words(found: Iterable[Beep]) -> list[str]:
    """Write the offset that all tags share, with the remedy, as one line; none: no line."""
    ppm = shared_offset_ppm(found)
    if ppm is None:
        return []
    remedy = f"{'lower' if ppm > 0.0 else 'raise'} frequency_correction_ppm by {abs(ppm):.1f}"
    return [f"the tags are {ppm:+.1f} ppm off their labels: the receiver's own error; {remedy}"]


def words_of_beeps(found: Sequence[Beep]) -> list[str]:
    """Describe what is not as listed, one line each."""
    return [str(one) for one in found if one.odd] + shared_offset_in_words(found)


def correction_of(
    tag: Tag, beep: Beep, time_ns: int, found: Sequence[Beep] = ()
) -> TagCorrection | None:
    """Get what a measured sender corrects of a tag that it may be; None if nothing.

    Frequency and interval are corrected one after the other: applied to the corrected tag, it
    gets the next correction.

    `found`: all senders of the flight. An offset that they share is the receiver's, and then
    only a tag that is farther off its label is listed elsewhere.
    """
    other_rate = beep.kind is BeepKind.OTHER_RATE
    if tag.coded or beep.kind not in MEASURED:
        return None
    keeps = keeps_interval(tag, beep.interval_s)
    off_label = beep.kind is BeepKind.OFF_LABEL or (
        other_rate and keeps and not _is_searched(tag.tag_id, beep)
    )
    off_hz = beep.frequency_hz - tag.frequency_hz
    drifted = beep.tag_ids == (tag.tag_id,) and abs(off_hz) >= _DRIFT_HZ
    moved = drifted or (off_label and abs(off_hz) >= 1.0)
    if moved and (shared_ppm := shared_offset_ppm(found)) is not None:
        moved = off_label and not _agrees(1e6 * off_hz / tag.frequency_hz, shared_ppm)
    what: Literal["frequency", "interval"] = "interval"
    after = corrected_interval(tag, beep.interval_s, beep.jitter_s)
    if keeps or not other_rate:
        if moved:
            what = "frequency"
            after = replace(tag, frequency_hz=float(round(beep.frequency_hz)))
        elif _is_narrow(tag, beep.interval_s):
            return None
    if after == tag:
        return None
    return TagCorrection(time_ns=time_ns, tag_id=tag.tag_id, what=what, before=tag, after=after)


def still_holds(beep: Beep, tags: Iterable[Tag]) -> bool:
    """Whether a measurement was made with these entries of the list, or of tags not in it."""
    at_hz = beep.frequency_hz if beep.image_of_hz is None else beep.image_of_hz
    away_hz = dict(zip(beep.tag_ids, beep.offsets_hz, strict=True))
    for tag in tags:
        if tag.tag_id not in away_hz:
            continue
        listed_hz = at_hz - away_hz[tag.tag_id]
        at_other_rate = beep.kind is BeepKind.OTHER_RATE and _is_searched(tag.tag_id, beep)
        if abs(tag.frequency_hz - listed_hz) >= 1.0 or (
            at_other_rate and keeps_interval(tag, beep.interval_s)
        ):
            return False
    return True


def _is_searched(tag_id: int, beep: Beep) -> bool:
    """Whether a tag that may be meant, at another rate, is searched for where it beeps."""
    place = beep.tag_ids.index(tag_id)
    return place == 0 or abs(beep.offsets_hz[place]) <= _SEARCH_HZ


def keeps_interval(tag: Tag, interval_s: float, error_s: float = 0.0) -> bool:
    """Whether an interval, measured with some error, is one that the list allows for a tag."""
    return any(
        abs(interval_s - one)
        <= max(tag.interval_uncertainty_s, LEAST_UNCERTAINTY * one) + error_s
        for one in tag.pulse_intervals_s
    )


def _is_narrow(tag: Tag, interval_s: float) -> bool:
    """Whether a correction by the measured interval would gain nothing."""
    uncertainty_s = tag.interval_uncertainty_s
    off_s = min(abs(interval_s - listed_s) for listed_s in tag.pulse_intervals_s)
    two_rates = len(tag.pulse_intervals_s) > 1  # their uncertainty stays as it is
    return off_s <= 0.5 * uncertainty_s and (
        two_rates or uncertainty_s <= 2 * DRIFT * interval_s
    )
