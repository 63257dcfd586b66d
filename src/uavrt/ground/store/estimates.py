"""Compute bearings and positions for the page, during and after a flight."""

import base64
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from uavrt.analysis.estimates.bearings import past_turns, read_recorded
from uavrt.analysis.estimates.records import bearing_record, position_record
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import FormatError, UsageError
from uavrt.core.messages import LiveBearing, Tag
from uavrt.core.units import wrap_degrees_360
from uavrt.ground.store.coordinates import readout
from uavrt.ground.store.stored_flights import Columns, known
from uavrt.localization.antenna import MONOPOLE
from uavrt.localization.estimates.estimate_cache import Cache
from uavrt.localization.estimates.flight_estimates import (
    EstimationOptions,
    Found,
    HeardInTurn,
    TagBearing,
    TagPosition,
    estimate,
)
from uavrt.localization.estimates.heard import Heard
from uavrt.localization.estimates.live_bearings import bearing_from_drone
from uavrt.localization.headings import yaws_deg
from uavrt.localization.position.regions import region_outlines
from uavrt.localization.position.tuning import COMMON, SURVEY
from uavrt.localization.results import PositionGrid
from uavrt.localization.terrain.elevation import Elevation
from uavrt.localization.terrain.elevation_files import open_elevation

SECTORS = 16
"""Number of directions in a turn's SNR plot, as in the original system's finest rotation."""
LIVE_AT_ONCE = {"bearing": 1, "position": 1, "survey": 1}
"""Maximum number of results of each kind computed in one estimate of a flight in progress,
after the first estimate. Each takes some 80 ms of a core; further tags follow in turn."""
Record = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class AntennaChoice:
    """Antenna, mounting, shared errors and elevation data used to estimate positions."""

    pattern: str = "RA-23K"
    offset_deg: float = 0.0
    """Boresight clockwise from the heading in the drone's pulses [deg]; 0 if the drone's
    settings include the mounting."""
    heading_sigma_deg: float = COMMON.heading_sigma_deg
    """Error shared by all headings of a flight, one standard deviation [deg]."""
    height_sigma_m: float = SURVEY.height_sigma_m
    """Standard deviation of the error shared by all heights above a tag [m]; used with a
    monopole."""
    dem: str = ""
    """Elevation file or folder; empty: the ground is taken as level."""

    @property
    def estimation_options(self) -> EstimationOptions:
        """Make the estimator's settings from these choices; raises `FormatError`."""
        return EstimationOptions(
            antenna=self.pattern,
            offset_deg=self.offset_deg,
            heading_sigma_deg=self.heading_sigma_deg,
            height_sigma_m=self.height_sigma_m,
            elevation=_elevation(self.dem) if self.dem else None,
        )


@lru_cache(maxsize=1)
def _elevation(dem: str) -> Elevation:
    """Open elevation files, cached since a flight in progress is estimated repeatedly."""
    return open_elevation(Path(dem))


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimates:
    """Estimated bearings and positions of the tags in a flight."""

    bearings: list[Record]
    positions: list[Record]
    found: Found = field(default_factory=Found)
    """Bearings and signal strengths, which other vehicles' sessions use to locate the tags."""
    more: bool = False
    """True while some received data has not been evaluated."""

    def record(self) -> dict[str, list[Record]]:
        """These estimates as a record for the page."""
        return {"bearings": self.bearings, "positions": self.positions}

    @property
    def outline(self) -> tuple[tuple[int, int, int, float], ...]:
        """Summary that changes with each new result: tag, turn, pulses and bearing or level.

        For signal strengths: number of positions, and their sum rounded to a decibel.
        """
        bearings = tuple(
            (one.tag_id, one.number, one.heard, one.bearing.bearing_deg)
            for one in self.found.bearings
        )
        return bearings + tuple(
            (tag_id, -1, len(one.level_db), float(round(one.level_db.sum())))
            for tag_id, one in self.found.strengths.items()
        )


class Estimator:
    """Estimates a flight repeatedly; results are reused while their data stays the same."""

    def __init__(self) -> None:
        self._cache = Cache()
        # What the page receives of each bearing and position, which are kept while unchanged.
        self._shown: dict[int, tuple[TagBearing | TagPosition, Record]] = {}
        self._past: tuple[tuple[Path, str, float], list[HeardInTurn]] | None = None

    def past(self, place: Path, antenna: AntennaChoice) -> Sequence[HeardInTurn]:
        """Read turns on the spot in the drone's past flights, to learn its antenna pattern."""
        if antenna.pattern == MONOPOLE:
            return ()
        key = (place, antenna.pattern, antenna.offset_deg)
        if self._past is None or self._past[0] != key:
            turns: list[HeardInTurn] = []
            with suppress(FormatError, UsageError):
                flight = read_recorded(place).flight
                if flight is not None:
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
        companions: Sequence[Estimates] = (),
        past: Sequence[HeardInTurn] = (),
        name: str = "this vehicle",
        listed: Sequence[Tag] = (),
    ) -> Estimates:
        """Estimate all bearings and positions of a flight in its present state.

        `companions`: other vehicles' estimates, used for a tag if number and frequency agree.
        Its frequency is the received one, else the searched one, else that in `listed`. A
        bearing in `from_drone` stays if it used more pulses of its turn than have reached the
        ground.
        """
        sent = {tag.tag_id for tag in tags}
        every = (*tags, *(tag for tag in listed if tag.tag_id not in sent))
        heard = columns.heard(every, name)
        found = estimate(
            heard,
            antenna.estimation_options,
            past=past,
            theirs=[
                bearing_from_drone(one)
                for one in from_drone
                if not _on_ground(one, columns.on_ground_ns)
            ],
            others=[one.found for one in companions],
            cache=self._cache,
            at_once=LIVE_AT_ONCE if columns.goes_on and self._shown else {},
        )
        others = [each for one in companions for each in one.found.bearings]
        bearings = found.found.bearings
        placed = [one for one in found.positions if one.position is not None]
        shown = {
            id(one): self._shown.get(id(one)) or (one, _bearing(one, heard, antenna.offset_deg))
            for one in bearings
        } | {id(one): self._shown.get(id(one)) or (one, _position(one)) for one in placed}
        self._shown = shown
        return Estimates(
            bearings=[shown[id(one)][1] for one in bearings],
            positions=[
                shown[id(one)][1] | {"end_time_ns": _end_ns(one, [*bearings, *others], heard)}
                for one in placed
            ],
            found=found.found,
            more=self._cache.more,
        )


def _on_ground(one: LiveBearing, spans_ns: Sequence[tuple[int, int]]) -> bool:
    """True if a bearing's turn happened on the ground, as reported by the autopilot."""
    middle_ns = (one.start_time_ns + one.end_time_ns) // 2
    return any(first <= middle_ns <= last for first, last in spans_ns)


def _bearing(one: TagBearing, heard: Heard, offset_deg: float) -> Record:
    """Record of a bearing for the page; a bearing from the drone has no SNR by direction."""
    assert one.turn is not None
    return bearing_record(one) | {
        "turn": one.number,
        "start_time_ns": one.turn.start_time_ns,
        "end_time_ns": one.turn.end_time_ns,
        "turned_deg": round(one.turn.turned_deg, 1),
        "pulses": one.heard,
        "rose_snr_db": [None] * SECTORS if one.from_drone else _rose(one, heard, offset_deg),
        "from_drone": one.from_drone,
    }


def _rose(one: TagBearing, heard: Heard, offset_deg: float) -> list[float | None]:
    """Highest SNR in each of 16 sectors [dB]; the first sector is centred on north."""
    own = heard.pulses[one.tag_id]
    first, last = np.searchsorted(own.time_ns, [one.start_time_ns, one.end_time_ns + 1])
    yaw = yaws_deg(own.quaternion_wxyz[first:last]) + offset_deg
    snr_db = own.snr_db[first:last]
    sectors = np.floor(wrap_degrees_360(yaw) / (360.0 / SECTORS) + 0.5).astype(int) % SECTORS
    return [
        known(round(float(snr_db[sectors == sector].max()), 2))
        if (sectors == sector).any()
        else None
        for sector in range(SECTORS)
    ]


def _end_ns(one: TagPosition, bearings: Sequence[TagBearing], heard: Heard) -> int:
    """Time of the newest data used for a tag's position [ns]."""
    if one.position is not None and one.position.track:
        return one.position.track[-1].time_ns
    ends = [
        each.turn.end_time_ns
        for each in bearings
        if each.tag_id == one.tag_id and each.bearing.accepted and each.turn is not None
    ]
    if not ends:
        ends = [int(heard.pulses[one.tag_id].time_ns[-1])]
    return max(ends)


def _position(one: TagPosition) -> Record:
    """Convert a tag's estimated position to a record for the page."""
    found = one.position
    assert found is not None
    record = position_record(one)
    return {
        **record,
        "stations": record["bearings"],
        "readout": asdict(readout(found.latitude_deg, found.longitude_deg)),
        **_regions(found.grid),
    }


def _regions(grid: PositionGrid | None) -> Record:
    """Outlines of the 50 % and 95 % regions, and heat map; empty without a probability grid."""
    if grid is None:
        return {"region50": [], "region95": [], "heat": None}
    outlines = {
        f"region{share}": [
            np.round(ring, 7).tolist() for ring in region_outlines(grid, share / 100.0)
        ]
        for share in (50, 95)
    }
    return {**outlines, "heat": _heat(grid)}


def _heat(grid: PositionGrid) -> Record:
    """Square root of the probability as bytes, north row first; corners from the north-west."""
    plane = TangentPlane(latitude_deg=grid.latitude_deg, longitude_deg=grid.longitude_deg)
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
