"""Read and write ``tags.toml``: one ``[[tag]]`` per tag, field names with the unit.

Values common to all tags are under ``[defaults]``.
"""

import json
import tomllib
from collections.abc import Sequence
from difflib import get_close_matches

from uavrt.config.tags.code_rules import MAX_GAPS
from uavrt.config.tags.tag_drafts import Entry, Fault, Quantity, TagDraft
from uavrt.config.toml_lines import Path, find_lines, line_of
from uavrt.core.foreign import MOST_FAULTS, TAGS, check_toml
from uavrt.core.messages import Tag

KEYS: dict[str, Quantity] = {
    "id": "id",
    "frequency_mhz": "frequency",
    "frequency_hz": "frequency",
    "interval_ms": "interval",
    "second_interval_ms": "second_interval",
    "pulse_width_ms": "pulse_width",
    "interval_uncertainty_ms": "interval_uncertainty",
    "interval_jitter_ms": "interval_jitter",
    "k": "k",
    "false_alarm_probability": "false_alarm_probability",
    "frequency_slide_hz": "frequency_slide",
}
_REQUIRED: dict[Quantity, str] = {
    "id": "id",
    "frequency": "frequency_mhz",
    "interval": "interval_ms",
    "pulse_width": "pulse_width_ms",
}
_REQUIRED_OF_CODED: dict[Quantity, str] = {
    "id": "id",
    "frequency": "frequency_mhz",
    "interval": "burst_interval_s",
}
_MOST_GAPS = 50
"""Maximum number of gaps that are read from one code; a longer list is rejected as a whole."""
_CODED_KEYS = ("kind", "gaps_ms", "burst_interval_s")
_HEADING = """\
# Tags for uavrt. Each tag is one [[tag]]; id, frequency, interval and pulse width are needed.
#   interval_ms              from the start of a pulse to the start of the next
#   second_interval_ms       the other interval of a tag with two (resting, mortality)
#   interval_uncertainty_ms  how far the tag's true interval may lie from interval_ms
#   interval_jitter_ms       how far a single pulse may come early or late
#   k                        pulses summed for one decision; more give more range and delay
#   false_alarm_probability  false detections accepted for each decision, 0.01 is 1 %
# Values common to all tags can be given once, under [defaults].
"""
_CODED_HEADING = """\
# A coded tag has kind = "coded", gaps_ms, from pulse to pulse within a burst, and
# burst_interval_s in place of an interval; k are the bursts summed at most.
"""


def parse_tags_toml(text: str, faults: list[Fault]) -> list[TagDraft]:
    """Read all tags of a ``tags.toml``; faults are added to `faults`."""
    try:
        check_toml(text, TAGS)
        document = tomllib.loads(text)
    except RecursionError:
        faults.append(Fault(line=1, text="nested too deeply for a tag file"))
        return []
    except ValueError as error:  # TOMLDecodeError, and integers of more than 4300 digits
        faults.append(_syntax_fault(error))
        return []
    lines = find_lines(text)
    for key in document:
        if key not in ("tag", "defaults"):
            _unknown(key, ("tag", "defaults"), line_of(lines, (key,)) or 1, faults)
    defaults = document.get("defaults", {})
    tables = document.get("tag", [])
    if not isinstance(defaults, dict):
        faults.append(
            Fault(line=line_of(lines, ("defaults",)) or 1, text="write [defaults] as a heading")
        )
        defaults = {}
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        faults.append(
            Fault(line=line_of(lines, ("tag",)) or 1, text="write [[tag]] above each tag")
        )
        return []
    drafts = []
    shared = TagDraft(line=line_of(lines, ("defaults",)) or 1)
    _read_table(defaults, ("defaults",), lines, shared, faults)
    for index, table in enumerate(tables):
        path: Path = ("tag", index)
        draft = TagDraft(line=line_of(lines, path) or 1)
        plain = {key: value for key, value in table.items() if key not in _CODED_KEYS}
        _read_table(plain, path, lines, draft, faults)
        _read_code(table, path, lines, draft, faults)
        coded = draft.gaps is not None
        own = {KEYS[key] for key in table if key in KEYS}
        for quantity, entry in shared.entries.items():
            if quantity not in own and (not coded or quantity == "frequency"):
                draft.entries[quantity] = entry
        faults += [
            Fault(line=draft.line, text=f"this tag has no {key}")
            for key in _missing(table, draft, faults)
        ]
        drafts.append(draft)
    return drafts


def _missing(table: dict[str, object], draft: TagDraft, faults: list[Fault]) -> list[str]:
    """Return the required fields that a tag lacks and that were not reported yet."""
    if draft.gaps is not None:
        required = _REQUIRED_OF_CODED
    elif any(key in table for key in _CODED_KEYS[1:]):
        required = {
            "id": "id",
            "frequency": "frequency_mhz",
        }  # without the kind of tag, which is known
    else:
        required = _REQUIRED
    known = (*KEYS, *_CODED_KEYS)
    meant = {near for key in table if (near := _nearest(key, known, faults)) is not None}
    return [
        key
        for quantity, key in required.items()
        if quantity not in draft.entries
        and key not in meant
        and quantity not in {KEYS[one] for one in meant if one in KEYS}
    ]


def format_tags_toml(tags: Sequence[Tag]) -> str:
    """Format tags as text, with comments for a person who edits the file."""
    blocks = [_HEADING + _CODED_HEADING if any(tag.coded for tag in tags) else _HEADING]
    for tag in tags:
        lines = ["[[tag]]", f"id = {tag.tag_id}"]
        if tag.name is not None:
            lines.append(f"name = {_quoted(tag.name)}")
        lines.append(f"frequency_mhz = {tag.frequency_hz / 1e6:.13g}")
        if tag.coded:
            gaps = ", ".join(f"{1e3 * gap_s:.13g}" for gap_s in tag.gaps_s)
            lines += [
                'kind = "coded"',
                f"gaps_ms = [{gaps}]",
                f"burst_interval_s = {tag.pulse_intervals_s[0]:.13g}",
            ]
        else:
            for key, seconds in zip(
                ("interval_ms", "second_interval_ms"), tag.pulse_intervals_s, strict=False
            ):
                lines.append(f"{key} = {seconds * 1000:.13g}")
        lines += [
            f"pulse_width_ms = {tag.pulse_width_s * 1000:.13g}",
            f"interval_uncertainty_ms = {tag.interval_uncertainty_s * 1000:.13g}",
            f"interval_jitter_ms = {tag.interval_jitter_s * 1000:.13g}",
            f"k = {tag.k}",
            f"false_alarm_probability = {tag.false_alarm_probability:.13g}",
        ]
        if tag.frequency_slide_hz:
            lines.append(f"frequency_slide_hz = {tag.frequency_slide_hz:.13g}")
        blocks.append("\n".join(lines) + "\n")
    return "\n".join(blocks)


def _read_table(
    table: dict[str, object],
    path: Path,
    lines: dict[Path, int],
    draft: TagDraft,
    faults: list[Fault],
) -> None:
    for key, value in table.items():
        line = line_of(lines, (*path, key)) or draft.line
        if key == "name" and path[0] == "tag":
            if isinstance(value, str):
                draft.name = value
            else:
                faults.append(Fault(line=line, text='name must be text: name = "Luna"'))
        elif key not in KEYS or (key == "id" and path[0] == "defaults"):
            _unknown(key, (*KEYS, "name", *_CODED_KEYS), line, faults)
        elif isinstance(value, bool) or not isinstance(value, int | float):
            faults.append(Fault(line=line, text=f"{key} must be a number without quotes"))
        elif KEYS[key] in draft.entries:
            faults.append(Fault(line=line, text="frequency is given twice, in MHz and in Hz"))
        else:
            draft.entries[KEYS[key]] = _entry(key, value, line)


def _read_code(
    table: dict[str, object],
    path: Path,
    lines: dict[Path, int],
    draft: TagDraft,
    faults: list[Fault],
) -> None:
    given = [key for key in _CODED_KEYS if key in table]
    if not given:
        return

    def fault(key: str, text: str) -> None:
        faults.append(Fault(line=line_of(lines, (*path, key)) or draft.line, text=text))

    kind = table.get("kind")
    if kind not in ("coded", "beeping"):
        fault(given[0], 'write kind = "coded" for a tag with gaps_ms, else kind = "beeping"')
        return
    if kind == "beeping":
        for key in given[1:]:
            fault(key, f'{key} is only for a coded tag: write kind = "coded", or leave it out')
        return
    for key in ("interval_ms", "second_interval_ms"):
        if key in table:
            fault(key, f"{key} is only for a beeping tag: a coded tag has burst_interval_s")
    read_gaps(
        draft, table.get("gaps_ms"), line_of(lines, (*path, "gaps_ms")) or draft.line, faults
    )
    if (interval_s := table.get("burst_interval_s")) is not None:
        at = line_of(lines, (*path, "burst_interval_s")) or draft.line
        read_burst_interval(draft, interval_s, at, faults)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def read_gaps(draft: TagDraft, gaps: object, line: int, faults: list[Fault]) -> None:
    """Store a code's gaps [ms] in a draft; report a fault if they are not a list of numbers or
    are too many.
    """
    draft.gaps = ()
    if not isinstance(gaps, list) or not gaps or not all(map(_is_number, gaps)):
        text = "a coded tag has gaps_ms, numbers in brackets: gaps_ms = [22.1, 48.8, 36.6]"
        faults.append(Fault(line=line, text=text))
        return
    if len(gaps) > _MOST_GAPS:
        text = f"a burst can have 1 to {MAX_GAPS} gaps, but {len(gaps)} were entered"
        faults.append(Fault(line=line, text=text))
        return
    shown = ", ".join(f"{gap:.13g}" for gap in gaps)
    draft.gaps = tuple(
        Entry(number=float(gap), label=f"gaps_ms = [{shown}]", line=line) for gap in gaps
    )


def read_burst_interval(
    draft: TagDraft, interval_s: object, line: int, faults: list[Fault]
) -> None:
    """Store a code's burst interval [s] in a draft; report a value that looks like
    milliseconds.
    """
    if not isinstance(interval_s, int | float) or isinstance(interval_s, bool):
        faults.append(Fault(line=line, text="burst_interval_s must be a number"))
        return
    label, interval_ms = f"burst_interval_s = {interval_s:.13g}", 1e3 * float(interval_s)
    if 60.0 < interval_s <= 60_000.0:
        hint = f": looks like ms but is read as s: write {interval_s / 1e3:.10g}"
        faults.append(Fault(line=line, text=label + hint))
        interval_ms = float(interval_s)
    draft.entries["interval"] = Entry(number=interval_ms, label=label, line=line)


def _entry(key: str, value: float, line: int) -> Entry:
    try:
        number = float(value)
    except OverflowError:
        number = float("inf")
    unit = {"frequency_mhz": "MHz", "frequency_hz": "Hz"}.get(key, "")
    return Entry(number=number, label=f"{key} = {number:.13g}", line=line, unit=unit)


def _nearest(key: str, known: Sequence[str], faults: list[Fault]) -> str | None:
    """Return the valid key most similar to a misspelt one; None if none is similar or if too
    many faults were reported.
    """
    if key in known:
        return key
    if len(faults) > MOST_FAULTS:
        return None
    return next(iter(get_close_matches(key[:80], known, n=1)), None)


def _unknown(key: str, known: Sequence[str], line: int, faults: list[Fault]) -> None:
    near = _nearest(key, known, faults)
    hint = f"; did you mean {near}?" if near else f"; known are {', '.join(known)}"
    faults.append(Fault(line=line, text=f"{key[:40]} is unknown here{hint}"))


def _syntax_fault(error: ValueError) -> Fault:
    message = str(error)
    head, _, place = message.partition(" (at ")
    number = place.removeprefix("line ").split(",", 1)[0]
    line = int(number) if number.isdigit() else 1
    text = f"{head[0].lower()}{head[1:]}"
    if isinstance(error, tomllib.TOMLDecodeError):
        text = f"not TOML: {text}"
    return Fault(line=line, text=text)


def _quoted(text: str) -> str:
    """Format a text as a basic string of TOML; JSON's escapes are valid in it,
    except for DEL.
    """
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
