"""Read and write lines of CSV files, so that no spreadsheet executes a cell as a formula."""

import csv
from collections.abc import Iterable
from typing import Any, TextIO

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")
"""First characters of a CSV cell that a spreadsheet interprets as a formula."""


class TableWriter:
    """Writes rows of a CSV file; a cell that begins like a formula gets an apostrophe.

    `stream` must be opened with ``newline=""``.
    """

    def __init__(self, stream: TextIO) -> None:
        self._writer = csv.writer(stream, lineterminator="\n")

    def writerow(self, row: Iterable[Any]) -> None:
        """Write one row; cells that begin like a formula get an apostrophe."""
        self._writer.writerow([no_formula(cell) for cell in row])

    def writerows(self, rows: Iterable[Iterable[Any]]) -> None:
        """Write several rows; cells that begin like a formula get an apostrophe."""
        for row in rows:
            self.writerow(row)


def no_formula(cell: Any) -> Any:
    """Put an apostrophe before a cell that a spreadsheet would interpret as a formula."""
    if not isinstance(cell, str) or not cell.startswith(FORMULA_STARTS) or _is_numbers(cell):
        return cell
    return f"'{cell}"


def _is_numbers(text: str) -> bool:
    try:
        return bool([float(part) for part in text.split()])
    except ValueError:
        return False


def text_of_cell(cell: str) -> str:
    """Read a cell that `TableWriter` wrote; its apostrophe is removed."""
    return cell[1:] if cell[:1] == "'" and cell[1:].startswith(FORMULA_STARTS) else cell


def csv_cells(line: str) -> list[str]:
    """Split one CSV line into cells; a quote that is not closed extends to the line's end."""
    try:
        return next(csv.reader([line]), [])
    except csv.Error as error:
        raise ValueError(f"the line is not CSV: {error}") from None
