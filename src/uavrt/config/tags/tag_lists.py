"""Read lists of tags: CSV files with a heading, or YAML files (coded tags only).

The heading names the columns; common variants are accepted, such as ``tagFreq``, ``g1`` to
``g7`` and ``bi`` of coded tags, ``Frequency (MHz)`` and ``Pulse rate (ppm)`` of beeping tags.
Gaps are in milliseconds, burst intervals in seconds, frequencies in megahertz, pulse rates in
pulses a minute. A YAML file contains either a list of mappings, or one mapping from tag names
to mappings.
"""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

from uavrt.config.tags.tag_drafts import Entry, Fault, Quantity, TagDraft
from uavrt.config.tags.tags_toml import KEYS, read_burst_interval, read_gaps
from uavrt.config.tags.yaml_nodes import Node, read_yaml

_NAMES: dict[str, Quantity | str] = {
    **KEYS,
    "tag_id": "id",
    "mfgid": "id",
    "name": "name",
    "animal": "name",
    "frequency": "frequency",
    "freq_mhz": "frequency",
    "freq_hz": "frequency",
    "tagfreq": "frequency",
    "nomfreq": "frequency",
    "freq": "frequency",
    "burst_interval_s": "burst_interval",
    "bi": "burst_interval",
    "period": "burst_interval",
    "gaps_ms": "gaps",
    "pulse_interval_ms": "interval",
}
_UNIT = r"(?:ppm|bpm|(?:pulses|beats)_(?:per|a)_min(?:ute)?)"
_RATE = re.compile(rf"(mort(?:ality)?_)?(?:pulse_)?(?:rate(?:_{_UNIT})?|{_UNIT})")
"""Columns of pulse rates [1/min]; the rate of a dead animal is the tag's second rate."""
_GAP = re.compile(r"(?:g|gap|gap_?ms_?)([1-9])(?:_ms)?", re.I)
_NEEDED = {
    "id": "id",
    "frequency": "frequency_mhz",
    "burst_interval": "burst_interval_s",
    "gaps": "gaps (g1, g2 … or gaps_ms)",
}
_NEEDED_OF_BEEPS = {
    "frequency": "frequency_mhz",
    "interval": "interval_ms or pulse_rate_ppm",
    "pulse_width": "pulse_width_ms",
}
_DECIMAL_COMMA = re.compile(r"^(\d+),(\d+)$")
_MINUTE_MS = 60_000.0
_NO_LIST = "not a list of tags: write - id: 12"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Cell:
    text: str
    line: int
    items: tuple[tuple[str, int], ...] | None = None

    @property
    def parts(self) -> tuple[tuple[str, int], ...]:
        if self.items is not None:
            return self.items
        return tuple((part, self.line) for part in re.split(r"[\s,;]+", self.text.strip("[] ")))


def is_tag_csv(text: str) -> bool:
    """True if the first non-empty line of a text is the heading of a list of tags; that of a
    TagInfo.txt is not, because its intervals are called ip_msecs.
    """
    for line in text.split("\n"):
        content = line.strip().lstrip("#").strip()
        if content:
            names = [cell.strip("\"' ") for cell in re.split(r"[,;\t]", content)]
            known = set(map(_quantity, names))
            return "gaps" in known or known >= {"frequency", "interval"}
    return False


def parse_tag_csv(text: str, faults: list[Fault]) -> list[TagDraft]:
    """Read a CSV list of tags and return one draft per tag; errors are appended to `faults`.

    If the list has no column of ids, its beeping tags are numbered from 1.
    """
    names: list[str] = []
    separator = ","
    drafts: list[TagDraft] = []
    for number, line in enumerate(text.split("\n"), start=1):
        content = line.strip()
        if not names:
            content = content.lstrip("#").strip()
        if not content or content.startswith("#"):
            continue
        if not names:
            separator = next((one for one in ";\t" if one in content), ",")
        try:
            cells = [cell.strip() for cell in next(csv.reader([content], delimiter=separator))]
        except csv.Error:
            faults.append(Fault(line=number, text="a cell of more than 131 072 characters"))
            continue
        if not names:
            names = cells
            continue
        absent = names[len(cells) :]
        if len(cells) != len(names):
            fault = f"{len(cells)} values where the heading has {len(names)}"
            last = f", none for {', '.join(absent)[:80]}" if absent else ""
            faults.append(Fault(line=number, text=fault + last))
        if len(cells) > len(names):
            continue  # cells cannot be matched to columns
        if separator != ",":
            cells = [_DECIMAL_COMMA.sub(r"\1.\2", cell) for cell in cells]
        pairs = zip(names, cells, strict=False)
        table = {name: _Cell(text=cell, line=number) for name, cell in pairs if cell}
        if "gaps" in map(_quantity, names):
            drafts.append(_draft(table, number, faults, absent))
            continue
        if "id" not in map(_quantity, names):
            table["id"] = _Cell(text=str(len(drafts) + 1), line=number)
        drafts.append(_beeping(table, number, faults, absent))
    return drafts


def parse_code_yaml(text: str, faults: list[Fault]) -> list[TagDraft]:
    """Read a YAML list of coded tags, one draft per tag; append errors to `faults`."""
    drafts: list[TagDraft] = []
    for node in read_yaml(text, faults):
        for tag, name in _tags_of(node, faults):
            before = len(faults)
            table = _table(tag, name, faults)
            draft = _draft(table, tag.line, faults)
            if len(faults) == before or draft.entries:
                drafts.append(draft)
    return drafts


def _tags_of(node: Node, faults: list[Fault]) -> list[tuple[Node, str | None]]:
    value = node.value
    if isinstance(value, dict):
        inside = [value[key] for key in ("tags", "codes") if key in value]
        if inside:
            return [tag for one in inside for tag in _tags_of(one, faults)]
        if any(_is_known(key) for key in value):
            return [(node, None)]  # one tag, and no list
        if value and all(isinstance(one.value, dict) for one in value.values()):
            return [(one, name) for name, one in value.items()]
    elif isinstance(value, list):
        wrong = [one.line for one in value if not isinstance(one.value, dict)]
        faults += [Fault(line=line, text=_NO_LIST) for line in wrong]
        return [(one, None) for one in value if isinstance(one.value, dict)]
    faults.append(Fault(line=node.line, text=_NO_LIST))
    return []


def _is_known(key: str) -> bool:
    return _quantity(key) is not None


def _table(tag: Node, name: str | None, faults: list[Fault]) -> dict[str, _Cell]:
    """Convert a tag's YAML mapping to a table row. A numeric `name` becomes the tag's id."""
    assert isinstance(tag.value, dict)
    table: dict[str, _Cell] = {}
    for key, one in tag.value.items():
        if isinstance(one.value, str):
            table[key] = _Cell(text=one.value, line=one.line)
        elif isinstance(one.value, list):
            items = [
                (item.value, item.line) for item in one.value if isinstance(item.value, str)
            ]
            if len(items) < len(one.value):
                text = f"{key[:40]} has a value that is not a number"
                faults.append(Fault(line=one.line, text=text))
            text = ", ".join(item for item, _ in items)
            table[key] = _Cell(text=text, line=one.line, items=tuple(items))
        elif one.value is not None and _is_known(key):
            faults.append(Fault(line=one.line, text=f"{key[:40]} is a mapping, not a value"))
    known = {_NAMES.get(key.lower()) for key in table}
    if name is not None and name.isdecimal() and "id" not in known:
        table["id"] = _Cell(text=name, line=tag.line)
    elif name is not None and "name" not in known:
        table["name"] = _Cell(text=name, line=tag.line)
    return table


def _draft(
    table: dict[str, _Cell], line: int, faults: list[Fault], absent: Sequence[str] = ()
) -> TagDraft:
    """Convert a row to a tag draft; report missing fields except those in `absent`."""
    draft = TagDraft(line=line, gaps=())
    interval = _read_numbers(draft, table, faults)
    gaps, gaps_line = _gaps(table, line, faults)
    if gaps is not None:
        read_gaps(draft, gaps, gaps_line, faults)
    if interval is not None:
        read_burst_interval(draft, interval.number, interval.line, faults)
    _report_missing(table, line, faults, absent, _NEEDED)
    return draft


def _beeping(
    table: dict[str, _Cell], line: int, faults: list[Fault], absent: Sequence[str]
) -> TagDraft:
    """Convert a table row to the draft of a beeping tag, like `_draft`."""
    draft = TagDraft(line=line)
    _read_numbers(draft, table, faults)
    _report_missing(table, line, faults, absent, _NEEDED_OF_BEEPS)
    return draft


def _read_numbers(
    draft: TagDraft, table: dict[str, _Cell], faults: list[Fault]
) -> Entry | None:
    """Read a row's name and numbers into `draft`; return its burst interval [s], if any."""
    burst = None
    for key, cell in table.items():
        quantity = _quantity(key)
        if quantity == "name":
            draft.name = draft.name or cell.text
            continue
        if quantity is None or quantity == "gaps":
            continue
        number = _number(key, cell.text, cell.line, faults)
        if number is None:
            continue
        if _RATE.fullmatch(_plain(key)):
            if number <= 0.0:
                faults.append(Fault(line=cell.line, text=f"{key} {cell.text} must be above 0"))
                continue
            number = _MINUTE_MS / number
        unit = "" if quantity != "frequency" else "Hz" if _plain(key).endswith("_hz") else "MHz"
        entry = Entry(number=number, label=f"{key} {cell.text[:40]}", line=cell.line, unit=unit)
        if quantity == "burst_interval":
            burst = entry
        else:
            known: Quantity = quantity  # type: ignore[assignment]
            draft.entries[known] = entry
    return burst


def _report_missing(
    table: dict[str, _Cell],
    line: int,
    faults: list[Fault],
    absent: Sequence[str],
    needed: dict[str, str],
) -> None:
    given = {quantity for key in (*table, *absent) if (quantity := _quantity(key))}
    missing = [name for key, name in needed.items() if key not in given]
    others = _words_of_unknown(table) if missing else ""
    faults += [Fault(line=line, text=f"this tag has no {name}{others}") for name in missing]


def _plain(key: str) -> str:
    """Name of a column in lower case with underscores: "Pulse rate (ppm)" is pulse_rate_ppm."""
    return re.sub(r"[^a-z0-9]+", "_", key.lower()).strip("_")


def _quantity(key: str) -> Quantity | str | None:
    if _GAP.fullmatch(key):
        return "gaps"
    if (rate := _RATE.fullmatch(_plain(key))) is not None:
        return "second_interval" if rate[1] else "interval"
    return _NAMES.get(_plain(key))


def _gaps(
    table: dict[str, _Cell], line: int, faults: list[Fault]
) -> tuple[list[float] | None, int]:
    """Return a coded tag's gaps [ms] and their line number. The gaps are None if any of them is
    not a number.
    """
    cells: dict[int, tuple[str, str, int]] = {}
    for key, cell in table.items():
        if (gap := _GAP.fullmatch(key)) is not None:
            cells[int(gap.group(1))] = key, cell.text, cell.line
        elif _quantity(key) == "gaps":
            for place, (part, at) in enumerate(cell.parts, start=1):
                cells[place] = key, part, at
    if not cells:
        return None, line
    at = max(one[2] for one in cells.values())
    lacking = [place for place in range(1, max(cells)) if place not in cells]
    if lacking:
        text = f"this tag has gap {max(cells)}, but no gap {lacking[0]}"
        faults.append(Fault(line=at, text=text))
    numbers = [_number(*cells[place], faults) for place in sorted(cells)]
    good = [number for number in numbers if number is not None]
    return (None if lacking or len(good) < len(numbers) else good), at


def _words_of_unknown(table: dict[str, _Cell]) -> str:
    """Return the end of an error sentence that lists unknown columns, since one of them may be
    a misspelt required column.
    """
    others = [key for key in table if not _is_known(key)]
    if not others:
        return ""
    verb = "is" if len(others) == 1 else "are"
    return f"; {', '.join(key[:40] for key in others[:8])} {verb} not known here"


def _number(key: str, value: str, line: int, faults: list[Fault]) -> float | None:
    try:
        return float(value)
    except ValueError:
        faults.append(Fault(line=line, text=f"{key} is {value[:40]!r}, not a number"))
        return None
