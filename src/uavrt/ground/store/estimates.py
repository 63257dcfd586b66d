"""Bearings and positions while flying and afterwards, by the same code.

Turns in place are found in the vehicle's poses; each tag's pulses inside a turn give a bearing,
from the third on; the bearings of all turns give a position. A turn that is not complete gives
a wide interval, not a wrong bearing. With a monopole there are no bearings: the strength along
the flight gives the position, by the function of the report and the command line.
"""

import base64
from collections.abc import Hashable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis import (
    LEAST_TAG_HZ,
    OTHER_TAG_HZ,
    HeardStrength,
    past_turns,
    position_of_strength,
)
from uavrt.analysis.measure import remarks_of
from uavrt.errors import FormatError, UsageError
from uavrt.ground.store.flights import Columns, known
from uavrt.ground.web import readout
from uavrt.localization import (
    ACCEPTED_EVIDENCE,
    HEIGHT_SIGMA_M,
    MONOPOLE,
    AntennaPattern,
    Bearing,
    HeardInTurn,
    OverGround,
    PoseColumns,
    Position,
    PositionGrid,
    PulseColumns,
    Rhythm,
    Strengths,
    TangentPlane,
    Turn,
    antenna_as_shown,
    bearing_of,
    heard_in,
    position_of_bearings,
    region_outlines,
    strengths_of,
    teaching,
    turns_in,
    yaws_deg,
)
from uavrt.localization.position import HEADING_SIGMA_DEG
from uavrt.messages import LiveBearing, Tag
from uavrt.recording import read_flight
from uavrt.terrain import open_elevation
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
    """How the ground reads the headings of pulses, what it trusts them to, and the hills."""

    pattern: str = "RA-23K"
    offset_deg: float = 0.0
    """Boresight clockwise from the heading that the drone tells; 0 when its own settings hold
    the mounting."""
    heading_sigma_deg: float = HEADING_SIGMA_DEG
    """Error that all headings of a flight share, one standard deviation."""
    height_sigma_m: float = HEIGHT_SIGMA_M
    """With a monopole: error that all heights over a tag share, likewise."""
    dem: str = ""
    """Elevation file or folder; empty: the ground is taken as level."""


Found = dict[int, list[tuple[Turn, tuple[Bearing, Record]]]]
"""Bearings of each tag, in order of time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimates:
    """Bearings and positions of a flight's tags."""

    bearings: list[Record]
    positions: list[Record]
    found: Found = field(default_factory=dict)
    """The bearings of each tag as they are, for other vehicles' positions of it."""
    strengths: dict[int, Strengths] = field(default_factory=dict)
    """Of the tags that were heard and of which there is no bearing, likewise."""
    frequencies_hz: dict[int, float] = field(default_factory=dict)
    """Of the tags that were heard or are listed: a number alone may be another animal's."""

    def knows(self, tag_id: int) -> bool:
        """Whether something was heard of a tag, not only listed."""
        return tag_id in self.found or tag_id in self.strengths

    def record(self) -> dict[str, list[Record]]:
        """What a page is told."""
        return {"bearings": self.bearings, "positions": self.positions}

    @property
    def told(self) -> tuple[tuple[int, int, int, float], ...]:
        """What changes when more is found: tag, turn, pulses and bearing of each.

        Of strengths the number of places and, to a decibel, their sum.
        """
        bearings = tuple(
            (tag_id, turn.start_time_ns, bearing.pulses, bearing.bearing_deg)
            for tag_id, items in self.found.items()
            for turn, (bearing, _) in items
        )
        return bearings + tuple(
            (tag_id, -1, len(one.level_db), float(round(one.level_db.sum())))
            for tag_id, one in self.strengths.items()
        )


_SURVEY_ALONE = "a survey by strength has a position of its own"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Others:
    """What other vehicles know of the tags, and what this one is called among them."""

    estimates: Sequence[Estimates]
    frequencies_hz: Mapping[int, float]
    """Of this vehicle's own tags."""
    name: str

    @property
    def found(self) -> set[int]:
        """Numbers of the tags of which others have bearings."""
        return {tag_id for each in self.estimates for tag_id in each.found}

    def _of_tag(self, tag_id: int) -> list[Estimates]:
        """Those to whom the number means the same tag as to us, or to the first of them."""
        heard = [each for each in self.estimates if each.knows(tag_id)]
        told = [self.frequencies_hz, *(each.frequencies_hz for each in heard)]
        ours_hz = next((each[tag_id] for each in told if tag_id in each), 0.0)
        return [
            each
            for each in self.estimates
            if abs(each.frequencies_hz.get(tag_id, ours_hz) - ours_hz) <= OTHER_TAG_HZ
        ]

    def together(
        self, tag_id: int, own: list[tuple[Turn, tuple[Bearing, Record]]]
    ) -> list[tuple[Turn, tuple[Bearing, Record]]]:
        """All bearings of a tag, in order of time."""
        theirs = [item for each in self._of_tag(tag_id) for item in each.found.get(tag_id, [])]
        return sorted(own + theirs, key=lambda item: item[0].start_time_ns)

    def listeners(self, tag_id: int, own: Strengths | None) -> list[Strengths]:
        """All that heard a tag without turning; one alone beside no others tells nothing."""
        every = [each.strengths.get(tag_id) for each in self._of_tag(tag_id)]
        theirs = [one for one in every if one is not None]
        return theirs if own is None else [own, *theirs]


class Estimator:
    """Estimates with a cache: does not recompute a turn and tag that have not changed.

    It holds what the last estimate was made of: what has changed since is not asked for again.
    """

    def __init__(self) -> None:
        self._bearings: dict[tuple[Any, ...], tuple[Bearing, Record] | None] = {}
        self._positions: dict[tuple[Any, ...], Record | None] = {}
        self._used_bearings: dict[tuple[Any, ...], tuple[Bearing, Record] | None] = {}
        self._used_positions: dict[tuple[Any, ...], Record | None] = {}
        self._learnt: tuple[Hashable, AntennaPattern] | None = None
        self._ground: tuple[Hashable, OverGround | None] | None = None
        self._past: tuple[Hashable, list[HeardInTurn]] | None = None

    def past(self, place: Path, antenna: AntennaChoice) -> Sequence[HeardInTurn]:
        """What turns of the same drone's past flights, beside this one, teach of the antenna.

        They are read once for each flight and antenna; a flight that cannot be read is taught
        nothing.
        """
        if antenna.pattern == MONOPOLE:
            return ()
        key = (place, antenna.pattern, antenna.offset_deg)
        if self._past is None or self._past[0] != key:
            turns: list[HeardInTurn] = []
            with suppress(FormatError, UsageError):
                flight = read_flight(place)
                for heard in past_turns(flight, antenna.pattern, antenna.offset_deg):
                    turns += heard
            self._past = (key, turns)
        return self._past[1]

    def estimate(
        self,
        columns: Columns,
        antenna: AntennaChoice,
        from_drone: Sequence[LiveBearing] = (),
        tags: Sequence[Tag] = (),
        beside: Sequence[Estimates] = (),
        past: Sequence[HeardInTurn] = (),
        name: str = "this vehicle",
        listed: Sequence[Tag] = (),
    ) -> Estimates:
        """Estimate all bearings and positions of a flight as it is now.

        What other vehicles have found `beside`, and how strongly those heard it that did not
        turn, go into the positions, too, where the number means a tag of the same frequency: as
        heard, else as searched for, else as `listed` here; a survey by strength with a monopole
        stands by itself. To others this vehicle's own strengths are those of its `name`. Turns
        of `past` flights teach the antenna's pattern with its own.

        Of the tags that are listed, pulses that must have come and were not heard count too.
        A bearing of the drone's own stands where it knows of more pulses of that turn than
        have reached the ground.
        """
        self._used_bearings, self._used_positions = {}, {}
        try:
            own_hz = _frequencies_hz(columns, (*listed, *tags))
            others = _Others(estimates=beside, frequencies_hz=own_hz, name=name)
            found = self._estimate(columns, antenna, from_drone, tags, others, past)
            return replace(found, frequencies_hz=own_hz)
        finally:
            self._bearings, self._positions = self._used_bearings, self._used_positions

    def _estimate(
        self,
        columns: Columns,
        antenna: AntennaChoice,
        from_drone: Sequence[LiveBearing],
        tags: Sequence[Tag],
        others: "_Others",
        past: Sequence[HeardInTurn],
    ) -> Estimates:
        poses = _pose_columns(columns)
        over = self._over_ground(columns, poses, antenna.dem)
        if antenna.pattern == MONOPOLE:
            return self._of_strength(columns, poses, tags, antenna, over, others)
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
        own_turns = [one for each in heard.values() for _, one in each]
        pattern = self._pattern(own_turns, past, antenna)
        bearings: list[Record] = []
        positions: list[Record] = []
        own: Found = {}
        levels: dict[int, Strengths] = {}
        for tag_id in sorted(set(tag_ids) | {one.tag_id for one in from_drone} | others.found):
            found = [
                (one.turn, bearing)
                for number, one in heard.get(tag_id, [])
                if (bearing := self._bearing(number, one, antenna, pattern))
            ]
            theirs = [
                one
                for one in from_drone
                if one.tag_id == tag_id and not _on_ground(one, columns.on_ground_ns)
            ]
            found = _with_the_drones(found, theirs, len(turns))
            bearings += [record for _, (_, record) in found]
            own[tag_id] = found
            if not found and tag_id in tag_ids:
                pulses = _pulse_columns(columns, tag_id, antenna.offset_deg)
                if len(pulses.time_ns):
                    levels[tag_id] = strengths_of(
                        *(others.name, pulses, poses, antenna.pattern), rhythms.get(tag_id)
                    )
            position = self._position(
                *(tag_id, others.together(tag_id, found), antenna, over),
                others.listeners(tag_id, levels.get(tag_id)),
            )
            if position is not None:
                positions.append(position)
        own = {tag_id: found for tag_id, found in own.items() if found}
        return Estimates(bearings=bearings, positions=positions, found=own, strengths=levels)

    def _of_strength(
        self,
        columns: Columns,
        poses: PoseColumns,
        tags: Sequence[Tag],
        antenna: AntennaChoice,
        over: OverGround | None,
        others: "_Others",
    ) -> Estimates:
        """Positions from a survey with a monopole; at one place, from others' bearings."""
        listed = {tag.tag_id: tag for tag in tags}
        positions = []
        levels: dict[int, Strengths] = {}
        own_ids = {int(tag_id) for tag_id in np.unique(columns["tag_id"])}
        for tag_id in sorted(own_ids | others.found):
            heard = _strength(columns, tag_id)
            if not len(heard.time_ns):
                position = self._of_others(tag_id, antenna, over, others, None)
                positions += [] if position is None else [position]
                continue
            ground = None if over is None else over.hills.name
            key = (
                *(tag_id, len(heard.time_ns), int(heard.time_ns[-1])),
                *(listed.get(tag_id), antenna.height_sigma_m, ground),
            )
            if key not in self._positions:
                found, _ = position_of_strength(
                    *(tag_id, heard, listed.get(tag_id), poses),
                    height_sigma_m=antenna.height_sigma_m,
                    over=over,
                )
                end_ns = int(heard.time_ns[-1])
                self._positions[key] = (
                    None
                    if found.position is None
                    else _position_record(tag_id, found.position, end_ns)
                )
            position = self._used_positions[key] = self._positions[key]
            tag = listed.get(tag_id)
            levels[tag_id] = strengths_of(
                *(others.name, _pulse_columns(columns, tag_id, 0.0), poses, MONOPOLE),
                None if tag is None else Rhythm.of(tag),
            )
            if position is None:
                position = self._of_others(tag_id, antenna, over, others, levels[tag_id])
            else:
                levels[tag_id] = replace(levels[tag_id], unused=_SURVEY_ALONE)
            if position is not None:
                positions.append(position)
        return Estimates(bearings=[], positions=positions, strengths=levels)

    def _of_others(
        self,
        tag_id: int,
        antenna: AntennaChoice,
        over: OverGround | None,
        others: "_Others",
        own: Strengths | None,
    ) -> Record | None:
        """The position of a tag by others' bearings, and all strengths."""
        return self._position(
            *(tag_id, others.together(tag_id, []), antenna, over), others.listeners(tag_id, own)
        )

    def _over_ground(self, columns: Columns, poses: PoseColumns, dem: str) -> OverGround | None:
        """The ground of the flight; what was computed of it stays while the take-off does."""
        if not dem or not len(poses.time_ns):
            return None
        key = (dem, int(poses.time_ns[0]))
        if self._ground is None or self._ground[0] != key:
            over = OverGround.of(open_elevation(Path(dem)), poses)
            if over is not None and columns.pulses.shape[1]:
                over = over.at(float(np.median(columns["frequency_hz"])))
            self._ground = (key, over)
        over = self._ground[1]
        return None if over is None else replace(over, poses=poses)

    def _pattern(
        self, heard: Sequence[HeardInTurn], past: Sequence[HeardInTurn], antenna: AntennaChoice
    ) -> tuple[Hashable, AntennaPattern]:
        """The antenna as the turns so far show it, and a name for what it was learnt from."""
        ordered = sorted(heard, key=lambda one: (one.turn.start_time_ns, one.tag_id))
        ordered += past if heard else ()
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
        self._used_bearings[key] = self._bearings[key]
        return self._bearings[key]

    def _position(
        self,
        tag_id: int,
        found: Sequence[tuple[Turn, tuple[Bearing, Record]]],
        antenna: AntennaChoice,
        over: OverGround | None,
        listeners: Sequence[Strengths],
    ) -> Record | None:
        if not any(bearing.accepted for _, (bearing, _) in found):
            return None
        key = (
            tag_id,
            tuple(
                (turn.start_time_ns, one.bearing_deg, one.sigma_deg) for turn, (one, _) in found
            ),
            antenna.heading_sigma_deg,
            None if over is None else over.hills.name,
            tuple((one.told, one.level_db.tobytes()) for one in listeners),
        )
        if key not in self._positions:
            self._positions[key] = _position(tag_id, found, antenna, over, listeners)
        self._used_positions[key] = self._positions[key]
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


def _on_ground(one: LiveBearing, spans_ns: Sequence[tuple[int, int]]) -> bool:
    """Whether a drone's bearing is of a turn on the ground, as was known only later."""
    middle_ns = (one.start_time_ns + one.end_time_ns) // 2
    return any(first <= middle_ns <= last for first, last in spans_ns)


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


def _frequencies_hz(columns: Columns, tags: Sequence[Tag]) -> dict[int, float]:
    """Of each tag, as it was heard; of one that was not, as it is listed."""
    found = {tag.tag_id: tag.frequency_hz for tag in tags}
    heard_hz = columns["frequency_hz"]
    for tag_id in np.unique(columns["tag_id"]):
        own_hz = heard_hz[(columns["tag_id"] == tag_id) & (heard_hz >= LEAST_TAG_HZ)]
        if len(own_hz):
            found[int(tag_id)] = float(np.median(own_hz))
    return found


def _pose_columns(columns: Columns) -> PoseColumns:
    """The vehicle's poses, and the pulses' own where no others are."""
    posed = np.flatnonzero(np.isfinite(columns["quaternion_w"]))
    poses = replace(_poses(columns.poses), on_ground_ns=columns.on_ground_ns)
    return poses.completed(_poses(columns.pulses[_POSE_OF_PULSE], posed))


def _poses(rows: _Floats, chosen: NDArray[np.intp] | slice = slice(None)) -> PoseColumns:
    return PoseColumns(
        time_ns=rows[0, chosen].astype(np.int64),
        latitude_deg=rows[1, chosen],
        longitude_deg=rows[2, chosen],
        height_m=rows[3, chosen],
        quaternion_wxyz=rows[4:8, chosen].T,
    )


def _strength(columns: Columns, tag_id: int) -> HeardStrength:
    """One tag's pulses at known places."""
    chosen = _usable(columns, tag_id)
    return HeardStrength(
        time_ns=columns["start_time_ns"][chosen].astype(np.int64),
        latitude_deg=columns["latitude_deg"][chosen],
        longitude_deg=columns["longitude_deg"][chosen],
        height_m=columns["altitude_relative_m"][chosen],
        snr_db=columns["snr_db"][chosen],
        rate=_rates(columns, chosen),
    )


def _usable(columns: Columns, tag_id: int) -> NDArray[np.intp]:
    """Which pulses are a tag's, with a pose and a power, in order of time."""
    usable = (columns["tag_id"] == tag_id) & np.isfinite(columns["quaternion_w"])
    usable &= np.isfinite(columns["snr_db"])
    chosen = np.flatnonzero(usable)
    return chosen[np.argsort(columns["start_time_ns"][chosen], kind="stable")]


def _rates(columns: Columns, chosen: NDArray[np.intp]) -> NDArray[np.int64]:
    return np.nan_to_num(columns["rate"][chosen], nan=1.0).astype(np.int64)


def _pulse_columns(columns: Columns, tag_id: int, offset_deg: float) -> PulseColumns:
    """One tag's pulses with a pose and a power, the antenna turned by its offset."""
    chosen = _usable(columns, tag_id)
    return PulseColumns(
        time_ns=columns["start_time_ns"][chosen].astype(np.int64),
        latitude_deg=columns["latitude_deg"][chosen],
        longitude_deg=columns["longitude_deg"][chosen],
        quaternion_wxyz=columns.pulses[11:15, chosen].T,
        snr_db=columns["snr_db"][chosen],
        noise_psd=columns["noise_psd"][chosen],
        rate=_rates(columns, chosen),
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
    place = {
        "latitude_deg": heard.latitude_deg,
        "longitude_deg": heard.longitude_deg,
        "middle_time_ns": heard.middle_time_ns,
    }
    return bearing, record | place


def _record(
    tag_id: int,
    number: int,
    turn: Turn,
    bearing: Bearing,
    pulses: int,
    rose: list[float | None] | None,
) -> Record:
    """What the page is told about a bearing; a drone's has no rose."""
    return {
        "tag_id": tag_id,
        "turn": number,
        "start_time_ns": turn.start_time_ns,
        "end_time_ns": turn.end_time_ns,
        "middle_time_ns": (turn.start_time_ns + turn.end_time_ns) // 2,
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
        "remarks": [*bearing.remarks],
        "level_db": _rounded(bearing.level_db),
        "rose_snr_db": [None] * SECTORS if rose is None else rose,
        "from_drone": False,
    }


def _position(
    tag_id: int,
    found: Sequence[tuple[Turn, tuple[Bearing, Record]]],
    antenna: AntennaChoice,
    over: OverGround | None,
    listeners: Sequence[Strengths],
) -> Record | None:
    records = [record for _, (_, record) in found]
    try:
        position = position_of_bearings(
            [record["latitude_deg"] for record in records],
            [record["longitude_deg"] for record in records],
            [record["middle_time_ns"] for record in records],
            [bearing for _, (bearing, _) in found],
            heading_sigma_deg=antenna.heading_sigma_deg,
            over=over,
            listeners=listeners,
        )
    except UsageError:
        return None
    ends = [turn.end_time_ns for turn, (bearing, _) in found if bearing.accepted]
    return _position_record(tag_id, position, max(ends))


def _position_record(tag_id: int, position: Position, end_ns: int) -> Record:
    """What the page is told of a position that knows what was heard until a time."""
    return {
        "tag_id": tag_id,
        "end_time_ns": position.track[-1].time_ns if position.track else end_ns,
        "latitude_deg": position.latitude_deg,
        "longitude_deg": position.longitude_deg,
        "method": position.method,
        "stations": position.stations,
        "powers": position.pulses,
        "radius50_m": _rounded(position.radius50_m),
        "radius95_m": _rounded(position.radius95_m),
        "at_edge": position.at_edge,
        "cautions": [{"name": one.name, "text": one.text} for one in position.cautions],
        "remarks": [*remarks_of(position)],
        "track": [
            {
                "time_ns": one.time_ns,
                "latitude_deg": round(one.latitude_deg, 7),
                "longitude_deg": round(one.longitude_deg, 7),
                "radius50_m": _rounded(one.radius50_m),
                "radius95_m": _rounded(one.radius95_m),
            }
            for one in position.track
        ],
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
