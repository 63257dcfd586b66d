"""One line of a CSV file, by itself: what is wrong with it concerns no other line."""

import csv


def csv_cells(line: str) -> list[str]:
    """Cells of one line of a CSV file; a quote that is not closed reaches to its end.

    Raises
    ------
    ValueError
        It is no such line: a carriage return in it, or a cell above 131 072 characters.
    """
    try:
        return next(csv.reader([line]), [])
    except csv.Error as error:
        raise ValueError(f"no line of a table: {error}") from None
