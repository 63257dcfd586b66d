"""Define the records that are passed between processing stages and processes.

All are immutable, unknown values are ``None``, times are integer nanoseconds UTC, and names
contain the units. Records travel between processes as JSON (``uavrt.drone.ipc``); sample blocks
use separate sockets.
"""

from dataclasses import dataclass, field, replace
from enum import StrEnum
from math import inf, isfinite
from typing import TYPE_CHECKING, Literal

import msgspec

from uavrt.core.commands import CommandName as CommandName
from uavrt.core.commands import SystemState as SystemState

if TYPE_CHECKING:
    # Half of the processes never see a sample; NumPy would cost each 12 MB and 0.1 s.
    import numpy as np
    from numpy.typing import NDArray

DetectionStatus = Literal["subthreshold", "detected", "confirmed", "integrated"]
"""Certainty of a pulse: below the threshold (found by a track), above the threshold, or
confirmed by a track. *integrated*: found after the flight by an analysis of all its data;
never in flight or over radio."""

_SAME_SENDER_HZ = 300.0
"""Maximum frequency difference of two measurements of one sender [Hz]."""
_SAME_RATE = 0.01
"""Maximum relative difference of two measured pulse intervals of one sender."""
_KILOHERTZ_FROM_HZ = 995.0

DEFAULT_FALSE_ALARM_PROBABILITY = 0.01
"""False-alarm probability of a tag if its entry in the tag list has none."""
WHOLE_FLIGHT_FALSE_ALARM = 0.01
"""Probability that the search of a whole flight reports a tag that is not there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tag:
    """A radio tag as described in the tag list."""

    tag_id: int
    frequency_hz: float
    """Nominal carrier frequency [Hz]."""
    pulse_width_s: float
    pulse_intervals_s: tuple[float, ...]
    """Time from pulse start to pulse start [s], for one or two rates."""
    interval_uncertainty_s: float = 0.0
    """Largest constant but unknown error of the interval [s]; it accumulates."""
    interval_jitter_s: float = 0.0
    """Largest independent timing error of each pulse [s]; it does not accumulate."""
    k: int = 3
    """Number of pulses (coded tag: bursts) that the detector sums for one decision."""
    false_alarm_probability: float = DEFAULT_FALSE_ALARM_PROBABILITY
    """Expected number of false detections of a group of K pulses, in each decision interval."""
    name: str | None = None
    frequency_slide_hz: float = 0.0
    """Change of the frequency from the start to the end of each pulse [Hz]."""
    gaps_s: tuple[float, ...] = ()
    """Times from pulse start to pulse start within a coded tag's burst [s]; empty for a beeping
    tag. A coded tag's `pulse_intervals_s` are the times between bursts, and its `k` is the
    largest number of summed bursts."""

    @property
    def coded(self) -> bool:
        """True for a coded tag, which sends bursts with gaps that identify the tag."""
        return bool(self.gaps_s)

    @property
    def length_s(self) -> float:
        """Time from the start to the end of a pulse [s]; for a coded tag, of a burst."""
        return sum(self.gaps_s) + self.pulse_width_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulse:
    """One pulse of a tag, as a detector reports it; each pulse is reported once."""

    tag_id: int
    frequency_hz: float
    """Measured carrier frequency, in the middle of the pulse [Hz]."""
    start_time_ns: int
    """Start of the pulse at the antenna [ns, UTC]; all filter delays are corrected."""
    end_time_ns: int
    snr_db: float
    """Ratio of pulse energy to noise power density (ENR) [dB]."""
    group_snr_db: float
    """Mean SNR of the K pulses that were detected together [dB]; their powers are averaged."""
    score: float
    """Ratio of the detector's test statistic to its threshold; from 1 on, the pulse is
    detected."""
    group_index: int
    """Number of the pulse among the K pulses detected together (its group), from 1."""
    group_sequence: int
    """Number of the group of K pulses, increasing for each tag and rate."""
    noise_psd: float
    """Noise power density at the pulse's frequency [input units squared per hertz]."""
    detection_status: DetectionStatus
    confirmed: bool
    rate: int
    """Number of the pulse interval that the tag uses: 1 or 2, for the first or second entry of
    `Tag.pulse_intervals_s`."""
    predicted_next_start_ns: int | None
    predicted_next_end_ns: int | None
    also_possible_tag_ids: tuple[int, ...] = ()
    """Ids of other listed tags that may have sent the pulse; `tag_id` is the likeliest. The
    pulse has only this one record."""
    ghost_of_tag_id: int | None = None
    """Id of the stronger tag if this pulse is a spurious signal (image or saturation) of it;
    None for a real pulse."""
    clipped: bool = False
    """True if the receiver's converter was saturated; `snr_db` is then a lower bound."""
    burst_starts_ns: tuple[int, ...] = ()
    """Measured start times of the pulses in a coded tag's burst, which is one record [ns, UTC].
    Overlapped and lost pulses are not included. Empty for other tags."""
    burst_snrs_db: tuple[float, ...] = ()
    """SNR of each pulse in `burst_starts_ns` [dB]; `snr_db` is their linear mean."""

    @property
    def key(self) -> "PulseKey":
        """Tag number and start time [ns], which identify the pulse within a flight."""
        return self.tag_id, self.start_time_ns


PulseKey = tuple[int, int]
"""Tag number and start time [ns] of a pulse, unique within a flight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstInside:
    """Times and SNR of the pulses in a coded tag's burst; sent after the burst's record."""

    tag_id: int
    start_time_ns: int
    """Start of the burst, as in its pulse message [ns, UTC]."""
    burst_starts_ns: tuple[int, ...]
    burst_snrs_db: tuple[float, ...]
    also_possible_tag_ids: tuple[int, ...] = ()

    @property
    def key(self) -> "PulseKey":
        """Tag number and start time [ns], which identify the burst within a flight."""
        return self.tag_id, self.start_time_ns

    def put_into(self, pulse: Pulse) -> Pulse:
        """Copy a burst's record; add times and SNR of its pulses, and other possible tags."""
        return replace(
            pulse,
            burst_starts_ns=self.burst_starts_ns,
            burst_snrs_db=self.burst_snrs_db,
            also_possible_tag_ids=self.also_possible_tag_ids,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchReport:
    """Report that a search detected nothing, which shows that the detector works."""

    tag_id: int
    time_ns: int
    """End of the searched time span [ns, UTC]."""
    frequency_hz: float
    noise_psd: float
    best_score: float
    """Maximum ratio of test statistic to detection threshold in the time span; below 1."""
    usable_share: float | None = None
    """Fraction of the time in which no other signal was on the tag's frequency; None if
    unknown."""
    weakest_enr_db: float | None = None
    """Ratio of pulse energy to noise power density (ENR) at which 90 % of groups of K pulses
    would have been found [dB]; None if unknown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Position and attitude of the antenna at one instant."""

    time_ns: int
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    altitude_relative_m: float
    quaternion_wxyz: tuple[float, float, float, float]
    """Unit quaternion, antenna body frame (forward, right, down) to north-east-down."""
    extrapolated: bool = False
    """True if the pose is extrapolated, or if the autopilot's clock has not been known for 10
    s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeSample:
    """Attitude of the vehicle as the autopilot reports it, timed by this computer's clock."""

    time_ns: int
    quaternion_wxyz: tuple[float, float, float, float]
    """Unit quaternion, vehicle body (forward, right, down) to north-east-down."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionSample:
    """Position of the vehicle as the autopilot reports it, timed by this computer's clock."""

    time_ns: int
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    altitude_relative_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PulsePose:
    """A pulse, and the antenna's pose at the middle of the pulse; None if unknown."""

    pulse: Pulse
    pose: Pose | None


class BeepKind(StrEnum):
    """Kind of a received sender of pulses, as found by comparison with the tag list."""

    LISTED = "listed"
    """A sender that has the frequency and interval of a listed tag."""
    OFF_LABEL = "off label"
    """A sender with a listed tag's interval at another frequency."""
    OTHER_RATE = "other rate"
    """A sender at a listed tag's frequency with another interval."""
    MIRRORED = "mirrored"
    """A listed tag on the other side of the centre frequency: I and Q are swapped."""
    UNLISTED = "unlisted"
    IMAGE = "image"
    """An image of stronger pulses, produced by the receiver."""
    NOT_ANIMAL = "not an animal"
    DOUBTFUL = "doubtful"


_OF_A_TAG = (BeepKind.OFF_LABEL, BeepKind.OTHER_RATE, BeepKind.MIRRORED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Beep:
    """A sender of regular pulses, and the listed tags that it may be."""

    kind: BeepKind
    time_ns: int
    """Time of the sender's last pulse so far [ns, UTC]."""
    frequency_hz: float
    interval_s: float
    jitter_s: float
    """Standard deviation of the pulse times about the interval [s]."""
    pulses: int
    level_db: float
    """Median level of the pulses above the noise in 94 Hz [dB]."""
    tag_ids: tuple[int, ...] = ()
    """Ids of tags that the sender may be, likeliest first; an image has its original's ids."""
    offsets_hz: tuple[float, ...] = ()
    """Frequency of the sender minus the listed frequency, for each tag in `tag_ids` [Hz]."""
    image_of_hz: float | None = None
    reason: str = ""
    """Reason why the sender may not be an animal's tag, or another cause of its pulses; empty
    if there is none."""

    def __post_init__(self) -> None:
        """Raise `ValueError` for impossible values; they may come from radio or files."""
        numbers = (self.frequency_hz, self.interval_s, self.jitter_s, self.level_db)
        if not all(map(isfinite, (*numbers, self.image_of_hz or 0.0))) or self.interval_s <= 0:
            raise ValueError(f"a beep has invalid values: {numbers}")
        if len(self.tag_ids) != len(self.offsets_hz):
            raise ValueError("a beep needs one offset for each tag")
        if not all(1.0 <= self.frequency_hz - one < inf for one in self.offsets_hz):
            raise ValueError(
                f"a beep has offsets that are not below its frequency: {self.offsets_hz}"
            )
        if self.kind in _OF_A_TAG and not self.tag_ids:
            raise ValueError(f"a beep of kind {self.kind!r} needs a tag")

    @property
    def away_hz(self) -> float | None:
        """Sender's frequency minus that of the likeliest listed tag [Hz]; None without a
        tag.
        """
        return self.offsets_hz[0] if self.offsets_hz else None

    def same_as(self, other: "Beep") -> bool:
        """True if two measurements are of the same sender."""
        return self._near(other) and self.kind is other.kind

    def replaced_by(self, other: "Beep") -> bool:
        """True if `other` is of this sender, and exactly one of them assumes I/Q swapped."""
        mirrored = self.kind is BeepKind.MIRRORED
        decided = mirrored is not (other.kind is BeepKind.MIRRORED)
        at_one_rate = abs(self.interval_s - other.interval_s) < _SAME_RATE * self.interval_s
        return decided and at_one_rate and self._near(other)

    def _near(self, other: "Beep") -> bool:
        return abs(self.frequency_hz - other.frequency_hz) < _SAME_SENDER_HZ

    @property
    def odd(self) -> bool:
        """True if the operator should look at the sender.

        False for a listed tag, and for a doubtful sender without a likely tag.
        """
        if self.kind is BeepKind.DOUBTFUL:
            return bool(self.tag_ids)
        return self.kind is not BeepKind.LISTED

    @property
    def meaning(self) -> str:
        """Sentence for the operator on what the sender may be."""
        mirrored = [self.reason] if self._maybe_mirrored else []
        reason = f", {self.reason}" if self.reason and not mirrored else ""
        match self.kind:
            case BeepKind.OFF_LABEL | BeepKind.LISTED if self.tag_ids:
                return " or ".join([*self._names(), *mirrored])
            case BeepKind.OTHER_RATE:
                first = f"tag {self.tag_ids[0]} with another pulse rate{reason}"
                return " or ".join([first, *self._names()[1:], *mirrored])
            case BeepKind.MIRRORED:
                return f"tag {self.tag_ids[0]} mirrored at the centre: I and Q are swapped"
            case BeepKind.IMAGE:
                of = f"spurious image of {(self.image_of_hz or 0.0) / 1e6:.6f} MHz"
                return of + (f" (tag {self.tag_ids[0]})" if self.tag_ids else "")
            case BeepKind.DOUBTFUL if self.tag_ids:
                return (
                    f"doubtful signal at the frequency of tag {self.tag_ids[0]}: {self.reason}"
                )
        return f"{self.kind}{reason}"

    @property
    def advice(self) -> str:
        """Sentence for the operator on what to do about the sender; empty if nothing."""
        if self._maybe_mirrored:
            return "? A second tag shows which"
        return _ADVICE.get(self.kind, "")

    @property
    def ambiguous(self) -> bool:
        """True if the sender may be one of several tags, or a tag at its mirror frequency."""
        return len(self.tag_ids) > 1 or self._maybe_mirrored

    @property
    def _maybe_mirrored(self) -> bool:
        return self.reason.endswith(_SWAPPED)

    def __str__(self) -> str:
        """Describe the sender in one line, for the operator."""
        rate = 60.0 / self.interval_s
        return (
            f"{self.level_db:.0f} dB at {self.frequency_hz / 1e6:.6f} MHz, "
            f"{self.pulses} pulses every {1e3 * self.interval_s:.0f} ms ({rate:.0f} a minute): "
            f"{self.meaning}{self.advice}"
        )

    def _names(self) -> list[str]:
        return [
            f"tag {tag_id}, {_distance(abs(away_hz))} {'above' if away_hz > 0.0 else 'below'} "
            "its label"
            for tag_id, away_hz in zip(self.tag_ids, self.offsets_hz, strict=True)
        ]


_SWAPPED = " mirrored (I and Q swapped)"


def mirrored_reason(tag_id: int) -> str:
    """Text for `Beep.reason` of a sender that may be this tag at its mirror frequency."""
    return f"tag {tag_id}{_SWAPPED}"


_ADVICE = {
    BeepKind.OFF_LABEL: "? List it at this frequency",
    BeepKind.OTHER_RATE: "? List this interval",
    BeepKind.MIRRORED: ". Swap them in the radio's program or format",
    BeepKind.IMAGE: ", made in the receiver. Reduce its gain",
}


def _distance(hz: float) -> str:
    return f"{hz:.0f} Hz" if hz < _KILOHERTZ_FROM_HZ else f"{hz / 1e3:.1f} kHz"


def keep_beep(known: list[Beep], new: Beep) -> bool:
    """Store a sender's measurement in place of an older one; True if the sender is new.

    If a second tag shows that I and Q are swapped, the new measurement replaces ambiguous ones.
    """
    replaced = [one for one in known if one.replaced_by(new)]
    if replaced and new.ambiguous:
        return False
    known[:] = [one for one in known if one not in replaced]
    for place, other in enumerate(known):
        if other.same_as(new):
            known[place] = new
            return False
    known.append(new)
    return True


MOST_BEEPS = 32
"""Maximum number of unlisted senders that a drone reports and a page shows."""


def drop_beeps(known: list[Beep]) -> int:
    """Drop senders beyond the maximum number; return how many were dropped.

    Unlisted senders with few pulses are dropped first.
    """
    excess = max(0, len(known) - MOST_BEEPS)
    for one in sorted(known, key=lambda one: (bool(one.tag_ids), one.pulses))[:excess]:
        known.remove(one)
    return excess


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveBearing:
    """A bearing estimated on the drone, from a turn that may still be in progress."""

    tag_id: int
    start_time_ns: int
    end_time_ns: int
    turned_deg: float
    latitude_deg: float
    longitude_deg: float
    bearing_deg: float
    """Bearing of the tag, clockwise from true north [°]."""
    sigma_deg: float
    interval90_deg: tuple[float, float]
    """Arc that contains the bearing with a probability of 90 % [°], clockwise from the first to
    the second value."""
    level_db: float | None
    """SNR with the antenna pointed at the tag [dB]; None if not estimated."""
    pulses: int
    accepted: bool
    """True if the SNR of the pulses clearly depends on the direction of the antenna."""
    ambiguous: bool
    multipath_suspected: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivered:
    """Report of pulses that a ground station has stored, or that were sent without receipts."""

    time_ns: int
    store: int
    """Id of the ground station's database that stores the pulses. 0: the pulses were sent once
    to stations that send no receipts."""
    pulses: tuple[PulseKey, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """Report that pulses are stored on the disk, each with a pose or without one."""

    pulses: tuple[PulseKey, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordsHandled:
    """Number of records that a process has handled; after a restart it receives the rest."""

    records: int
    """Number of received records that are on the disk or need no storage. The first record,
    which assigns the process its task, is not counted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Poses:
    """Consecutive poses of the vehicle, in one record for the recorder."""

    poses: tuple[Pose, ...]


STATION_COUNTER = "station_silent_s_"
"""Prefix of counters in the `Health` of the connection process, which give the time since a
ground station was last received [s]. The ids of the station follow:
``station_silent_s_255_190``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """State of a process, reported about once a second."""

    process: str
    time_ns: int
    status: str
    """State in a few words: ``"ready"``, ``"waiting for autopilot"``, ``"radio absent"``."""
    ok: bool
    counters: dict[str, float] = field(default_factory=dict)
    """Counts since the process started, by name: samples lost, pulses refused, retries …"""
    reason: str = ""
    """Reason why the process is not `ok`, with a remedy; at its end, the result."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessStatus:
    """State of one process, as seen by the supervisor."""

    process: str
    running: bool
    pid: int | None
    status: str
    ok: bool
    restarts: int
    cpu_s: float
    """CPU time of the process and its children, over all restarts, since the supervisor started
    [s]."""
    memory_mb: float
    counters: dict[str, float] = field(default_factory=dict)
    reason: str = ""
    """Reason why the process is not `ok`, with a remedy; empty otherwise."""
    tag_ids: tuple[int, ...] = ()
    """Ids of the tags that the process searches for, if it is a detector."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusText:
    """A short text for the operator, with MAVLink's severity: 0 (emergency) to 7 (debug)."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SystemStatus:
    """State of the drone's processes and computer, published once a second."""

    time_ns: int
    state: SystemState
    flight_directory: str | None
    center_frequency_hz: float | None
    tags: tuple[Tag, ...]
    processes: tuple[ProcessStatus, ...]
    commander: str | None = None
    """Station that is in command, as the source of its commands: ``"mavlink 255/190"``; None if
    no station is."""
    ending: bool = False
    """True from the stop command until the last pulses are recorded."""
    faults: tuple[StatusText, ...] = ()
    """Lasting faults of the computer, such as a full disk; every status lists all of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """An operator's command to the supervisor, by radio, page or command line."""

    name: CommandName
    request_id: int
    """Number of the request; a retry has an equal number, so that it is not carried out
    twice."""
    tag: Tag | None = None
    center_frequency_hz: float | None = None
    """Radio's centre frequency chosen by the operator [Hz]; None: computed from the tags."""
    gain: int | None = None
    parameter: str | None = None
    value: float | None = None
    """New value of the parameter; None for commands that set no parameter."""
    source: str = ""
    """Sender: ``"mavlink 255/190"``, ``"ros2"``, ``"command line"``."""
    sealed: bool = False
    """True if the command was authenticated with the drone's key."""
    tag_count: int | None = None
    """Number of tags that were sent, at the end of an upload or at a start; None if unknown.
    The drone refuses to start with fewer tags."""
    values: dict[str, float] = field(default_factory=dict)
    """Other numbers in the command, by the field's name in `uavrt.core.commands`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandReply:
    """The supervisor's answer to a command."""

    request_id: int
    name: CommandName
    accepted: bool
    message: str
    """Reason for a refusal, or a detail such as the flight's directory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Operation:
    """Progress of a job that continues after its command was answered."""

    name: CommandName
    state: Literal["running", "complete", "failed"]
    step: int = 0
    step_count: int = 0
    """Total number of steps of the job; 0: unknown."""
    message: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightInfo:
    """Description of a started flight: directory, clock, radio frequency and tags."""

    directory: str
    start_time_ns: int
    clock_offset_ns: int
    """UTC minus CLOCK_MONOTONIC [ns], fixed at the start of the flight, so that later changes
    of the wall clock have no effect."""
    center_frequency_hz: float
    sample_rate_hz: float
    tags: tuple[Tag, ...]
    capture_s: float | None = None
    """Duration of a raw recording without tags and detection [s]; None for a flight."""


MotionAction = Literal["rotate", "goto", "survey", "hold", "return", "search", "takeoff"]


SurveyPattern = Literal["lines", "around", "points"]
"""Pattern of a survey: lines, laps along its outline, or full turns at points."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeepOut:
    """An area that must not be flown over, such as a building or a place with people."""

    places: tuple[tuple[float, float], ...]
    """Latitude and longitude [°] of a polygon's corners, or of a circle's centre."""
    radius_m: float | None = None
    """Radius of the area if it is a circle [m]; None for a polygon."""
    name: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleFence:
    """The geofence that the autopilot reports."""

    within: tuple[KeepOut, ...] = ()
    """Areas that the vehicle must stay inside."""
    keep_out: tuple[KeepOut, ...] = ()
    """Areas that the vehicle must not enter."""
    fault: str | None = None
    """Reason why the geofence cannot be used, which prevents all motions; None if it can be
    used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A motion that an operator can request."""

    action: MotionAction
    places: tuple[tuple[float, float], ...] = ()
    """Latitude and longitude [°] of a goal, or of the corners of an outline."""
    height_m: float | None = None
    """Height above home at which the motion is flown [m]; None: the present height."""
    duration_s: float = 60.0
    """Duration of a full turn, or longest duration of a search [s]."""
    clockwise: bool = True
    spacing_m: float = 60.0
    """Distance between the lines or points of a survey [m]."""
    pattern: SurveyPattern = "lines"
    tags: tuple[int, ...] = ()
    """Numbers of tags to search for; empty: all listed tags."""
    radius_m: float | None = None
    """Radius of a search around the drone [m]; None: the search has an outline."""
    accuracy_m: float = 25.0
    """Target accuracy [m]: radius of the circle around the estimate that contains the tag with
    a probability of 95 %."""
    keep_out: tuple[KeepOut, ...] = ()
    """Areas that must not be flown over, in addition to those of the settings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionRequest(Motion):
    """A motion requested by an operator; nothing moves before it is confirmed."""

    request_id: int
    """Number of the request, chosen by the sender."""
    requester: tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundTag:
    """A tag found by one drone, as reported to the other drones."""

    tag_id: int
    place: tuple[float, float]
    """Latitude and longitude [°] of the tag, as estimated."""
    radius95_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """Report of a drone to the other drones: its position, its leg and its tags.

    While it flies the leg, no other drone may cross the straight line from its position to its
    goal.
    """

    sequence: int
    """Number of the report, modulo 65536."""
    place: tuple[float, float]
    """Latitude and longitude [°] of the drone."""
    altitude_amsl_m: float
    goal: tuple[float, float]
    """Latitude and longitude [°] of the end of the present leg, or of the drone itself if it
    does not move."""
    searching: bool = False
    """True if this drone has a confirmed search order."""
    returning: bool = False
    flown: int = 0
    """Number of the leg that the ground station assigned and the drone is flying; 0: none."""
    asked: int = 0
    """Number of the leg that the drone requests; 0: none."""
    requested_leg: tuple[tuple[float, float], ...] = ()
    """Start and end of the requested leg, as latitude and longitude [°]; empty: none."""
    given: tuple[tuple[int, int], ...] = ()
    """Ids of the other drones, each with the version of its leg that was considered for the
    requested leg."""
    held: tuple[int, ...] = ()
    """Ids of the tags that the drone is searching for at present."""
    found: tuple[FoundTag, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbour:
    """A ground station's report of another drone; information only, not a command."""

    vehicle: int
    """MAVLink system id of the other drone; 0 means that other drones exist but none has
    reported yet."""
    version: int = 0
    """Number that identifies the other drone's leg; changes with each new leg."""
    granted: int = 0
    """Number of the leg that the receiver of this report requested and may now fly; 0: none."""
    denied: int = 0
    """Number of the leg that the receiver of this report requested and may not fly; 0: none."""
    age_s: float = 0.0
    """Time since the other drone's last report [s]."""
    course: Course | None = None
    """Last report of the other drone; None if unknown. Its `requested_leg` is a leg that is
    assigned but not yet begun."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SoughtTag:
    """Present estimate of one tag during a search."""

    tag_id: int
    latitude_deg: float
    longitude_deg: float
    radius95_m: float
    existence: float
    """Probability that the tag is in the area and transmits."""
    found_s: float | None
    """Time from the start of the search to the find [s]; None: not found yet."""
    pulses: int
    missed: int
    """Number of expected pulses that were not received."""
    likely: tuple[tuple[float, float, float], ...] = ()
    """Squares of the area that most likely contain a tag that is not found yet: latitude and
    longitude of the centre [°], and probability."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchNote:
    """Entry in the log of a search: start, end, decision or found tag, with the reason."""

    time_ns: int
    order_id: int
    event: Literal["begun", "decision", "found", "ended"]
    text: str
    reason: str
    """Reason for the logged event or decision, with numbers."""
    elapsed_s: float
    latitude_deg: float
    longitude_deg: float
    height_m: float
    """Height of the drone above home [m]."""
    battery_percent: float | None
    tags: tuple[SoughtTag, ...]
    tag_id: int | None = None
    """Id of the tag that was found; None for other events."""
    goal: tuple[float, float] | None = None
    """Latitude and longitude [°] of the destination; None if there is none."""
    area: tuple[tuple[float, float], ...] = ()
    """Corners of the search area, as latitude and longitude [°]; empty except at the start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionOffer:
    """Plan of a requested motion for the operator to confirm, or the refusal of the request."""

    request_id: int
    requester: tuple[int, int]
    order_id: int
    nonce: int
    """Random number that the confirmation must contain; it is valid for one confirmation."""
    summary: str
    mode: str = ""
    """Present flight mode of the autopilot, which the motion would end."""
    refused: bool = False
    """True if the request is refused; the summary contains the reason."""
    takeoff: bool = False
    """True if the order begins with a take-off from the ground."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleStatus:
    """State of the vehicle and its response to uavrt's commands, as the autopilot reports."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    altitude_relative_m: float
    speed_m_s: float
    yaw_deg: float | None
    home: tuple[float, float]
    battery_percent: float | None
    obeyed: bool
    """True if the autopilot's reports show that it carries out uavrt's last command."""
    requests_sent: int
    requests_refused: int
    turned_deg: float
    ground_silent_s: float
    settling: bool = False
    """True if the vehicle is still moving near its target; only return and stop are allowed."""
    heading_rests: bool = True
    """True if the heading is steady; a turn in place may begin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleReport:
    """State of the vehicle and of uavrt's control over it, sent ten times a second."""

    autopilot: str | None
    """Kind of the autopilot, ``"px4"`` or ``"ardupilot"``; None if it is of another kind or not
    received."""
    fault: str | None
    """Reason why no motion can be confirmed now, with a remedy; None if possible."""
    takeoff_fault: str | None = field(kw_only=True, default=None)
    """Reason why no take-off can be confirmed now, with a remedy; None if possible."""
    standing: str = "out"
    """State of uavrt's control: ``"out"`` (nothing may be sent), ``"confirmed"`` by the
    operator but no command sent yet, or ``"in command"`` (commands were sent)."""
    reason: str = ""
    """Reason why nothing may be sent, if `standing` is ``"out"``."""
    order_id: int | None = None
    mode: str = ""
    seen: VehicleStatus | None = None
    """State of the vehicle; None if its position or home is unknown."""
    wind_m_s: tuple[float, float] | None = None
    """Wind velocity to the east and north [m/s]; None if not reported."""


class FlyThere(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """Fly straight to a position and stay, with a heading if the autopilot accepts it."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    yaw_deg: float | None = None
    """Heading at the position [°]; None: chosen by the autopilot."""


class TurnInPlace(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """Turn in place by one command, if the autopilot supports it."""

    turn_deg: float
    """Angle of at most one turn, clockwise [°]; negative: counterclockwise."""
    rate_deg_s: float


class GoHome(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """Fly home in the autopilot's return mode, which lands as configured; ends the order."""


class TakeMode(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """Set the flight mode in which motions are flown, on the ground before a take-off."""


class TakeOff(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """Climb straight up from the ground, after a pilot has armed."""

    height_m: float
    altitude_amsl_m: float


Manoeuvre = FlyThere | TurnInPlace | GoHome | TakeMode | TakeOff


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleRequest:
    """A requested motion, which `uavrt.guidance.control` permits or refuses."""

    order_id: int | None
    manoeuvre: Manoeuvre | None = None
    """Requested motion; None if there is no new request and the record only shows that the
    requester still runs."""
    ends: bool = False
    """True if the order has ended."""
    status_text: str = ""
    """Text on the progress of the order, or on why the order has ended."""


@dataclass(frozen=True, slots=True, eq=False)
class IQBlock:
    """Consecutive complex samples of a radio.

    Blocks follow each other without a gap unless `lost_before` counts missing samples.
    """

    samples: "NDArray[np.complex64]"
    """(n,) complex64 samples; they are valid only until the source is read again, so they must
    be copied to be stored."""
    sample_index: int
    """Index of the first sample since the source started, including lost samples."""
    time_ns: int
    """Time of the first sample at the antenna connector [ns, UTC]."""
    sample_rate_hz: float
    """Measured sample rate, near the nominal one [Hz]."""
    lost_before: int = 0
    """Number of samples missing between the previous block and this one."""
    unsure_before: int = 0
    """Number of samples in `lost_before` that may be due to a clock error instead of a loss."""


@dataclass(frozen=True, slots=True, eq=False)
class ChannelBlock:
    """Consecutive samples of one channel of the channelizer."""

    channel: int
    """Number of the channel, in the order of an FFT: 0 at the radio's centre frequency,
    increasing with frequency; the channels below the centre follow after those above."""
    center_frequency_hz: float
    samples: "NDArray[np.complex64]"
    """(n,) complex64 samples, never overwritten; the amplitude of a tone is equal to that in
    the radio's samples."""
    sample_index: int
    """Index of the first sample of this channel since the start, including lost samples."""
    time_ns: int
    """Time of the first sample at the antenna [ns, UTC]; filter delays are corrected."""
    sample_rate_hz: float
    lost_before: int = 0
    clipped_ns: tuple[tuple[int, int], ...] = ()
    """Start and end of time spans since the last block in which the radio clipped [ns, UTC]."""
    carriers_hz: tuple[float, ...] = ()
    """Frequencies of strong steady carriers in the radio's band [Hz]; they may cause false
    pulses."""


@dataclass(frozen=True, slots=True)
class TunnelPayload:
    """A payload of a MAVLink TUNNEL message, to be sent."""

    payload: bytes
    place: tuple[int, int] | None = None
    """System and component id of the receiver; None: all ground stations."""
    payload_type: int = 0
