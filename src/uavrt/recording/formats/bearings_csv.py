"""Write ``bearings.csv`` as the original's uavrt_bearing does.

No heading, ten columns (reference/localization.md §1.8), and our eleventh, the standard
deviation, which the original's readers pass over. The reader is
`uavrt.recording.bearing_files`::

    tag_id,parent_file,bearing_deg,tau,lat,lon,alt_agl,alt_asl,t_start,t_end[,sigma_deg]
"""

import os
from collections.abc import Iterable

from uavrt.errors import FormatError
from uavrt.recording.bearing_files import BearingRow, read_bearing_file
from uavrt.recording.formats.whole_file import write_whole


def write_bearing_file(path: str | os.PathLike[str], rows: Iterable[BearingRow]) -> None:
    """Write a bearings.csv, whole or not at all.

    Lines that are there already stay, except those of a tag and a parent file that are written
    anew: all its rotations are replaced together.

    Raises
    ------
    FormatError
        What is there already is no bearings.csv, or a name holds a comma.
    RecordingError
        It cannot be written.
    """
    new = list(rows)
    for row in new:
        if "," in row.parent_file or "\n" in row.parent_file:
            raise FormatError(
                f"the name {row.parent_file!r} cannot stand in a CSV without quotes",
                remedy="Rename the file",
            )
    old = read_bearing_file(path) if os.path.exists(path) else ()
    replaced = {(row.tag_id, row.parent_file) for row in new}
    kept = [row for row in old if (row.tag_id, row.parent_file) not in replaced]
    write_whole(path, "".join(map(bearing_line, [*kept, *new])))


def bearing_line(row: BearingRow) -> str:
    """Write one line, with its newline; what is not known is ``NaN``."""
    cells = [
        *(str(row.tag_id), row.parent_file, f"{row.bearing_deg:.6f}"),
        _number(row.confidence, 6),
        *(f"{row.latitude_deg:.9f}", f"{row.longitude_deg:.9f}"),
        *(_number(row.altitude_relative_m, 6), _number(row.altitude_amsl_m, 6)),
        *(_number(row.start_time_s, 6), _number(row.end_time_s, 6)),
    ]
    if row.sigma_deg is not None:
        cells.append(_number(row.sigma_deg, 6))
    return ",".join(cells) + "\n"


def _number(value: float | None, decimals: int) -> str:
    return "NaN" if value is None else f"{value:.{decimals}f}"
