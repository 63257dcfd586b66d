"""PX4's onboard log (``.ulg``), read by the package pyulog.

Topics ``vehicle_attitude`` (quaternion), ``vehicle_global_position``, for UTC the GPS topics,
and ``vehicle_land_detected`` and ``vehicle_status`` (arming) where they are. Times are
microseconds since boot.
"""

import contextlib
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from uavrt.analysis.tracks.track import (
    VehicleTrack,
    attitude,
    in_order,
    over_the_first,
    position,
)
from uavrt.errors import FormatError, needs_extra
from uavrt.on_ground import spans_on_ground

_GPS = ("vehicle_gps_position", "sensor_gps")
_LANDED, _STATUS = "vehicle_land_detected", "vehicle_status"
_TOPICS = ["vehicle_attitude", "vehicle_global_position", _LANDED, _STATUS, *_GPS]
_ARMED = 2
"""`vehicle_status.arming_state`."""
_SANE_UNIX_US = 1_400_000_000_000_000


def read_ulog(path: Path) -> VehicleTrack:
    """Read a ULog file.

    Raises
    ------
    FormatError
        It cannot be read, or has no GPS time.
    UsageError
        The extra ``uavrt[analysis]`` is not installed.
    """
    with needs_extra("analysis", "a log of PX4"):
        from pyulog import ULog
    try:
        # Opened here: pyulog leaves a file open that it cannot read; and it prints.
        with path.open("rb") as file, contextlib.redirect_stdout(io.StringIO()):
            log = ULog(file, _TOPICS)
    except OSError as error:
        raise FormatError(f"cannot read {path}: {error.strerror}") from error
    except Exception as error:
        raise FormatError(
            f"{path} is a damaged ULog file: {error}",
            remedy="Copy it from the autopilot again, or take another flight's",
        ) from error
    topics: dict[str, Any] = {one.name: one.data for one in log.data_list if not one.multi_id}
    offset_us = _utc_of_boot_us(topics)
    if offset_us is None:
        raise FormatError(f"{path} has no GPS time", remedy="Give a log of a flight with GPS")
    turns = topics.get("vehicle_attitude", {"timestamp": ()})
    places = topics.get("vehicle_global_position", {"timestamp": ()})
    attitudes = (
        attitude(
            (int(time) + offset_us) * 1000,
            (
                float(turns["q[0]"][i]),
                float(turns["q[1]"][i]),
                float(turns["q[2]"][i]),
                float(turns["q[3]"][i]),
            ),
        )
        for i, time in enumerate(turns["timestamp"])
    )
    positions = (
        position(
            (int(time) + offset_us) * 1000,
            *(float(places[name][i]) for name in ("lat", "lon", "alt")),
        )
        for i, time in enumerate(places["timestamp"])
    )
    return VehicleTrack(
        kind="ULog",
        attitudes=in_order(one for one in attitudes if one),
        positions=over_the_first(one for one in positions if one),
        on_ground_ns=spans_on_ground(
            _told(topics.get(_STATUS), "arming_state", _ARMED, offset_us),
            _told(topics.get(_LANDED), "landed", 1, offset_us),
        ),
    )


def _told(
    data: Mapping[str, Sequence[Any]] | None, name: str, yes: int, offset_us: int
) -> list[tuple[int, bool]]:
    """Times [ns] and states of a topic; none of one that is not logged."""
    if data is None or name not in data:
        return []
    pairs = zip(data["timestamp"], data[name], strict=True)
    return [((int(time) + offset_us) * 1000, int(state) == yes) for time, state in pairs]


def _utc_of_boot_us(topics: dict[str, Any]) -> int | None:
    """UTC at boot: the least difference, of the message that waited least."""
    for name in _GPS:
        data = topics.get(name)
        if data is not None and "time_utc_usec" in data:
            pairs = zip(data["time_utc_usec"], data["timestamp"], strict=True)
            found = [int(utc) - int(boot) for utc, boot in pairs if utc > _SANE_UNIX_US]
            if found:
                return min(found)
    return None
