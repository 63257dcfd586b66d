"""Read and write the original system's ``positions.csv``.

The file has no heading, and one line for each tag and bearings file, with a comma at the end::

    tag_id,bearing_file,latMLE,lonMLE,latRMR,lonRMR,latMEST,lonMEST,

An estimator without a result has ``NaN`` in its two cells.
"""

import os
from collections.abc import Iterable
from dataclasses import dataclass

from uavrt.formats.text import cells_of, place_or_none, read_lines, whole, wrong_line
from uavrt.formats.whole_file import require_plain_name, write_whole

Place = tuple[float, float]
"""Latitude and longitude of a position [deg]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionRow:
    """One line of a positions.csv."""

    tag_id: int
    bearing_file: str
    mle: Place | None
    rmr: Place | None
    mest: Place | None


def read_position_file(path: str | os.PathLike[str]) -> tuple[PositionRow, ...]:
    """Read a positions.csv; raises `FormatError` if it cannot be read."""
    found = []
    for number, line in enumerate(read_lines(path), start=1):
        cells = cells_of(line)
        if not cells or cells[0].startswith("#") or cells[0] == "tag_id":
            continue
        try:
            if not 4 <= len(cells) <= 8:
                raise ValueError(f"the line has {len(cells)} columns, not 4 to 8")
            cells += [""] * (8 - len(cells))
            mle, rmr, mest = (place_or_none(cells[i], cells[i + 1]) for i in (2, 4, 6))
            tag_id = whole(cells[0])
            row = PositionRow(tag_id=tag_id, bearing_file=cells[1], mle=mle, rmr=rmr, mest=mest)
            found.append(row)
        except (ValueError, OverflowError) as error:
            remedy = "A positions.csv has 8 columns: tag, file, latitude, longitude, …"
            raise wrong_line(path, number, error, remedy) from None
    return tuple(found)


def write_position_file(path: str | os.PathLike[str], rows: Iterable[PositionRow]) -> None:
    """Write a complete positions.csv; raises `FormatError` or `RecordingError`."""
    kept: dict[tuple[int, str], PositionRow] = {}
    if os.path.exists(path):
        kept = {(row.tag_id, row.bearing_file): row for row in read_position_file(path)}
    for row in rows:
        require_plain_name(row.bearing_file)
        kept[row.tag_id, row.bearing_file] = row
    write_whole(path, "".join(map(_line, kept.values())))


def _line(row: PositionRow) -> str:
    cells = [str(row.tag_id), row.bearing_file]
    for place in (row.mle, row.rmr, row.mest):
        cells += ["NaN", "NaN"] if place is None else [f"{degrees:.9f}" for degrees in place]
    return ",".join(cells) + ",\n"
