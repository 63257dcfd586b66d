"""Correct a listed tag by what was measured of it."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final, Literal

from uavrt.messages import Beep, BeepKind, Tag

DRIFT: Final = 0.005
"""Change of a measured interval with temperature and battery, as a part of it."""
LEAST_UNCERTAINTY: Final = 0.01
"""Difference from a listed interval that is no other rate, as a part of it."""
_INTERVAL_ERROR_S: Final = 0.003
"""Largest error of a measured interval [s]."""
_DRIFT_HZ: Final = 100.0
"""Distance from a label that is worth listing [Hz]; a fifth of the usual search."""
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
    undo: bool = False
    """Whether it lists the values before an earlier correction again."""

    def __str__(self) -> str:
        """Write it as a line for the operator."""
        return (
            f"tag {self.tag_id}: {_listed(self.after, self)}, was {_listed(self.before, self)}"
        )


def _listed(tag: Tag, one: TagCorrection) -> str:
    if one.what == "frequency":
        return f"{tag.frequency_hz / 1e6:.6f} MHz"
    intervals = " and ".join(f"{1e3 * interval_s:.1f}" for interval_s in tag.pulse_intervals_s)
    return (
        f"{intervals} ms ± {1e3 * tag.interval_uncertainty_s:.1f} ms, "
        f"jitter {1e3 * tag.interval_jitter_s:.1f} ms"
    )


def corrected_frequency(tag: Tag, frequency_hz: float) -> Tag:
    """List a tag at the frequency that was measured, to 1 Hz."""
    return replace(tag, frequency_hz=float(round(frequency_hz)))


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
        if not one.undo:
            standing.append(one)
        elif undone := [x for x in standing if x.tag_id == one.tag_id]:
            standing.remove(undone[-1])
    return standing


def correction_of(tag: Tag, beep: Beep, time_ns: int) -> TagCorrection | None:
    """Get what a measured sender corrects of a tag that it may be; None if nothing."""
    at_other_rate = beep.kind is BeepKind.OTHER_RATE
    drifted = beep.kind is BeepKind.LISTED and beep.tag_ids == (tag.tag_id,)
    if (
        beep.kind is BeepKind.OFF_LABEL
        or (at_other_rate and keeps_interval(tag, beep.interval_s, _INTERVAL_ERROR_S))
        or (drifted and abs(beep.frequency_hz - tag.frequency_hz) >= _DRIFT_HZ)
    ):
        what: Literal["frequency", "interval"] = "frequency"
        after = corrected_frequency(tag, beep.frequency_hz)
    elif beep.kind is BeepKind.LISTED and _is_narrow(tag, beep.interval_s):
        return None
    elif at_other_rate or beep.kind is BeepKind.LISTED:
        what, after = "interval", corrected_interval(tag, beep.interval_s, beep.jitter_s)
    else:
        return None
    if tag.coded or after == tag:
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
        at_other_rate = beep.kind is BeepKind.OTHER_RATE and tag.tag_id == beep.tag_ids[0]
        if abs(tag.frequency_hz - listed_hz) >= 1.0 or (
            at_other_rate and keeps_interval(tag, beep.interval_s)
        ):
            return False
    return True


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
