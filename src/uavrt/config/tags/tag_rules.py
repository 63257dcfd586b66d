"""Check tags for plausibility and report faults in the units of the file.

Both tag file formats are read into `TagDraft` records, which are checked here; tags received
over the radio link are checked by the same rules
(`uavrt.config.tags.tag_files.faults_of_tags`). The limits allow a margin around usual wildlife
tags: pulses of 15 to 20 ms every 1 to 2 s near 150 MHz (thesis §1.1).
"""

import math

from uavrt.config.tags.code_rules import (
    BURST_TOLERANCE_MS,
    CODED_K,
    CODED_PULSE_WIDTH_MS,
    faults_of_codes,
    faults_of_gaps,
)
from uavrt.config.tags.tag_drafts import Entry as Entry
from uavrt.config.tags.tag_drafts import Fault as Fault
from uavrt.config.tags.tag_drafts import Quantity as Quantity
from uavrt.config.tags.tag_drafts import TagDraft as TagDraft
from uavrt.core.messages import DEFAULT_FALSE_ALARM_PROBABILITY, Tag
from uavrt.core.units import hz_from_mhz, s_from_ms

MIN_FREQUENCY_HZ, MAX_FREQUENCY_HZ = 20e6, 1e9
MAX_INTERVAL_MS = 60_000.0
MIN_PULSE_WIDTH_MS, MAX_PULSE_WIDTH_MS = 1.0, 1_000.0
SHORTEST_LIKELY_MS = 60.0
"""Limit for detecting a wrong unit [ms]: an interval shorter than this and than the pulse is
assumed to be in seconds."""
MAX_SLIDE_HZ = 500.0
"""Largest change of a tag's frequency within a pulse [Hz]."""
MAX_K = 100
MAX_FALSE_ALARM_PROBABILITY = 0.5  # as TagTracker's
MAX_ID = 2**32 - 1  # uint32 on the wire

USUAL_UNCERTAINTY_MS, USUAL_JITTER_MS = 60.0, 10.0
"""Interval uncertainty and jitter of a tag whose list has none [ms]: the thesis's own values
(figure 4.9). Labels are rounded, and intervals change with temperature and battery."""

_FREQUENCY_UNITS = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6}


def tags_from_drafts(drafts: list[TagDraft], faults: list[Fault]) -> tuple[Tag, ...]:
    """Check drafts and convert them to tags; faults are added to `faults`, and if there are
    any, no tag is returned.
    """
    first_lines: dict[int, int] = {}
    for draft in drafts:
        _check(draft, faults)
        identity = draft.entries.get("id")
        if identity is not None and math.isfinite(identity.number):
            first = first_lines.setdefault(int(identity.number), identity.line)
            if first != identity.line:
                faults.append(
                    Fault(
                        line=identity.line,
                        text=f"id {identity.number:.0f} is already the tag of line {first}",
                    )
                )
    faults += faults_of_codes(drafts)
    return () if faults else tuple(_tag(draft) for draft in drafts)


def _tag(draft: TagDraft) -> Tag:
    entries = draft.entries
    intervals = [entries["interval"]]
    if "second_interval" in entries:
        intervals.append(entries["second_interval"])

    def number(quantity: Quantity, default: float) -> float:
        return entries[quantity].number if quantity in entries else default

    shortest_ms = min(entry.number for entry in intervals)
    width_ms = number("pulse_width", CODED_PULSE_WIDTH_MS)
    k = int(number("k", 3 if draft.gaps is None else CODED_K))
    uncertainty_ms, jitter_ms = BURST_TOLERANCE_MS, 0.0
    if draft.gaps is None:
        uncertainty_ms = usual_uncertainty_ms(shortest_ms, width_ms, k)
        jitter_ms = min(USUAL_JITTER_MS, 0.01 * shortest_ms)
    frequency = entries["frequency"]
    return Tag(
        tag_id=int(entries["id"].number),
        frequency_hz=(
            hz_from_mhz(frequency.number) if frequency.unit == "MHz" else frequency.number
        ),
        pulse_width_s=s_from_ms(width_ms),
        pulse_intervals_s=tuple(s_from_ms(interval.number) for interval in intervals),
        interval_uncertainty_s=s_from_ms(number("interval_uncertainty", uncertainty_ms)),
        interval_jitter_s=s_from_ms(number("interval_jitter", jitter_ms)),
        k=k,
        false_alarm_probability=number(
            "false_alarm_probability", DEFAULT_FALSE_ALARM_PROBABILITY
        ),
        name=draft.name,
        frequency_slide_hz=number("frequency_slide", 0.0),
        gaps_s=tuple(round(s_from_ms(gap.number), 9) for gap in draft.gaps or ()),
    )


def usual_uncertainty_ms(shortest_ms: float, width_ms: float, k: int) -> float:
    """Return the interval uncertainty for a tag list that gives none [ms]: 60 ms, or less if a
    search requires it.

    It is at most a tenth of the interval, and small enough to predict the last of K pulses to
    within one interval (see `_fault_of_group`).
    """
    room_ms = 0.5 * (shortest_ms - 2.0 * width_ms)
    most_ms = min(0.1 * shortest_ms, shortest_ms / max(k - 1, 1), room_ms)
    return math.floor(1e3 * min(USUAL_UNCERTAINTY_MS, most_ms)) / 1e3


def _check(draft: TagDraft, faults: list[Fault]) -> None:
    good: dict[Quantity, Entry] = {}
    for quantity, entry in draft.entries.items():
        text = _fault_of_number(quantity, entry)
        if text is None:
            good[quantity] = entry
        else:
            faults.append(Fault(line=entry.line, text=f"{entry.label} {text}"))
    pairs = _fault_of_pairs(good)
    if draft.gaps is not None:
        pairs = faults_of_gaps(draft.gaps, good.get("interval"), good.get("pulse_width"))
        if (slide := good.get("frequency_slide")) is not None and slide.number:
            pairs = [*pairs, (slide, "is only for a beeping tag")]
    for entry, text in pairs:
        faults.append(Fault(line=entry.line, text=f"{entry.label} {text}"))


def _fault_of_number(quantity: Quantity, entry: Entry) -> str | None:
    n = entry.number
    if not math.isfinite(n):
        return "is not a finite number"
    match quantity:
        case "id":
            if n != int(n) or not 1 <= n <= MAX_ID:
                return f"must be a whole number from 1 to {MAX_ID}"
        case "frequency":
            return _fault_of_frequency(n, entry.unit)
        case "interval" | "second_interval":
            if not 0.0 < n <= MAX_INTERVAL_MS:
                return f"must be above 0 and at most {MAX_INTERVAL_MS:.0f} ms"
            if n < 2.0 * MIN_PULSE_WIDTH_MS:
                return f"is too short for any pulse; is it in seconds? Write {n * 1e3:g}"
        case "pulse_width":
            if not MIN_PULSE_WIDTH_MS <= n <= MAX_PULSE_WIDTH_MS:
                hint = "; is it in seconds?" if 0.0 < n < MIN_PULSE_WIDTH_MS else ""
                low, high = MIN_PULSE_WIDTH_MS, MAX_PULSE_WIDTH_MS
                return f"must be {low:.0f} to {high:.0f} ms{hint}"
        case "interval_uncertainty" | "interval_jitter":
            if n < 0.0:
                return "must not be negative"
        case "frequency_slide":
            if abs(n) > MAX_SLIDE_HZ:
                return f"must be at most {MAX_SLIDE_HZ:.0f} Hz, up or down"
        case "k":
            if n != int(n) or not 1 <= n <= MAX_K:
                return f"must be a whole number from 1 to {MAX_K}"
        case "false_alarm_probability":
            if not 0.0 < n <= MAX_FALSE_ALARM_PROBABILITY:
                hint = f"; {n:g} % is {n / 100:g}" if 1.0 <= n < 100.0 else ""
                return f"must be above 0 and at most {MAX_FALSE_ALARM_PROBABILITY:g}{hint}"
    return None


def _fault_of_frequency(n: float, unit: str) -> str | None:
    if MIN_FREQUENCY_HZ <= n * _FREQUENCY_UNITS[unit] <= MAX_FREQUENCY_HZ:
        return None
    for other, factor in _FREQUENCY_UNITS.items():
        if other != unit and MIN_FREQUENCY_HZ <= n * factor <= MAX_FREQUENCY_HZ:
            value = n * factor / _FREQUENCY_UNITS[unit]
            return f"looks like {other} but is read as {unit}: write {value:.13g}"
    low, high = MIN_FREQUENCY_HZ / 1e6, MAX_FREQUENCY_HZ / 1e6
    return f"must be a frequency from {low:.0f} to {high:.0f} MHz"


def _fault_of_pairs(entries: dict[Quantity, Entry]) -> list[tuple[Entry, str]]:
    found: list[tuple[Entry, str]] = []
    first, second = entries.get("interval"), entries.get("second_interval")
    intervals = [entry for entry in (first, second) if entry is not None]
    if first is not None and second is not None and first.number == second.number:
        found.append((second, "is the same as the first interval; leave it out"))
    if not intervals:
        return found
    shortest = min(intervals, key=lambda entry: entry.number)
    width = entries.get("pulse_width")
    if width is not None and width.number >= shortest.number:
        if shortest.number < SHORTEST_LIKELY_MS:
            # What else does not fit it is right, most likely.
            text = f"must be longer than the pulse, {width.label}; is it in seconds?"
            return [*found, (shortest, text)]
        found.append((width, f"must be shorter than the interval, {shortest.label}"))
    timing: tuple[Quantity, ...] = ("interval_uncertainty", "interval_jitter")
    for quantity in timing:
        entry = entries.get(quantity)
        if entry is not None and entry.number >= shortest.number / 2:
            text = f"must be under half of the interval, {shortest.label}"
            found.append((entry, text))
    return found or _fault_of_group(entries, shortest)


def _fault_of_group(entries: dict[Quantity, Entry], shortest: Entry) -> list[tuple[Entry, str]]:
    """Check that a tag's pulse width and its number of summed pulses K allow a search; return
    the faults.
    """
    uncertainty = entries.get("interval_uncertainty")
    width, k = entries.get("pulse_width"), entries.get("k")
    loose_ms = 0.0 if uncertainty is None else uncertainty.number
    found: list[tuple[Entry, str]] = []
    if width is not None and shortest.number - loose_ms <= 2.0 * width.number:
        less = "" if uncertainty is None else f" less {uncertainty.label}"
        found.append((width, f"must be under half of the interval, {shortest.label}{less}"))
    if k is not None and (k.number - 1.0) * loose_ms > shortest.number and uncertainty:
        text = (
            f"is too large for {uncertainty.label}: after so many pulses, the time of the "
            f"next is uncertain by more than the interval, {shortest.label}"
        )
        found.append((k, text))
    return found
