"""``bearings.csv`` as the original's tools write it (reference/localization.md §1.8).

No header; ten columns: tag, parent file, bearing, tau, latitude, longitude, height above
ground, altitude, first and last time. Ours follow it with an eleventh, the standard deviation.
"""

import os
from dataclasses import dataclass
from pathlib import Path

from uavrt.errors import FormatError
from uavrt.recording.formats.text import finite, latitude, longitude, whole

_COLUMNS = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingRow:
    """One line of the file."""

    tag_id: int
    parent_file: str
    bearing_deg: float
    confidence: float | None
    latitude_deg: float
    longitude_deg: float
    altitude_relative_m: float | None
    altitude_amsl_m: float | None
    start_time_s: float | None
    end_time_s: float | None
    sigma_deg: float | None = None


def read_bearing_file(path: str | os.PathLike[str]) -> tuple[BearingRow, ...]:
    """Read a bearings.csv; empty lines, ``#`` lines and a line of names are passed over.

    Raises
    ------
    FormatError
        The file cannot be read, or a line is not a bearing.
    """
    name = os.fspath(path)
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise FormatError(
            f"{name} cannot be read: {error.strerror}",
            remedy="Name a flight directory or a bearings.csv",
        ) from error
    except UnicodeDecodeError:
        raise FormatError(
            f"{name} is not a text file",
            remedy="A bearings.csv has 10 columns: tag, file, bearing, tau, latitude, …",
        ) from None
    rows = []
    for number, line in enumerate(lines, start=1):
        cells = [cell.strip() for cell in line.split(",")]
        if not line.strip() or line.startswith("#") or cells[0] == "tag_id":
            continue
        try:
            rows.append(_row(cells))
        except (ValueError, IndexError) as error:
            raise FormatError(
                f"{name} line {number} is not a bearing: {error}",
                remedy="Give a flight directory, or a bearings.csv with its 10 columns: tag, "
                "file, bearing, tau, latitude, …",
            ) from None
    return tuple(rows)


def _row(cells: list[str]) -> BearingRow:
    if len(cells) < _COLUMNS:
        raise ValueError(f"{len(cells)} columns")
    return BearingRow(
        tag_id=whole(cells[0]),
        parent_file=cells[1],
        bearing_deg=finite(cells[2]),
        confidence=_known(cells[3]),
        latitude_deg=latitude(cells[4]),
        longitude_deg=longitude(cells[5]),
        altitude_relative_m=_known(cells[6]),
        altitude_amsl_m=_known(cells[7]),
        start_time_s=_known(cells[8]),
        end_time_s=_known(cells[9]),
        sigma_deg=_known(cells[10]) if len(cells) > _COLUMNS else None,
    )


def _known(cell: str) -> float | None:
    if not cell:
        return None
    value = float(cell)
    return value if value == value and abs(value) != float("inf") else None
