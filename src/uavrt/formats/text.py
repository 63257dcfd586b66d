"""Parse lines, numbers and times of text files; errors state the number of the line."""

import math
import os
import re
import zlib
from collections.abc import Callable, Sequence
from typing import TypeVar

from uavrt.core.clock import parse_iso_utc
from uavrt.core.earth.on_earth import latitude_on_earth, longitude_on_earth, place_on_earth
from uavrt.core.errors import FormatError
from uavrt.core.foreign import TEXT_LOG, most_unpacked, pieces_of, read_file, unpack
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.formats.damaged_lines import reason_of

T = TypeVar("T")
MAX_TIME_NS = 2**62
"""Latest time accepted in a file [ns since 1970]: the year 2116. SQLite's integers can hold
it."""
_DECIMAL = re.compile(r"(?<![^\s;\t])([+-]?\d+),(\d+(?:[eE][+-]?\d+)?)(?![^\s;\t])")
"""Pattern of a table cell that contains only a number with a decimal comma."""
_GZIP = b"\x1f\x8b"


def read_lines(path: str | os.PathLike[str]) -> list[str]:
    """Lines of a text file, also gzipped, without line ends, byte order mark and NUL
    characters.
    """
    name = os.fspath(path)
    try:
        content = read_file(path, TEXT_LOG)
        if content.startswith(_GZIP):
            most = min(TEXT_LOG.bytes, most_unpacked(len(content)))
            lines = min(TEXT_LOG.values, max(most // 32, len(content)))
            content = unpack(pieces_of(content), most)
        else:
            most, lines = TEXT_LOG.bytes, TEXT_LOG.values
        if len(content) > most or _line_count(content) > lines:
            raise FormatError(f"{name} is too large to be a log", remedy="Check the name")
    except (EOFError, zlib.error) as error:
        raise FormatError(f"{name} is damaged: {error}", remedy="Copy it again") from error
    except OSError as error:
        raise FormatError(
            f"cannot read {name}: {error.strerror or error}", remedy="Check the name"
        ) from error
    text = content.decode("utf-8-sig", "replace").replace("\0", "")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _line_count(content: bytes) -> int:
    return max(content.count(b"\n"), content.count(b"\r"))


def wrong_line(
    path: str | os.PathLike[str], number: int, why: object, remedy: str
) -> FormatError:
    """Create the error for one line of a file; a remedy in `why` is used if there is one."""
    reason, known = reason_of(why)
    return FormatError(f"{os.fspath(path)} line {number}: {reason}", remedy=known or remedy)


def cells_of(line: str, separator: str = ",") -> list[str]:
    """Split a line into cells, stripped of blanks, without empty cells at the end."""
    cells = [cell.strip() for cell in line.split(separator)]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _parted(line: str) -> list[str]:
    return [cell.strip() for cell in line.split(",")]


def lower_names(heading: Sequence[str]) -> list[str]:
    """Column names of a CSV heading, in lower case."""
    return [name.lower() for name in heading]


def parsed_rows(
    path: str | os.PathLike[str],
    columns: Sequence[str],
    parse: Callable[[Sequence[str]], T],
    remedy: str,
    *,
    cells: Callable[[str], list[str]] = _parted,
    names: Callable[[Sequence[str]], list[str]] = lower_names,
) -> list[T]:
    """Parse the rows of a table with a heading, each from the cells in the given `columns`,
    without a truncated last row. `cells` splits a line; `names` reads the heading.
    """
    lines, places, rows = read_lines(path), list[int](), list[T]()
    for number, line in enumerate(lines, start=1):
        found = cells(line)
        if not any(found):
            continue
        try:
            if places:
                rows.append(parse([found[place] for place in places]))
                continue
            heading = names(found)
            if missing := set(columns) - set(heading):
                raise ValueError(
                    f"the header line lacks the columns {', '.join(sorted(missing))}"
                )
            places = [heading.index(column) for column in columns]
        except (ValueError, IndexError, OverflowError) as error:
            if number == len(lines) and rows:
                break
            raise wrong_line(path, number, error, remedy) from None
    return rows


def separator_of(lines: Sequence[str]) -> str:
    """Character that separates a text file's cells: comma, semicolon or tab."""
    some = [line for line in lines if line.strip() and not line.lstrip().startswith("#")]
    first = some[0] if some else ""
    commas = first.count(",")
    if 2 * first.count(";") > commas:  # each cell may have a decimal comma
        return ";"
    return "\t" if 2 * first.count("\t") > commas and ",\t" not in first else ","


def with_commas(lines: Sequence[str]) -> list[str]:
    """Convert a spreadsheet's semicolons and tabs to commas, and decimal commas to points."""
    separator = separator_of(lines)
    if separator == ",":
        return list(lines)
    return [_DECIMAL.sub(r"\1.\2", line).replace(separator, ",") for line in lines]


def finite(cell: str) -> float:
    """Parse a finite number; raises `ValueError`."""
    value = float(cell)
    if not math.isfinite(value):
        raise ValueError(f"{cell} is not a finite number")
    return value


def number_or_nan(cell: str) -> float:
    """Parse a number; an empty cell, ``nan`` and infinities are NaN. Raises `ValueError`."""
    value = float(cell) if cell else math.nan
    return value if math.isfinite(value) else math.nan


def whole(cell: str) -> int:
    """Parse a whole number, also if it is written as ``3.0``; raises `ValueError`."""
    value = finite(cell)
    if value != int(value):
        raise ValueError(f"{cell} is not a whole number")
    return int(value)


def latitude(cell: str) -> float:
    """Parse a latitude [deg]; raises `ValueError` beyond ±90°."""
    return latitude_on_earth(finite(cell))


def longitude(cell: str) -> float:
    """Parse a longitude [deg]; raises `ValueError` beyond ±360°."""
    return longitude_on_earth(finite(cell))


def place_or_none(latitude_cell: str, longitude_cell: str) -> tuple[float, float] | None:
    """Parse a latitude and longitude [deg]; None if a cell is empty or not a number.

    Raises `ValueError` for a latitude beyond ±90° or a longitude beyond ±360°.
    """
    return place_on_earth(number_or_nan(latitude_cell), number_or_nan(longitude_cell))


def seconds_ns(cell: str) -> int:
    """Convert a text with seconds since 1970 to nanoseconds by its digits; a float resolves
    only 240 ns.
    """
    before, point, after = cell.partition(".")
    if point and before.isdigit() and after.isdigit():
        value = int(before) * NANOSECONDS_PER_SECOND + int(after[:9].ljust(9, "0"))
    else:
        seconds = finite(cell)
        value = ns_from_s(seconds) if abs(seconds) < MAX_TIME_NS else -1
    if not 0 <= value <= MAX_TIME_NS:
        raise ValueError(f"{cell} is not a time")
    return value


def any_time_ns(cell: str) -> int:
    """Parse a time in ISO 8601, or in s, ms, µs or ns since 1970; raises `ValueError`."""
    try:
        value = finite(cell)
    except ValueError:
        time_ns = parse_iso_utc(cell.replace(" UTC", "Z"))
    else:
        # Counts of today: 1.7e9 s, 1.7e12 ms, 1.7e15 µs, 1.7e18 ns.
        scale = next((s for limit, s in _SCALES if abs(value) < limit), 1)
        if scale == NANOSECONDS_PER_SECOND:
            return seconds_ns(cell)
        time_ns = int(cell) * scale if cell.lstrip("-").isdigit() else round(value * scale)
    if not 0 <= time_ns <= MAX_TIME_NS:
        raise ValueError(f"{cell} is not a time")
    return time_ns


_SCALES = ((1e11, NANOSECONDS_PER_SECOND), (1e14, 1_000_000), (1e17, 1_000))


def seconds_text(time_ns: int) -> str:
    """Format seconds since 1970 with six decimals, as the original system's tools do."""
    seconds, rest = divmod(time_ns, NANOSECONDS_PER_SECOND)
    micro = round(rest / 1000)
    if micro == 1_000_000:
        seconds, micro = seconds + 1, 0
    return f"{seconds}.{micro:06d}"
