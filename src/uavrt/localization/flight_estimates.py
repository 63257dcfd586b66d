"""From a flight's poses and pulses, in columns, to turns, bearings and positions.

The one way that the drone, the page, the report and the command line take, so that they tell
the same of the same flight.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavrt.errors import UsageError
from uavrt.localization.antenna import AntennaPattern, pattern_named
from uavrt.localization.bearing import (
    CLIMB_M,
    Turn,
    TurnPulses,
    estimate_bearing,
    find_turns,
    learn_pattern,
)
from uavrt.localization.headings import Headings
from uavrt.localization.position import (
    HEADING_SIGMA_DEG,
    PowerTrack,
    Stations,
    Strengths,
    estimate_position,
)
from uavrt.localization.results import Bearing, BearingMethod, Position, PositionMethod
from uavrt.localization.survey_errors import HEIGHT_SIGMA_M
from uavrt.messages import Pose, PulsePose, Tag
from uavrt.terrain import Elevation, HillLosses
from uavrt.units import NANOSECONDS_PER_SECOND

OWN_HEADING_SIGMA_DEG = 1.0
"""Error of a turn's headings that the flight's other turns do not share, at the least."""
MISS_THRESHOLD_DB = 13.0
"""SNR from which a pulse that a detector was following is not missed: three pulses of 11.4 dB
are found with 90 % (docs/reference), the rest is room for losses."""
LEAST_PULSES = 3
LEAST_TURN_DEG = 45.0
"""A turn that goes on counts from here on; one that is over, from 270°."""
EDGE_NS = NANOSECONDS_PER_SECOND
"""Pulses this long before and after a turn belong to it: the same place, the first heading."""
ONE_FLIGHT_S = 7200.0
"""Bearings over a longer time are of several flights: the tag is taken to rest."""
_GOES_ON_NS = 10_000_000_000
"""A turn whose end is this near to the last pose may go on."""
_WHOLE_DEG = 270.0
POSE_STEP_NS = 180_000_000
"""Poses closer than this tell nothing new of a turn."""
LEAST_TURNS = 3
"""Fewer do not teach a pattern."""
_LEAST_TO_LEARN = 12
POSE_GAP_NS = 2_000_000_000
"""Telemetry comes several times a second; this far from it, a pulse's own pose tells more."""
_MOST_TURNS = 24
"""More turns teach little, and cost."""
APART_M = 20.0
"""Heights of a flight and of the elevation files that differ by more do not count alike."""
_ON_GROUND_M = 5.0
"""Poses that begin higher do not tell where the take-off was."""

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseColumns:
    """Where the vehicle was, in order of time."""

    time_ns: NDArray[np.int64]
    latitude_deg: _Floats
    longitude_deg: _Floats
    height_m: _Floats
    """(n,) above the take-off; NaN where nobody knows."""
    quaternion_wxyz: _Floats
    """(n, 4)."""
    altitude_amsl_m: _Floats | None = None
    """(n,) above sea level, NaN where nobody knows; tells what is flown where `height_m` does
    not."""
    on_ground_ns: tuple[tuple[int, int], ...] = ()
    """First and last times of what the autopilot says was not flown; empty where it tells
    nothing."""

    @classmethod
    def of(
        cls, poses: Iterable[Pose], on_ground_ns: tuple[tuple[int, int], ...] = ()
    ) -> "PoseColumns":
        """Put poses into columns, each time once, in order."""
        by_time = {pose.time_ns: pose for pose in poses}
        ordered = [by_time[time] for time in sorted(by_time)]
        return cls(
            time_ns=np.array([pose.time_ns for pose in ordered], np.int64),
            latitude_deg=np.array([pose.latitude_deg for pose in ordered]),
            longitude_deg=np.array([pose.longitude_deg for pose in ordered]),
            height_m=np.array([pose.altitude_relative_m for pose in ordered], np.float64),
            quaternion_wxyz=np.array([pose.quaternion_wxyz for pose in ordered]).reshape(-1, 4),
            altitude_amsl_m=np.array([pose.altitude_amsl_m for pose in ordered], np.float64),
            on_ground_ns=on_ground_ns,
        )

    def completed(self, others: "PoseColumns") -> "PoseColumns":
        """Add poses of others, such as the pulses' own, at times of which these tell nothing.

        Telemetry that a silent radio has lost never comes; the pulses of that time do. Both
        may be out of order; each time stands once.
        """
        alone = np.flatnonzero(_far_from(np.sort(self.time_ns), others.time_ns))
        time_ns = np.concatenate([self.time_ns, others.time_ns[alone]])
        _, kept = np.unique(time_ns, return_index=True)

        def joined(own: _Floats, theirs: _Floats) -> _Floats:
            return np.asarray(np.concatenate([own, theirs[alone]])[kept])

        return PoseColumns(
            time_ns=time_ns[kept],
            latitude_deg=joined(self.latitude_deg, others.latitude_deg),
            longitude_deg=joined(self.longitude_deg, others.longitude_deg),
            height_m=joined(self.height_m, others.height_m),
            quaternion_wxyz=joined(self.quaternion_wxyz, others.quaternion_wxyz),
            altitude_amsl_m=joined(self.amsl_m, others.amsl_m),
            on_ground_ns=self.on_ground_ns + others.on_ground_ns,
        )

    @property
    def amsl_m(self) -> _Floats:
        """(n,) altitudes; NaN where nobody knows."""
        nowhere = np.full(len(self.time_ns), np.nan)
        return nowhere if self.altitude_amsl_m is None else self.altitude_amsl_m

    @property
    def flown_m(self) -> _Floats:
        """(n,) heights that tell flight from ground: above the take-off, else the lowest."""
        amsl = self.amsl_m
        if np.any(np.isfinite(self.height_m)) or not np.any(np.isfinite(amsl)):
            return self.height_m
        return np.asarray(amsl - np.nanmin(amsl))

    @property
    def on_ground(self) -> NDArray[np.bool_]:
        """(n,) what the autopilot says was not flown."""
        found = np.zeros(len(self.time_ns), bool)
        for first, last in self.on_ground_ns:
            found |= (self.time_ns >= first) & (self.time_ns <= last)
        return found

    @property
    def leaves_ground(self) -> bool:
        """Whether some of it was flown, and some of it not, as heights or autopilot tell."""
        on_ground = self.on_ground
        flown = self.flown_m[np.isfinite(self.flown_m)]
        climbed = len(flown) > 0 and float(np.ptp(flown)) >= CLIMB_M
        return climbed or bool(on_ground.any() and not on_ground.all())

    @property
    def yaw_deg(self) -> _Floats:
        """(n,) headings."""
        return Headings.from_quaternions(self.quaternion_wxyz).yaw_deg


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PulseColumns:
    """One tag's pulses that have a pose and a power, in order of time."""

    time_ns: NDArray[np.int64]
    """(n,) beginnings."""
    latitude_deg: _Floats
    longitude_deg: _Floats
    quaternion_wxyz: _Floats
    """(n, 4) of the antenna."""
    snr_db: _Floats
    noise_psd: _Floats
    """(n,) NaN where nobody knows."""
    rate: NDArray[np.int64]
    """(n,) which of the tag's intervals, from 1."""

    @classmethod
    def of(cls, pulses: Sequence[PulsePose]) -> "PulseColumns":
        """Put one tag's pulses with poses, in order of time, into columns."""
        poses = [one.pose for one in pulses if one.pose is not None]
        return cls(
            time_ns=np.array([one.pulse.start_time_ns for one in pulses], np.int64),
            latitude_deg=np.array([pose.latitude_deg for pose in poses]),
            longitude_deg=np.array([pose.longitude_deg for pose in poses]),
            quaternion_wxyz=np.array([pose.quaternion_wxyz for pose in poses]).reshape(-1, 4),
            snr_db=np.array([one.pulse.snr_db for one in pulses]),
            noise_psd=np.array([one.pulse.noise_psd for one in pulses], np.float64),
            rate=np.array([one.pulse.rate for one in pulses], np.int64),
        )

    def turned(self, offset_deg: float) -> "PulseColumns":
        """The same with the antenna turned clockwise about its own down axis."""
        if offset_deg == 0.0:
            return self
        w, x, y, z = self.quaternion_wxyz.T
        c, s = np.cos(np.radians(offset_deg) / 2.0), np.sin(np.radians(offset_deg) / 2.0)
        parts = [w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s]
        return replace(self, quaternion_wxyz=np.stack(parts, axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OverGround:
    """A flight over ground that is known."""

    hills: HillLosses
    poses: PoseColumns

    @classmethod
    def of(
        cls, elevation: Elevation, poses: PoseColumns, *, takeoff_amsl_m: float | None = None
    ) -> "OverGround | None":
        """Lay the ground around a flight; None where no pose tells of the place.

        Heights of a flight count from its take-off, taken to be beneath the first pose.

        Parameters
        ----------
        elevation : Elevation
        poses : PoseColumns
        takeoff_amsl_m : float, optional
            What the flight itself says of the take-off's height.

        Raises
        ------
        FormatError
            A file of heights is damaged.
        """
        known = np.flatnonzero(np.isfinite(poses.latitude_deg) & np.isfinite(poses.height_m))
        if not len(known):
            return None
        first = int(known[0])
        hills = HillLosses(
            elevation,
            latitude_deg=float(poses.latitude_deg[first]),
            longitude_deg=float(poses.longitude_deg[first]),
        )
        said = list(elevation.cautions)
        height_m = float(poses.height_m[first])
        if height_m > _ON_GROUND_M:
            said.append(
                f"the flight's poses begin {height_m:.0f} m up: its heights are counted from "
                "the ground beneath that place"
            )
        if takeoff_amsl_m is not None:
            said += apart_in_words(hills.start_amsl_m, takeoff_amsl_m)
        return cls(hills=hills.noting(*said), poses=poses)

    def noting(self, *limitations: str) -> "OverGround":
        """The same with more that an operator must know."""
        return replace(self, hills=self.hills.noting(*limitations))

    def at(self, frequency_hz: float) -> "OverGround":
        """The same for a tag."""
        return replace(self, hills=self.hills.at(frequency_hz))

    def heights_m(self, time_ns: Sequence[int] | NDArray[np.int64]) -> _Floats:
        """Heights above the take-off at some times."""
        told = np.isfinite(self.poses.height_m)
        known_ns = self.poses.time_ns[told].astype(np.float64)
        wanted_ns = np.asarray(time_ns, np.float64)
        return np.asarray(np.interp(wanted_ns, known_ns, self.poses.height_m[told]))


def apart_in_words(ground_m: float, said_m: float) -> tuple[str, ...]:
    """What to tell where elevation files and flight disagree on the take-off's height."""
    if not abs(said_m - ground_m) > APART_M:  # so, too, where one of them is not known
        return ()
    return (
        f"the elevation files have the take-off at {ground_m:.0f} m, the flight at "
        f"{said_m:.0f} m: another datum, or another place; heights are counted from the "
        "elevation files' take-off on",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Rhythm:
    """When a tag's pulses must come."""

    intervals_s: tuple[float, ...]
    uncertainty_s: float

    @classmethod
    def of(cls, tag: Tag) -> "Rhythm":
        """When a listed tag's pulses must come."""
        return cls(intervals_s=tag.pulse_intervals_s, uncertainty_s=tag.interval_uncertainty_s)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeardInTurn:
    """One tag's pulses in one turn."""

    tag_id: int
    turn: Turn
    inside: NDArray[np.intp]
    """Which of the tag's pulses."""
    latitude_deg: float
    """Median over the pulses."""
    longitude_deg: float
    start_time_ns: int
    middle_time_ns: int
    """Between the first pulse and the last: when a tag that moves was there."""
    quaternion_wxyz: _Floats
    """(n, 4) of the antenna."""
    snr_db: _Floats
    noise_psd: _Floats
    missed_yaw_deg: _Floats
    """(m,) headings at pulses that must have come and were not heard."""

    @property
    def whole(self) -> bool:
        """Whether the turn has gone all the way round, or nearly."""
        return abs(self.turn.turned_deg) >= _WHOLE_DEG


def _far_from(known_ns: NDArray[np.int64], times_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(n,) which times are farther than `POSE_GAP_NS` from every one of rising `known_ns`."""
    if not len(known_ns):
        return np.ones(len(times_ns), bool)
    after = np.searchsorted(known_ns, times_ns)
    before_ns = times_ns - known_ns[np.maximum(after - 1, 0)]
    after_ns = known_ns[np.minimum(after, len(known_ns) - 1)] - times_ns
    return np.asarray(np.minimum(np.abs(before_ns), np.abs(after_ns)) > POSE_GAP_NS)


def turns_in(poses: PoseColumns, *, least_turn_deg: float = _WHOLE_DEG) -> list[Turn]:
    """Find the turns of a flight, and the one that goes on, if any."""
    if len(poses.time_ns) < 4 or poses.on_ground.all():
        return []  # what flew before is not among these poses any more
    slots = (poses.time_ns - poses.time_ns[0]) // POSE_STEP_NS
    _, kept = np.unique(slots, return_index=True)
    every = find_turns(
        poses.time_ns[kept],
        poses.yaw_deg[kept],
        poses.latitude_deg[kept],
        poses.longitude_deg[kept],
        height_m=poses.flown_m[kept],
        on_ground=poses.on_ground[kept],
        least_turn_deg=LEAST_TURN_DEG,
    )
    last_ns = int(poses.time_ns[-1])
    return [
        turn
        for turn in every
        if abs(turn.turned_deg) >= least_turn_deg or last_ns - turn.end_time_ns <= _GOES_ON_NS
    ]


def heard_in(
    tag_id: int,
    turn: Turn,
    pulses: PulseColumns,
    poses: PoseColumns,
    rhythm: Rhythm | None = None,
) -> HeardInTurn | None:
    """Collect a tag's pulses in a turn; None for fewer than three."""
    times = pulses.time_ns
    first, last = np.searchsorted(
        times, [turn.start_time_ns - EDGE_NS, turn.end_time_ns + EDGE_NS + 1]
    )
    if last - first < LEAST_PULSES:
        return None
    part = slice(int(first), int(last))
    return HeardInTurn(
        tag_id=tag_id,
        turn=turn,
        inside=np.arange(part.start, part.stop),
        latitude_deg=float(np.median(pulses.latitude_deg[part])),
        longitude_deg=float(np.median(pulses.longitude_deg[part])),
        start_time_ns=int(times[part.start]),
        middle_time_ns=int(times[part.start] + times[part.stop - 1]) // 2,
        quaternion_wxyz=pulses.quaternion_wxyz[part],
        snr_db=pulses.snr_db[part],
        noise_psd=pulses.noise_psd[part],
        missed_yaw_deg=missed_yaws_deg(pulses, poses, turn, rhythm),
    )


def missed_yaws_deg(
    pulses: PulseColumns, poses: PoseColumns, turn: Turn, rhythm: Rhythm | None
) -> _Floats:
    """Headings of the antenna at pulses that must have come during a turn and were not heard.

    Between two heard pulses whose distance is a multiple of the tag's interval. The heading is
    the vehicle's, plus what the antenna's differed from it at the heard pulses.
    """
    if rhythm is None or not len(poses.time_ns):
        return np.zeros(0)
    times: list[float] = []
    # From the last pulse before the turn to the first after it; the others tell nothing of it.
    first = max(0, int(np.searchsorted(pulses.time_ns, turn.start_time_ns)) - 1)
    last = int(np.searchsorted(pulses.time_ns, turn.end_time_ns, side="right")) + 1
    near = zip(pulses.time_ns[first:last], pulses.rate[first:last], strict=True)
    for (before, rate), (after, _) in pairwise(near):
        number = min(max(int(rate), 1), len(rhythm.intervals_s))
        interval_ns = rhythm.intervals_s[number - 1] * NANOSECONDS_PER_SECOND
        gap_ns = int(after) - int(before)
        count = round(gap_ns / interval_ns)
        tolerance_ns = NANOSECONDS_PER_SECOND * rhythm.uncertainty_s * count + 0.1 * interval_ns
        if count > 1 and abs(gap_ns - count * interval_ns) <= tolerance_ns:
            times += [int(before) + gap_ns * step / count for step in range(1, count)]
    inside = [time for time in times if turn.start_time_ns <= time <= turn.end_time_ns]
    if not inside:
        return np.zeros(0)
    yaw = np.unwrap(poses.yaw_deg, period=360.0)
    antenna = Headings.from_quaternions(pulses.quaternion_wxyz).yaw_deg
    vehicle = np.interp(pulses.time_ns, poses.time_ns, yaw)
    offset = np.angle(np.mean(np.exp(1j * np.radians(antenna - vehicle))), deg=True)
    return np.asarray(np.remainder(np.interp(inside, poses.time_ns, yaw) + offset, 360.0))


def bearing_of(
    heard: HeardInTurn,
    *,
    antenna: AntennaPattern | str,
    method: BearingMethod | str = "pattern_ml",
) -> Bearing:
    """Estimate the bearing of a tag in a turn.

    Parameters
    ----------
    heard : HeardInTurn
        What was heard of it.
    antenna : AntennaPattern or str
        The pattern.
    method : str
        How pulses become a bearing.

    Raises
    ------
    UsageError
        The method cannot use these pulses, or it or the antenna is unknown.
    """
    half = np.radians(heard.missed_yaw_deg) / 2.0
    nothing = np.zeros(len(half))
    missed = np.stack([np.cos(half), nothing, nothing, np.sin(half)], axis=1)
    noise = heard.noise_psd
    known = bool(np.all(np.isfinite(noise) & (noise > 0.0)))
    fill = np.full(len(half), np.median(noise) if known else 1.0)
    return estimate_bearing(
        None,
        np.concatenate([heard.snr_db, np.full(len(half), np.nan)]),
        method=method,
        antenna=antenna,
        quaternion_wxyz=np.concatenate([heard.quaternion_wxyz, missed]),
        noise_psd=np.concatenate([noise, fill]) if known else None,
        threshold_db=MISS_THRESHOLD_DB,
        heading_sigma_deg=OWN_HEADING_SIGMA_DEG,
    )


def teaching(heard: Iterable[HeardInTurn]) -> list[HeardInTurn]:
    """Choose the turns that a pattern is learnt from: whole ones with many pulses."""
    whole = [one for one in heard if one.whole and len(one.snr_db) >= _LEAST_TO_LEARN]
    return whole[:_MOST_TURNS]


def antenna_as_shown(
    heard: Sequence[HeardInTurn], antenna: AntennaPattern | str
) -> AntennaPattern:
    """Correct a pattern by what whole turns have shown; as it is, where they are too few."""
    whole = teaching(heard)
    pattern = pattern_named(antenna)
    if len(whole) < LEAST_TURNS:
        return pattern
    turns = [
        TurnPulses(
            yaw_deg=np.concatenate(
                [Headings.from_quaternions(one.quaternion_wxyz).yaw_deg, one.missed_yaw_deg]
            ),
            matched_power=np.concatenate(
                [1.0 + 10.0 ** (one.snr_db / 10.0), np.full(len(one.missed_yaw_deg), np.nan)]
            ),
        )
        for one in whole
    ]
    return learn_pattern(turns, pattern, threshold_db=MISS_THRESHOLD_DB)


def position_of_bearings(
    latitude_deg: Sequence[float],
    longitude_deg: Sequence[float],
    time_ns: Sequence[int],
    bearings: Sequence[Bearing],
    *,
    method: PositionMethod | str = "bayes",
    heading_sigma_deg: float = HEADING_SIGMA_DEG,
    over: OverGround | None = None,
    listeners: Sequence[Strengths] = (),
) -> Position:
    """Estimate where a tag is from the bearings of a flight; those without a direction go out.

    With the ground, levels are compared by what hills take from them. What receivers heard that
    never turned goes in as strengths, to the method ``bayes``; the position says what became of
    each.

    Raises
    ------
    UsageError
        None has a direction, or the method comes to no position.
    """
    used = [number for number, one in enumerate(bearings) if one.accepted]
    if not used:
        raise UsageError(
            "none of its bearings points in a clear direction", remedy="Fly nearer"
        )
    times_s = [(time_ns[number] - min(time_ns)) / NANOSECONDS_PER_SECOND for number in used]
    stations = Stations.of(
        [latitude_deg[number] for number in used],
        [longitude_deg[number] for number in used],
        [bearings[number] for number in used],
        times_s if max(times_s) - min(times_s) <= ONE_FLIGHT_S else None,
        min(time_ns),
    )
    stations = replace(stations, listeners=tuple(listeners))
    hills = None
    if over is not None:
        height_m = over.heights_m([time_ns[number] for number in used])
        stations, hills = replace(stations, height_m=height_m), over.hills
    found = located(stations, method=method, heading_sigma_deg=heading_sigma_deg, hills=hills)
    if method in ("bayes", "track") or not listeners:
        return found
    left_out = f"the method {method} takes bearings alone"
    return replace(found, listeners=tuple(one.because(left_out) for one in listeners))


def located(
    stations: Stations | None = None,
    powers: PowerTrack | None = None,
    *,
    method: PositionMethod | str = "bayes",
    heading_sigma_deg: float = HEADING_SIGMA_DEG,
    height_sigma_m: float = HEIGHT_SIGMA_M,
    hills: HillLosses | None = None,
) -> Position:
    """Estimate where a tag is, from a flight's bearings or from its powers.

    A tag whose bearings or powers contradict a place that rests is followed. Where the ground
    is known, hills weaken what is heard.

    Raises
    ------
    UsageError
        The method comes to no position.
    """
    return estimate_position(
        stations,
        powers,
        method=method,
        heading_sigma_deg=heading_sigma_deg,
        height_sigma_m=height_sigma_m,
        follow=True,
        hills=hills,
    )
