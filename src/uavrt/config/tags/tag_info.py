"""Read and write the thesis's ``TagInfo.txt``: one tag per line, eight numbers separated by
commas.

``# id, freq_hz, ip_msecs, pulse_width_msecs, ip_uncertainty_msecs, ip_jitter_msecs, k,
false_alarm``. The heading may be missing or lack its ``#``. Comments, blank lines, spaces, and
tabs or semicolons instead of commas are accepted.

TagTracker's file has ten columns: a name after the id, and a second interval after the first (0
for a tag with one rate). Either may be missing; a frequency is recognised by its value, 20 MHz
to 1 GHz in hertz.
"""

import re
from collections.abc import Sequence

from uavrt.config.tags.tag_drafts import Entry, Fault, Quantity, TagDraft
from uavrt.config.tags.tag_rules import MAX_FREQUENCY_HZ, MIN_FREQUENCY_HZ, MIN_PULSE_WIDTH_MS
from uavrt.core.messages import Tag

COLUMNS: tuple[tuple[str, Quantity], ...] = (
    ("id", "id"),
    ("freq_hz", "frequency"),
    ("ip_msecs", "interval"),
    ("pulse_width_msecs", "pulse_width"),
    ("ip_uncertainty_msecs", "interval_uncertainty"),
    ("ip_jitter_msecs", "interval_jitter"),
    ("k", "k"),
    ("false_alarm", "false_alarm_probability"),
)
HEADING = "# " + ", ".join(name for name, _ in COLUMNS)

_NUMBER = re.compile(
    r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?|[+-]?(nan|inf|infinity)", re.A | re.I
)


def parse_tag_info(text: str, faults: list[Fault]) -> list[TagDraft]:
    """Read the tags of the file's lines; report lines without eight numbers in `faults`."""
    drafts: list[TagDraft] = []
    for line, written in enumerate(text.split("\n"), start=1):
        content = written.split("#", 1)[0].strip()
        if not content:
            continue
        cells = _cells(content)
        if not drafts and not faults and cells[0].lower() in ("id", "tag_id"):
            continue
        draft = _draft(cells, line, faults)
        if draft is not None:
            drafts.append(draft)
    return drafts


def format_tag_info(tags: Sequence[Tag]) -> str:
    """Format tags as text, without names; each tag must have one interval."""
    lines = [HEADING]
    for tag in tags:
        values = (
            tag.tag_id,
            tag.frequency_hz,
            tag.pulse_intervals_s[0] * 1000,
            tag.pulse_width_s * 1000,
            tag.interval_uncertainty_s * 1000,
            tag.interval_jitter_s * 1000,
            tag.k,
            tag.false_alarm_probability,
        )
        lines.append(", ".join(f"{value:.13g}" for value in values))
    return "\n".join(lines) + "\n"


def _cells(content: str) -> list[str]:
    """Split a line of TagInfo.txt into its values; if semicolons or tabs separate them, a comma
    is a decimal point.
    """
    order = (",", ";", "\t") if content.count(",") >= len(COLUMNS) - 1 else (";", "\t", ",")
    for separator in order if ";" not in content else (";",):
        if separator in content:
            cells = [cell.strip() for cell in content.split(separator)]
            while len(cells) > len(COLUMNS) and not cells[-1]:
                cells.pop()
            decimal = separator != ","
            return [_with_point(cell) if decimal else cell for cell in cells]
    return content.split()


def _with_point(cell: str) -> str:
    pointed = cell.replace(",", ".", 1)
    return pointed if _NUMBER.fullmatch(pointed) else cell


def _draft(cells: list[str], line: int, faults: list[Fault]) -> TagDraft | None:
    name, cells, second = _tagtrackers(cells)
    if len(cells) != len(COLUMNS):
        names = ", ".join(name for name, _ in COLUMNS)
        hint = " (write numbers with a point, 0.01)" if len(cells) > len(COLUMNS) else ""
        text = f"{len(cells)} values instead of {len(COLUMNS)}: {names}{hint}"
        faults.append(Fault(line=line, text=text))
        return None
    draft = TagDraft(line=line, name=name)
    columns = list(zip(COLUMNS, cells, strict=True))
    if second is not None:
        columns.insert(3, (("ip_msecs_2", "second_interval"), second))
    for (label, quantity), cell in columns:
        if not _NUMBER.fullmatch(cell):
            shown = repr(cell[:40]) if cell else "nothing"
            faults.append(Fault(line=line, text=f"{label} is {shown}, not a number"))
            continue
        if quantity == "second_interval" and float(cell) == 0.0:
            continue
        unit = "Hz" if quantity == "frequency" else ""
        draft.entries[quantity] = Entry(
            number=float(cell), label=f"{label} {cell[:40]}", line=line, unit=unit
        )
    return draft


def _tagtrackers(cells: list[str]) -> tuple[str | None, list[str], str | None]:
    """Split a line of TagTracker's file into the name, the eight numbers of TagInfo.txt and the
    second interval.
    """
    name = second = None
    if len(cells) > len(COLUMNS) and not _is_frequency(cells[1]) and _is_frequency(cells[2]):
        name, cells = cells[1], [cells[0], *cells[2:]]
    if len(cells) == len(COLUMNS) + 1 and _is_frequency(cells[1]) and _is_interval(*cells[3:5]):
        second, cells = cells[3], [*cells[:3], *cells[4:]]
    return name or None, cells, second


def _is_frequency(cell: str) -> bool:
    return bool(_NUMBER.fullmatch(cell)) and (
        MIN_FREQUENCY_HZ <= float(cell) <= MAX_FREQUENCY_HZ
    )


def _is_interval(cell: str, width: str) -> bool:
    """True if the number before the pulse width is a second interval, or 0 for none."""
    if not (_NUMBER.fullmatch(cell) and _NUMBER.fullmatch(width)):
        return False
    width_ms = float(width)
    return width_ms >= MIN_PULSE_WIDTH_MS and (
        float(cell) == 0.0 or float(cell) > 2.0 * width_ms
    )
