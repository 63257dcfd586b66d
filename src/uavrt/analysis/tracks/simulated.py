"""The vehicle's true poses as ``uavrt simulate`` writes them: ``telemetry.csv``.

Columns ``time_ns, latitude_deg, longitude_deg, altitude_amsl_m, altitude_relative_m, qw, qx,
qy, qz``; anyone may write such a file.
"""

from pathlib import Path

from uavrt.analysis.tracks.track import VehicleTrack, attitude, in_order
from uavrt.errors import FormatError
from uavrt.messages import AttitudeSample, PositionSample
from uavrt.recording import csv_cells
from uavrt.recording.formats import read_lines

FIRST_COLUMN = b"time_ns,latitude_deg"


def read_simulated(path: Path) -> VehicleTrack:
    """Read poses from a CSV file.

    Raises
    ------
    FormatError
        The file cannot be read, or a line of it holds something else.
    """
    turns: list[AttitudeSample] = []
    places: list[PositionSample] = []
    names, *lines = read_lines(path)
    for number, line in enumerate(lines, start=2):
        if not line.strip():
            continue
        try:
            row = dict(zip(csv_cells(names), csv_cells(line), strict=False))
            time_ns = int(row["time_ns"])
            turned = attitude(
                time_ns,
                (float(row["qw"]), float(row["qx"]), float(row["qy"]), float(row["qz"])),
            )
            place = PositionSample(
                time_ns=time_ns,
                latitude_deg=float(row["latitude_deg"]),
                longitude_deg=float(row["longitude_deg"]),
                altitude_amsl_m=float(row["altitude_amsl_m"]),
                altitude_relative_m=float(row["altitude_relative_m"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise FormatError(
                f"{path} line {number} is not a pose: {error}",
                remedy="The columns are those of telemetry.csv, docs/reference/scenario.md",
            ) from None
        turns += [] if turned is None else [turned]
        places.append(place)
    return VehicleTrack(
        kind="telemetry.csv", attitudes=in_order(turns), positions=in_order(places)
    )
