"""Tables of results: common layout, columns and files."""

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from uavrt_experiments.result import Row

HEADER = ("measured", "95 %", "n", "bar", "", "original", "theory", "remarks")
"""Column headings of `cells`."""
COLUMNS = (
    *("experiment", "condition", "quantity", "value", "low", "high"),
    *("least", "most", "bound", "runs", "passed"),
)
"""Column names of a CSV file of rows."""


def aligned(lines: Sequence[Sequence[str]], *, numbers_from: int | None = None) -> str:
    """Lay out cells in columns, two spaces apart.

    `lines`: headings and rows, all of the same length.
    `numbers_from`: index of the first right-aligned column; by default there is none.
    """
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(
            cell.ljust(width)
            if numbers_from is None or place < numbers_from
            else cell.rjust(width)
            for place, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


def markdown(lines: Sequence[Sequence[str]]) -> str:
    """Write headings and rows as a table in Markdown; a bar in a cell becomes a slash."""
    heads, *rows = ("| " + " | ".join(c.replace("|", "/") for c in one) + " |" for one in lines)
    return "\n".join((heads, "|---" * len(lines[0]) + "|", *rows))


def drawn(rows: Sequence[Row], title: str = "") -> str:
    """Format rows as plain text; empty columns are left out."""
    several = len({row.experiment for row in rows}) > 1
    lines: list[tuple[str, ...]] = [("", "quantity", "case", *HEADER)]
    lines += [
        (row.experiment if several else "", row.quantity, row.case, *cells(row)) for row in rows
    ]
    columns = [column for column in zip(*lines, strict=True) if any(column[1:])]
    text = aligned(list(zip(*columns, strict=True)))
    return f"{title}\n{text}" if title else text


def cells(row: Row) -> tuple[str, ...]:
    """Format a row as cells under `HEADER`."""
    bounds = (
        *(("genie", row.genie), ("union", row.union), ("single", row.single)),
        ("bound", row.bound),
    )
    return (
        number(row.figure),
        "" if row.exact else f"{number(row.low)} … {number(row.high)}",
        str(row.n),
        row.bar,
        row.verdict,
        "" if row.original is None else number(row.original),
        ", ".join(f"{name} {number(value)}" for name, value in bounds if value is not None),
        row.note,
    )


def number(value: float) -> str:
    """Format with three digits, without exponents for measured values; counts in full."""
    if isinstance(value, int):
        return str(value)
    if not math.isfinite(value):
        return "∞" if value > 0 else "−∞" if value < 0 else "–"
    if abs(value) >= 100.0:
        return f"{value:.0f}"
    return f"{value:.2f}" if abs(value) >= 10.0 else f"{value:.3f}"


def bars_kept(rows: Sequence[Row]) -> str:
    """Sentence with the number of requirements that are met."""
    asked = [row for row in rows if row.barred]
    barred = [row for row in asked if row.shown or not row.met]
    missed = [row for row in barred if not row.met]
    sure = sum(row.contradicted for row in missed)
    return (
        f"{len(barred) - len(missed)} of {len(barred)} requirements met; of the {len(missed)} "
        f"missed, {sure} lie outside the 95 % interval"
        + (f"; {unshown} more are not shown" if (unshown := len(asked) - len(barred)) else "")
    )


def write_rows(path: Path, rows: Iterable[Row]) -> None:
    """Write rows to a CSV file; unknown values are empty."""
    write_csv(
        path,
        COLUMNS,
        (
            (
                *(one.experiment, one.case, one.quantity, one.figure, one.low, one.high),
                *(one.least, one.most, one.bound, one.n, one.met),
            )
            for one in rows
        ),
    )


def write_csv(path: Path, header: Sequence[str], lines: Iterable[Sequence[object]]) -> None:
    """Write a heading and lines to a CSV file."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(lines)
