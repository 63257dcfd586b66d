"""Everything known from a flight or an old log, gathered once for reports and exports."""

import math
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from uavrt.analysis.bearings import (
    NO_BEARINGS_FROM_THESE,
    TagBearing,
    bearings_of_flight,
    bearings_of_pulses,
    heard_in_turns,
    learnt_antenna,
    past_turns,
    taught_in_words,
)
from uavrt.analysis.facts import Facts, facts_of
from uavrt.analysis.flown_with import flight_antenna
from uavrt.analysis.map_files import MapFile
from uavrt.analysis.positions import (
    TagPosition,
    antenna_of,
    over_ground,
    positions_of_bearings,
    positions_of_powers,
)
from uavrt.analysis.power_survey import TagSignal
from uavrt.errors import FormatError, UsageError
from uavrt.localization import (
    HEIGHT_SIGMA_M,
    MONOPOLE,
    AntennaPattern,
    HeardInTurn,
    OverGround,
    antenna_as_shown,
)
from uavrt.localization.position import HEADING_SIGMA_DEG
from uavrt.messages import (
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
from uavrt.recording import (
    Flight,
    FlightFold,
    FlightLayout,
    IntegratedVerdict,
    Mark,
    places_of,
    read_beeps,
    read_flight,
    read_folds,
    read_health,
    read_integrated,
    read_search_notes,
    read_search_reports,
    vehicle_of,
)
from uavrt.recording.formats import ORIGINAL_POSES, LogKind, read_pulse_log
from uavrt.terrain import Elevation
from uavrt.units import NANOSECONDS_PER_SECOND

if TYPE_CHECKING:
    from uavrt.analysis.silence import SilentMap


@dataclass(frozen=True, slots=True, kw_only=True)
class _Asked:
    """What somebody says of a flight who wants it read."""

    antenna: str | None
    height_m: float | None
    offset_deg: float
    heading_sigma_deg: float
    height_sigma_m: float
    elevation: Elevation | None

    def over(
        self, poses: Sequence[Pose], pulse_poses: Sequence[PulsePose]
    ) -> OverGround | None:
        """The ground of a flight, where heights of it were given."""
        if self.elevation is None:
            return None
        return over_ground(self.elevation, poses, pulse_poses)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Survey:
    """A flight or a pulse log with what follows from it."""

    name: str
    kind: LogKind
    antenna: str
    """Name of the pattern that the bearings were estimated with."""
    pattern: Callable[[], AntennaPattern | None] = lambda: None
    """Learns the same as the turns have shown it, at the first call; None where they do not."""
    offset_deg: float = 0.0
    """Boresight clockwise from the heading that the pulses carry."""
    pulse_poses: tuple[PulsePose, ...]
    """In order of time."""
    track: tuple[Pose, ...]
    """Where the vehicle was; of a log without it, where its pulses were heard."""
    bearings: tuple[TagBearing, ...] = ()
    positions: tuple[TagPosition, ...] = ()
    signals: tuple[TagSignal, ...] = ()
    """Of a survey with a monopole: strength over the ground and over height."""
    warnings: tuple[str, ...] = ()
    info: FlightInfo | None = None
    health: tuple[Health, ...] = ()
    search_reports: tuple[SearchReport, ...] = ()
    beeps: tuple[Beep, ...] = ()
    """What beeped in the flight, listed or not."""
    search_notes: tuple[SearchNote, ...] = ()
    """Of searches that the drone flew by itself."""
    status_texts: tuple[tuple[int, StatusText], ...] = ()
    notes: tuple[tuple[int, str], ...] = ()
    integrated: tuple[PulsePose, ...] = ()
    """Pulses that ``uavrt integrate`` saw in hindsight; no bearing or position is of them."""
    verdicts: tuple[IntegratedVerdict, ...] = ()
    """What it said of each tag."""
    folds: tuple[FlightFold, ...] = ()
    """Of the tags that it judged."""
    silences: "tuple[SilentMap, ...]" = ()
    """Maps of where tags would have been heard, where their power was told."""
    facts: Facts = field(default_factory=Facts)
    """What people tell of it in a report.toml."""
    maps: tuple[MapFile, ...] = ()
    """Map files of pictures, for what lies under the flight in a report."""

    @property
    def tag_ids(self) -> tuple[int, ...]:
        """Numbers of all tags that were heard or looked for."""
        listed = () if self.info is None else self.info.tags
        heard = {one.pulse.tag_id for one in self.pulse_poses}
        judged = {one.tag_id for one in self.verdicts}
        return tuple(sorted(heard | judged | {tag.tag_id for tag in listed}))

    def tag(self, tag_id: int) -> Tag | None:
        """Get the tag as the operator listed it."""
        tags = () if self.info is None else self.info.tags
        return next((tag for tag in tags if tag.tag_id == tag_id), None)

    def pulses_of(self, tag_id: int) -> tuple[PulsePose, ...]:
        """Get one tag's pulses."""
        return tuple(one for one in self.pulse_poses if one.pulse.tag_id == tag_id)

    @property
    def every_pulse(self) -> tuple[PulsePose, ...]:
        """All pulses in the order of time, those seen in hindsight among them."""
        if not self.integrated:
            return self.pulse_poses
        both = (*self.pulse_poses, *self.integrated)
        return tuple(sorted(both, key=lambda one: one.pulse.start_time_ns))

    def verdict_of(self, tag_id: int) -> IntegratedVerdict | None:
        """Get what a whole flight said of one tag; None when nobody has asked."""
        return next((one for one in self.verdicts if one.tag_id == tag_id), None)

    def bearings_of(self, tag_id: int) -> tuple[TagBearing, ...]:
        """Get one tag's bearings."""
        return tuple(one for one in self.bearings if one.tag_id == tag_id)

    def position_of(self, tag_id: int) -> TagPosition | None:
        """Get one tag's position, or why there is none."""
        return next((one for one in self.positions if one.tag_id == tag_id), None)

    def position_time_ns(self, tag_id: int) -> int | None:
        """When a tag was at its position: at the end of its last bearing, or last pulse.

        One that walked was there at the last time of its way.
        """
        found = self.position_of(tag_id)
        if found is not None and found.position is not None and found.position.track:
            return found.position.track[-1].time_ns
        bearings = [one.end_time_ns for one in self.bearings_of(tag_id) if one.bearing.accepted]
        heard = [one.pulse.start_time_ns for one in self.pulses_of(tag_id)]
        return max(bearings or heard, default=None)

    def signal_of(self, tag_id: int) -> TagSignal | None:
        """Get what one tag's strength says, in a survey with a monopole."""
        return next((one for one in self.signals if one.tag_id == tag_id), None)

    @property
    def marks(self) -> tuple[Mark, ...]:
        """Places that the operator marked."""
        return places_of(self.notes).marks

    @property
    def vehicle(self) -> str | None:
        """Number and name of the vehicle, as a ground station noted them; None of others."""
        return vehicle_of(self.notes)

    def label(self, tag_id: int) -> str:
        """Get a tag's number, and its name if it has one."""
        tag = self.tag(tag_id)
        return f"tag {tag_id}" + (f" {tag.name}" if tag is not None and tag.name else "")

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last time of anything in it; None when there is nothing."""
        times = [pose.time_ns for pose in self.track]
        times += [one.pulse.start_time_ns for one in self.pulse_poses]
        if self.info is not None:
            times.append(self.info.start_time_ns)
        return (min(times), max(times)) if times else None


def read_survey(
    path: str | os.PathLike[str],
    *,
    antenna: str | None = None,
    height_m: float | None = None,
    offset_deg: float = 0.0,
    heading_sigma_deg: float = HEADING_SIGMA_DEG,
    height_sigma_m: float = HEIGHT_SIGMA_M,
    elevation: Elevation | None = None,
) -> Survey:
    """Read a flight directory or a pulse log of any kind; estimate bearings and positions.

    What cannot be estimated is missing from the result, and a warning says why.

    Parameters
    ----------
    path : path
        The flight or log.
    antenna : str, optional
        Name of its pattern; without it that of the flight's settings, RA-23K for a log
        without, and a monopole for UCSD's pings.
    height_m : float, optional
        With a monopole: the drone's height over the tags where the log does not tell it.
    offset_deg : float
        Boresight clockwise from the heading that the pulses carry.
    heading_sigma_deg : float
        Error that all headings of the flight share, one standard deviation.
    height_sigma_m : float
        With a monopole: error that all heights over a tag share, one standard deviation.
    elevation : Elevation, optional
        Heights of the ground: hills weaken what is heard, and explain silence.

    Raises
    ------
    FormatError
        It is neither a flight nor a pulse log.
    UsageError
        There is no such antenna, or the report.toml beside it is damaged.
    """
    place = Path(path)
    asked = _Asked(
        antenna=antenna,
        height_m=height_m,
        offset_deg=offset_deg,
        heading_sigma_deg=heading_sigma_deg,
        height_sigma_m=height_sigma_m,
        elevation=elevation,
    )
    survey = _read(place, asked)
    return replace(survey, facts=facts_of(place.resolve()))


def _read(place: Path, asked: _Asked) -> Survey:
    if FlightLayout(place).database.is_file():
        return _of_flight(place, read_flight(place), asked)
    log = read_pulse_log(place)
    antenna = asked.antenna or antenna_of(place, log)
    pulses = tuple(sorted(log.pulse_poses, key=lambda one: one.pulse.start_time_ns))
    warnings = list(log.warnings)
    over = asked.over((), pulses)
    if antenna == MONOPOLE and ORIGINAL_POSES not in warnings:
        positions, signals = positions_of_powers(
            *(pulses, (), ()),
            height_m=asked.height_m,
            height_sigma_m=asked.height_sigma_m,
            over=over,
        )
        warnings += _reasons(positions)
        return Survey(
            name=place.name,
            kind=log.kind,
            antenna=antenna,
            pulse_poses=pulses,
            track=_on_earth(one.pose for one in pulses),
            positions=tuple(positions),
            signals=tuple(signals),
            warnings=tuple(warnings),
        )
    bearings: list[TagBearing] = []
    if ORIGINAL_POSES in warnings:
        warnings.append(NO_BEARINGS_FROM_THESE)
    else:
        bearings = _attempted(
            lambda: bearings_of_pulses(
                _placed(pulses), antenna=antenna, offset_deg=asked.offset_deg
            ),
            warnings,
        )
    positions = positions_of_bearings(
        bearings, heading_sigma_deg=asked.heading_sigma_deg, over=over
    )
    return Survey(
        name=place.name,
        kind=log.kind,
        antenna=antenna,
        pulse_poses=pulses,
        track=_on_earth(one.pose for one in pulses),
        pattern=_shown(lambda: learnt_antenna(place, antenna, asked.offset_deg)),
        offset_deg=asked.offset_deg,
        bearings=tuple(bearings),
        positions=tuple(positions),
        warnings=tuple(warnings),
    )


def thinned(track: Sequence[Pose], step_s: float = 1.0) -> list[Pose]:
    """Keep the first pose of each step of time; the last one stays too."""
    first = [
        next(group)
        for _, group in groupby(track, lambda p: p.time_ns // (step_s * NANOSECONDS_PER_SECOND))
    ]
    if track and first[-1] is not track[-1]:
        first.append(track[-1])
    return first


def _reasons(positions: Iterable[TagPosition]) -> list[str]:
    """Why tags have no position by their strength, for those who can help it."""
    return [
        f"Tag {one.tag_id} has no position: {one.reason}."
        for one in positions
        if one.position is None
    ]


def _past_turns(flight: Flight, antenna: str, offset_deg: float) -> list[list[HeardInTurn]]:
    """What past flights teach of the antenna; nothing where no pulse has a pose."""
    try:
        return past_turns(flight, antenna, offset_deg)
    except UsageError:
        return []


def _taught_bearings(
    flight: Flight,
    past: list[list[HeardInTurn]],
    antenna: str,
    offset_deg: float,
    warnings: list[str],
) -> list[TagBearing]:
    """A flight's bearings by the pattern that past flights teach, too."""
    own, _ = heard_in_turns(flight, offset_deg)
    if (text := taught_in_words([own, *past])) is not None:
        warnings.append(f"{text[0].upper()}{text[1:]}.")
    turns = [one for earlier in past for one in earlier]
    return bearings_of_flight(flight, antenna=antenna, offset_deg=offset_deg, past=turns)


def _of_flight(directory: Path, flight: Flight, asked: _Asked) -> Survey:
    antenna = asked.antenna or flight_antenna(flight)
    over = asked.over(flight.poses, flight.pulse_poses)
    past = _past_turns(flight, antenna, asked.offset_deg) if antenna != MONOPOLE else []
    warnings: list[str] = []
    bearings: list[TagBearing] = []
    signals: list[TagSignal] = []
    if antenna == MONOPOLE:
        positions, signals = positions_of_powers(
            *(flight.pulse_poses, flight.info.tags, flight.poses),
            height_m=asked.height_m,
            height_sigma_m=asked.height_sigma_m,
            over=over,
        )
    else:
        bearings = _attempted(
            lambda: _taught_bearings(flight, past, antenna, asked.offset_deg, warnings),
            warnings,
        )
        positions = positions_of_bearings(
            bearings, heading_sigma_deg=asked.heading_sigma_deg, over=over
        )
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
        warnings.append(f"Nothing of what was integrated: {error}.")
    track = flight.poses or tuple(one.pose for one in flight.pulse_poses if one.pose)
    return Survey(
        name=directory.resolve().name,
        kind="flight",
        antenna=antenna,
        pattern=_shown(
            lambda: antenna_as_shown(
                [
                    *heard_in_turns(flight, asked.offset_deg)[0],
                    *(one for turns in past for one in turns),
                ],
                antenna,
            ),
        ),
        offset_deg=asked.offset_deg,
        pulse_poses=flight.pulse_poses,
        track=_on_earth(track),
        bearings=tuple(bearings),
        positions=tuple(positions),
        signals=tuple(signals),
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


def _attempted(
    estimate: Callable[[], list[TagBearing]], warnings: list[str]
) -> list[TagBearing]:
    """Bearings, or none and a warning."""
    try:
        return estimate()
    except UsageError as error:
        if "there is no antenna" in error.message:
            raise
        warnings.append(f"No bearings: {error}.")
        return []


def _shown(learn: Callable[[], AntennaPattern]) -> Callable[[], AntennaPattern | None]:
    """Learn the antenna as the bearings took it, when somebody wants to see it, and once."""

    @cache
    def shown() -> AntennaPattern | None:
        try:
            return learn()
        except UsageError:
            return None

    return shown


def _placed(pulses: Iterable[PulsePose]) -> list[PulsePose]:
    return [one for one in pulses if one.pose is not None]


def _on_earth(poses: Iterable[Pose | None]) -> tuple[Pose, ...]:
    """Poses with a place, each time once, in order."""
    found = {
        pose.time_ns: pose
        for pose in poses
        if pose is not None
        and math.isfinite(pose.latitude_deg)
        and math.isfinite(pose.longitude_deg)
    }
    return tuple(found[time] for time in sorted(found))
