"""Records that cross a stage or a process.

All are frozen; absence is ``None``; times are integer nanoseconds UTC; units stand in the
names. Records travel between processes as JSON (``uavrt.ipc``), except
the sample blocks, which have their own road.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from uavrt.commands import CommandName as CommandName
from uavrt.commands import SystemState as SystemState

if TYPE_CHECKING:
    # Half of the processes never see a sample; NumPy would cost each 12 MB and 0.1 s.
    import numpy as np
    from numpy.typing import NDArray

DetectionStatus = Literal["subthreshold", "detected", "confirmed"]
"""How sure a pulse is: below the threshold (seen by a track), above it, or part of a track."""


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
    false_alarm_probability: float = 0.01
    """Expected false groups for each decision interval over the whole search."""
    name: str | None = None


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
    """Other listed tags that may have sent it: nothing measured so far tells them apart. The
    pulse is reported once, as `tag_id`, the likeliest."""
    ghost_of_tag_id: int | None = None
    """The stronger tag of which the receiver made it: its image, or by saturation."""
    clipped: bool = False
    """The receiver's converter was at its limits during it: `snr_db` is a lower bound."""

    @property
    def key(self) -> "PulseKey":
        """How it is known in its flight."""
        return self.tag_id, self.start_time_ns


PulseKey = tuple[int, int]
"""Tag id and start time [ns]: no flight has two pulses of one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchReport:
    """What a detector searched without a detection; also its sign of life."""

    tag_id: int
    time_ns: int
    """End of the searched stretch."""
    frequency_hz: float
    noise_psd: float
    best_score: float
    """Best statistic over its threshold in the stretch; below 1."""


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
    """True when no pose later than this instant was known in time, or when the autopilot had
    not told its clock for more than 10 s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeSample:
    """Attitude of the vehicle as the autopilot told it, on our clock."""

    time_ns: int
    quaternion_wxyz: tuple[float, float, float, float]
    """Unit quaternion, vehicle body (forward, right, down) to north-east-down."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionSample:
    """Position of the vehicle as the autopilot told it, on our clock."""

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


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveBearing:
    """A bearing of a turn that may still go on, estimated on the drone."""

    tag_id: int
    start_time_ns: int
    """Of the turn."""
    end_time_ns: int
    """Of the turn so far."""
    turned_deg: float
    latitude_deg: float
    """Of the place of the turn."""
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
    """There is a direction in the pulses at all."""
    ambiguous: bool
    multipath_suspected: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivered:
    """Pulses that have reached a ground station's store, or were sent to plain ones."""

    time_ns: int
    store: int
    """Number of the store (`uavrt.tunnel.private`); 0: sent once, nobody acknowledges."""
    pulses: tuple[PulseKey, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """Pulses that are safe on the disk, with the word on their poses."""

    pulses: tuple[PulseKey, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Taken:
    """How far a process is with what it was sent; the rest goes to its successor again."""

    records: int
    """Records that it has dealt with for good since its start: they are on the disk, or were
    not for the disk. Its assignment does not count."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Poses:
    """Several raw poses of the vehicle in a row, batched for the recorder."""

    poses: tuple[Pose, ...]


STATION_COUNTER = "station_silent_s_"
"""Begins the name of a count of the connection's health, which ends with a ground station's
numbers: ``station_silent_s_255_190``, how long it has not been heard [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """What a process says of itself about once a second."""

    process: str
    time_ns: int
    status: str
    """A word or two: ``"ready"``, ``"waiting for autopilot"``, ``"radio absent"``."""
    ok: bool
    counters: dict[str, float] = field(default_factory=dict)
    """Everything counted since the start: samples lost, pulses refused, retries …"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessStatus:
    """What the supervisor knows of one process."""

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
    """Whose commands count, as their source: ``"mavlink 255/190"``; None before the first."""
    ending: bool = False
    """Stop was asked for: the state holds until the last pulses are recorded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """What an operator asks of the supervisor, by tunnel, page or command line."""

    name: CommandName
    request_id: int
    """Repeated by the asker on a retry, so that a retry is answered, not done again."""
    tag: Tag | None = None
    center_frequency_hz: float | None = None
    """Radio frequency chosen on the ground; None lets the tuner choose."""
    gain: int | None = None
    parameter: str | None = None
    """Name of a parameter (`uavrt.config.parameters`)."""
    value: float | None = None
    """What it is to be."""
    source: str = ""
    """Who asked: ``"mavlink 255/190"``, ``"ros2"``, ``"command line"``."""
    sealed: bool = False
    """It came with a seal of the drone's key."""
    tag_count: int | None = None
    """With a start: as many tags were sent; with fewer it is refused. None: not told."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandReply:
    """The supervisor's answer to a command."""

    request_id: int
    name: CommandName
    accepted: bool
    message: str
    """Why not, or a useful detail: the flight directory on start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Operation:
    """How far something is that takes longer than its command."""

    name: CommandName
    state: Literal["running", "complete", "failed"]
    step: int = 0
    step_count: int = 0
    """0: not known."""
    message: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusText:
    """A short text for the operator, as MAVLink severity 0 (emergency) to 7 (debug)."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightInfo:
    """A flight that was started: what the recorder needs to open it, also after a restart."""

    directory: str
    start_time_ns: int
    clock_offset_ns: int
    """UTC minus CLOCK_MONOTONIC, fixed at the flight's start: its time, whatever is done to the
    wall clock later."""
    center_frequency_hz: float
    sample_rate_hz: float
    tags: tuple[Tag, ...]
    capture_s: float | None = None
    """For a raw capture: how long; then there are no tags and nothing is detected."""


@dataclass(frozen=True, slots=True, eq=False)
class IQBlock:
    """Consecutive complex samples of a radio.

    Blocks follow one another without a gap unless `lost_before` says how many samples are
    missing; a gap is a fact in the stream, not something to guess from times.
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
    """So many of `lost_before` a crystal far off its rate would explain as well."""


@dataclass(frozen=True, slots=True, eq=False)
class ChannelBlock:
    """Consecutive samples of one channel of the channelizer."""

    channel: int
    """Channel number from 0: 0 is the radio centre, then upwards, wrapping to the negative."""
    center_frequency_hz: float
    """Frequency of the channel's centre, absolute."""
    samples: "NDArray[np.complex64]"
    """(n,) complex64; a tone of amplitude A in the channel has amplitude A here."""
    sample_index: int
    """Index of the first sample of this channel since the start, lost ones counted."""
    time_ns: int
    """Time at the antenna that the first sample stands for: filter delays are taken out."""
    sample_rate_hz: float
    lost_before: int = 0
    clipped_ns: tuple[tuple[int, int], ...] = ()
    """Begin and end of the stretches [ns, UTC], in order, in which the radio's converter was at
    its limits, as far as no block before told of them."""
    carriers_hz: tuple[float, ...] = ()
    """Strong steady carriers in the radio's band, absolute: with them it makes ghosts."""
