"""Compute poses, bearings and positions of one flight's pulses, in one worker."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path

from uavrt.analysis.archive.parquet.parquet_tables import (
    BearingOfTag,
    PoseRow,
    PositionOfTag,
    read_pulses,
)
from uavrt.analysis.estimates.bearings import heard_in_flight, past_turns
from uavrt.analysis.estimates.records import bearing_record, position_record
from uavrt.analysis.inputs.flown_with import USUAL_ANTENNA, flight_antenna
from uavrt.analysis.measure.antenna_files import antenna_named
from uavrt.analysis.measure.redetect import posed_in
from uavrt.analysis.tracks.attach import attach_poses, estimate_offset
from uavrt.analysis.tracks.recognised import read_track
from uavrt.core.earth.attitude import yaw_deg
from uavrt.core.errors import UavrtError
from uavrt.core.messages import Pose, Pulse, PulsePose, Tag
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.integrated import IntegratedVerdict
from uavrt.flight.reading.flight_reader import Flight, read_flight
from uavrt.localization.antenna import MONOPOLE, pattern_named
from uavrt.localization.estimates.flight_estimates import (
    EstimationOptions,
    HeardInTurn,
    TagBearing,
    TagPosition,
    bearings_of,
    estimate,
)
from uavrt.localization.estimates.heard import Heard
from uavrt.localization.terrain.elevation import Elevation
from uavrt.localization.terrain.elevation_files import open_elevation

PATH_FIELDS = ("time_ns", "latitude_deg", "longitude_deg", "radius50_m", "radius95_m")
"""Fields of a moving tag's path; each is a list column in the table of positions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacingSettings(EstimationOptions):
    """Settings for bearings and positions, as in `uavrt localize`."""

    antenna: str | None = None
    """Name of an antenna pattern, path of a pattern file, or monopole; None for the antenna in
    the drone's settings."""
    dem: str | None = None
    """Elevation file, or folder of such files; None assumes level ground."""
    sea: bool = False
    """True if areas that no elevation file covers are water."""

    def estimation_options(self, antenna: str) -> EstimationOptions:
        """Convert these settings to the options of the estimator."""
        same = {one.name: getattr(self, one.name) for one in fields(EstimationOptions)}
        elevation = _elevation(self.dem, self.sea)
        return EstimationOptions(**same | {"antenna": antenna, "elevation": elevation})


@dataclass(frozen=True, slots=True, kw_only=True)
class Searched:
    """A searched recording and its pulses."""

    recording: str
    file: Path
    pulses: tuple[Pulse, ...] = ()
    """Pulses of the recording; empty until `FlightTask.packed` loads them for a worker."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightResult:
    """Poses, bearings and positions of one flight."""

    fault: str | None = None
    """Reason why the flight has no result, or why some tags have no position."""
    integrate_fault: str | None = None
    failed: bool = False
    gone: bool = False
    """True if the task failed because the flight's files cannot be reached at present."""
    recorded: tuple[Pulse, ...] | None = None
    """Pulses that the flight itself recorded; None if a recording of it was searched."""
    start_time_ns: int | None = None
    antenna: str = ""
    pulses: int = 0
    poses: tuple[PoseRow, ...] = ()
    clock_offset_s: float | None = None
    bearings: tuple[BearingOfTag, ...] = ()
    positions: tuple[PositionOfTag, ...] = ()
    integrated: tuple[IntegratedVerdict, ...] = ()
    cpu_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightTask:
    """Task for a worker: compute poses, bearings and positions of one flight."""

    path: str
    """Directory of the flight, or path of a recording without a flight."""
    flight: str
    key: str
    is_flight: bool
    searched: tuple[Searched, ...]
    """Searched recordings of the flight; if empty, the pulses recorded in flight are used."""
    tags: tuple[Tag, ...]
    track: Path | None
    clock_offset_s: float | None
    """Offset of the recording's clock from the track's clock [s], positive if the recording's
    clock is ahead; None to estimate it."""
    vehicle: int | None
    """MAVLink system id of the track's vehicle; None for the only one."""
    steps: tuple[str, ...]
    settings: PlacingSettings

    def packed(self) -> "FlightTask":
        """Copy with the pulses, as workers read no Parquet files. Raises `FormatError`."""
        return replace(
            self,
            searched=tuple(
                replace(one, pulses=tuple(read_pulses(one.file))) for one in self.searched
            ),
        )

    def failed(self, fault: str) -> FlightResult:
        """Result with the reason why the task could not be done."""
        return FlightResult(fault=fault, failed=True)

    def work(
        self, should_stop: Callable[[], bool], on_done: Callable[[int], None]
    ) -> FlightResult | None:
        """Attach poses and run the requested steps; None if stopped before the start."""
        if should_stop():
            return None
        began_s = time.process_time()
        try:
            result = _place(self)
        except (UavrtError, OSError) as error:
            result = replace(self.failed(str(error)), gone=_gone(self, error))
        on_done(1)
        return replace(result, cpu_s=time.process_time() - began_s)


def _gone(task: FlightTask, error: Exception) -> bool:
    """True if `error` occurred because the flight's files cannot be read at present."""
    if isinstance(error, OSError):
        return True
    read = FlightLayout(Path(task.path)).database if task.is_flight else task.track
    try:
        if read is not None:
            with read.open("rb") as file:
                file.read(1)
    except OSError:
        return True
    return False


def _place(task: FlightTask) -> FlightResult:
    flight, posed, offset_s = _attached(task)
    antenna = _antenna(task, flight)
    found = FlightResult(
        antenna=antenna,
        recorded=None if task.searched else tuple(one.pulse for one in posed),
        start_time_ns=(
            min((one.pulse.start_time_ns for one in posed), default=None)
            if flight is None
            else flight.info.start_time_ns
        ),
        pulses=len(posed),
        poses=tuple(_pose_rows(task, posed)) if "attach" in task.steps else (),
        clock_offset_s=offset_s,
    )
    if "integrate" in task.steps and flight is not None:
        verdicts, fault = _integrated(task, flight, antenna)
        found = replace(found, integrated=verdicts, integrate_fault=fault)
    if "bearing" not in task.steps:
        return found
    try:
        bearings, positions = _located(task, flight, posed, antenna)
    except UavrtError as error:  # no pulse has a pose: the pulses count all the same
        return replace(found, fault=str(error))
    without = [f"tag {one.tag_id}: {one.reason}" for one in positions if not one.position]
    return replace(
        found,
        fault="; ".join(without) or None,
        bearings=tuple(map(_bearing_row, bearings)),
        positions=tuple(
            row for one in positions if (row := _position_row(one, bearings, posed)) is not None
        ),
    )


def _integrated(
    task: FlightTask, flight: Flight, antenna: str
) -> tuple[tuple[IntegratedVerdict, ...], str | None]:
    """Whole-flight results of tags with a recorded channel, and errors as text or None."""
    from uavrt.analysis.inputs.flown_with import antenna_is_recorded
    from uavrt.analysis.integrated.hindsight import verdict_of
    from uavrt.analysis.whole_flights.judged_flights import WholeFlightOptions
    from uavrt.analysis.whole_flights.kept_samples import (
        channel_of,
        integrate_kept,
        kept_channels,
    )

    assumed = task.settings.antenna is None and not antenna_is_recorded(flight)
    elevation = _elevation(task.settings.dem, task.settings.sea)
    how = WholeFlightOptions(
        pattern=pattern_named(antenna), antenna_assumed=assumed, elevation=elevation
    )
    channels = kept_channels(Path(flight.info.directory))
    verdicts, faults = [], []
    for tag in flight.info.tags:
        if channel_of(channels, tag) is None:
            continue
        try:
            (result,) = integrate_kept(flight, [tag], how)
        except UavrtError as error:
            faults.append(f"integrate tag {tag.tag_id}: {error}")
        else:
            verdicts.append(verdict_of(flight, result))
    return tuple(verdicts), "; ".join(faults) or None


def _attached(task: FlightTask) -> tuple[Flight | None, tuple[PulsePose, ...], float | None]:
    """Attach poses to a task's pulses; return the flight if there is one, the pulses, and the
    clock offset [s].
    """
    pulses = [pulse for one in task.searched for pulse in one.pulses]
    if task.is_flight:
        flight = read_flight(task.path)
        if task.searched:
            info = replace(flight.info, tags=task.tags)
            flight = replace(flight, info=info, pulse_poses=posed_in(flight, pulses))
        return flight, flight.pulse_poses, None
    assert task.track is not None
    track, bare = (
        read_track(task.track, task.vehicle),
        [PulsePose(pulse=one, pose=None) for one in pulses],
    )
    offset_s = task.clock_offset_s
    if offset_s is None:
        offset_s = estimate_offset(bare, track, antenna=_antenna(task, None)).offset_s
    return None, tuple(attach_poses(bare, track, offset_s)), offset_s


def _located(
    task: FlightTask, flight: Flight | None, posed: Sequence[PulsePose], antenna: str
) -> tuple[Sequence[TagBearing], Sequence[TagPosition]]:
    localize = "localize" in task.steps
    if antenna == MONOPOLE and not localize:
        return [], []
    heard = Heard.of_records(posed) if flight is None else heard_in_flight(flight, posed)
    past: list[HeardInTurn] = []
    if flight is not None and antenna != MONOPOLE:
        for turns in past_turns(flight, antenna, task.settings.offset_deg):
            past += turns
    how = task.settings.estimation_options(antenna)
    if not localize:
        return bearings_of(heard, how, past), []
    found = estimate(heard, how, past=past)
    return found.found.bearings, found.positions


def _antenna(task: FlightTask, flight: Flight | None) -> str:
    if task.settings.antenna is None:
        return USUAL_ANTENNA if flight is None else flight_antenna(flight)
    return _asked_antenna(task.settings.antenna)


@lru_cache(maxsize=16)
def _asked_antenna(text: str) -> str:
    return text if text == MONOPOLE else antenna_named(text)


@lru_cache(maxsize=4)
def _elevation(dem: str | None, sea: bool) -> Elevation | None:
    return None if dem is None else open_elevation(Path(dem), sea=sea)


def _pose_rows(task: FlightTask, posed: Sequence[PulsePose]) -> list[PoseRow]:
    recording_of = {pulse.key: one.recording for one in task.searched for pulse in one.pulses}
    return [
        PoseRow(
            recording=recording_of.get(one.pulse.key, task.path),
            tag_id=one.pulse.tag_id,
            start_time_ns=one.pulse.start_time_ns,
            yaw_deg=yaw_deg(one.pose.quaternion_wxyz),
            **{field.name: getattr(one.pose, field.name) for field in fields(Pose)},
        )
        for one in posed
        if one.pose is not None
    ]


def _bearing_row(one: TagBearing) -> BearingOfTag:
    record = bearing_record(one)
    low_deg, high_deg = one.bearing.interval90_deg or (None, None)
    record |= {
        "interval90_from_deg": low_deg,
        "interval90_to_deg": high_deg,
        "altitude_amsl_m": one.altitude_amsl_m,
    }
    return BearingOfTag(**{name: record[name] for name in BearingOfTag.__dataclass_fields__})


def _position_row(
    one: TagPosition, bearings: Sequence[TagBearing], posed: Sequence[PulsePose]
) -> PositionOfTag | None:
    if one.position is None:
        return None
    spans = [
        (each.start_time_ns, each.end_time_ns)
        for each in bearings
        if each.tag_id == one.tag_id and each.bearing.accepted
    ] or [
        (each.pulse.start_time_ns, each.pulse.end_time_ns)
        for each in posed
        if each.pulse.tag_id == one.tag_id
    ]
    record = position_record(one)
    cautions, way = record["cautions"], record["track"]
    record |= {
        "start_time_ns": min(begin for begin, _ in spans),
        "end_time_ns": max(end for _, end in spans),
        "remarks": "; ".join(record["remarks"]),
        "cautions": ", ".join(each["name"] for each in cautions),
        "cautions_in_words": "\n".join(each["text"] for each in cautions),
        **{f"track_{name}": tuple(each[name] for each in way) for name in PATH_FIELDS},
    }
    return PositionOfTag(**{name: record[name] for name in PositionOfTag.__dataclass_fields__})
