"""From bearings of a flight, or a bearings.csv, to one position for each tag."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uavrt.analysis.bearings import TagBearing, read_bearings
from uavrt.errors import UsageError
from uavrt.localization import (
    AntennaPattern,
    Position,
    PositionMethod,
    Stations,
    estimate_position,
)
from uavrt.recording.bearing_files import BearingRow, read_bearing_file


@dataclass(frozen=True, slots=True, kw_only=True)
class TagPosition:
    """A position of a tag, or why there is none."""

    tag_id: int
    position: Position | None
    reason: str | None = None
    """Why there is no position."""


def read_positions(
    path: str | os.PathLike[str],
    *,
    method: PositionMethod = "bayes",
    antenna: AntennaPattern | str = "RA-23K",
) -> list[TagPosition]:
    """Estimate the positions of the tags of a flight directory or a bearings.csv.

    Raises
    ------
    FormatError
        It is neither.
    """
    if Path(path).is_dir():
        found = read_bearings(path, antenna=antenna)
        return positions_of_bearings(found, method=method)
    rows = read_bearing_file(path)
    return [
        _positioned(
            tag_id, _stations_of_rows([row for row in rows if row.tag_id == tag_id]), method
        )
        for tag_id in sorted({row.tag_id for row in rows})
    ]


def positions_of_bearings(
    bearings: Sequence[TagBearing], *, method: PositionMethod = "bayes"
) -> list[TagPosition]:
    """One position for each tag; bearings in which there is no direction are left out."""
    found = []
    for tag_id in sorted({one.tag_id for one in bearings}):
        used = [one for one in bearings if one.tag_id == tag_id and one.bearing.accepted]
        if used:
            stations = Stations.of(
                np.array([one.latitude_deg for one in used]),
                np.array([one.longitude_deg for one in used]),
                [one.bearing for one in used],
            )
            found.append(_positioned(tag_id, stations, method))
        else:
            reason = "none of its bearings has a direction"
            found.append(TagPosition(tag_id=tag_id, position=None, reason=reason))
    return found


def _stations_of_rows(rows: Sequence[BearingRow]) -> Stations:
    sigmas = [row.sigma_deg for row in rows if row.sigma_deg is not None]
    return Stations(
        latitude_deg=np.array([row.latitude_deg for row in rows]),
        longitude_deg=np.array([row.longitude_deg for row in rows]),
        bearing_deg=np.array([row.bearing_deg for row in rows]),
        sigma_deg=np.array(sigmas) if len(sigmas) == len(rows) else None,
    )


def _positioned(tag_id: int, stations: Stations, method: PositionMethod) -> TagPosition:
    try:
        position = estimate_position(stations, method=method)
    except UsageError as error:
        # One tag with a single bearing must not keep the others from the list.
        return TagPosition(tag_id=tag_id, position=None, reason=str(error))
    return TagPosition(tag_id=tag_id, position=position)
