"""Check the codes of coded tags for plausibility, and find similar codes.

A code consists of the gaps between the pulses of a burst. The tolerances are those of tag
registration: 1.5 ms for the sum of all gap errors, 4 ms for the burst interval.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from uavrt.config.tags.tag_drafts import Entry, Fault, TagDraft
from uavrt.core.messages import Tag

MAX_CODES = 500
"""Maximum number of coded tags in a list; one core can search for this many besides its other
work."""
MOST_NEAR = 50
"""Maximum number of pairs of similar codes that are printed as warnings."""
MAX_GAPS = 7
MAX_GAP_MS = 1_000.0
CODED_PULSE_WIDTH_MS = 2.5
CODED_K = 10
GAP_TOLERANCE_S = 1.5e-3
"""Maximum sum of a burst's gap errors for the burst to match a code [s]."""
BURST_TOLERANCE_MS = 4.0
_UNLIKE_MS = 0.01
"""Gap difference below which the gaps of two codes are considered equal [ms]."""
_SAME_KHZ = 1.0
_MHZ = {"Hz": 1e-6, "MHz": 1.0}


def faults_of_gaps(
    gaps: Sequence[Entry], interval: Entry | None, width: Entry | None
) -> list[tuple[Entry, str]]:
    """Check the gaps and burst interval of a code [ms]; return each wrong entry's fault."""
    if not gaps:
        return []  # reported when they were read
    width_ms = CODED_PULSE_WIDTH_MS if width is None else width.number
    factor, found = _faults_of_numbers(gaps, width_ms)
    if len(gaps) > MAX_GAPS:
        found.append(
            (gaps[0], f": a burst can have 1 to {MAX_GAPS} gaps, but {len(gaps)} were entered")
        )
    # Invalid gaps were reported before, and are ignored here.
    meant_ms = [factor * gap.number for gap in gaps if 0.0 < factor * gap.number <= MAX_GAP_MS]
    length_ms = sum(meant_ms) + width_ms
    if interval is not None and length_ms >= interval.number:
        text = f"must be longer than the burst; its gaps add up to {length_ms:.10g} ms"
        found.append((interval, text))
    return found


def _faults_of_numbers(
    gaps: Sequence[Entry], width_ms: float
) -> tuple[float, list[tuple[Entry, str]]]:
    """Check each gap. Return the factor that converts the given numbers to milliseconds (1000
    if they look like seconds), and the faults.
    """
    if all(0.0 < 1e3 * gap.number < MAX_GAP_MS and gap.number < width_ms for gap in gaps):
        seconds = ", ".join(f"{1e3 * gap.number:.10g}" for gap in gaps)
        return 1e3, [(gaps[0], f"looks like seconds but is read as ms: write {seconds}")]
    if all(gap.number > MAX_GAP_MS for gap in gaps):
        smaller = ", ".join(f"{1e-3 * gap.number:.10g}" for gap in gaps)
        return 1e-3, [(gaps[0], f"looks like µs but is read as ms: write {smaller}")]
    found: list[tuple[Entry, str]] = []
    for gap in gaps:
        if not gap.number <= MAX_GAP_MS:
            found.append((gap, f"must be at most {MAX_GAP_MS:.0f} ms"))
        elif not gap.number > 2.0 * width_ms:
            text = f"must be longer than two pulses of {width_ms:.10g} ms: they would overlap"
            found.append((gap, text))
    return 1.0, found


def faults_of_codes(drafts: Sequence[TagDraft]) -> list[Fault]:
    """Return a fault if a list has too many codes, and one for each duplicate."""
    coded = [draft for draft in drafts if draft.gaps]
    found: list[Fault] = []
    if len(coded) > MAX_CODES:
        text = (
            f"the list has {len(coded)} codes, but at most {MAX_CODES} are possible: remove "
            "tags that are not in the area"
        )
        found.append(Fault(line=coded[MAX_CODES].line, text=text))
    known = _Codes()
    for draft in coded[:MAX_CODES]:
        interval, frequency = draft.entries.get("interval"), draft.entries.get("frequency")
        if interval is None or frequency is None:
            continue
        code = _Code(
            gaps_ms=tuple(gap.number for gap in draft.gaps or ()),
            interval_ms=interval.number,
            frequency_khz=1e3 * frequency.number * _MHZ.get(frequency.unit, 1e-6),
        )
        line = known.first(code, draft.line)
        if line != draft.line:
            text = f"the same code, gaps and burst interval, as the tag of line {line}"
            found.append(Fault(line=draft.line, text=text))
    return found


def same_codes(tags: Sequence[Tag]) -> list[tuple[Tag, Tag]]:
    """Find pairs of tags with the same code, which cannot be distinguished."""
    known, found = _Codes(), []
    for place, tag in enumerate(tags):
        if tag.coded:
            code = _Code(
                gaps_ms=tuple(1e3 * gap_s for gap_s in tag.gaps_s),
                interval_ms=1e3 * tag.pulse_intervals_s[0],
                frequency_khz=1e-3 * tag.frequency_hz,
            )
            first = known.first(code, place)
            if first != place:
                found.append((tags[first], tag))
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class _Code:
    gaps_ms: tuple[float, ...]
    interval_ms: float
    frequency_khz: float


class _Codes:
    """Set of codes in which an equal code is found quickly, indexed by number of gaps and total
    length.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[int, ...], list[tuple[_Code, int]]] = {}

    def first(self, code: _Code, place: int) -> int:
        """Return the index of the first tag with an equal code. If there is none, store the
        code and return `place`, this tag's own index.
        """
        numbers = (*code.gaps_ms, code.interval_ms, code.frequency_khz)
        if not all(map(math.isfinite, numbers)):
            return place  # reported elsewhere
        length_ms = sum(code.gaps_ms)
        near = range(round(length_ms) - 1, round(length_ms) + 2)
        for key in near:
            for other, at in self._known.get((len(code.gaps_ms), key), []):
                if _are_same(code, other):
                    return at
        self._known.setdefault((len(code.gaps_ms), round(length_ms)), []).append((code, place))
        return place


def _are_same(one: _Code, other: _Code) -> bool:
    return (
        abs(one.frequency_khz - other.frequency_khz) < _SAME_KHZ
        and abs(one.interval_ms - other.interval_ms) < BURST_TOLERANCE_MS
        and all(
            abs(mine - others) < _UNLIKE_MS
            for mine, others in zip(one.gaps_ms, other.gaps_ms, strict=True)
        )
    )


def near_codes(tags: Sequence[Tag], window_hz: float) -> list[tuple[Tag, Tag, float]]:
    """Find pairs of tags with similar codes in overlapping search bands; return each pair with
    the total difference of the gaps [s].
    """
    found: list[tuple[int, int, float]] = []
    by_length: dict[int, list[tuple[float, int]]] = {}
    for place, tag in enumerate(tags):
        if tag.coded:
            by_length.setdefault(len(tag.gaps_s), []).append((sum(tag.gaps_s), place))
    for same in by_length.values():
        same.sort()
        for at, (length_s, place) in enumerate(same):
            # Codes whose lengths differ more also differ more in their gaps.
            for other_s, other in same[at + 1 :]:
                if other_s - length_s > GAP_TOLERANCE_S:
                    break
                first, second = sorted((place, other))
                one, two = tags[first], tags[second]
                pairs = zip(one.gaps_s, two.gaps_s, strict=True)
                apart_s = sum(abs(mine_s - others_s) for mine_s, others_s in pairs)
                near = abs(one.frequency_hz - two.frequency_hz) < 2.0 * window_hz
                if near and apart_s <= GAP_TOLERANCE_S:
                    found.append((first, second, apart_s))
    return [(tags[first], tags[second], apart_s) for first, second, apart_s in sorted(found)]


def words_of_near_codes(tags: Sequence[Tag], window_hz: float) -> list[str]:
    """Warn of pairs of codes so similar that one may be reported as the other."""
    near = near_codes(tags, window_hz)
    more = [f"and {len(near) - MOST_NEAR} more pairs"] if len(near) > MOST_NEAR else []
    return [
        f"codes {one.tag_id} and {two.tag_id} are too similar: their gaps differ by "
        f"{1e3 * apart_s:.2g} ms in total, less than the {1e3 * GAP_TOLERANCE_S:.2g} ms "
        "accuracy of a burst, so either tag may be reported as the other"
        for one, two, apart_s in near[:MOST_NEAR]
    ] + more
