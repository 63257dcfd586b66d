"""Store received pulses and poses from a flight, a log or live data in columns, as input of the
estimates.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.core.columns import chosen_rows, joined_rows
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import UsageError
from uavrt.core.messages import Pose, PulsePose, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.localization.bearing.tuning import TURNS
from uavrt.localization.headings import Headings
from uavrt.localization.terrain.elevation import Elevation
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.localization.tuning import FLIGHT, RECEIVERS
from uavrt.localization.usual_noise import over_usual_noise_db

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseColumns:
    """Positions and attitudes of the vehicle, in order of time."""

    time_ns: NDArray[np.int64]
    latitude_deg: _Floats
    longitude_deg: _Floats
    height_m: _Floats
    """Height of the vehicle above the take-off [m], shape (n,); NaN if unknown."""
    quaternion_wxyz: _Floats
    altitude_amsl_m: _Floats | None = None
    """Altitude of the vehicle above sea level [m], shape (n,); NaN where unknown."""
    on_ground_ns: tuple[tuple[int, int], ...] = ()
    """Start and end of each time span on the ground, as reported by the autopilot [ns]."""

    @classmethod
    def of(
        cls, poses: Iterable[Pose], on_ground_ns: tuple[tuple[int, int], ...] = ()
    ) -> "PoseColumns":
        """Convert poses to columns in order of time; only one pose is kept for each time."""
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
        """Fill gaps between these poses with poses from another source, such as those stored
        with pulses.
        """
        alone = np.flatnonzero(_far_from(np.sort(self.time_ns), others.time_ns))
        parts = (self, others.chosen(alone))
        both = joined_rows([replace(one, altitude_amsl_m=one.amsl_m) for one in parts])
        _, kept = np.unique(both.time_ns, return_index=True)
        on_ground_ns = self.on_ground_ns + others.on_ground_ns
        return replace(both.chosen(kept), on_ground_ns=on_ground_ns)

    def chosen(self, which: NDArray[np.intp] | NDArray[np.bool_]) -> "PoseColumns":
        """Return the poses selected by an index array or a mask."""
        return chosen_rows(self, which)

    @property
    def amsl_m(self) -> _Floats:
        """Altitudes above sea level [m], shape (n,); NaN where unknown."""
        nowhere = np.full(len(self.time_ns), np.nan)
        return nowhere if self.altitude_amsl_m is None else self.altitude_amsl_m

    @property
    def flown_m(self) -> _Floats:
        """Heights above the take-off [m], shape (n,); if all are unknown, heights above the
        lowest pose.
        """
        amsl = self.amsl_m
        if np.any(np.isfinite(self.height_m)) or not np.any(np.isfinite(amsl)):
            return self.height_m
        return np.asarray(amsl - np.nanmin(amsl))

    def heights_m(self, time_ns: Sequence[int] | NDArray[np.int64]) -> _Floats:
        """Heights above the take-off at given times [m]; 0 if no height is known."""
        known, wanted_ns = np.isfinite(self.height_m), np.asarray(time_ns, np.float64)
        if not known.any():
            return np.zeros(len(wanted_ns))
        known_ns = self.time_ns[known].astype(np.float64)
        return np.asarray(np.interp(wanted_ns, known_ns, self.height_m[known]))

    @property
    def on_ground(self) -> NDArray[np.bool_]:
        """True where the autopilot reports the vehicle on the ground, shape (n,)."""
        found = np.zeros(len(self.time_ns), bool)
        for first, last in self.on_ground_ns:
            found |= (self.time_ns >= first) & (self.time_ns <= last)
        return found

    @property
    def leaves_ground(self) -> bool:
        """True if heights or the autopilot's reports show both times in flight and times on the
        ground.
        """
        on_ground = self.on_ground
        flown = self.flown_m[np.isfinite(self.flown_m)]
        climbed = len(flown) > 0 and float(np.ptp(flown)) >= TURNS.height_error_m
        return climbed or bool(on_ground.any() and not on_ground.all())

    @property
    def yaw_deg(self) -> _Floats:
        """Headings of the vehicle, clockwise from true north [deg], shape (n,)."""
        return Headings.from_quaternions(self.quaternion_wxyz).yaw_deg


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PulseColumns:
    """Pulses that have a pose and a power, as columns in order of time."""

    time_ns: NDArray[np.int64]
    latitude_deg: _Floats
    longitude_deg: _Floats
    height_m: _Floats
    """Height of the antenna above the take-off [m], shape (n,); NaN where unknown."""
    quaternion_wxyz: _Floats
    """Unit quaternions from the antenna frame (forward, right, down) to north-east-down, shape
    (n, 4)."""
    snr_db: _Floats
    noise_psd: _Floats
    """Noise density at each pulse [input units²/Hz], shape (n,); NaN where unknown."""
    frequency_hz: _Floats
    rate: NDArray[np.int64]
    """Number of the tag's pulse interval in use at each pulse, counted from 1, shape (n,)."""
    altitude_amsl_m: _Floats
    """Altitude of the antenna above sea level [m], shape (n,); NaN where unknown."""

    @property
    def noise_known(self) -> bool:
        """False if the noise at any pulse is unknown."""
        return bool(np.all(np.isfinite(self.noise_psd) & (self.noise_psd > 0.0)))

    @property
    def noise_db(self) -> _Floats:
        """Noise at each pulse relative to the usual noise at the same receiver gain [dB], shape
        (n,); 0 if any noise is unknown.

        Its sum with the SNR is the pulse's energy, which noise from a direction does not
        change.
        """
        noise = self.noise_psd
        if not self.noise_known:
            return np.zeros(len(noise))
        return over_usual_noise_db(10.0 * np.log10(noise), self.snr_db)

    @classmethod
    def of(cls, pulse_poses: Iterable[PulsePose]) -> "PulseColumns":
        """Convert pulses to columns in the given order; pulses without a pose are excluded."""
        posed = [(one.pulse, one.pose) for one in pulse_poses if one.pose is not None]
        poses = [pose for _, pose in posed]
        return cls(
            time_ns=np.array([pulse.start_time_ns for pulse, _ in posed], np.int64),
            latitude_deg=np.array([pose.latitude_deg for pose in poses]),
            longitude_deg=np.array([pose.longitude_deg for pose in poses]),
            height_m=np.array([pose.altitude_relative_m for pose in poses], np.float64),
            quaternion_wxyz=np.array([pose.quaternion_wxyz for pose in poses]).reshape(-1, 4),
            snr_db=np.array([pulse.snr_db for pulse, _ in posed]),
            noise_psd=np.array([pulse.noise_psd for pulse, _ in posed], np.float64),
            frequency_hz=np.array([pulse.frequency_hz for pulse, _ in posed], np.float64),
            rate=np.array([pulse.rate for pulse, _ in posed], np.int64),
            altitude_amsl_m=np.array([pose.altitude_amsl_m for pose in poses], np.float64),
        )

    def chosen(self, which: NDArray[np.intp] | slice) -> "PulseColumns":
        """Return the pulses selected by an index array or a mask."""
        return chosen_rows(self, which)

    def merged_with(self, others: "PulseColumns") -> "PulseColumns":
        """Merge with other pulses, in order of time."""
        both = joined_rows([self, others])
        return both.chosen(np.argsort(both.time_ns, kind="stable"))

    @property
    def poses(self) -> PoseColumns:
        """Poses of the antenna at the pulses."""
        return PoseColumns(
            time_ns=self.time_ns,
            latitude_deg=self.latitude_deg,
            longitude_deg=self.longitude_deg,
            height_m=self.height_m,
            quaternion_wxyz=self.quaternion_wxyz,
            altitude_amsl_m=self.altitude_amsl_m,
        )

    def missed_ns(self, rhythm: "Rhythm | None") -> _Floats:
        """Times of expected pulses between received ones that were not received [ns].

        They divide gaps between received pulses that are multiples of the tag's interval. A gap
        longer than a day's pulses counts as a jump of the clock.
        """
        if rhythm is None or len(self.time_ns) < 2:
            return np.zeros(0)
        number = np.clip(self.rate[:-1], 1, len(rhythm.intervals_s)) - 1
        interval_ns = np.array(rhythm.intervals_s)[number] * NANOSECONDS_PER_SECOND
        gap_ns = np.diff(self.time_ns)
        count = np.rint(gap_ns / interval_ns)
        slack_ns = NANOSECONDS_PER_SECOND * rhythm.uncertainty_s * count + 0.1 * interval_ns
        fits = (count > 1) & (count < FLIGHT.most_missed)
        fits &= np.abs(gap_ns - count * interval_ns) <= slack_ns
        fits &= np.cumsum(np.where(fits, count - 1, 0)) < FLIGHT.most_missed
        each = np.where(fits, count - 1, 0).astype(np.int64)
        gap = np.repeat(np.arange(len(each)), each)
        number = np.arange(1, len(gap) + 1) - np.repeat(np.cumsum(each) - each, each)
        return np.asarray(self.time_ns[gap] + gap_ns[gap] * number / count[gap])

    def turned(self, offset_deg: float) -> "PulseColumns":
        """Return a copy in which the antenna is rotated clockwise about its own down axis."""
        if offset_deg == 0.0:
            return self
        w, x, y, z = self.quaternion_wxyz.T
        c, s = np.cos(np.radians(offset_deg) / 2.0), np.sin(np.radians(offset_deg) / 2.0)
        parts = [w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s]
        return replace(self, quaternion_wxyz=np.stack(parts, axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightGround:
    """Ground model of a flight, and the flight's heights above it."""

    hills: HillLosses
    poses: PoseColumns

    @classmethod
    def of(
        cls,
        elevation: Elevation,
        poses: PoseColumns,
        lay: Callable[..., HillLosses] = HillLosses,
    ) -> "FlightGround | None":
        """Create the ground model around a flight; None if no pose has position and height.

        Heights in a flight are relative to its take-off, which is assumed to be below the first
        pose. `lay` creates the ground model, or returns an earlier one.
        """
        known = np.flatnonzero(np.isfinite(poses.latitude_deg) & np.isfinite(poses.height_m))
        if not len(known):
            return None
        first = int(known[0])
        hills = lay(
            elevation,
            latitude_deg=float(poses.latitude_deg[first]),
            longitude_deg=float(poses.longitude_deg[first]),
        )
        said = list(elevation.cautions)
        height_m = float(poses.height_m[first])
        if height_m > TURNS.height_error_m:
            said.append(
                f"the flight's poses begin {height_m:.0f} m up: its heights are counted from "
                "the ground beneath that place"
            )
        said += height_warning(hills.start_amsl_m, float(poses.amsl_m[first]) - height_m)
        return cls(hills=hills.with_limitations(*said), poses=poses)

    def with_limitations(self, *limitations: str) -> "FlightGround":
        """Copy with further limitations for the operator."""
        return replace(self, hills=self.hills.with_limitations(*limitations))

    def at(self, frequency_hz: float) -> "FlightGround":
        """Return a copy with the losses behind hills for a tag at this frequency."""
        return replace(self, hills=self.hills.at(frequency_hz))

    def heights_m(self, time_ns: Sequence[int]) -> _Floats:
        """Heights above the take-off at given times [m]."""
        return self.poses.heights_m(time_ns)


def height_warning(ground_m: float, said_m: float) -> tuple[str, ...]:
    """Return a warning if the elevation files (`ground_m`) and the flight (`said_m`) give
    different heights for the take-off.
    """
    if (
        not abs(said_m - ground_m) > FLIGHT.reported_height_m
    ):  # also if one of the heights is unknown
        return ()
    return (
        f"the take-off is at {ground_m:.0f} m in the elevation files and at {said_m:.0f} m "
        "in the flight: the height datums differ, or the take-off position is wrong. "
        "Heights are measured from the take-off in the elevation files",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Rhythm:
    """Intervals between a tag's pulses, and their uncertainty."""

    intervals_s: tuple[float, ...]
    uncertainty_s: float

    @classmethod
    def of(cls, tag: Tag) -> "Rhythm":
        """Return a tag's pulse intervals from its entry in the tag list."""
        return cls(intervals_s=tag.pulse_intervals_s, uncertainty_s=tag.interval_uncertainty_s)


def _far_from(known_ns: NDArray[np.int64], times_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """True for times farther than `FLIGHT.pose_gap_ns` from all `known_ns`, which must be
    ascending; shape (n,).
    """
    if not len(known_ns):
        return np.ones(len(times_ns), bool)
    after = np.searchsorted(known_ns, times_ns)
    before_ns = times_ns - known_ns[np.maximum(after - 1, 0)]
    after_ns = known_ns[np.minimum(after, len(known_ns) - 1)] - times_ns
    return np.asarray(np.minimum(np.abs(before_ns), np.abs(after_ns)) > FLIGHT.pose_gap_ns)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Heard:
    """Pulses and poses of one receiver in a flight or log, as columns."""

    pulses: Mapping[int, PulseColumns]
    poses: PoseColumns
    """Poses of the vehicle, reduced in number; gaps are filled with the poses stored with
    pulses."""
    tags: tuple[Tag, ...] = ()
    """Entries of the tag list of a flight; empty for a log."""
    antenna: str = "RA-23K"
    """Name of the receiving antenna's pattern, unless `EstimationOptions` sets another."""
    name: str = "this vehicle"
    """Name of the receiver as shown to the operator."""
    one_turn: bool = False
    """True to treat a log at one position and without a climb as one turn, as UAV-RT does."""
    goes_on: bool = False
    """True while more data may arrive; only complete turns are then used to correct the antenna
    pattern."""

    @classmethod
    def of(
        cls,
        tag_id: NDArray[np.int64],
        pulses: PulseColumns,
        poses: PoseColumns | None = None,
        *,
        tags: Sequence[Tag] = (),
        antenna: str = "RA-23K",
        name: str = "this vehicle",
        goes_on: bool = False,
    ) -> "Heard":
        """Sort pulses by tag and time; pulses without position or power are excluded.

        Times are rounded to 256 ns, the resolution of columns of floating-point numbers.
        """
        usable = np.isfinite(pulses.snr_db) & np.isfinite(pulses.quaternion_wxyz[:, 0])
        usable &= np.isfinite(pulses.latitude_deg) & np.isfinite(pulses.longitude_deg)
        order = np.flatnonzero(usable)
        order = order[np.argsort(pulses.time_ns[order], kind="stable")]
        every = pulses.chosen(order)
        every, tag_id = replace(every, time_ns=_in_ticks(every.time_ns)), tag_id[order]
        own = every.poses
        if poses is not None:
            known = poses.chosen(np.isfinite(poses.latitude_deg))
            own = replace(known, time_ns=_in_ticks(known.time_ns)).completed(own)
        elif len(own.time_ns):
            own = own.chosen(np.unique(own.time_ns, return_index=True)[1])
        return cls(
            pulses={
                int(one): every.chosen(np.flatnonzero(tag_id == one))
                for one in np.unique(tag_id)
            },
            poses=_thinned(own),
            tags=tuple(tags),
            antenna=antenna,
            name=name,
            one_turn=poses is None and _in_place(own) and not own.leaves_ground,
            goes_on=goes_on,
        )

    @classmethod
    def of_records(
        cls,
        pulse_poses: Sequence[PulsePose],
        poses: Sequence[Pose] | None = None,
        on_ground_ns: tuple[tuple[int, int], ...] = (),
        *,
        tags: Sequence[Tag] = (),
        antenna: str = "RA-23K",
        name: str = "this vehicle",
        goes_on: bool = False,
    ) -> "Heard":
        """Convert records of pulses and poses; a log has no `poses`. Raises `UsageError` if no
        pulse has a pose.
        """
        if pulse_poses and all(one.pose is None for one in pulse_poses):
            raise UsageError(
                "no pulse has a pose, so headings are unknown",
                remedy="Use a log that was recorded with the autopilot connected",
            )
        posed = [one for one in pulse_poses if one.pose is not None]
        return cls.of(
            np.array([one.pulse.tag_id for one in posed], np.int64),
            PulseColumns.of(posed),
            None if poses is None else PoseColumns.of(poses, on_ground_ns),
            tags=tags,
            antenna=antenna,
            name=name,
            goes_on=goes_on,
        )

    def rhythm(self, tag_id: int) -> "Rhythm | None":
        """Pulse intervals of a tag; None if the tag is not listed."""
        return next((Rhythm.of(tag) for tag in self.tags if tag.tag_id == tag_id), None)

    def renamed(self, keys: Mapping[int, int]) -> "Heard":
        """Return a copy with other tag ids; `keys` maps old ids to new ones."""
        return replace(
            self,
            pulses={keys.get(tag_id, tag_id): own for tag_id, own in self.pulses.items()},
            tags=tuple(
                replace(tag, tag_id=keys.get(tag.tag_id, tag.tag_id)) for tag in self.tags
            ),
        )

    def merged_with(self, other: "Heard") -> "Heard":
        """Merge with the pulses and poses of another receiver, as if both belonged to one
        flight.
        """
        pulses = dict(self.pulses)
        for tag_id, own in other.pulses.items():
            pulses[tag_id] = pulses[tag_id].merged_with(own) if tag_id in pulses else own
        listed = {tag.tag_id: tag for tag in (*self.tags, *other.tags)}
        return replace(
            self,
            pulses=pulses,
            poses=self.poses.completed(other.poses),
            tags=tuple(listed.values()),
            one_turn=False,
        )

    @property
    def frequencies_hz(self) -> dict[int, float]:
        """Median frequency of each tag's received pulses [Hz]; for a tag without pulses, the
        listed frequency.
        """
        found = {tag.tag_id: tag.frequency_hz for tag in self.tags}
        for tag_id, own in self.pulses.items():
            known_hz = own.frequency_hz[own.frequency_hz >= FLIGHT.least_tag_hz]
            if len(known_hz):
                found[tag_id] = float(np.median(known_hz))
        return found

    def over(
        self, elevation: Elevation | None, lay: Callable[..., HillLosses] = HillLosses
    ) -> FlightGround | None:
        """Return the ground model at the pulses' median frequency; None without elevation data.
        Raises `FormatError`.
        """
        over = None if elevation is None else FlightGround.of(elevation, self.poses, lay)
        heard_hz = [own.frequency_hz for own in self.pulses.values()]
        every_hz = np.concatenate(heard_hz) if heard_hz else np.zeros(0)
        known_hz = every_hz[np.isfinite(every_hz)]
        if over is None or not len(known_hz):
            return over
        return over.at(float(np.round(np.median(known_hz), -FLIGHT.hills_digits)))


def _in_ticks(time_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    return time_ns.astype(np.float64).astype(np.int64)


def _thinned(poses: PoseColumns) -> PoseColumns:
    if not len(poses.time_ns):
        return poses
    slots = (poses.time_ns - poses.time_ns[0]) // FLIGHT.pose_step_ns
    return poses.chosen(np.unique(slots, return_index=True)[1])


def _in_place(poses: PoseColumns) -> bool:
    if not len(poses.time_ns):
        return False
    plane = TangentPlane(
        latitude_deg=float(np.median(poses.latitude_deg)),
        longitude_deg=float(np.median(poses.longitude_deg)),
    )
    off = np.hypot(*plane.to_local(poses.latitude_deg, poses.longitude_deg))
    return bool(off.max() <= RECEIVERS.one_place_m)
