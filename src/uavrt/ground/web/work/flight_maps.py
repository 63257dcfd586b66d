"""Results for a whole flight after its end, by ``uavrt integrate`` and ``uavrt coverage``: tags
found in its samples, and coverage maps, which `map_jobs` computes.
"""

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uavrt.core.errors import FormatError, UsageError
from uavrt.flight.integrated import read_integrated
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.link.page_values import power_in, whole_in
from uavrt.ground.store.estimates import AntennaChoice
from uavrt.ground.web.work.map_jobs import MapJobs, OnStep, Record, map_record
from uavrt.localization.terrain.elevation_files import open_elevation

if TYPE_CHECKING:
    from uavrt.analysis.covered.silence import SilentMap

_MOST_PULSES = 3000
_MOST_CORNERS = 500


def integrated_record(flight: Path) -> Record:
    """Results of ``uavrt integrate`` as a record: tags, and found pulses, thinned evenly."""
    from uavrt.analysis.whole_flights.verdict_words import verdict_facts

    verdicts, pulses = read_integrated(flight)
    placed = [one for one in pulses if one.pose is not None]
    step = max(1, math.ceil(len(placed) / _MOST_PULSES))
    return {
        "tags": [{**asdict(one), "facts": asdict(verdict_facts(one))} for one in verdicts],
        "pulses": [
            {
                "tag_id": one.pulse.tag_id,
                "time_ns": one.pulse.start_time_ns,
                "longitude_deg": one.pose.longitude_deg,
                "latitude_deg": one.pose.latitude_deg,
            }
            for one in placed[::step]
            if one.pose is not None
        ],
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class CoverageMapRequest:
    """Requested map of where a tag would have been detected."""

    flight: Path
    tag_id: int
    tag_power_dbm: float
    antenna: AntennaChoice

    @classmethod
    def from_request(
        cls, flight: Path, antenna: AntennaChoice, wanted: dict[str, Any]
    ) -> "CoverageMapRequest":
        """Read a page's request; raises `FormatError` or `UsageError`."""
        return cls(
            flight=flight,
            tag_id=whole_in(wanted, "tag_id"),
            tag_power_dbm=power_in(wanted),
            antenna=antenna,
        )


class CoverageMapJobs(MapJobs[CoverageMapRequest, "SilentMap"]):
    """Makes maps of where a tag would have been detected, one at a time; keeps the last map."""

    def __init__(self) -> None:
        super().__init__(_made, _record, "map of silence")

    def absence(self, asked: CoverageMapRequest, wanted: dict[str, Any]) -> Record:
        """Probability that an undetected tag is outside an outline, as a record."""
        # Loaded with the first question only, as in `_made`.
        from uavrt.analysis.covered.coverage_maps import inside
        from uavrt.planning.area import Polygon
        from uavrt.planning.detectability.detection_coverage import absence

        found = self.found(asked)
        if found is None:
            raise UsageError(
                "the map is not ready yet", remedy="Wait until the map has been calculated"
            )
        if found.ambiguous:
            raise UsageError(
                f"pulses at the frequency of tag {asked.tag_id} may come from this tag, so "
                "its absence cannot be shown"
            )
        if found.heard:
            raise UsageError(
                f"tag {asked.tag_id} was detected, so no map of its absence is made"
            )
        coverage, plane = found.coverage, found.coverage.ground.plane
        longitude, latitude = np.array(_outline(wanted)).T
        east, north = plane.to_local(latitude, longitude)
        corners = tuple(zip(east.tolist(), north.tolist(), strict=True))
        area = Polygon(corners=corners, name="area")
        absent = absence(coverage, inside(area, coverage.ground), None)
        return {**asdict(absent), "prior_is": "all places on the map equally likely"}


def _outline(wanted: dict[str, Any]) -> list[list[float]]:
    outline = wanted.get("outline")
    good = isinstance(outline, list) and 3 <= len(outline) <= _MOST_CORNERS
    if not good or not all(_is_place(one) for one in outline or ()):
        raise FormatError("an outline is a list of 3 or more [longitude, latitude]")
    assert isinstance(outline, list)
    return outline


def _is_place(one: object) -> bool:
    return (
        isinstance(one, list)
        and len(one) == 2
        and all(isinstance(value, int | float) and abs(value) <= 360.0 for value in one)
    )


def _made(asked: CoverageMapRequest, on_step: OnStep) -> "SilentMap":
    from uavrt.analysis.covered.silence import silent_map

    dem = asked.antenna.dem
    return silent_map(
        asked.flight,
        read_flight(asked.flight),
        asked.tag_id,
        asked.tag_power_dbm,
        elevation=open_elevation(Path(dem)) if dem else None,
        antenna=asked.antenna.pattern,
        on_pulse=on_step,
    )


def _record(found: "SilentMap") -> Record:
    return {
        "tag_id": found.tag_id,
        "tag_power_dbm": found.tag_power_dbm,
        **map_record(found.coverage),
        "heard_pulses": found.heard_pulses,
        "in_hindsight": found.in_hindsight,
        "whole_flight": found.coverage.whole_flight,
        "noise": found.noise,
    }
