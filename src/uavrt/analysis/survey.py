"""Collect all data and estimates of a flight or a pulse log, for reports and exports."""

import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from uavrt.analysis.estimates.bearings import (
    NO_BEARINGS_FROM_THESE,
    Recorded,
    past_turns,
    pattern_origin,
    read_recorded,
)
from uavrt.analysis.estimates.power_survey import TagSignal, signal_of
from uavrt.analysis.inputs.flight_facts import ReportFacts, facts_of
from uavrt.analysis.inputs.map_files import MapFile
from uavrt.core.errors import FormatError, NotFound, UsageError
from uavrt.core.messages import (
    Beep,
    FlightInfo,
    Health,
    Pose,
    PulsePose,
    SearchNote,
    SearchReport,
    StatusText,
    Tag,
)
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.integrated import FlightFold, IntegratedVerdict, read_folds, read_integrated
from uavrt.flight.reading.flight_reader import (
    Flight,
    read_beeps,
    read_health,
    read_search_notes,
    read_search_reports,
)
from uavrt.flight.reading.noted_places import Mark, places_of, vehicle_of
from uavrt.flight.reading.recognise import ORIGINAL_POSES
from uavrt.formats.pulses.pulse_log import LogKind
from uavrt.localization.antenna import MONOPOLE, AntennaPattern
from uavrt.localization.estimates.flight_estimates import (
    Estimated,
    EstimationOptions,
    Found,
    HeardInTurn,
    TagBearing,
    TagPosition,
    estimate,
    heard_in_turns,
)
from uavrt.localization.results import Position

if TYPE_CHECKING:
    from uavrt.analysis.covered.silence import SilentMap


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Survey:
    """A flight or pulse log with all its estimates."""

    name: str
    kind: LogKind
    antenna: str
    """Name of the antenna pattern used for the bearings."""
    pattern: AntennaPattern | None = None
    """Antenna pattern corrected by the flight's turns; None if the drone did not turn."""
    offset_deg: float = 0.0
    """Angle of the antenna's boresight clockwise from the heading in the poses [deg]."""
    pulse_poses: tuple[PulsePose, ...]
    track: tuple[Pose, ...]
    """Poses of the vehicle; for a log without poses, the positions of its pulses."""
    bearings: tuple[TagBearing, ...] = ()
    positions: tuple[TagPosition, ...] = ()
    signals: tuple[TagSignal, ...] = ()
    """Signal strength by position and height, for surveys with a monopole."""
    warnings: tuple[str, ...] = ()
    info: FlightInfo | None = None
    health: tuple[Health, ...] = ()
    search_reports: tuple[SearchReport, ...] = ()
    beeps: tuple[Beep, ...] = ()
    search_notes: tuple[SearchNote, ...] = ()
    status_texts: tuple[tuple[int, StatusText], ...] = ()
    notes: tuple[tuple[int, str], ...] = ()
    integrated: tuple[PulsePose, ...] = ()
    """Pulses found by ``uavrt integrate``; not used for bearings or positions."""
    verdicts: tuple[IntegratedVerdict, ...] = ()
    folds: tuple[FlightFold, ...] = ()
    silences: "tuple[SilentMap, ...]" = ()
    """Coverage maps of tags that were not found, if their radiated power was given."""
    facts: ReportFacts = field(default_factory=ReportFacts)
    maps: tuple[MapFile, ...] = ()
    """Map files for the background of the report's maps."""

    @property
    def tag_ids(self) -> tuple[int, ...]:
        """Numbers of all tags that were received or searched for."""
        listed = () if self.info is None else self.info.tags
        heard = {one.pulse.tag_id for one in self.pulse_poses}
        judged = {one.tag_id for one in self.verdicts}
        return tuple(sorted(heard | judged | {tag.tag_id for tag in listed}))

    def tag(self, tag_id: int) -> Tag | None:
        """Tag list entry of a tag; None if it is not listed."""
        tags = () if self.info is None else self.info.tags
        return next((tag for tag in tags if tag.tag_id == tag_id), None)

    def pulses_of(self, tag_id: int) -> tuple[PulsePose, ...]:
        """Pulses of one tag, excluding those found by ``uavrt integrate``."""
        return tuple(one for one in self.pulse_poses if one.pulse.tag_id == tag_id)

    def integrated_of(self, tag_id: int) -> tuple[PulsePose, ...]:
        """Pulses of one tag found by ``uavrt integrate``."""
        return tuple(one for one in self.integrated if one.pulse.tag_id == tag_id)

    @property
    def every_pulse(self) -> tuple[PulsePose, ...]:
        """All pulses in order of time, including those found by ``uavrt integrate``."""
        if not self.integrated:
            return self.pulse_poses
        both = (*self.pulse_poses, *self.integrated)
        return tuple(sorted(both, key=lambda one: one.pulse.start_time_ns))

    def verdict_of(self, tag_id: int) -> IntegratedVerdict | None:
        """Whole-flight result of one tag; None if ``uavrt integrate`` was not run."""
        return next((one for one in self.verdicts if one.tag_id == tag_id), None)

    def bearings_of(self, tag_id: int) -> tuple[TagBearing, ...]:
        """Bearings of one tag."""
        return tuple(one for one in self.bearings if one.tag_id == tag_id)

    def position_of(self, tag_id: int) -> TagPosition | None:
        """Position of one tag, or why it has none; None if none was estimated."""
        return next((one for one in self.positions if one.tag_id == tag_id), None)

    def placed(self, tag_id: int) -> Position | None:
        """Estimated position of one tag; None if it could not be located."""
        found = self.position_of(tag_id)
        return None if found is None else found.position

    def position_time_ns(self, tag_id: int) -> int | None:
        """Time of a tag's position [ns, UTC]: end of its path, last bearing or pulse."""
        position = self.placed(tag_id)
        if position is not None and position.track:
            return position.track[-1].time_ns
        bearings = [one.end_time_ns for one in self.bearings_of(tag_id) if one.bearing.accepted]
        heard = [one.pulse.start_time_ns for one in self.pulses_of(tag_id)]
        return max(bearings or heard, default=None)

    def signal_of(self, tag_id: int) -> TagSignal | None:
        """Results from the signal strength of one tag; None unless flown with a monopole."""
        return next((one for one in self.signals if one.tag_id == tag_id), None)

    @property
    def marks(self) -> tuple[Mark, ...]:
        """Positions that the operator marked during the flight."""
        return places_of(self.notes).marks

    @property
    def vehicle(self) -> str | None:
        """Number and name of the vehicle, if recorded by a ground station."""
        return vehicle_of(self.notes)

    def name_of(self, tag_id: int) -> str:
        """Name of a tag in the tag list; empty without one."""
        tag = self.tag(tag_id)
        return "" if tag is None else tag.name or ""

    def label(self, tag_id: int) -> str:
        """Number of a tag, followed by its name if it has one."""
        return f"tag {tag_id} {self.name_of(tag_id)}".rstrip()

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last time in the records [ns, UTC]; None without records."""
        times = [pose.time_ns for pose in self.track]
        times += [one.pulse.start_time_ns for one in self.pulse_poses]
        if self.info is not None:
            times.append(self.info.start_time_ns)
        return (min(times), max(times)) if times else None


def read_survey(path: str | os.PathLike[str], how: EstimationOptions | None = None) -> Survey:
    """Read a flight directory or a pulse log of any kind, and estimate bearings and positions.

    An estimate that fails is missing from the result, and a warning states the reason. If `how`
    names no antenna, the flight's antenna is used, RA-23K for a log without one, and a monopole
    for UCSD's pings. Raises `FormatError` if `path` is neither flight nor log, and `UsageError`
    for an unknown antenna or a damaged report.toml.
    """
    how, recorded = how or EstimationOptions(), read_recorded(path)
    antenna = how.antenna or recorded.antenna
    flight, log = recorded.flight, recorded.log
    warnings = list(log.warnings)
    estimated = Estimated(found=Found(), positions=())
    if ORIGINAL_POSES in warnings:
        warnings.append(NO_BEARINGS_FROM_THESE)
    else:
        try:
            estimated = _estimated(recorded, replace(how, antenna=antenna), warnings)
        except NotFound:
            raise
        except UsageError as error:
            warnings.append(f"No bearings: {error}.")
    if antenna == MONOPOLE:
        warnings += [
            f"Tag {one.tag_id} has no position: {one.reason}."
            for one in estimated.positions
            if one.position is None
        ]
    pulses = tuple(sorted(log.pulse_poses, key=lambda one: one.pulse.start_time_ns))
    own = tuple(one.pose for one in pulses if one.pose is not None)
    placed = {one.tag_id: one.position for one in estimated.positions}
    survey = Survey(
        name=recorded.path.resolve().name if flight else recorded.path.name,
        kind=log.kind,
        antenna=antenna if isinstance(antenna, str) else antenna.name,
        pattern=estimated.found.pattern,
        offset_deg=how.offset_deg,
        pulse_poses=pulses,
        track=_on_earth(own if flight is None else flight.poses or own),
        bearings=tuple(estimated.found.bearings),
        positions=estimated.positions,
        signals=tuple(
            signal_of(tag_id, track, placed[tag_id])
            for tag_id, track in estimated.tracks.items()
        ),
        warnings=tuple(warnings),
        facts=facts_of(recorded.path.resolve()),
    )
    return survey if flight is None else _with_records(survey, recorded.path, flight)


def _estimated(recorded: Recorded, how: EstimationOptions, warnings: list[str]) -> Estimated:
    """Estimate bearings and positions; past flights' turns correct the pattern, too."""
    heard = recorded.heard(recorded.antenna)
    past: list[list[HeardInTurn]] = []
    if how.antenna is not None and how.antenna != MONOPOLE and recorded.flight is not None:
        past = past_turns(recorded.flight, how.antenna, how.offset_deg)
        own = heard_in_turns(heard, how.offset_deg)
        if (text := pattern_origin([own, *past])) is not None:
            warnings.append(f"{text[0].upper()}{text[1:]}.")
    return estimate(heard, how, past=[one for turns in past for one in turns])


def _with_records(survey: Survey, directory: Path, flight: Flight) -> Survey:
    warnings = list(survey.warnings)
    without = sum(one.pose is None for one in flight.pulse_poses)
    if without:
        warnings.append(f"{without} of {len(flight.pulse_poses)} pulses have no pose.")
    verdicts: tuple[IntegratedVerdict, ...] = ()
    integrated: tuple[PulsePose, ...] = ()
    folds: tuple[FlightFold, ...] = ()
    try:
        verdicts, integrated = read_integrated(directory)
        folds = read_folds(directory)
    except FormatError as error:
        warnings.append(f"Whole-flight results cannot be read: {error}.")
    return replace(
        survey,
        warnings=tuple(warnings),
        info=flight.info,
        health=read_health(directory),
        search_reports=read_search_reports(directory),
        beeps=read_beeps(directory),
        search_notes=read_search_notes(directory),
        status_texts=flight.status_texts,
        notes=flight.notes,
        integrated=integrated,
        verdicts=verdicts,
        folds=folds,
    )


def thinned(track: Sequence[Pose], step_s: float = 1.0) -> list[Pose]:
    """Reduce a track to the first pose of each time step, and the last pose."""
    first = [
        next(group)
        for _, group in groupby(track, lambda p: p.time_ns // (step_s * NANOSECONDS_PER_SECOND))
    ]
    if track and first[-1] is not track[-1]:
        first.append(track[-1])
    return first


def _on_earth(poses: Iterable[Pose | None]) -> tuple[Pose, ...]:
    found = {
        pose.time_ns: pose
        for pose in poses
        if pose is not None
        and math.isfinite(pose.latitude_deg)
        and math.isfinite(pose.longitude_deg)
    }
    return tuple(found[time] for time in sorted(found))
