"""Read and write the original system's ``bearings.csv``, and read bearings noted by hand.

The file has no heading. It has ten columns, and uavrt adds an eleventh, the standard deviation,
which the original's readers ignore::

    tag_id,parent_file,bearing_deg,tau,lat,lon,alt_agl,alt_asl,t_start,t_end[,sigma_deg]

A file of bearings noted by hand has a heading, and columns in any order; these are the names,
of which the first four are required (`uavrt.formats.noted_headings` has other names)::

    tag_id,latitude_deg,longitude_deg,bearing_deg[,sigma_deg][,time_utc][,observer]

A test trial with a tag at a known place has two more columns: true_latitude_deg,
true_longitude_deg.
"""

import csv
import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from uavrt.core.clock import parse_iso_utc
from uavrt.core.earth.geodesy import geodetic_of_epsg
from uavrt.core.units import wrap_degrees_360
from uavrt.formats.noted_headings import check_noted, epsg_of_zone, is_noted, noted_columns
from uavrt.formats.text import (
    finite,
    latitude,
    longitude,
    number_or_nan,
    read_lines,
    seconds_ns,
    seconds_text,
    whole,
    with_commas,
    wrong_line,
)
from uavrt.formats.tracks.declination import declination_deg
from uavrt.formats.whole_file import require_plain_name, write_whole

_COLUMNS = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingRow:
    """One line of a bearings.csv, or one bearing noted by hand."""

    tag_id: int
    """Number of the tag; if it was noted by name, the place of this name in the file."""
    tag_name: str | None = None
    """Name of the tag if the table has names instead of numbers."""
    parent_file: str
    bearing_deg: float
    confidence: float | None = None
    latitude_deg: float
    longitude_deg: float
    altitude_relative_m: float | None = None
    altitude_amsl_m: float | None = None
    start_time_ns: int | None = None
    end_time_ns: int | None = None
    sigma_deg: float | None = None
    observer: str | None = None
    """Name of the person who took the bearing by hand, empty if not given; None if the bearing
    was not taken by hand."""
    true_place: tuple[float, float] | None = None
    """Known latitude and longitude of the tag in a test trial [deg]."""


def read_bearing_file(path: str | os.PathLike[str]) -> tuple[BearingRow, ...]:
    """Read a bearings.csv or a file of bearings noted by hand; comments are skipped.

    Raises `FormatError` if the file cannot be read.
    """
    rows: list[BearingRow] = []
    names: list[str] = []
    columns: dict[str, int] = {}
    for number, line in enumerate(with_commas(read_lines(path)), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            cells = [cell.strip() for cell in next(csv.reader([line]))]
            if is_noted(cells):
                names, columns = cells, noted_columns(cells)
                check_noted(columns)
            elif "tag_id" in cells:
                names, columns = [], {}
            elif columns:
                padded = [*cells, *[""] * len(names)]
                rows.append(_noted_row({name: padded[at] for name, at in columns.items()}))
            else:
                rows.append(_row(cells))
        except (ValueError, IndexError, csv.Error) as error:
            remedy = (
                f"The heading names the columns: {', '.join(names)}"
                if names
                else "A bearings.csv has 10 columns: tag, file, bearing, tau, latitude, …"
            )
            raise wrong_line(path, number, error, remedy) from None
    return tuple(_numbered(rows))


def _numbered(rows: Iterable[BearingRow]) -> Iterable[BearingRow]:
    """Number the tags that a file names, in order of appearance."""
    numbers: dict[str, int] = {}
    for row in rows:
        if row.tag_name is None:
            yield row
        else:
            yield replace(row, tag_id=numbers.setdefault(row.tag_name, len(numbers) + 1))


def _row(cells: list[str]) -> BearingRow:
    if len(cells) < _COLUMNS:
        raise ValueError(f"the line has {len(cells)} columns, not {_COLUMNS}")
    return BearingRow(
        tag_id=whole(cells[0]),
        parent_file=cells[1],
        bearing_deg=finite(cells[2]),
        confidence=_known(cells[3]),
        latitude_deg=latitude(cells[4]),
        longitude_deg=longitude(cells[5]),
        altitude_relative_m=_known(cells[6]),
        altitude_amsl_m=_known(cells[7]),
        start_time_ns=_time_ns(cells[8]),
        end_time_ns=_time_ns(cells[9]),
        sigma_deg=_sigma_deg(cells[10]) if len(cells) > _COLUMNS else None,
    )


def _noted_row(cells: Mapping[str, str]) -> BearingRow:
    """Convert a row of a table of noted bearings, by the meanings of its columns."""
    truth = [cells.get(name, "") for name in ("true_latitude", "true_longitude")]
    observer = cells.get("observer", "")
    if any(truth) and not (all(truth) and observer):
        raise ValueError("a test trial needs an observer and both true coordinates")
    tag, numbered = cells["tag"], _is_whole(cells["tag"])
    if not tag:
        raise ValueError("the tag has no name or number")
    place = _noted_place(cells)
    time_ns = _noted_time_ns(cells)
    return BearingRow(
        tag_id=whole(tag) if numbered else 0,
        tag_name=None if numbered else tag,
        parent_file="noted",
        bearing_deg=_from_true_north(cells, place, time_ns),
        latitude_deg=place[0],
        longitude_deg=place[1],
        start_time_ns=time_ns,
        sigma_deg=_sigma_deg(cells.get("sigma") or "NaN"),
        observer=observer,
        true_place=(latitude(truth[0]), longitude(truth[1])) if all(truth) else None,
    )


def _noted_place(cells: Mapping[str, str]) -> tuple[float, float]:
    if "latitude" in cells and "longitude" in cells:
        return latitude(cells["latitude"]), longitude(cells["longitude"])
    metres = finite(cells["easting"]), finite(cells["northing"])
    return geodetic_of_epsg(epsg_of_zone(cells["zone"]), *metres)


def _is_whole(cell: str) -> bool:
    try:
        whole(cell)
    except ValueError:
        return False
    return True


def _noted_time_ns(cells: Mapping[str, str]) -> int | None:
    text = cells.get("time") or " ".join(
        cells[name] for name in ("date", "clock") if cells.get(name)
    )
    if not text:
        return None
    try:
        return parse_iso_utc(text)
    except ValueError as error:
        text = f"{text} is not a date, or date and time, such as 2026-08-01 08:00 (UTC)"
        raise ValueError(text) from error


def _from_true_north(
    cells: Mapping[str, str], place: tuple[float, float], time_ns: int | None
) -> float:
    """Bearing from true north [deg]; a magnetic one needs the table's declination, or a time
    for the World Magnetic Model.
    """
    if "true" in cells:
        return finite(cells["true"])
    noted = cells["magnetic"] if "magnetic" in cells else cells["bearing"]
    if declination := cells.get("declination"):
        return wrap_degrees_360(finite(noted) + finite(declination))
    if time_ns is None:
        raise ValueError("a magnetic bearing needs a declination, or a date to compute it")
    return wrap_degrees_360(finite(noted) + declination_deg(*place, 0.0, time_ns))


def _known(cell: str) -> float | None:
    value = number_or_nan(cell)
    return None if math.isnan(value) else value


def _time_ns(cell: str) -> int | None:
    return None if _known(cell) is None else seconds_ns(cell)


def _sigma_deg(cell: str) -> float | None:
    value = _known(cell)
    if value is not None and value <= 0.0:
        raise ValueError(f"{cell} is not a standard deviation")
    return value


def write_bearing_file(path: str | os.PathLike[str], rows: Iterable[BearingRow]) -> None:
    """Write bearings to a bearings.csv; they replace those of equal tag and parent file."""
    new = list(rows)
    for row in new:
        require_plain_name(row.parent_file)
    old = read_bearing_file(path) if os.path.exists(path) else ()
    replaced = {(row.tag_id, row.parent_file) for row in new}
    kept = [row for row in old if (row.tag_id, row.parent_file) not in replaced]
    write_whole(path, "".join(map(bearing_line, [*kept, *new])))


def bearing_line(row: BearingRow) -> str:
    """Format one line of a bearings.csv, with its newline; unknown values are ``NaN``."""
    cells = [
        *(str(row.tag_id), row.parent_file, f"{row.bearing_deg:.6f}"),
        _number(row.confidence, 6),
        *(f"{row.latitude_deg:.9f}", f"{row.longitude_deg:.9f}"),
        *(_number(row.altitude_relative_m, 6), _number(row.altitude_amsl_m, 6)),
        *(
            "NaN" if t is None else seconds_text(t)
            for t in (row.start_time_ns, row.end_time_ns)
        ),
    ]
    if row.sigma_deg is not None:
        cells.append(_number(row.sigma_deg, 6))
    return ",".join(cells) + "\n"


def _number(value: float | None, decimals: int) -> str:
    return "NaN" if value is None else f"{value:.{decimals}f}"
