"""Bearings and positions while flying and afterwards, by the same code.

Turns in place are found in the vehicle's poses; each tag's pulses inside a turn give a bearing,
from the third on; the bearings of all turns give a position. A turn that is not complete gives
a wide interval, not a wrong bearing.
"""

import base64
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.errors import UsageError
from uavrt.ground.coordinates import readout
from uavrt.ground.flights import Columns, known
from uavrt.localization import (
    AntennaPattern,
    Bearing,
    Position,
    PositionGrid,
    TangentPlane,
    Turn,
    region_outlines,
)
from uavrt.localization.flight_estimates import (
    HeardInTurn,
    PoseColumns,
    PulseColumns,
    Rhythm,
    antenna_as_shown,
    bearing_of,
    heard_in,
    position_of_bearings,
    teaching,
    turns_in,
)
from uavrt.localization.headings import yaws_deg
from uavrt.localization.records import ACCEPTED_EVIDENCE
from uavrt.messages import LiveBearing, Tag
from uavrt.units import wrap_degrees_360

SECTORS = 16
"""Wedges of the pulse rose, as the original ground station's finest rotation."""
_POSE_OF_PULSE = [1, *range(8, 15)]
"""Rows of `PULSE_COLUMNS` that are those of a pose: time, place, height, quaternion."""

DRONE_LEVEL_SIGMA_DB = 1.0
"""Of a bearing that came from the drone, which does not tell it."""

_Floats = NDArray[np.float64]
Record = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class AntennaChoice:
    """How the ground reads the headings of pulses."""

    pattern: str = "RA-23K"
    offset_deg: float = 0.0
    """Boresight clockwise from the heading that the drone tells; 0 when its own settings hold
    the mounting."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimates:
    """What a flight says of its tags."""

    bearings: list[Record]
    positions: list[Record]


class Estimator:
    """Estimates with a memory: a turn and tag that have not changed are not computed again."""

    def __init__(self) -> None:
        self._bearings: dict[tuple[Any, ...], tuple[Bearing, Record] | None] = {}
        self._positions: dict[tuple[Any, ...], Record | None] = {}
        self._learnt: tuple[Hashable, AntennaPattern] | None = None

    def estimate(
        self,
        columns: Columns,
        antenna: AntennaChoice,
        from_drone: Sequence[LiveBearing] = (),
        tags: Sequence[Tag] = (),
    ) -> Estimates:
        """Estimate all bearings and positions of a flight as it is now.

        Of the tags that are listed, pulses that must have come and were not heard count too.
        A bearing of the drone's own stands where it knows of more pulses of that turn than
        have reached the ground.
        """
        poses = _pose_columns(columns)
        turns = turns_in(poses)
        rhythms = {tag.tag_id: Rhythm.of(tag) for tag in tags}
        tag_ids = sorted({int(tag_id) for tag_id in np.unique(columns["tag_id"])})
        heard: dict[int, list[tuple[int, HeardInTurn]]] = {}
        for tag_id in tag_ids:
            pulses = _pulse_columns(columns, tag_id, antenna.offset_deg)
            inside = [
                (number, heard_in(tag_id, turn, pulses, poses, rhythms.get(tag_id)))
                for number, turn in enumerate(turns)
            ]
            heard[tag_id] = [(number, one) for number, one in inside if one is not None]
        pattern = self._pattern([one for each in heard.values() for _, one in each], antenna)
        bearings: list[Record] = []
        positions: list[Record] = []
        for tag_id in sorted(set(tag_ids) | {one.tag_id for one in from_drone}):
            found = [
                (one.turn, bearing)
                for number, one in heard.get(tag_id, [])
                if (bearing := self._bearing(number, one, antenna, pattern))
            ]
            theirs = [one for one in from_drone if one.tag_id == tag_id]
            found = _with_the_drones(found, theirs, len(turns))
            bearings += [record for _, (_, record) in found]
            position = self._position(tag_id, found, antenna)
            if position is not None:
                positions.append(position)
        return Estimates(bearings=bearings, positions=positions)

    def _pattern(
        self, heard: Sequence[HeardInTurn], antenna: AntennaChoice
    ) -> tuple[Hashable, AntennaPattern]:
        """The antenna as the turns so far show it, and a name for what it was learnt from."""
        ordered = sorted(heard, key=lambda one: (one.turn.start_time_ns, one.tag_id))
        key = (
            antenna,
            tuple((one.tag_id, one.turn, len(one.snr_db)) for one in teaching(ordered)),
        )
        if self._learnt is None or self._learnt[0] != key:
            self._learnt = (key, antenna_as_shown(ordered, antenna.pattern))
        return self._learnt

    def _bearing(
        self,
        number: int,
        heard: HeardInTurn,
        antenna: AntennaChoice,
        pattern: tuple[Hashable, AntennaPattern],
    ) -> tuple[Bearing, Record] | None:
        turn = heard.turn
        count = (len(heard.snr_db), len(heard.missed_yaw_deg))
        key = (heard.tag_id, turn.start_time_ns, turn.end_time_ns, count, pattern[1])
        if key not in self._bearings:
            self._bearings[key] = _bearing(number, heard, pattern[1])
        return self._bearings[key]

    def _position(
        self,
        tag_id: int,
        found: Sequence[tuple[Turn, tuple[Bearing, Record]]],
        antenna: AntennaChoice,
    ) -> Record | None:
        if not any(bearing.accepted for _, (bearing, _) in found):
            return None
        key = (
            tag_id,
            tuple(
                (turn.start_time_ns, one.bearing_deg, one.sigma_deg) for turn, (one, _) in found
            ),
        )
        if key not in self._positions:
            self._positions[key] = _position(tag_id, found)
        return self._positions[key]


def _with_the_drones(
    found: list[tuple[Turn, tuple[Bearing, Record]]],
    theirs: Sequence[LiveBearing],
    turns: int,
) -> list[tuple[Turn, tuple[Bearing, Record]]]:
    """Put the drone's bearings in place of ours that know less, in order of time."""
    for one in theirs:
        ours = [
            item
            for item in found
            if item[0].start_time_ns <= one.end_time_ns
            and one.start_time_ns <= item[0].end_time_ns
        ]
        if any(record["pulses"] >= one.pulses for _, (_, record) in ours):
            continue
        found = [item for item in found if item not in ours]
        number = ours[0][1][1]["turn"] if ours else turns
        found.append(_of_the_drone(one, number))
    return sorted(found, key=lambda item: item[0].start_time_ns)


def _of_the_drone(one: LiveBearing, number: int) -> tuple[Turn, tuple[Bearing, Record]]:
    """A bearing as if it had been estimated here; its posterior is taken as von Mises."""
    turn = Turn(
        start_time_ns=one.start_time_ns,
        end_time_ns=one.end_time_ns,
        turned_deg=one.turned_deg,
        stops=0,
        widest_gap_deg=max(0.0, 360.0 - abs(one.turned_deg)),
        latitude_deg=one.latitude_deg,
        longitude_deg=one.longitude_deg,
    )
    bearing = Bearing(
        bearing_deg=one.bearing_deg,
        method="pattern_ml",
        pulses=one.pulses,
        sigma_deg=one.sigma_deg,
        interval90_deg=one.interval90_deg,
        evidence=ACCEPTED_EVIDENCE if one.accepted else 0.0,
        multipath_suspected=one.multipath_suspected,
        level_db=one.level_db,
        level_sigma_db=None if one.level_db is None else DRONE_LEVEL_SIGMA_DB,
        posterior=_von_mises(one.bearing_deg, one.sigma_deg),
    )
    record = _record(one.tag_id, number, turn, bearing, one.pulses, None)
    return turn, (bearing, record | {"ambiguous": one.ambiguous, "from_drone": True})


def _von_mises(bearing_deg: float, sigma_deg: float) -> _Floats:
    """(360,) probabilities of whole degrees."""
    off = np.radians(np.arange(360.0) - bearing_deg)
    density = np.exp((np.cos(off) - 1.0) / np.radians(max(sigma_deg, 0.5)) ** 2)
    return np.asarray(density / density.sum())


def _pose_columns(columns: Columns) -> PoseColumns:
    """The vehicle's poses, and the pulses' own where no others are."""
    posed = np.flatnonzero(np.isfinite(columns["quaternion_w"]))
    return _poses(columns.poses).completed(_poses(columns.pulses[_POSE_OF_PULSE], posed))


def _poses(rows: _Floats, chosen: NDArray[np.intp] | slice = slice(None)) -> PoseColumns:
    return PoseColumns(
        time_ns=rows[0, chosen].astype(np.int64),
        latitude_deg=rows[1, chosen],
        longitude_deg=rows[2, chosen],
        height_m=rows[3, chosen],
        quaternion_wxyz=rows[4:8, chosen].T,
    )


def _pulse_columns(columns: Columns, tag_id: int, offset_deg: float) -> PulseColumns:
    """One tag's pulses with a pose and a power, the antenna turned by its offset."""
    usable = (columns["tag_id"] == tag_id) & np.isfinite(columns["quaternion_w"])
    usable &= np.isfinite(columns["snr_db"])
    chosen = np.flatnonzero(usable)
    chosen = chosen[np.argsort(columns["start_time_ns"][chosen], kind="stable")]
    return PulseColumns(
        time_ns=columns["start_time_ns"][chosen].astype(np.int64),
        latitude_deg=columns["latitude_deg"][chosen],
        longitude_deg=columns["longitude_deg"][chosen],
        quaternion_wxyz=columns.pulses[11:15, chosen].T,
        snr_db=columns["snr_db"][chosen],
        noise_psd=columns["noise_psd"][chosen],
        rate=np.nan_to_num(columns["rate"][chosen], nan=1.0).astype(np.int64),
    ).turned(offset_deg)


def _bearing(
    number: int, heard: HeardInTurn, pattern: AntennaPattern
) -> tuple[Bearing, Record] | None:
    try:
        bearing = bearing_of(heard, antenna=pattern)
    except UsageError:
        return None
    rose = _rose(yaws_deg(heard.quaternion_wxyz), heard.snr_db)
    count = len(heard.snr_db)
    record = _record(heard.tag_id, number, heard.turn, bearing, count, rose)
    place = {"latitude_deg": heard.latitude_deg, "longitude_deg": heard.longitude_deg}
    return bearing, record | place


def _record(
    tag_id: int,
    number: int,
    turn: Turn,
    bearing: Bearing,
    pulses: int,
    rose: list[float | None] | None,
) -> Record:
    """What the page is told of a bearing; a drone's has no rose."""
    return {
        "tag_id": tag_id,
        "turn": number,
        "start_time_ns": turn.start_time_ns,
        "end_time_ns": turn.end_time_ns,
        "turned_deg": round(turn.turned_deg, 1),
        "latitude_deg": turn.latitude_deg,
        "longitude_deg": turn.longitude_deg,
        "bearing_deg": round(bearing.bearing_deg, 2),
        "sigma_deg": _rounded(bearing.sigma_deg),
        "interval90_deg": None
        if bearing.interval90_deg is None
        else [round(edge, 2) for edge in bearing.interval90_deg],
        "method": bearing.method,
        "pulses": pulses,
        "accepted": bearing.accepted,
        "ambiguous": bearing.ambiguous,
        "multipath_suspected": bearing.multipath_suspected,
        "level_db": _rounded(bearing.level_db),
        "rose_snr_db": [None] * SECTORS if rose is None else rose,
        "from_drone": False,
    }


def _position(
    tag_id: int, found: Sequence[tuple[Turn, tuple[Bearing, Record]]]
) -> Record | None:
    records = [record for _, (_, record) in found]
    try:
        position = position_of_bearings(
            [record["latitude_deg"] for record in records],
            [record["longitude_deg"] for record in records],
            [turn.start_time_ns for turn, _ in found],
            [bearing for _, (bearing, _) in found],
        )
    except UsageError:
        return None
    return {
        "tag_id": tag_id,
        "latitude_deg": position.latitude_deg,
        "longitude_deg": position.longitude_deg,
        "method": position.method,
        "stations": position.stations,
        "radius50_m": _rounded(position.radius50_m),
        "radius95_m": _rounded(position.radius95_m),
        "at_edge": position.at_edge,
        "cautions": [{"name": one.name, "text": one.text} for one in position.cautions],
        "remarks": list(position.remarks),
        "readout": readout(position.latitude_deg, position.longitude_deg).as_dict(),
        **_regions(position),
    }


def _regions(position: Position) -> Record:
    """Outlines of the smallest regions of 50 and 95 %, and the heat map."""
    grid = position.grid
    if grid is None:
        return {"region50": [], "region95": [], "heat": None}
    plane = TangentPlane(latitude_deg=grid.latitude_deg, longitude_deg=grid.longitude_deg)
    outlines = {
        f"region{share}": [
            np.round(ring, 7).tolist() for ring in region_outlines(grid, share / 100.0)
        ]
        for share in (50, 95)
    }
    return {**outlines, "heat": _heat(grid, plane)}


def _heat(grid: PositionGrid, plane: TangentPlane) -> Record:
    """Probability as bytes, north row first, and the corners clockwise from the north-west."""
    step_e = float(grid.east_m[1] - grid.east_m[0]) / 2.0
    step_n = float(grid.north_m[1] - grid.north_m[0]) / 2.0
    west, east = float(grid.east_m[0]) - step_e, float(grid.east_m[-1]) + step_e
    south, north = float(grid.north_m[0]) - step_n, float(grid.north_m[-1]) + step_n
    latitude, longitude = plane.to_geodetic(
        [west, east, east, west], [north, north, south, south]
    )
    scaled = np.sqrt(grid.probability / max(float(grid.probability.max()), 1e-30))
    cells = np.flipud((scaled * 255.0).astype(np.uint8))
    return {
        "width": int(cells.shape[1]),
        "height": int(cells.shape[0]),
        "corners": np.stack([longitude, latitude], axis=-1).tolist(),
        "values": base64.b64encode(cells.tobytes()).decode(),
    }


def _rose(yaw: _Floats, snr_db: _Floats) -> list[float | None]:
    """Greatest SNR in each of 16 sectors, the first centred on north."""
    sectors = np.floor((wrap_degrees_360(yaw)) / (360.0 / SECTORS) + 0.5).astype(int) % SECTORS
    return [
        known(round(float(snr_db[sectors == sector].max()), 2))
        if (sectors == sector).any()
        else None
        for sector in range(SECTORS)
    ]


def _rounded(value: float | None) -> float | None:
    return None if value is None else known(round(value, 2))
