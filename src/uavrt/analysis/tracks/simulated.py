"""Read a simulated vehicle's true poses from ``uavrt simulate``'s ``telemetry.csv``.

Columns are ``time_ns, latitude_deg, longitude_deg, altitude_amsl_m, altitude_relative_m, qw,
qx, qy, qz``. Other programs may write such files too.
"""

from pathlib import Path

from uavrt.core.messages import AttitudeSample, PositionSample
from uavrt.formats.csv_line import csv_cells
from uavrt.formats.text import place_or_none, read_lines, wrong_line
from uavrt.formats.tracks.track import VehicleTrack, attitude, in_order

FIRST_COLUMN = b"time_ns,latitude_deg"


def read_simulated(path: Path) -> VehicleTrack:
    """Read poses from a telemetry.csv; raises `FormatError`, also for an invalid line."""
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
            place = place_or_none(row["latitude_deg"], row["longitude_deg"])
            altitudes_m = [float(row[f"altitude_{of}_m"]) for of in ("amsl", "relative")]
        except (KeyError, TypeError, ValueError) as error:
            raise wrong_line(
                path,
                number,
                error,
                "Use the columns of telemetry.csv, see docs/reference/scenario.md",
            ) from None
        turns += [] if turned is None else [turned]
        if place is not None:
            places.append(
                PositionSample(
                    time_ns=time_ns,
                    latitude_deg=place[0],
                    longitude_deg=place[1],
                    altitude_amsl_m=altitudes_m[0],
                    altitude_relative_m=altitudes_m[1],
                )
            )
    return VehicleTrack(
        kind="telemetry.csv", attitudes=in_order(turns), positions=in_order(places)
    )
