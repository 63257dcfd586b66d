"""``tags.toml``: tags by name, with units in the names, one ``[[tag]]`` each.

What is the same for all tags stands once, under ``[defaults]``.
"""

import json
import tomllib
from collections.abc import Sequence
from difflib import get_close_matches

from uavrt.config.tag_rules import Entry, Fault, Quantity, TagDraft
from uavrt.config.toml_lines import Path, find_lines, line_of
from uavrt.messages import Tag

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
}
_REQUIRED: dict[Quantity, str] = {
    "id": "id",
    "frequency": "frequency_mhz",
    "interval": "interval_ms",
    "pulse_width": "pulse_width_ms",
}
_HEADING = """\
# Tags for uavrt. Each tag is one [[tag]]; id, frequency, interval and pulse width are needed.
#   interval_ms              from the start of a pulse to the start of the next
#   second_interval_ms       the other interval of a tag with two (resting, mortality)
#   interval_uncertainty_ms  how far the tag's true interval may lie from interval_ms
#   interval_jitter_ms       how far a single pulse may come early or late
#   k                        pulses summed for one decision; more reach farther, answer later
#   false_alarm_probability  false detections accepted for each decision, 0.01 is 1 %
# What all tags share may stand once, under [defaults].
"""


def parse_tags_toml(text: str, faults: list[Fault]) -> list[TagDraft]:
    """Read the tables; add whatever is not understood to `faults`."""
    try:
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
        before = len(faults)
        _read_table(table, path, lines, draft, faults)
        for quantity, entry in shared.entries.items():
            if quantity not in table_quantities(table):
                draft.entries[quantity] = entry
        if len(faults) == before:
            for quantity, key in _REQUIRED.items():
                if quantity not in draft.entries:
                    faults.append(Fault(line=draft.line, text=f"this tag has no {key}"))
        drafts.append(draft)
    return drafts


def table_quantities(table: dict[str, object]) -> set[Quantity]:
    """What a table speaks of, rightly or wrongly."""
    return {KEYS[key] for key in table if key in KEYS}


def format_tags_toml(tags: Sequence[Tag]) -> str:
    """Write tags, with comments for the person who edits the file."""
    blocks = [_HEADING]
    for tag in tags:
        lines = ["[[tag]]", f"id = {tag.tag_id}"]
        if tag.name is not None:
            lines.append(f"name = {_quoted(tag.name)}")
        lines.append(f"frequency_mhz = {tag.frequency_hz / 1e6:.13g}")
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
            _unknown(key, (*KEYS, "name"), line, faults)
        elif isinstance(value, bool) or not isinstance(value, int | float):
            faults.append(Fault(line=line, text=f"{key} must be a number without quotes"))
        elif KEYS[key] in draft.entries:
            faults.append(Fault(line=line, text="frequency is given twice, in MHz and in Hz"))
        else:
            draft.entries[KEYS[key]] = _entry(key, value, line)


def _entry(key: str, value: float, line: int) -> Entry:
    try:
        number = float(value)
    except OverflowError:
        number = float("inf")
    unit = {"frequency_mhz": "MHz", "frequency_hz": "Hz"}.get(key, "")
    return Entry(number=number, label=f"{key} = {number:.13g}", line=line, unit=unit)


def _unknown(key: str, known: Sequence[str], line: int, faults: list[Fault]) -> None:
    near = get_close_matches(key, known, n=1)
    hint = f"; did you mean {near[0]}?" if near else f"; known are {', '.join(known)}"
    faults.append(Fault(line=line, text=f"{key[:40]} is unknown here{hint}"))


def _syntax_fault(error: ValueError) -> Fault:
    message = str(error)
    head, _, place = message.partition(" (at ")
    number = place.removeprefix("line ").split(",", 1)[0]
    line = int(number) if number.isdigit() else 1
    return Fault(line=line, text=f"not TOML: {head[0].lower()}{head[1:]}")


def _quoted(text: str) -> str:
    """Write a TOML basic string; JSON's escapes are TOML's, except that DEL needs one."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
