"""Correct a tag's entry in the tag list by its measured frequency and pulse interval."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Final, Literal

from uavrt.core.messages import Beep, BeepKind, Tag

MEASURED: Final = (BeepKind.LISTED, BeepKind.OFF_LABEL, BeepKind.OTHER_RATE)
"""Kinds of measured pulse trains that may be used to correct a tag's list entry."""
DRIFT: Final = 0.005
"""Assumed relative change of a tag's interval with temperature and battery (0.005: 0.5 %)."""
LEAST_UNCERTAINTY: Final = 0.01
"""Relative difference up to which a measured interval agrees with the listed one (0.01: 1
%)."""
_DRIFT_HZ: Final = 100.0
"""Difference from the labelled frequency above which the tag's entry is corrected [Hz]; a fifth
of the usual search window."""
_SEARCH_HZ: Final = 530.0
"""Half-width of a tag's usual search band, plus the error of a measured frequency [Hz]."""
_LEAST_SHARED_PPM: Final = 0.5
"""Minimum frequency offset common to all tags that is attributed to the receiver's oscillator
[ppm]."""
_AGREE_PPM: Final = 1.5
"""Maximum difference of one tag's frequency offset from the offset common to all tags [ppm].
The difference must also be below a sixth of the common offset."""
_SHARE: Final = 0.75
"""Minimum share of tags that must have a common frequency offset; of four tags, one may have
drifted independently."""
_LEAST_JITTER_S: Final = 0.002
_JITTER_SIGMAS: Final = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TagCorrection:
    """Correction of one property of a tag: the list entry before and after the correction."""

    time_ns: int
    tag_id: int
    what: Literal["frequency", "interval"]
    before: Tag
    after: Tag

    def applied(self, tag: Tag) -> Tag:
        """Return a copy of the tag with this correction's frequency or interval."""
        return _listed_as(tag, self.after, self.what)

    def undone(self, tag: Tag, time_ns: int) -> "TagCorrection":
        """Return the correction, dated `time_ns`, that undoes this one."""
        after = _listed_as(tag, self.before, self.what)
        return replace(self, time_ns=time_ns, before=tag, after=after)

    def undoes(self, other: "TagCorrection") -> bool:
        """True if this correction restores the values that the `other` correction replaced."""
        same = (self.tag_id, self.what) == (other.tag_id, other.what)
        return same and self.applied(other.before) == other.before

    def __str__(self) -> str:
        return (
            f"tag {self.tag_id}: {_listed(self.after, self)}, was {_listed(self.before, self)}"
        )


def _listed_as(tag: Tag, other: Tag, what: Literal["frequency", "interval"]) -> Tag:
    """Return a tag with the frequency, or the intervals, of another tag."""
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
    """Return a copy of a tag in which a measured interval and its jitter [s] replace a listed
    interval.

    The nearest listed interval is replaced. If it differs from the measured one by more than
    its uncertainty, the measured interval is added as a second interval instead.
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
        # The other rate of a tag with two rates was not measured.
        interval_uncertainty_s=(
            round(DRIFT * measured_s, 4) if alone else tag.interval_uncertainty_s
        ),
        interval_jitter_s=jitter_s if alone else max(jitter_s, tag.interval_jitter_s),
    )


def standing_corrections(corrections: Iterable[TagCorrection]) -> list[TagCorrection]:
    """Return the corrections that no later correction has undone, in order of time."""
    standing: list[TagCorrection] = []
    for one in corrections:
        last = next((x for x in reversed(standing) if x.tag_id == one.tag_id), None)
        if last is not None and one.undoes(last):
            standing.remove(last)
        else:
            standing.append(one)
    return standing


def shared_offset_ppm(found: Iterable[Beep]) -> float | None:
    """Return the frequency offset common to the measured tags [ppm], or None if they have none.

    Two tags must agree, or three of four. Pulse trains that may belong to two tags, or that
    have an unlisted interval, are ignored.
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
    """Return one sentence that states the frequency offset common to all tags and the setting
    that corrects it; empty without such an offset.
    """
    ppm = shared_offset_ppm(found)
    if ppm is None:
        return []
    remedy = f"{'lower' if ppm > 0.0 else 'raise'} frequency_correction_ppm by {abs(ppm):.1f}"
    return [f"the tags are {ppm:+.1f} ppm off their labels: the receiver's own error; {remedy}"]


def words_of_beeps(found: Sequence[Beep]) -> list[str]:
    """Return sentences about the measured pulse trains that disagree with the tag list."""
    return [str(one) for one in found if one.odd] + shared_offset_in_words(found)


def correction_of(
    tag: Tag, beep: Beep, time_ns: int, found: Sequence[Beep] = ()
) -> TagCorrection | None:
    """Return the correction that a measured pulse train `beep` implies for a tag; None if the
    list entry is right.

    The frequency is corrected first. Called again with the corrected tag, the function returns
    the correction of the interval. An offset common to all trains in `found` is attributed to
    the receiver and not corrected.
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
    """True while no tag that a pulse train was compared with has been corrected since."""
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
    """True if the pulse train's frequency is within the band that is searched for a tag it may
    belong to.
    """
    place = beep.tag_ids.index(tag_id)
    return place == 0 or abs(beep.offsets_hz[place]) <= _SEARCH_HZ


def keeps_interval(tag: Tag, interval_s: float, error_s: float = 0.0) -> bool:
    """True if a measured interval, within its error, is in the tag's allowed range."""
    return any(
        abs(interval_s - one)
        <= max(tag.interval_uncertainty_s, LEAST_UNCERTAINTY * one) + error_s
        for one in tag.pulse_intervals_s
    )


def _is_narrow(tag: Tag, interval_s: float) -> bool:
    """True if a listed interval is close to `interval_s` and so exact that a correction would
    not improve it.
    """
    uncertainty_s = tag.interval_uncertainty_s
    off_s = min(abs(interval_s - listed_s) for listed_s in tag.pulse_intervals_s)
    two_rates = len(tag.pulse_intervals_s) > 1  # their uncertainty is unchanged
    return off_s <= 0.5 * uncertainty_s and (
        two_rates or uncertainty_s <= 2 * DRIFT * interval_s
    )
