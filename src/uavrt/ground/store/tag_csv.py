"""Tables of tags as CSV: uavrt's and TagTracker's databases, with or without a header line.

TagTracker writes ``TagInfo.db`` (selected, id, name, manufacturer, MHz) as CSV without a header
line. Its ``TagManufacturer.db`` has id, name, two intervals, the meaning of each, pulse width,
uncertainty and jitter. Spreadsheets separate columns by semicolons or tabs.
"""

import csv
import math
from collections.abc import Sequence

from uavrt.formats.csv_line import text_of_cell

TAG_NAMES = ("selected", "id", "name", "manufacturerid", "freqmhz")
MAKER_NAMES = (
    *("id", "name", "ip_msecs_1", "ip_msecs_2", "ip1_id", "ip2_id"),
    *("pulse_width", "uncertainty", "jitter"),
)
_HEADINGS = ("manufacturerid", "ip_msecs_1", "frequency_mhz")
"""Column names; a line with one of them is a header line."""
_SELECTED = {"0": False, "1": True, "false": False, "true": True}


def read_csv(text: str) -> list[dict[str, str]]:
    """Read rows by column name in lower case; empty for another kind of file."""
    lines = [line for line in text.removeprefix("\ufeff").splitlines() if line.strip()]
    lines = [line for line in lines if not line.lstrip().startswith(("#", "["))]
    if not lines:
        return []
    separator = max((";", "\t", ","), key=lines[0].count)
    try:
        rows = [
            [text_of_cell(cell.strip()) for cell in cells]
            for cells in csv.reader(lines, delimiter=separator, skipinitialspace=True)
        ]
    except csv.Error:  # a cell without end
        return []
    names = [cell.lower() for cell in rows[0]]
    if any(name in names for name in _HEADINGS):
        return [dict(zip(names, cells, strict=False)) for cells in rows[1:]]
    joined = separator + " "
    for columns, after, fits in ((TAG_NAMES, 2, _is_tag), (MAKER_NAMES, 7, _is_maker)):
        before = columns.index("name")
        named = [_with_whole_name(cells, before, after, joined) for cells in rows]
        if all(len(cells) == len(columns) and fits(cells) for cells in named):
            return [dict(zip(columns, cells, strict=True)) for cells in named]
    return []


def is_selected(cell: str) -> bool:
    """True if the cell in column ``selected`` means that the tag is searched for."""
    return _SELECTED.get(cell.strip().lower(), True)


def _with_whole_name(cells: list[str], before: int, after: int, joined: str) -> list[str]:
    """Rejoin a name split at separators, with `before` and `after` cells around it."""
    last = next((place for place in range(len(cells), 0, -1) if cells[place - 1]), 0)
    cells = cells[:last]
    end = last - after
    return [*cells[:before], joined.join(cells[before:end]), *cells[end:]]


def _is_tag(cells: Sequence[str]) -> bool:
    selected, number, _, maker, frequency = cells
    mhz = number_in_cell(frequency)
    return (
        selected.lower() in _SELECTED
        and None not in (number_in_cell(number), number_in_cell(maker))
        and mhz is not None
        and 20.0 <= mhz <= 1000.0
    )


def _is_maker(cells: Sequence[str]) -> bool:
    numbers = (*cells[:1], *cells[2:4], *cells[6:])
    meanings = cells[4], cells[5]
    return (
        (bool(cells[1]) or all(meanings))
        and all(number_in_cell(cell) is not None for cell in numbers)
        and any(number_in_cell(word) is None for word in meanings)
    )


def number_in_cell(written: object) -> float | None:
    """Read a number with a decimal point or comma; None for anything else."""
    try:
        number = (
            math.nan if isinstance(written, bool) else float(str(written).replace(",", "."))
        )
    except ValueError:
        return None
    return number if math.isfinite(number) else None
