"""Where a flight would have heard a tag: one map for page, report and ``uavrt coverage``.

Of a tag that ``uavrt integrate`` looked for in vain it is the map of what judging the whole
flight would have found; of others that of single groups of pulses.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from uavrt.analysis.coverage import (
    MapArea,
    MapSize,
    flight_coverage,
    flight_plane,
    frequency_window_hz,
    map_around,
)
from uavrt.analysis.flight_noise import FlightNoise, flight_noise_of
from uavrt.analysis.flown_with import antenna_is_told, flight_antenna
from uavrt.clock import parse_iso_intervals
from uavrt.errors import RecordingError, UsageError
from uavrt.localization import PATTERNS, pattern_named
from uavrt.messages import Tag
from uavrt.planning import Coverage, LinkBudget
from uavrt.recording import Flight, IntegratedVerdict, SearchedFor, read_integrated
from uavrt.terrain import Elevation

LEVEL_SIGMA_DB = 3.0
_MARGIN_M = 2000.0
_FINEST_M = 20.0
_CELLS = 120
"""Along the longer side: a flight of twenty minutes takes some seconds."""
_FALSE_ALARM = 0.01
"""At which `uavrt.planning` takes a whole flight to show a tag; `uavrt integrate` may be asked
for less."""
_NOT_JUDGED = (
    "nobody has looked for it over the whole flight yet (uavrt integrate), which hears weaker "
    "tags"
)
_NOT_TOLD = (
    "an earlier version looked for it over the whole flight, and did not write down with which "
    "frequencies and antenna: they are taken to be the flight's own"
)
_NOT_SILENT = (
    "the search of the whole flight (uavrt integrate) says nothing here, as it was for {}: "
    "groups of pulses are told of; integrate again"
)
_ANTENNA_ASSUMED = "nobody told which antenna the drone carried: it is taken for an {}"
_AMBIGUOUS = (
    "a train on its frequency may be its own (uavrt integrate names it): it cannot be said to "
    "be silent"
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SilentMap:
    """With which probability a tag at each place would have been heard."""

    tag_id: int
    tag_power_dbm: float
    coverage: Coverage
    heard_pulses: int
    """Confirmed ones of this tag."""
    in_hindsight: bool
    """Whether the whole flight showed it."""
    ambiguous: bool
    """Whether it showed a train that may be its own."""
    noise: str
    """What is known of the drone's, in words."""
    antenna: str
    """Name of the pattern that it was made with."""

    @property
    def heard(self) -> bool:
        """Whether it was heard, or may have been: then silence tells nothing."""
        return self.heard_pulses > 0 or self.in_hindsight or self.ambiguous


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ListenedFlight:
    """A flight, the ground around it, and its noise."""

    flight: Flight
    area: MapArea
    noise: FlightNoise | None
    noise_said: str
    verdicts: tuple[IntegratedVerdict, ...]

    @classmethod
    def read(
        cls,
        directory: Path,
        flight: Flight,
        elevation: Elevation | None,
        *,
        margin_m: float = _MARGIN_M,
        cell_m: float | None = None,
    ) -> "ListenedFlight":
        """Lay a map around a flight, by default of 120 cells, and read its noise.

        Raises
        ------
        RecordingError
            It has no poses.
        FormatError
            A file of heights, or of what was integrated, is damaged.
        UsageError
            The map would be too large.
        """
        plane, east, north = flight_plane(flight)
        if cell_m is None:
            extent = max(float(np.ptp(east)), float(np.ptp(north))) + 2.0 * margin_m
            cell_m = max(_FINEST_M, round(extent / _CELLS))
        size = MapSize(margin_m=margin_m, cell_m=cell_m)
        try:
            noise = flight_noise_of(directory, flight)
            said = f"+{noise.median_db:.1f} dB in the air over {noise.quiet}"
        except RecordingError as error:
            noise, said = None, f"not known: {error.message}"
        return cls(
            flight=flight,
            area=map_around(plane, east, north, elevation, size),
            noise=noise,
            noise_said=said,
            verdicts=read_integrated(directory)[0],
        )

    def silent_map(
        self,
        tag: Tag,
        budget: LinkBudget,
        *,
        antenna: str | None = None,
        level_sigma_db: float = LEVEL_SIGMA_DB,
        on_pulse: Callable[[int, int], None] | None = None,
    ) -> SilentMap:
        """Map where a tag would have been heard, by default with the flight's antenna.

        Raises
        ------
        UsageError
            The flight is too long, or there is no such antenna.
        """
        verdict = next((one for one in self.verdicts if one.tag_id == tag.tag_id), None)
        searched = None if verdict is None else verdict.searched
        named = antenna or _own_antenna(self.flight, searched)
        in_hindsight = verdict is not None and _shown(verdict)
        doubts = () if verdict is None else self._doubts(tag, named, searched)
        judged = verdict is not None and not in_hindsight and not doubts
        coverage = flight_coverage(
            self.area,
            self.flight,
            tag,
            budget,
            noise=self.noise,
            pattern=pattern_named(named),
            level_sigma_db=level_sigma_db,
            whole_flight=judged,
            searched=searched,
            listened=parse_iso_intervals(verdict.listened) if verdict and judged else (),
            on_pulse=on_pulse,
        )
        said = [*coverage.limitations, *doubts]
        if verdict is None:
            said.append(_NOT_JUDGED)
        elif searched is None and judged:
            said.append(_NOT_TOLD)
        if verdict is not None and verdict.ambiguous:
            said.append(_AMBIGUOUS)
        if antenna is None and not antenna_is_told(self.flight):
            said.append(_ANTENNA_ASSUMED.format(named))
        coverage = replace(coverage, limitations=tuple(said))
        return SilentMap(
            tag_id=tag.tag_id,
            tag_power_dbm=budget.tag_eirp_dbm,
            coverage=coverage,
            heard_pulses=sum(
                one.pulse.tag_id == tag.tag_id and one.pulse.confirmed
                for one in self.flight.pulse_poses
            ),
            in_hindsight=in_hindsight,
            ambiguous=verdict is not None and verdict.ambiguous,
            noise=self.noise_said,
            antenna=named,
        )

    def _doubts(self, tag: Tag, antenna: str, searched: SearchedFor | None) -> tuple[str, ...]:
        """Why a search in vain does not tell of this tag; nothing where it does."""
        if searched is None:
            return ()
        found = _otherwise(tag, searched)
        window_hz = frequency_window_hz(self.flight)
        if searched.frequency_window_hz < window_hz:
            found.append(
                f"frequencies within {searched.frequency_window_hz:g} Hz of the listed one, "
                f"and the flight's detectors listened within {window_hz:g} Hz "
                f"(--frequency-window {window_hz:g})"
            )
        if searched.antenna != antenna:
            found.append(f"the antenna {searched.antenna}, and the map is of {antenna}")
        return (_NOT_SILENT.format("; for ".join(found)),) if found else ()


def _own_antenna(flight: Flight, searched: SearchedFor | None) -> str:
    """The antenna that a flight was judged with, where this computer knows it, else its own."""
    if searched is not None and searched.antenna in PATTERNS:
        return searched.antenna
    return flight_antenna(flight)


def _otherwise(tag: Tag, searched: SearchedFor) -> list[str]:
    """What a search looked for otherwise, or less of, than the list has now."""
    found = []
    listed = (tag.frequency_hz, tag.pulse_width_s, tag.pulse_intervals_s, tag.gaps_s)
    sought = (
        *(searched.frequency_hz, searched.pulse_width_s, searched.pulse_intervals_s),
        searched.gaps_s,
    )
    if listed != sought:
        found.append("another frequency, pulse width, interval or code than it is listed with")
    if searched.interval_uncertainty_s < tag.interval_uncertainty_s:
        found.append(
            f"intervals within {1e3 * searched.interval_uncertainty_s:g} ms of the listed one, "
            f"which may be {1e3 * tag.interval_uncertainty_s:g} ms off"
        )
    if searched.interval_jitter_s < tag.interval_jitter_s:
        found.append(
            f"pulses within {1e3 * searched.interval_jitter_s:g} ms of their beat, which may "
            f"be {1e3 * tag.interval_jitter_s:g} ms off"
        )
    return found


def _shown(verdict: IntegratedVerdict) -> bool:
    """Whether a whole flight showed a tag, at the false alarms of the map or its own."""
    return verdict.found or verdict.false_alarm_probability <= _FALSE_ALARM


def silent_map(
    directory: Path,
    flight: Flight,
    tag_id: int,
    tag_power_dbm: float,
    *,
    elevation: Elevation | None,
    antenna: str | None,
    on_pulse: Callable[[int, int], None] | None = None,
) -> SilentMap:
    """Map where a flight would have heard a tag, with the budget of `uavrt coverage`.

    Parameters
    ----------
    directory : Path
        Of the flight, where its noise and what was integrated are read.
    flight : Flight
    tag_id : int
        Listed in it.
    tag_power_dbm : float
        That it radiates.
    elevation : Elevation, optional
        None takes the ground for level.
    antenna : str, optional
        Name of its pattern; by default the flight's.
    on_pulse : callable, optional
        Takes how many pulses are done, and of how many.

    Raises
    ------
    UsageError
        The flight does not list the tag, or is too long; or there is no such antenna.
    RecordingError
        It has no poses.
    FormatError
        A file of heights, or of what was integrated, is damaged.
    """
    tag = next((one for one in flight.info.tags if one.tag_id == tag_id), None)
    if tag is None:
        listed = ", ".join(str(one.tag_id) for one in flight.info.tags) or "none"
        raise UsageError(
            f"tag {tag_id} was not listed in this flight", remedy=f"Choose from {listed}"
        )
    budget = LinkBudget(
        frequency_hz=tag.frequency_hz,
        pulse_width_s=tag.pulse_width_s,
        tag_eirp_dbm=tag_power_dbm,
        drone_height_m=60.0,
    )
    listened = ListenedFlight.read(directory, flight, elevation)
    return listened.silent_map(tag, budget, antenna=antenna, on_pulse=on_pulse)
