"""Compute the coverage map of a flight for a tag, for page, report and ``uavrt coverage``.

If ``uavrt integrate`` searched for the tag without finding it, the map shows where whole-flight
analysis would have found it. Otherwise it shows where single groups of pulses would have been
detected.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.covered.coverage_maps import MapArea, MapSize, map_around
from uavrt.analysis.covered.flight_coverage import (
    flight_coverage,
    flight_plane,
    frequency_window_hz,
)
from uavrt.analysis.inputs.flight_noise import FlightNoise, flight_noise_of
from uavrt.analysis.inputs.flown_with import antenna_is_recorded, flight_antenna
from uavrt.core.clock import parse_iso_intervals
from uavrt.core.errors import FormatError, RecordingError, UsageError
from uavrt.core.messages import WHOLE_FLIGHT_FALSE_ALARM, Tag
from uavrt.flight.integrated import (
    IntegratedVerdict,
    SearchedFor,
    SilentAround,
    read_integrated,
)
from uavrt.flight.reading.flight_reader import Flight, read_search_reports
from uavrt.localization.antenna import PATTERNS, pattern_named
from uavrt.localization.terrain.elevation import Elevation
from uavrt.planning.detectability.detection_coverage import Coverage
from uavrt.planning.detectability.link_budget import LinkBudget

LEVEL_SIGMA_DB = 3.0
SURE = 0.9
"""Detection probability from which not receiving a tag counts as evidence of its absence."""
_MARGIN_M = 2000.0
_FINEST_M = 20.0
_CELLS = 120
"""Number of cells along the longer side of a coverage map; for a 20-minute flight the
computation takes seconds."""
_NOT_JUDGED = (
    "the whole flight has not been searched for this tag yet; uavrt integrate finds weaker tags"
)
_NO_DETECTORS = (
    "no record shows that a detector ran in this flight (no search report, no pulse); the map "
    "assumes that one ran. uavrt integrate shows what the flight's samples contain"
)
_ANTENNA_UNKNOWN = (
    "an earlier version of uavrt searched the whole flight and did not record frequencies "
    "and antenna: those of the flight are assumed"
)
_NOT_SILENT = (
    "the whole-flight search was for {} and does not apply to this map, so the map uses only "
    "groups of pulses. Run uavrt integrate again"
)
_WITHIN = "the result covers tags within {:g} Hz of their listed frequency"
_ANTENNA_ASSUMED = "antenna not specified: {} assumed"
_AMBIGUOUS = (
    "pulses on the tag's frequency may come from this tag, so it may be present (uavrt "
    "integrate lists them)"
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SilentMap:
    """Probability that a tag at each position would have been detected in a flight."""

    tag_id: int
    tag_power_dbm: float
    coverage: Coverage
    heard_pulses: int
    in_hindsight: bool
    """True if whole-flight analysis found the tag."""
    ambiguous: bool
    """True if whole-flight analysis found a periodic pulse train that may be the tag's."""
    noise: str
    """Sentence for the operator on the noise measurement that the map uses."""
    antenna: str
    sure_within_m: float | None
    """Distance from the flight within which a tag would have been detected everywhere with
    probability 0.9 or more [m]; None if nowhere."""

    @property
    def heard(self) -> bool:
        """True if the tag was received or may have been, so that the map is no evidence of its
        absence.
        """
        return self.heard_pulses > 0 or self.in_hindsight or self.ambiguous

    @property
    def around(self) -> SilentAround:
        """Record of the distance within which the tag would have been found."""
        return SilentAround(
            tag_power_dbm=self.tag_power_dbm,
            probability=SURE,
            within_m=None if self.sure_within_m is None else round(self.sure_within_m, 1),
            whole_flight=self.coverage.whole_flight,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ListenedFlight:
    """A flight with the grid, terrain and noise from which `silent_map` makes coverage maps."""

    flight: Flight
    area: MapArea
    noise: FlightNoise | None
    noise_text: str
    verdicts: tuple[IntegratedVerdict, ...]
    path_m: tuple[NDArray[np.float64], NDArray[np.float64]]
    """East and north of the flight path in the map's plane [m]."""
    of_track: bool = False
    """True if poses and samples come from other programs, without detectors."""
    detectors_ran: bool = True
    """True if pulses or reports in the flight show that its detectors ran."""

    @classmethod
    def read(
        cls,
        directory: Path,
        flight: Flight,
        elevation: Elevation | None,
        *,
        margin_m: float = _MARGIN_M,
        cell_m: float | None = None,
        verdicts: Sequence[IntegratedVerdict] | None = None,
    ) -> "ListenedFlight":
        """Read a flight's noise and create a map grid around it, by default 120 cells wide;
        stored whole-flight results are read unless `verdicts` are given.
        """
        plane, east, north = flight_plane(flight)
        if cell_m is None:
            extent = max(float(np.ptp(east)), float(np.ptp(north))) + 2.0 * margin_m
            cell_m = max(_FINEST_M, round(extent / _CELLS))
        size = MapSize(margin_m=margin_m, cell_m=cell_m)
        of_track = directory.is_file()
        try:
            if of_track:
                raise RecordingError(
                    "the noise level is unknown, because a vehicle's track contains no noise "
                    "measurements"
                )
            noise = flight_noise_of(directory, flight)
            said = f"+{noise.median_db:.1f} dB in the air over {noise.quiet}"
        except (RecordingError, FormatError) as error:
            noise, said = None, f"unknown, only the radio's own is used: {error.message}"
        reports = not of_track and (noise is not None or bool(read_search_reports(directory)))
        return cls(
            flight=flight,
            area=map_around(plane, east, north, elevation, size),
            noise=noise,
            noise_text=said,
            verdicts=tuple(read_integrated(directory)[0] if verdicts is None else verdicts),
            path_m=(east, north),
            of_track=of_track,
            detectors_ran=reports or bool(flight.pulse_poses),
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
        """Map a tag's detection probability for the flown antenna, or another `antenna`."""
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
        if self.of_track and searched is not None:
            said.append(_WITHIN.format(searched.frequency_window_hz))
        if verdict is None:
            said.append(_NOT_JUDGED)
        elif searched is None and judged:
            said.append(_ANTENNA_UNKNOWN)
        if verdict is not None and verdict.ambiguous:
            said.append(_AMBIGUOUS)
        heard = judged or self.detectors_ran
        if not heard:
            said.append(_NO_DETECTORS)
        if antenna is None and not antenna_is_recorded(self.flight):
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
            noise=self.noise_text,
            antenna=named,
            sure_within_m=sure_within_m(coverage, *self.path_m) if heard else None,
        )

    def _doubts(self, tag: Tag, antenna: str, searched: SearchedFor | None) -> tuple[str, ...]:
        """Why a stored whole-flight search does not apply to this map; empty if it does."""
        if searched is None:
            return ()
        found = _setting_changes(tag, searched)
        window_hz = 0.0 if self.of_track else frequency_window_hz(self.flight)
        if searched.frequency_window_hz < window_hz:
            found.append(
                f"frequencies within {searched.frequency_window_hz:g} Hz of the listed one, "
                f"and the flight's detectors searched within {window_hz:g} Hz "
                f"(--frequency-window {window_hz:g})"
            )
        if searched.antenna != antenna:
            found.append(f"the antenna {searched.antenna}, and the map is for {antenna}")
        return (_NOT_SILENT.format("; for ".join(found)),) if found else ()


def _own_antenna(flight: Flight, searched: SearchedFor | None) -> str:
    """Antenna pattern of whole-flight analysis or, if it is unknown, the flight's antenna."""
    if searched is not None and searched.antenna in PATTERNS:
        return searched.antenna
    return flight_antenna(flight)


def _setting_changes(tag: Tag, searched: SearchedFor) -> list[str]:
    """List the differences between the settings of a stored search and the present tag list."""
    found = []
    listed = (tag.frequency_hz, tag.pulse_width_s, tag.pulse_intervals_s, tag.gaps_s)
    sought = (
        *(searched.frequency_hz, searched.pulse_width_s, searched.pulse_intervals_s),
        searched.gaps_s,
    )
    if listed != sought:
        found.append("a frequency, pulse width, interval or code that the tag list has changed")
    if searched.interval_uncertainty_s < tag.interval_uncertainty_s:
        found.append(
            f"intervals within {1e3 * searched.interval_uncertainty_s:g} ms of the listed one, "
            f"but the tag's may differ by {1e3 * tag.interval_uncertainty_s:g} ms"
        )
    if searched.interval_jitter_s < tag.interval_jitter_s:
        found.append(
            f"pulses at most {1e3 * searched.interval_jitter_s:g} ms off equal intervals, but "
            f"they may be {1e3 * tag.interval_jitter_s:g} ms off"
        )
    return found


def _shown(verdict: IntegratedVerdict) -> bool:
    """True if whole-flight analysis found the tag at the limit of false alarms of its search,
    or at the usual limit.
    """
    return verdict.found or verdict.false_alarm_probability <= WHOLE_FLIGHT_FALSE_ALARM


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
    """Compute where a flight would have detected a tag, with the link budget of `uavrt
    coverage`.

    Without `elevation` the ground is assumed level; without `antenna` the flight's antenna is
    used. `on_pulse` is called with the number of computed pulses and their total.
    """
    tag = next((one for one in flight.info.tags if one.tag_id == tag_id), None)
    if tag is None:
        listed = ", ".join(str(one.tag_id) for one in flight.info.tags) or "none"
        raise UsageError(
            f"tag {tag_id} was not listed in this flight", remedy=f"Choose from {listed}"
        )
    listened = ListenedFlight.read(directory, flight, elevation)
    budget = _budget(tag, tag_power_dbm)
    return listened.silent_map(tag, budget, antenna=antenna, on_pulse=on_pulse)


def silent_maps(
    flight: Flight,
    tags: Sequence[Tag],
    verdicts: Sequence[IntegratedVerdict],
    tag_power_dbm: float,
    *,
    elevation: Elevation | None,
    on_pulse: Callable[[int, int], None] | None = None,
) -> dict[int, SilentMap]:
    """Coverage maps of the tags not found in the flight just analysed, by tag id.

    These are the maps of `uavrt coverage FLIGHT`, computed before the results are saved. Tags
    that were received, or may have been, get no map. Parameters and errors are as in
    `silent_map`.
    """
    silent = [
        (tag, one)
        for tag, one in zip(tags, verdicts, strict=True)
        if not (one.ambiguous or _shown(one) or _confirmed(flight, tag))
    ]
    if not silent:
        return {}
    listened = ListenedFlight.read(
        Path(flight.info.directory), flight, elevation, verdicts=verdicts
    )
    return {
        tag.tag_id: listened.silent_map(
            tag,
            _budget(tag, tag_power_dbm),
            antenna=None if one.searched is None else one.searched.antenna,
            on_pulse=on_pulse,
        )
        for tag, one in silent
    }


def _budget(tag: Tag, tag_power_dbm: float) -> LinkBudget:
    """Link budget of `uavrt coverage`; its 60 m height is replaced by the flown heights."""
    return LinkBudget(
        frequency_hz=tag.frequency_hz,
        pulse_width_s=tag.pulse_width_s,
        tag_eirp_dbm=tag_power_dbm,
        drone_height_m=60.0,
    )


def sure_within_m(
    coverage: Coverage, east_m: NDArray[np.float64], north_m: NDArray[np.float64]
) -> float | None:
    """Distance from a path within which the detection probability is at least 0.9 everywhere
    [m]; None if nowhere.

    Cells of unknown ground height count as not detected, and the distance cannot exceed the
    map's extent. `east_m` and `north_m` (n,) are the path in the map's plane.
    """
    from scipy.spatial import KDTree

    ground = coverage.ground
    row, column = np.nonzero(~(coverage.heard >= SURE))
    least = min(
        float(east_m.min() - ground.east_m[0]),
        float(ground.east_m[-1] - east_m.max()),
        float(north_m.min() - ground.north_m[0]),
        float(ground.north_m[-1] - north_m.max()),
    )
    if len(row):
        way = KDTree(np.stack((east_m, north_m), axis=1))
        unsure = np.stack((ground.east_m[column], ground.north_m[row]), axis=1)
        away = float(np.min(way.query(unsure)[0]))
        # As far as the nearest corner of such a cell.
        least = min(least, away - math.sqrt(0.5) * ground.cell_m)
    return least if least > 0.0 else None


def around_in_words(around: SilentAround) -> str:
    """Sentence on the distance from the flight within which a tag would have been found."""
    what = "found" if around.whole_flight else "detected"
    power = f"{around.tag_power_dbm:g} dBm".replace("-", "\N{MINUS SIGN}")
    if around.within_m is None:
        return (
            f"nowhere around the flight would a tag that radiates {power} have been {what} "
            f"with a probability of at least {around.probability:g}"
        )
    return (
        f"within {_rounded_down(around.within_m):.0f} m of the flight, a tag that radiates "
        f"{power} would have been {what} with a probability of at least {around.probability:g}"
    )


def _rounded_down(metres: float) -> float:
    step = 10.0 ** max(0, math.floor(math.log10(max(metres, 1.0))) - 1)
    return math.floor(metres / step) * step


def _confirmed(flight: Flight, tag: Tag) -> bool:
    return any(
        one.pulse.tag_id == tag.tag_id and one.pulse.confirmed for one in flight.pulse_poses
    )
