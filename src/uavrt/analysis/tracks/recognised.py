"""Read a track file of any known kind."""

from pathlib import Path

from uavrt.analysis.tracks.simulated import FIRST_COLUMN, read_simulated
from uavrt.analysis.tracks.tlog import read_tlog
from uavrt.core.errors import FormatError, os_errors_as
from uavrt.core.foreign import require_plain_file
from uavrt.formats.tracks.dataflash import MARK, read_dataflash
from uavrt.formats.tracks.gps_tracks import read_gpx, read_nmea
from uavrt.formats.tracks.track import VehicleTrack
from uavrt.formats.tracks.ulog import read_ulog


def read_track(path: Path, vehicle: int | None = None) -> VehicleTrack:
    """Read a track file, whose kind is recognised by its content.

    `vehicle` is the MAVLink system id of the vehicle to read from a .tlog, which may contain
    several; None: the only one. Raises `FormatError` if the file cannot be read.
    """
    with os_errors_as(FormatError, f"cannot read {path}", "Check the name"):
        require_plain_file(path)
        with path.open("rb") as file:
            head = file.read(4096)
    if not head.strip(b"\0\r\n\t "):
        raise FormatError(f"{path} is empty", remedy="Copy it from the autopilot again")
    if head.startswith(b"ULog"):
        track = read_ulog(path)
    elif head.startswith(MARK):
        track = read_dataflash(path)
    elif b"<gpx" in head:
        track = read_gpx(path)
    elif len(head) > 11 and head[8] in (0xFD, 0xFE):
        track = read_tlog(path, vehicle)
    elif head.startswith(FIRST_COLUMN):
        track = read_simulated(path)
    elif b"$G" in head:
        track = read_nmea(path)
    else:
        raise FormatError(
            f"{path} is not a known kind of track",
            remedy="If it is a log of the autopilot, it is damaged: copy it again. "
            "Supported are .ulg of PX4, .BIN and .tlog of ArduPilot, NMEA, GPX, and the "
            "telemetry.csv of uavrt simulate",
        )
    if not track.attitudes or not track.positions:
        missing = "place" if track.attitudes else "attitude"
        raise FormatError(f"{path} ({track.kind}) has no {missing}", remedy="Give another log")
    return track
