"""Lines of CSV files: read each by itself, written so that a spreadsheet runs none."""

import csv
from collections.abc import Iterable
from typing import Any, TextIO

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")
"""A text that begins so is a formula to a spreadsheet."""


class TableWriter:
    """Writes rows of a CSV file; names that begin as a formula get an apostrophe before them.

    `stream`: where to; opened with ``newline=""``.
    """

    def __init__(self, stream: TextIO) -> None:
        self._writer = csv.writer(stream, lineterminator="\n")

    def writerow(self, row: Iterable[Any]) -> None:
        """Write one row."""
        self._writer.writerow([no_formula(cell) for cell in row])

    def writerows(self, rows: Iterable[Iterable[Any]]) -> None:
        """Write rows."""
        for row in rows:
            self.writerow(row)


def no_formula(cell: Any) -> Any:
    """Get a cell with an apostrophe before it if a spreadsheet would take it for a formula."""
    if not isinstance(cell, str) or not cell.startswith(FORMULA_STARTS) or _is_numbers(cell):
        return cell
    return f"'{cell}"


def _is_numbers(text: str) -> bool:
    """Whether a text is one number or several."""
    try:
        return bool([float(part) for part in text.split()])
    except ValueError:
        return False


def text_of_cell(cell: str) -> str:
    """Read a text as `TableWriter` has written it."""
    return cell[1:] if cell[:1] == "'" and cell[1:].startswith(FORMULA_STARTS) else cell


def csv_cells(line: str) -> list[str]:
    """Cells of one line of a CSV file; a quote that is not closed reaches to its end.

    Raises `ValueError`: it is no such line: a carriage return in it, or a cell above 131 072
    characters.
    """
    try:
        return next(csv.reader([line]), [])
    except csv.Error as error:
        raise ValueError(f"no line of a table: {error}") from None
