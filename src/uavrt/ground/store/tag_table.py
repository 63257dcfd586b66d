"""The tag table of the page: check, import and export typed rows."""

import hashlib
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uavrt.config.settings import DetectionSettings
from uavrt.config.tags.code_rules import words_of_near_codes
from uavrt.config.tags.tag_drafts import Entry, Fault, Quantity, TagDraft
from uavrt.config.tags.tag_files import parse_tags, tags_as_text
from uavrt.config.tags.tag_rules import MAX_FALSE_ALARM_PROBABILITY, tags_from_drafts
from uavrt.core.errors import NotFound, TagFileError, UsageError
from uavrt.core.foreign import TAGS, read_file
from uavrt.core.messages import DEFAULT_FALSE_ALARM_PROBABILITY, Tag
from uavrt.formats.csv_line import TableWriter
from uavrt.ground.store.tag_csv import is_selected, number_in_cell, read_csv

FIELDS: dict[str, Quantity] = {
    "id": "id",
    "frequency_mhz": "frequency",
    "interval_ms": "interval",
    "second_interval_ms": "second_interval",
    "pulse_width_ms": "pulse_width",
    "interval_uncertainty_ms": "interval_uncertainty",
    "interval_jitter_ms": "interval_jitter",
    "k": "k",
    "false_alarm_percent": "false_alarm_probability",
}
"""Columns of the page's table, in the users' units, and the quantity in each."""
CODE_FIELDS = ("kind", "gaps_ms")
"""Columns of the page's table for coded tags only, whose interval is that between bursts."""
KINDS = ("beeping", "coded")
LEAST_BARE_PERCENT = 0.05
"""Minimum false-alarm probability accepted without a percent sign [%]; a smaller number is
probably meant as a fraction."""
REQUIRED = ("id", "frequency_mhz", "interval_ms", "pulse_width_ms")
REQUIRED_OF_CODES = ("id", "frequency_mhz", "interval_ms")
MAX_ROWS = 500
MAX_NAME = 60

_INCOMPLETE = Fault(line=0, text="incomplete")

Row = dict[str, Any]

PRESETS: tuple[dict[str, Any], ...] = (
    {
        # TagTracker's first manufacturer record.
        "name": "Two rates: moving 1333 ms, resting 2000 ms",
        "interval_ms": 1333,
        "second_interval_ms": 2000,
        "pulse_width_ms": 15,
        "interval_uncertainty_ms": 60,
        "interval_jitter_ms": 20,
    },
    {
        # The thesis's tag.
        "name": "One rate: 1254 ms, 20 ms pulses",
        "interval_ms": 1254,
        "second_interval_ms": "",
        "pulse_width_ms": 20,
        "interval_uncertainty_ms": 60,
        "interval_jitter_ms": 10,
    },
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldFault:
    """A mistake in the tag table: row, field, what is wrong and what to do."""

    row: int
    """Index of the tag's row in the page's table, from 0."""
    field: str
    text: str


def tags_from_rows(rows: object) -> tuple[tuple[Tag, ...], list[FieldFault]]:
    """Check typed rows and convert them to tags; no tags if any row has a fault."""
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise UsageError("tags must be a list of rows")
    if len(rows) > MAX_ROWS:
        raise UsageError(
            f"the list has {len(rows)} tags; at most {MAX_ROWS} are allowed",
            remedy=f"Use at most {MAX_ROWS} tags",
        )
    found: list[FieldFault] = []
    drafts = [_draft(row, index, found) for index, row in enumerate(rows)]
    # A fault from the beginning: incomplete drafts are judged, but made into no tags.
    faults = [_INCOMPLETE] if found else []
    tags = tags_from_drafts(drafts, faults)
    found += [_at_field(fault) for fault in faults if fault is not _INCOMPLETE]
    return ((), found) if found else (tags, [])


def warnings_of(tags: Sequence[Tag]) -> list[str]:
    """List valid but suspicious entries: codes that are easily confused."""
    return words_of_near_codes(tags, DetectionSettings().frequency_window_hz)


def rows_from_tags(tags: Sequence[Tag]) -> list[Row]:
    """Convert tags to rows of the page's table."""
    return [
        {
            "id": tag.tag_id,
            "name": tag.name or "",
            "frequency_mhz": _short(tag.frequency_hz / 1e6),
            "interval_ms": _short(tag.pulse_intervals_s[0] * 1e3),
            "second_interval_ms": (
                _short(tag.pulse_intervals_s[1] * 1e3) if len(tag.pulse_intervals_s) > 1 else ""
            ),
            "pulse_width_ms": _short(tag.pulse_width_s * 1e3),
            "interval_uncertainty_ms": _short(tag.interval_uncertainty_s * 1e3),
            "interval_jitter_ms": _short(tag.interval_jitter_s * 1e3),
            "k": tag.k,
            "false_alarm_percent": _percent(tag.false_alarm_probability * 100.0),
            **(_code_cells(tag) if tag.coded else {}),
        }
        for tag in tags
    ]


def _code_cells(tag: Tag) -> Row:
    return {"kind": "coded", "gaps_ms": " ".join(str(_short(gap * 1e3)) for gap in tag.gaps_s)}


def import_rows(files: Mapping[str, str]) -> list[Row]:
    """Import rows from ``TagInfo.txt``, ``tags.toml``, CSV, TagTracker's databases.

    TagTracker keeps tags and manufacturers in two files, which must be imported together.
    """
    tables = {name: read_csv(text) for name, text in files.items()}
    makers = {
        _key(cells["id"]): cells
        for table in tables.values()
        if table and "ip_msecs_1" in table[0]
        for cells in table
    }
    rows: list[Row] = []
    for name, text in files.items():
        table = tables[name]
        if table and "manufacturerid" in table[0]:
            rows += [_tracker_row(name, cells, makers) for cells in table]
        elif table and "frequency_mhz" in table[0] and "interval_ms" in table[0]:
            rows += [_own_row(cells) for cells in table]
        elif not (table and "ip_msecs_1" in table[0]):
            rows += rows_from_tags(parse_tags(text.encode(), name=name))
    if not rows:
        raise UsageError(
            f"no tag was found in {', '.join(files)}",
            remedy="TagTracker's manufacturers file has no tags; give TagTracker's "
            "TagInfo.db as well",
        )
    return rows


def slides_not_sent(files: Mapping[str, str]) -> list[str]:
    """Return a warning if a ``tags.toml`` lists frequency slides, which no row can hold."""
    tags = [
        tag
        for name, text in files.items()
        if name.endswith(".toml")
        for tag in parse_tags(text.encode(), name=name)
        if tag.frequency_slide_hz
    ]
    ids = ", ".join(str(tag.tag_id) for tag in tags)
    return [f"the frequency slides of tags {ids} are not sent to the drone"] if tags else []


def not_selected(files: Mapping[str, str]) -> tuple[int, ...] | None:
    """Ids that ``TagInfo.db`` lists but does not search for; None without such a column."""
    table = [cells for text in files.values() for cells in read_csv(text)]
    found = [cells for cells in table if "manufacturerid" in cells and "selected" in cells]
    numbers = [
        number_in_cell(cells.get("id")) for cells in found if not is_selected(cells["selected"])
    ]
    return tuple(sorted({int(one) for one in numbers if one is not None})) if found else None


def _own_row(cells: Mapping[str, str]) -> Row:
    """Read one line of a table as `export_text` writes it."""
    row = {key: cells.get(key, "") for key in (*FIELDS, "name")}
    return row | {key: cells[key] for key in CODE_FIELDS if cells.get(key)}


def export_text(tags: Sequence[Tag], name: str) -> str:
    """Write tags as ``tags.toml``, ``TagInfo.txt`` or ``tags.csv``; raises `UsageError`."""
    if name in ("tags.toml", "TagInfo.txt"):
        return tags_as_text(tags, Path(name).suffix)
    if name == "tags.csv":
        stream = io.StringIO()
        more = CODE_FIELDS if any(tag.coded for tag in tags) else ()
        writer, names = TableWriter(stream), ["name", *FIELDS, *more]
        writer.writerow(names)
        writer.writerows([row.get(name, "") for name in names] for row in rows_from_tags(tags))
        return stream.getvalue()
    raise NotFound(
        f"there is no format {name}", remedy="Choose from tags.toml, TagInfo.txt, tags.csv"
    )


def read_table(path: Path) -> tuple[Tag, ...]:
    """Read the stored table; a damaged one gives no tags, and its file is left for repair."""
    try:
        return parse_tags(read_file(path, TAGS), name=path.name)
    except (OSError, TagFileError):
        return ()


def _draft(row: Mapping[str, Any], index: int, found: list[FieldFault]) -> TagDraft:
    def fault(field: str, text: str) -> None:
        found.append(FieldFault(row=index, field=field, text=text))

    draft = TagDraft(line=index + 1, gaps=_gaps(row, index + 1, fault))
    coded = draft.gaps is not None
    for field, quantity in FIELDS.items():
        written = row.get(field, "")
        if written is None or str(written).strip() == "":
            if field in (REQUIRED_OF_CODES if coded else REQUIRED):
                fault(field, "this field is empty: enter a value")
            continue
        percent = str(written).rstrip().endswith("%") and field == "false_alarm_percent"
        if coded and field == "second_interval_ms":
            fault(
                field,
                "this field must be empty: a coded tag has one interval, from burst to burst",
            )
            continue
        number = number_in_cell(str(written).rstrip().rstrip("%") if percent else written)
        if number is None:
            fault(field, "this value is not a number")
            continue
        if field == "false_alarm_percent":
            most = 100.0 * MAX_FALSE_ALARM_PROBABILITY
            if 0.0 < number < LEAST_BARE_PERCENT and not percent:
                fault(
                    field,
                    f"if you mean {number:g} %, write it with the % sign; the probability "
                    f"{number:g} is {100.0 * number:g} %",
                )
                continue
            if not 0.0 < number <= most:
                fault(field, f"this value must be above 0 and at most {most:g} %")
                continue
            number /= 100.0
        unit = "MHz" if quantity == "frequency" else ""
        draft.entries[quantity] = Entry(number=number, label=field, line=index + 1, unit=unit)
    name = row.get("name")
    if name is not None and str(name).strip():
        draft.name = str(name).strip()
        if len(draft.name) > MAX_NAME or not draft.name.isprintable():
            fault("name", f"this name must have at most {MAX_NAME} printable characters")
    return draft


def _gaps(
    row: Mapping[str, Any], line: int, fault: Callable[[str, str], None]
) -> tuple[Entry, ...] | None:
    """Read the gaps of a coded tag; None for a tag with single pulses."""
    kind = str(row.get("kind") or "").strip().lower()
    written = str(row.get("gaps_ms") or "").strip().strip("[]")
    if kind and kind not in KINDS:
        fault("kind", f"this value must be {' or '.join(KINDS)}")
        return ()
    if kind == "beeping" or (not kind and not written):
        if written:
            fault("gaps_ms", "this field must be empty: a tag that beeps has no gaps")
        return None
    entries = []
    apart = written.replace(",", " ") if "." in written else written
    for part in apart.replace(";", " ").split() or [""]:
        number = number_in_cell(part.rstrip(","))
        if number is None:
            fault(
                "gaps_ms",
                "this field must contain numbers separated by spaces, for example 22 48.8 36.6"
                if written
                else "this field is empty: enter a value",
            )
            return ()
        entries.append(Entry(number=number, label="gaps_ms", line=line))
    return tuple(entries)


def table_version(tags: Sequence[Tag]) -> str:
    """Hash of a tag table's content, to detect changes by another page."""
    text = json.dumps(rows_from_tags(tags), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _at_field(fault: Fault) -> FieldFault:
    field, _, text = fault.text.partition(" ")
    if field == "id" and "already" in text:
        text = f"the number {text.split()[0]} is used by more than one tag"
    elif fault.text.startswith("the same code"):
        field, text = "gaps_ms", fault.text.replace("tag of line", "tag of row")
    elif text.startswith(": "):
        text = text.removeprefix(": ")
    elif field in (*FIELDS, "gaps_ms"):
        text = f"this value {text}"
    else:
        field, text = "gaps_ms", fault.text
    return FieldFault(row=fault.line - 1, field=field, text=text)


def _tracker_row(
    name: str, cells: Mapping[str, str], makers: Mapping[str, Mapping[str, str]]
) -> Row:
    """Convert one row of TagTracker's ``TagInfo.db`` to a row of the page's tag table."""
    maker = makers.get(_key(cells["manufacturerid"]))
    if maker is None:
        raise UsageError(
            f"{name}: tag {cells.get('id', '?')} has manufacturer {cells['manufacturerid']}, "
            "which is missing in TagManufacturer.db",
            remedy="Choose TagInfo.db and TagManufacturer.db together",
        )
    second = maker.get("ip_msecs_2", "")
    return {
        "id": cells.get("id", ""),
        "name": cells.get("name", ""),
        "frequency_mhz": cells.get("freqmhz", ""),
        "interval_ms": maker.get("ip_msecs_1", ""),
        "second_interval_ms": "" if number_in_cell(second) in (None, 0.0) else second,
        "pulse_width_ms": maker.get("pulse_width", ""),
        "interval_uncertainty_ms": maker.get("uncertainty", ""),
        "interval_jitter_ms": maker.get("jitter", ""),
        "k": 3,
        "false_alarm_percent": _short(DEFAULT_FALSE_ALARM_PROBABILITY * 100.0),
    }


def _percent(number: float) -> float | int | str:
    short = _short(number)
    return f"{short} %" if short < LEAST_BARE_PERCENT else short


def _key(number: str) -> str:
    """Manufacturer number without spaces and ``.0``, to compare numbers of two files."""
    return number.removesuffix(".0").strip()


def _short(number: float) -> float | int:
    rounded = round(number, 9)
    return int(rounded) if rounded == int(rounded) else rounded
