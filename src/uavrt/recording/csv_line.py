"""Lines of CSV files: parsed one by one, written so that a spreadsheet runs no formula."""

import csv
from collections.abc import Iterable
from typing import Any, TextIO

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")
"""First characters that make a spreadsheet read a text as a formula."""


class TableWriter:
    """Writes rows of a CSV file; an apostrophe disarms names that begin as a formula.

    `stream`: opened with ``newline=""``.
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
    """Cells of one CSV line; an open quote reaches to its end.

    Raises `ValueError` on a carriage return, or a cell above 131 072 characters.
    """
    try:
        return next(csv.reader([line]), [])
    except csv.Error as error:
        raise ValueError(f"no line of a table: {error}") from None
