"""Records that cross a stage or a process.

All are frozen; absence is ``None``; times are integer nanoseconds UTC; units stand in the
names. Records travel between processes as JSON (``uavrt.ipc``), except
the sample blocks, which have their own road.
"""

from dataclasses import dataclass, field, replace
from enum import StrEnum
from math import inf, isfinite
from typing import TYPE_CHECKING, Literal

import msgspec

from uavrt.commands import CommandName as CommandName
from uavrt.commands import SystemState as SystemState

if TYPE_CHECKING:
    # Half of the processes never see a sample; NumPy would cost each 12 MB and 0.1 s.
    import numpy as np
    from numpy.typing import NDArray

DetectionStatus = Literal["subthreshold", "detected", "confirmed", "integrated"]
"""Certainty of a pulse: below the threshold (seen by a track), above it, or part of a track.
*integrated*: seen in hindsight, by the whole flight; never in flight, and never on the wire."""

_SAME_SENDER_HZ = 300.0
"""Frequencies of one sender, measured twice, differ by less."""
_KILOHERTZ_FROM_HZ = 995.0

DEFAULT_FALSE_ALARM_PROBABILITY = 0.01
"""False-alarm probability of a tag without its own."""
WHOLE_FLIGHT_FALSE_ALARM = 0.01
"""Probability that a whole flight without the tag is judged to have it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tag:
    """A radio tag as the operator describes it."""

    tag_id: int
    frequency_hz: float
    """Nominal carrier frequency, absolute."""
    pulse_width_s: float
    pulse_intervals_s: tuple[float, ...]
    """Interval from pulse start to pulse start, one for each rate; one or two rates."""
    interval_uncertainty_s: float = 0.0
    """Bound of the unknown but constant error of the interval; it accumulates."""
    interval_jitter_s: float = 0.0
    """Bound of the independent timing error of each pulse; it does not accumulate."""
    k: int = 3
    """Pulses summed for one decision."""
    false_alarm_probability: float = DEFAULT_FALSE_ALARM_PROBABILITY
    """Expected false groups for each decision interval over the whole search."""
    name: str | None = None
    gaps_s: tuple[float, ...] = ()
    """Gaps from pulse start to pulse start within a coded tag's burst; empty for a beeping tag.
    Its one interval is then that from burst to burst, and K the bursts summed at most."""

    @property
    def coded(self) -> bool:
        """True if it sends bursts whose gaps identify it."""
        return bool(self.gaps_s)

    @property
    def length_s(self) -> float:
        """Length from the start to the end of a pulse; of a coded tag, of a burst."""
        return sum(self.gaps_s) + self.pulse_width_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulse:
    """One pulse of a tag, as a detector reports it; each pulse is reported once."""

    tag_id: int
    frequency_hz: float
    """Measured carrier frequency, absolute."""
    start_time_ns: int
    """Start of the pulse at the antenna: all filter delays are taken out."""
    end_time_ns: int
    snr_db: float
    """Pulse energy over noise power density (ENR)."""
    group_snr_db: float
    """Mean linear SNR of the group's pulses, in decibel."""
    score: float
    """Decision statistic over its threshold; 1 is just detected."""
    group_index: int
    """Place in the group, from 1."""
    group_sequence: int
    """Number of the group, rising for each tag and rate."""
    noise_psd: float
    """Noise power density at the pulse's frequency [input units squared per hertz]."""
    detection_status: DetectionStatus
    confirmed: bool
    rate: int
    """Which of the tag's intervals, from 1."""
    predicted_next_start_ns: int | None
    predicted_next_end_ns: int | None
    also_possible_tag_ids: tuple[int, ...] = ()
    """Other listed tags that may have sent it, as far as measured. The pulse is reported once,
    as `tag_id`, the likeliest."""
    ghost_of_tag_id: int | None = None
    """The stronger tag whose ghost it is: its image in the receiver, or by saturation."""
    clipped: bool = False
    """True if the receiver's converter was at its limits; `snr_db` is then a lower bound."""
    burst_starts_ns: tuple[int, ...] = ()
    """Measured starts of the pulses in a coded tag's burst, which is one record. Covered and
    lost pulses are left out; empty for a beep."""
    burst_snrs_db: tuple[float, ...] = ()
    """SNR of each of them; `snr_db` is their mean, of linear values."""

    @property
    def key(self) -> "PulseKey":
        """Its key within a flight."""
        return self.tag_id, self.start_time_ns


PulseKey = tuple[int, int]
"""Tag id and start time [ns]: no flight has two pulses of one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstInside:
    """Content of a coded tag's burst, sent after its pulse message."""

    tag_id: int
    start_time_ns: int
    """Start of the burst, as in its pulse message."""
    burst_starts_ns: tuple[int, ...]
    burst_snrs_db: tuple[float, ...]
    also_possible_tag_ids: tuple[int, ...] = ()

    @property
    def key(self) -> "PulseKey":
        """The burst's key within a flight."""
        return self.tag_id, self.start_time_ns

    def put_into(self, pulse: Pulse) -> Pulse:
        """Get the burst with its content."""
        return replace(
            pulse,
            burst_starts_ns=self.burst_starts_ns,
            burst_snrs_db=self.burst_snrs_db,
            also_possible_tag_ids=self.also_possible_tag_ids,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchReport:
    """A search without a detection; also the detector's sign of life."""

    tag_id: int
    time_ns: int
    """End of the searched stretch."""
    frequency_hz: float
    noise_psd: float
    best_score: float
    """Best statistic over its threshold in the stretch; below 1."""
    usable_share: float | None = None
    """Share of the time in which no other signal was on the tag's frequency; None: unknown."""
    weakest_enr_db: float | None = None
    """ENR [dB] over `noise_psd` at which nine groups of ten would have been found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Position and attitude of the antenna at one instant."""

    time_ns: int
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    altitude_relative_m: float
    """Height above the take-off point."""
    quaternion_wxyz: tuple[float, float, float, float]
    """Unit quaternion, antenna body frame (forward, right, down) to north-east-down."""
    extrapolated: bool = False
    """True if no later pose was known in time, or the autopilot's clock was unknown for 10
    s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeSample:
    """Attitude of the vehicle by the autopilot, on our clock."""

    time_ns: int
    quaternion_wxyz: tuple[float, float, float, float]
    """Unit quaternion, vehicle body (forward, right, down) to north-east-down."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionSample:
    """Position of the vehicle by the autopilot, on our clock."""

    time_ns: int
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    altitude_relative_m: float
    """Height above the take-off point."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PulsePose:
    """A pulse with the antenna's pose at its centre, or without one."""

    pulse: Pulse
    pose: Pose | None


class BeepKind(StrEnum):
    """Relation of a sender of pulses to the list of tags."""

    LISTED = "listed"
    """A listed tag, as its entry says."""
    OFF_LABEL = "off label"
    """It has the interval of a listed tag at another frequency."""
    OTHER_RATE = "other rate"
    """It is at a listed tag's frequency, at another interval."""
    MIRRORED = "mirrored"
    """It is a listed tag on the other side of the centre: I and Q are swapped."""
    UNLISTED = "unlisted"
    IMAGE = "image"
    """The receiver made it of stronger pulses."""
    NOT_ANIMAL = "not an animal"
    DOUBTFUL = "doubtful"


_OF_A_TAG = (BeepKind.OFF_LABEL, BeepKind.OTHER_RATE, BeepKind.MIRRORED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Beep:
    """A sender of pulses that was found without the list, and which tags it may be."""

    kind: BeepKind
    time_ns: int
    """Time of its last pulse so far."""
    frequency_hz: float
    interval_s: float
    jitter_s: float
    """Standard deviation of its pulses about the interval."""
    pulses: int
    level_db: float
    """Median level over the noise in 94 Hz."""
    tag_ids: tuple[int, ...] = ()
    """Tags that it may be, the likeliest first; of an image those of its original."""
    offsets_hz: tuple[float, ...] = ()
    """Distance from the listed frequency of each of them."""
    image_of_hz: float | None = None
    reason: str = ""
    """Why it is doubtful or no animal; what another rate may mean."""

    def __post_init__(self) -> None:
        """Raise `ValueError` for impossible values: they come by radio and from files."""
        numbers = (self.frequency_hz, self.interval_s, self.jitter_s, self.level_db)
        if not all(map(isfinite, (*numbers, self.image_of_hz or 0.0))) or self.interval_s <= 0:
            raise ValueError(f"a beep has frequency, interval, jitter and level {numbers}")
        if len(self.tag_ids) != len(self.offsets_hz):
            raise ValueError("a beep needs one offset for each tag")
        if not all(1.0 <= self.frequency_hz - one < inf for one in self.offsets_hz):
            raise ValueError(f"a beep has an impossible offset: {self.offsets_hz}")
        if self.kind in _OF_A_TAG and not self.tag_ids:
            raise ValueError(f"a beep of kind {self.kind!r} needs a tag")

    @property
    def away_hz(self) -> float | None:
        """Distance from the first tag's listed frequency [Hz]."""
        return self.offsets_hz[0] if self.offsets_hz else None

    def same_as(self, other: "Beep") -> bool:
        """True if both are measurements of one sender."""
        near = abs(self.frequency_hz - other.frequency_hz) < _SAME_SENDER_HZ
        return near and self.kind is other.kind

    @property
    def odd(self) -> bool:
        """True if it differs from its list entry, so that the operator should be informed."""
        if self.kind is BeepKind.DOUBTFUL:
            return bool(self.tag_ids)
        return self.kind is not BeepKind.LISTED

    @property
    def meaning(self) -> str:
        """What it may be, in words."""
        reason = f", {self.reason}" if self.reason else ""
        match self.kind:
            case BeepKind.OFF_LABEL | BeepKind.LISTED if self.tag_ids:
                return " or ".join(self._names())
            case BeepKind.OTHER_RATE:
                first = f"tag {self.tag_ids[0]} at another rate{reason}"
                return " or ".join([first, *self._names()[1:]])
            case BeepKind.MIRRORED:
                return f"tag {self.tag_ids[0]} mirrored at the centre"
            case BeepKind.IMAGE:
                of = f"an image of {(self.image_of_hz or 0.0) / 1e6:.6f} MHz"
                return of + (f" (tag {self.tag_ids[0]})" if self.tag_ids else "")
            case BeepKind.DOUBTFUL if self.tag_ids:
                return f"doubtful, at tag {self.tag_ids[0]}'s frequency: {self.reason}"
        return f"{self.kind}{reason}"

    @property
    def advice(self) -> str:
        """What to do about it, in words; empty without advice."""
        return _ADVICE.get(self.kind, "")

    def __str__(self) -> str:
        """Write it as a line for the operator."""
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


_ADVICE = {
    BeepKind.OFF_LABEL: "? List it at this frequency",
    BeepKind.OTHER_RATE: "? List this interval",
    BeepKind.MIRRORED: ": I and Q are swapped. Swap them in the radio's program or format",
    BeepKind.IMAGE: ", made in the receiver. Reduce its gain",
}


def _distance(hz: float) -> str:
    return f"{hz:.0f} Hz" if hz < _KILOHERTZ_FROM_HZ else f"{hz / 1e3:.1f} kHz"


def keep_beep(known: list[Beep], new: Beep) -> bool:
    """Replace older measurements of the same sender; return whether the sender is new."""
    for place, other in enumerate(known):
        if other.same_as(new):
            known[place] = new
            return False
    known.append(new)
    return True


MOST_BEEPS = 32
"""Senders that a drone repeats and a page shows."""


def drop_beeps(known: list[Beep]) -> int:
    """Drop senders above `MOST_BEEPS`, those of no listed tag and of few pulses; count them."""
    excess = max(0, len(known) - MOST_BEEPS)
    for one in sorted(known, key=lambda one: (bool(one.tag_ids), one.pulses))[:excess]:
        known.remove(one)
    return excess


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveBearing:
    """A bearing of a turn that may still go on, estimated on the drone."""

    tag_id: int
    start_time_ns: int
    """Start of the turn."""
    end_time_ns: int
    """End of the turn so far."""
    turned_deg: float
    latitude_deg: float
    """Place of the turn."""
    longitude_deg: float
    bearing_deg: float
    """Clockwise from true north."""
    sigma_deg: float
    interval90_deg: tuple[float, float]
    """Clockwise from first to second."""
    level_db: float | None
    """SNR on boresight."""
    pulses: int
    accepted: bool
    """Whether the pulses show a direction at all."""
    ambiguous: bool
    multipath_suspected: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivered:
    """Pulses that have reached a ground station's store, or were sent to plain ones."""

    time_ns: int
    store: int
    """Number of the store (`uavrt.tunnel.private`); 0: sent once, without acknowledgement."""
    pulses: tuple[PulseKey, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """Pulses that are safe on the disk, with their poses or their absence."""

    pulses: tuple[PulseKey, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Taken:
    """Progress of a process; records it has not taken go to its successor again."""

    records: int
    """Number of records handled for good since its start: on the disk, or not meant for it. Its
    assignment does not count."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Poses:
    """Several raw poses of the vehicle in a row, batched for the recorder."""

    poses: tuple[Pose, ...]


STATION_COUNTER = "station_silent_s_"
"""Prefix of a count in the connection's health: a ground station's silence [s]. The station's
numbers follow: ``station_silent_s_255_190``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """State of a process, sent about once a second."""

    process: str
    time_ns: int
    status: str
    """A word or two: ``"ready"``, ``"waiting for autopilot"``, ``"radio absent"``."""
    ok: bool
    counters: dict[str, float] = field(default_factory=dict)
    """Everything counted since the start: samples lost, pulses refused, retries …"""
    reason: str = ""
    """Why it is not `ok`, or its result at its end, with the remedy."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessStatus:
    """The supervisor's record of one process."""

    process: str
    running: bool
    pid: int | None
    status: str
    ok: bool
    restarts: int
    cpu_s: float
    """CPU time of all its instances since the supervisor started, their children included."""
    memory_mb: float
    counters: dict[str, float] = field(default_factory=dict)
    reason: str = ""
    """Why it is not `ok`, with the remedy; empty otherwise."""
    tag_ids: tuple[int, ...] = ()
    """Tags whose pulses it finds, if it is a detector."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusText:
    """A short text for the operator, as MAVLink severity 0 (emergency) to 7 (debug)."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SystemStatus:
    """State of the whole drone side, published once a second."""

    time_ns: int
    state: SystemState
    flight_directory: str | None
    center_frequency_hz: float | None
    tags: tuple[Tag, ...]
    processes: tuple[ProcessStatus, ...]
    commander: str | None = None
    """Source of accepted commands: ``"mavlink 255/190"``; None before the first."""
    ending: bool = False
    """True after Stop was commanded, until the last pulses are recorded."""
    faults: tuple[StatusText, ...] = ()
    """Lasting faults of the computer, such as a full disk; the ground is reminded of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """An operator's command to the supervisor, by tunnel, page or command line."""

    name: CommandName
    request_id: int
    """Repeated by the sender on a retry, so that it is answered and not done again."""
    tag: Tag | None = None
    center_frequency_hz: float | None = None
    """Radio frequency chosen on the ground; None lets the tuner choose."""
    gain: int | None = None
    parameter: str | None = None
    """Name of a parameter (`uavrt.config.parameters`)."""
    value: float | None = None
    """New value of the parameter; None for commands that set none."""
    source: str = ""
    """Sender: ``"mavlink 255/190"``, ``"ros2"``, ``"command line"``."""
    sealed: bool = False
    """Whether it came with a seal of the drone's key."""
    tag_count: int | None = None
    """Number of tags sent, with the end of an upload or a start; None: not counted. A start
    with fewer tags is refused."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandReply:
    """The supervisor's answer to a command."""

    request_id: int
    name: CommandName
    accepted: bool
    message: str
    """Reason of a refusal, or a detail: the flight directory on start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Operation:
    """Progress of a job that outlasts its command."""

    name: CommandName
    state: Literal["running", "complete", "failed"]
    step: int = 0
    step_count: int = 0
    """Number of steps; 0: unknown."""
    message: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightInfo:
    """A started flight, for the recorder to open it, also after a restart."""

    directory: str
    start_time_ns: int
    clock_offset_ns: int
    """UTC minus CLOCK_MONOTONIC, fixed at the flight's start. The flight keeps this time,
    whatever happens to the wall clock."""
    center_frequency_hz: float
    sample_rate_hz: float
    tags: tuple[Tag, ...]
    capture_s: float | None = None
    """Length of a raw capture, without tags or detection; None for a flight."""


MotionAction = Literal["rotate", "goto", "survey", "hold", "return", "search", "takeoff"]
"""Motions that can be requested."""


SurveyPattern = Literal["lines", "around", "points"]
"""Pattern of a survey: line by line, along its outline, by whole turns at places."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeepOut:
    """An area over which nothing flies: a person, a building."""

    places: tuple[tuple[float, float], ...]
    """Latitude and longitude [deg] of its corners, or of the middle of a circle."""
    radius_m: float | None = None
    """Radius of a circle."""
    name: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleFence:
    """The fence reported by the autopilot."""

    within: tuple[KeepOut, ...] = ()
    """Areas that the vehicle does not leave."""
    keep_out: tuple[KeepOut, ...] = ()
    """Areas that it does not enter."""
    fault: str | None = None
    """Why it cannot be read, with the remedy; nothing is flown then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A motion that an operator can request."""

    action: MotionAction
    places: tuple[tuple[float, float], ...] = ()
    """Latitude and longitude [deg] of a goal, or of an outline's corners."""
    height_m: float | None = None
    """Height above home; None: as it is."""
    duration_s: float = 60.0
    """Duration of a whole turn; longest duration of a search."""
    clockwise: bool = True
    spacing_m: float = 60.0
    """Distance between a survey's lines or places."""
    pattern: SurveyPattern = "lines"
    """Pattern of a survey."""
    tags: tuple[int, ...] = ()
    """Tags to search for; empty: all that are listed."""
    radius_m: float | None = None
    """Radius of a search around the drone, without an outline."""
    wish_m: float = 25.0
    """Target accuracy: radius around a found tag that contains it with 95 % [m]."""
    keep_out: tuple[KeepOut, ...] = ()
    """Keep-out areas in addition to those of the drone's settings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionRequest(Motion):
    """A motion requested by an operator; nothing moves before it is confirmed."""

    request_id: int
    """Number given by the sender."""
    asker: tuple[int, int]
    """System and component id of the ground station."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundTag:
    """A tag that a drone has found, as sent to the others."""

    tag_id: int
    place: tuple[float, float]
    """Latitude and longitude [deg]."""
    radius95_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """A drone's report to others that fly: its place, its leg, its tags.

    It owns the straight line from its place to its goal, whenever it flies it.
    """

    sequence: int
    """Rises by one with each, modulo 65536."""
    place: tuple[float, float]
    """Latitude and longitude [deg]."""
    altitude_amsl_m: float
    goal: tuple[float, float]
    """End of the leg that it flies; its place if it stays."""
    searching: bool = False
    """Whether an order to search is confirmed."""
    returning: bool = False
    flown: int = 0
    """Number of its last granted leg, which it flies; 0: none."""
    asked: int = 0
    """Number of the requested leg; 0: none."""
    asked_way: tuple[tuple[float, float], ...] = ()
    """Start and end of that leg."""
    given: tuple[tuple[int, int], ...] = ()
    """Vehicles, and the versions of their legs on which its choice was based."""
    held: tuple[int, ...] = ()
    """Tags that it searches for at present."""
    found: tuple[FoundTag, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbour:
    """A ground station's report of another drone; it requests nothing."""

    vehicle: int
    """Its system number; 0: there are others, none of which has reported yet."""
    version: int = 0
    """Changes when it owns another leg."""
    granted: int = 0
    """Number of the receiver's requested leg that it now owns; 0: none."""
    denied: int = 0
    """Number of its requested leg that was denied; 0: none."""
    age_s: float = 0.0
    """Time since its last report."""
    course: Course | None = None
    """Its report; `asked_way` is a leg that it owns and has not begun to fly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SoughtTag:
    """A search's estimate of a tag."""

    tag_id: int
    latitude_deg: float
    """Its place, if it is there."""
    longitude_deg: float
    radius95_m: float
    existence: float
    """Probability that it is there and beeps."""
    found_s: float | None
    """Time from the begin until it was found; None: not found yet."""
    pulses: int
    """Number of received pulses so far."""
    missed: int
    """Number of expected pulses that were not received."""
    likely: tuple[tuple[float, float, float], ...] = ()
    """Likeliest squares of a tag not found, at the end: latitude, longitude and share."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchNote:
    """A search's decision, find, or end, and why."""

    time_ns: int
    order_id: int
    event: Literal["begun", "decision", "found", "ended"]
    text: str
    """Short text for the operator."""
    reason: str
    """Reason, with figures."""
    elapsed_s: float
    latitude_deg: float
    """Place of the drone."""
    longitude_deg: float
    height_m: float
    """Height above home."""
    battery_percent: float | None
    tags: tuple[SoughtTag, ...]
    tag_id: int | None = None
    """The found tag."""
    goal: tuple[float, float] | None = None
    """Destination: latitude, longitude."""
    area: tuple[tuple[float, float], ...] = ()
    """Outline, with the begin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionOffer:
    """The guide's plan for a request, or why it refuses."""

    request_id: int
    asker: tuple[int, int]
    order_id: int
    nonce: int
    """Number that confirms the order, once."""
    summary: str
    mode: str = ""
    """Mode that the drone would leave, as in the summary."""
    refused: bool = False
    """True if it is refused; the summary is the reason."""
    takeoff: bool = False
    """True if it begins on the ground."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSeen:
    """State of the vehicle and of our commands, by the autopilot."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    altitude_relative_m: float
    speed_m_s: float
    yaw_deg: float | None
    home: tuple[float, float]
    """Latitude and longitude [deg] of home."""
    battery_percent: float | None
    obeyed: bool
    """True if the vehicle reports the target of the last command."""
    wishes_sent: int
    wishes_refused: int
    turned_deg: float
    ground_silent_s: float
    settling: bool = False
    """True if it is near its target and still moving: only a return or a stop may follow."""
    heading_rests: bool = True
    """True if a turn in place may begin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleReport:
    """The vehicle and our authority over it, ten times a second."""

    autopilot: str | None
    """``"px4"`` or ``"ardupilot"``; None: not received, or another."""
    fault: str | None
    """Why no motion can be confirmed now, with the remedy."""
    takeoff_fault: str | None = field(kw_only=True, default=None)
    """Why no take-off can be confirmed now, with the remedy."""
    standing: str = "out"
    """``"out"``, ``"confirmed"`` or ``"in command"``."""
    reason: str = ""
    """Why it is out."""
    order_id: int | None = None
    mode: str = ""
    seen: VehicleSeen | None = None
    """State; None: its position or home is unknown."""
    wind_m_s: tuple[float, float] | None = None
    """Motion of the air, east and north, by the autopilot; None: not reported."""


class FlyThere(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """Fly straight to a place and stay; also turns, if the autopilot accepts the yaw."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    yaw_deg: float | None = None
    """None: the autopilot chooses."""


class TurnInPlace(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """Turn by one command, if the autopilot has it."""

    turn_deg: float
    """Angle, clockwise; negative: the other way. At most a whole turn."""
    rate_deg_s: float


class GoHome(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """Return by the autopilot's own mode; it lands as it is set to. Ends the order."""


class TakeMode(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """Change into our own mode on the ground, where a take-off is commanded in it."""


class TakeOff(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """Climb straight up from the ground; a pilot has armed."""

    height_m: float
    """Height above home."""
    altitude_amsl_m: float


Wish = FlyThere | TurnInPlace | GoHome | TakeMode | TakeOff


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleWish:
    """The guide's requested motion; `uavrt.guidance.authority` decides on it."""

    order_id: int | None
    wish: Wish | None = None
    """None: no new request, only a heartbeat."""
    ends: bool = False
    """The order has ended."""
    said: str = ""
    """Progress of the order, or why it has ended."""


@dataclass(frozen=True, slots=True, eq=False)
class IQBlock:
    """Consecutive complex samples of a radio.

    Blocks follow one another without a gap unless `lost_before` counts missing samples.
    """

    samples: "NDArray[np.complex64]"
    """(n,) complex64; valid until the source is read again, copy to keep."""
    sample_index: int
    """Index of the first sample since the source started, lost ones counted."""
    time_ns: int
    """Time of the first sample at the antenna connector [ns, UTC]."""
    sample_rate_hz: float
    """Rate as measured, near the nominal one."""
    lost_before: int = 0
    """Samples missing between the previous block and this one."""
    unsure_before: int = 0
    """Part of `lost_before` that a crystal far off its rate would explain as well."""


@dataclass(frozen=True, slots=True, eq=False)
class ChannelBlock:
    """Consecutive samples of one channel of the channelizer."""

    channel: int
    """Channel number from 0: 0 is the radio centre, then upwards, wrapping to the negative."""
    center_frequency_hz: float
    """Frequency of the channel's centre, absolute."""
    samples: "NDArray[np.complex64]"
    """(n,) complex64, never overwritten; a tone of amplitude A has amplitude A here."""
    sample_index: int
    """Index of the first sample of this channel since the start, lost ones counted."""
    time_ns: int
    """Time of the first sample at the antenna: filter delays are taken out."""
    sample_rate_hz: float
    lost_before: int = 0
    clipped_ns: tuple[tuple[int, int], ...] = ()
    """Begin and end of clipped stretches [ns, UTC], in order, new since the last block."""
    carriers_hz: tuple[float, ...] = ()
    """Strong steady carriers in the radio's band, absolute, which make ghosts with it."""


@dataclass(frozen=True, slots=True)
class TunnelPayload:
    """A payload of MAVLink's TUNNEL on its way."""

    payload: bytes
    place: tuple[int, int] | None = None
    """System and component id of the receiver; None: all ground stations."""
    payload_type: int = 0
