"""The drone side's settings, as in ``uavrt.toml``; the loader is `uavrt.config.loader`.

Each class is one table of the file; each default is what a first flight needs.
"""

import os
import re
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Gt, Interval, Predicate

STRICT: dict[str, Any] = {
    "extra": "forbid",
    "strict": True,
    "allow_inf_nan": False,
    "use_attribute_docstrings": True,
}
"""How `uavrt.config.loader` has pydantic read each table; a plain dict, so that this module
costs the drone nothing."""


def is_ros_namespace(text: str) -> bool:
    """Whether ROS 2 takes a text for a namespace: names of letters, digits and underscores.

    Rules: design.ros2.org, "Topic and Service name mapping to DDS".
    """
    named = re.fullmatch(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*", text)
    return text == "" or (named is not None and "__" not in text and len(text) <= 100)


Shape = Literal["workers", "one"]
OperatingModeName = Literal[
    "freqSearchSoftLock", "freqSearchHardLock", "freqKnownHardLock", "freqAllNeverLock"
]
"""Names of `uavrt.detection.modes.OperatingMode`, those of the original's
``detectorConfig.txt``."""
NamedValuesName = Literal["all", "snr", "off"]
RADIO_GROUP = "uavrt.radios"
"""Entry points of this group add kinds of radio (docs/how-to/extend.md)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioSettings:
    """``[radio]``: which receiver, and how it is set."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    kind: str = "airspy"
    """``airspy`` (Mini, R2), ``airspyhf``, ``rtlsdr``, ``hackrf``, ``soapy`` for others, or one
    that an installed package adds."""
    program: tuple[str, ...] = ()
    """Program and first arguments in place of the usual one (``airspy_rx`` …); empty: usual."""
    sample_rate_hz: Annotated[float, Interval(ge=3_000.0, le=100e6)] = 3_000_000.0
    """Samples a second from the radio."""
    gain: Annotated[int, Ge(0)] | None = None
    """Gain in the radio's own steps (Airspy: 0 to 21); left out: a sensible one."""
    bias_tee: bool = False
    """Power an amplifier at the antenna through the cable."""
    frequency_correction_ppm: Annotated[float, Interval(ge=-200.0, le=200.0)] = 0.0
    """Known error of the radio's crystal, positive when it runs fast."""
    serial: str | None = None
    """Serial number of the device, when there are several."""
    center_frequency_hz: Annotated[float, Interval(ge=20e6, le=1e9)] | None = None
    """Radio frequency; left out: the tuner chooses it from the tags."""
    retry_s: Annotated[float, Interval(ge=0.1, le=60.0)] = 3.0
    """Between attempts to open a radio that has failed twice within ten seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MavlinkSettings:
    """``[mavlink]``: the way to the autopilot."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    address: str = "serial:///dev/ttyUSB0:57600"
    """``serial:///dev/ttyUSB0:57600``, ``udpin://127.0.0.1:14540``, ``udpout://HOST:PORT``,
    ``tcp://HOST:PORT``; empty for none (cart, bench and field-monitor use)."""
    direct_links: tuple[str, ...] = ()
    """Further links, straight to ground stations, such as ["udpin://0.0.0.0:14560"] over Wi-Fi:
    pulses, answers and files go by the first of them on which a ground station is heard, and
    else through the autopilot."""
    system_id: Annotated[int, Interval(ge=1, le=253)] = 1
    """Number of this station where there is no autopilot, which else tells it; each station and
    vehicle needs its own."""
    component_id: Annotated[int, Interval(ge=1, le=255)] = 191
    """Ours in the vehicle's MAVLink system; 191 is the first onboard computer."""
    tunnel_gap_s: Annotated[float, Interval(ge=0.012, le=1.0)] = 0.020
    """Time between two tunnel messages; never below 0.012."""
    attitude_rate_hz: Annotated[float, Interval(gt=0.0, le=250.0)] = 50.0
    """Attitudes asked of the autopilot each second."""
    position_rate_hz: Annotated[float, Interval(gt=0.0, le=250.0)] = 10.0
    """Positions asked of the autopilot each second."""
    parameter_encoding: Literal["auto", "bytewise", "c_cast", "float"] = "auto"
    """How whole numbers travel in parameters; auto: as the autopilot does it (PX4 bytewise,
    ArduPilot cast), which is what most ground stations expect; float: all parameters are of
    type float, which everyone reads alike, MAVProxy beside a PX4, too."""
    named_values: NamedValuesName = "all"
    """SNR and count of each tag as NAMED_VALUE_FLOAT (``SNR_2``, ``CNT_2``), while a ground
    station that is not ours is there; snr: that alone, for plots of one tag; off: none."""
    commanders: tuple[Annotated[int, Interval(ge=1, le=255)], ...] = ()
    """System ids of the ground stations that may command; empty: all."""
    first_commands: bool = True
    """Whoever commands a flight first, by MAVLink or ROS 2, commands it alone: others watch,
    until that has been silent for 60 s, or with a sealed command; false: everybody commands."""
    key_file: str | None = None
    """File with a key of 32 or more hexadecimal digits that the ground station has too; then
    only commands sealed with it are taken, and other ground stations can only listen."""
    key_required: bool = True
    """With a key: false takes unsealed commands, too, from the first who commands; whoever has
    the key commands at any time."""
    signing_key_file: str | None = None
    """File with a key of 64 hexadecimal digits: MAVLink 2 signing, for direct links and through
    ArduPilot. PX4 1.17 breaks the signatures of what it passes on; there use key_file."""
    accept_unsigned: Literal["none", "autopilot", "all"] = "autopilot"
    """With a signing key: whose unsigned frames are taken all the same; the autopilot's are its
    telemetry only."""
    tunnel_generation: Literal["auto", "G0", "G1", "G2v1", "G2"] = "auto"
    """Wire format towards the ground; auto answers in the format the ground used. The numbered
    versions of the original must be named: G2v1 is version 1, G2 that of tunnel_version."""
    tunnel_version: Annotated[int, Interval(ge=4, le=7)] = 7
    """Number told with G2; the ground station must expect exactly this one."""
    tunnel_experimental: bool = False
    """Allow G2, some of whose layouts were inferred and never seen on a wire."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseSettings:
    """``[pose]``: where place and heading come from; a mast or a person has no autopilot."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    source: Literal["autopilot", "fixed", "nmea", "gpsd"] = "autopilot"
    """``autopilot``; ``fixed``: what is written here, for a mast; ``nmea`` or ``gpsd``: a GPS
    receiver, for a person or a cart. Any but the autopilot leaves mavlink.address empty and
    reaches ground stations by mavlink.direct_links."""
    address: str = ""
    """Of the receiver: NMEA by serial:///dev/ttyACM0:9600, udpin://0.0.0.0:10110 or
    tcp://HOST:PORT; gpsd by HOST:PORT, empty for the one on this computer."""
    latitude_deg: Annotated[float, Interval(ge=-90.0, le=90.0)] | None = None
    """Of a fixed station."""
    longitude_deg: Annotated[float, Interval(ge=-180.0, le=180.0)] | None = None
    """Of a fixed station."""
    altitude_amsl_m: Annotated[float, Interval(ge=-500.0, le=9000.0)] = 0.0
    """Of the ground there above the sea, where no receiver tells it."""
    height_m: Annotated[float, Interval(ge=0.0, le=500.0)] = 2.0
    """Of the antenna above ground."""
    heading_deg: Annotated[float, Interval(ge=-360.0, le=360.0)] | None = None
    """Where the station looks, clockwise from true north; left out: as the receiver's compass
    says (NMEA's HDT and THS, gpsd's ATT). The parameter POSE_HEADING sets it at any time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AntennaSettings:
    """``[antenna]``: how the antenna sits on the vehicle."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    yaw_offset_deg: Annotated[float, Interval(ge=-360.0, le=360.0)] = 0.0
    """Antenna boresight clockwise from the vehicle's nose."""
    pitch_offset_deg: Annotated[float, Interval(ge=-180.0, le=180.0)] = 0.0
    """Boresight up from the vehicle's level, applied after the yaw offset."""
    roll_offset_deg: Annotated[float, Interval(ge=-180.0, le=180.0)] = 0.0
    """Antenna turned right side down around its boresight, applied last."""
    offset_forward_m: Annotated[float, Interval(ge=-100.0, le=100.0)] = 0.0
    """Antenna ahead of the autopilot."""
    offset_right_m: Annotated[float, Interval(ge=-100.0, le=100.0)] = 0.0
    """Antenna to the right of the autopilot."""
    offset_down_m: Annotated[float, Interval(ge=-100.0, le=100.0)] = 0.0
    """Antenna below the autopilot."""
    pose_wait_s: Annotated[float, Interval(ge=0.0, le=60.0)] = 1.0
    """How long a pulse waits for a pose later than itself before it is extrapolated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionSettings:
    """``[detection]``: the search."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    frequency_window_hz: Annotated[float, Gt(0.0)] = 500.0
    """Half-width of the search around each tag's nominal frequency."""
    operating_mode: OperatingModeName = "freqSearchSoftLock"
    """How the search follows a frequency that it has found: ``freqSearchSoftLock`` (search the
    window always), ``freqSearchHardLock`` (once confirmed, ± 100 Hz around it for the rest of
    the flight), ``freqKnownHardLock`` (± 100 Hz around the nominal frequency),
    ``freqAllNeverLock`` (the whole channel, no track)."""
    workers: Annotated[int, Interval(ge=0, le=64)] = 0
    """Detector processes; 0: one for each spare core."""
    shape: Shape = "workers"
    """Which stage runs in which process: ``workers`` (a receiver and several detectors),
    ``one`` (all in one process, for a single core)."""
    maximum_tags: Annotated[int, Interval(ge=0, le=1000)] = 0
    """Most tags that are taken; 0: as many as this computer's cores carry, which is measured at
    the start of a flight with more than 100 tags."""
    k: Annotated[int, Interval(ge=0, le=100)] = 0
    """Pulses summed for one decision, for all tags; 0: as each tag says."""
    false_alarm_probability: Annotated[float, Interval(ge=0.0, le=0.5)] = 0.0
    """Expected false groups for each decision interval, for all tags; 0: as each tag says."""

    @property
    def worker_count(self) -> int:
        """Detector processes: as set, or one for each core but one."""
        return self.workers or max(1, (os.cpu_count() or 2) - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingSettings:
    """``[bearings]``: whether the drone estimates them itself."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    on_drone: bool = False
    """Also estimate bearings on the drone and send them: for a link that loses most pulses."""
    antenna: str = "RA-23K"
    """The antenna's pattern, for these."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegrationSettings:
    """``[integration]``: whether the drone itself looks for tags below the noise in flight."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    on_drone: bool = False
    """Judge each tag by the whole flight so far, twice a minute or as often as a tenth of a
    core allows, and tell what is found. Needs ``recording.channels``, and 400 MB of memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSettings:
    """``[recording]``: what is kept."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    directory: str = "flights"
    """Where flight directories are made."""
    iq: bool = False
    """Also record the decimated band while detecting (cs16 SigMF, about 5.4 GB an hour)."""
    channels: bool = True
    """Keep the samples of each tag's channel (SigMF, 54 MB an hour for each channel), for
    ``uavrt integrate``; false spares the card."""
    channels_mb: Annotated[float, Interval(ge=1.0, le=10e6)] = 2000.0
    """What the kept channels of all flights may take: beyond it the oldest are removed. Starred
    flights keep theirs, and do not count."""
    minimum_free_mb: Annotated[float, Ge(0.0)] = 500.0
    """Below this much free space IQ recording stops, and below 1.2 times as much the keeping of
    channels; pulses and poses go on."""
    capture_s: Annotated[float, Interval(gt=0.0, le=3600.0)] = 8.0
    """How long a raw capture lasts unless it is stopped."""
    save_directory: str | None = None
    """Where "save logs" copies the flights; left out: the only drive under /media."""
    remove_oldest_flights: bool = False
    """Below that, remove the oldest flight directories, never the present one, a starred one or
    one of the newest."""
    keep_newest_flights: Annotated[int, Interval(ge=1, le=100_000)] = 3
    """So many of the newest flights are never removed for room."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GuidanceSettings:
    """``[guidance]``: whether and how the drone may be flown; nothing moves unconfirmed."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    enabled: bool = False
    """Take orders of motion, each confirmed by the operator, over a link with a key."""
    may_take_off: bool = False
    """Take off when an operator orders and confirms it, once a pilot has armed; uavrt never
    arms."""
    lowest_m: Annotated[float, Interval(ge=5.0, le=500.0)] = 20.0
    """Least height above ground, which is taken to be that of home."""
    highest_m: Annotated[float, Interval(ge=10.0, le=500.0)] = 120.0
    """Greatest height above ground."""
    fence_m: Annotated[float, Interval(ge=10.0, le=10_000.0)] = 500.0
    """Greatest distance from home."""
    speed_m_s: Annotated[float, Interval(ge=0.5, le=25.0)] = 5.0
    """What the autopilot is set to fly at; times and energies are told by it."""
    airspeed_m_s: Annotated[float, Interval(ge=1.0, le=60.0)] = 12.0
    """Greatest speed through the air: against a wind the drone comes forward the slower, and in
    nearly as much it flies nowhere but home."""
    wind_m_s: Annotated[float, Interval(ge=0.0, le=30.0)] = 8.0
    """Worst wind to be expected, straight against the way home; used where the autopilot tells
    of none."""
    return_height_m: Annotated[float, Interval(ge=0.0, le=500.0)] = 60.0
    """To which the autopilot climbs before it returns: RTL_RETURN_ALT of PX4, RTL_ALT of
    ArduPilot."""
    hover_w: Annotated[float, Interval(ge=5.0, le=20_000.0)] | None = None
    """Power of hovering: volts times amperes of a flight's log. Left out, it is taken to be 400
    W, or thrice as much for the way home, until the battery has shown it in flight."""
    battery_wh: Annotated[float, Gt(0.0)] | None = None
    """Size of the full battery; without it no way is flown, only turns, hold and return."""
    reserve_percent: Annotated[float, Interval(ge=5.0, le=90.0)] = 25.0
    """What must be left in the battery at home."""
    keep_away_m: Annotated[float, Interval(ge=0.0, le=500.0)] = 30.0
    """A search keeps so far, over ground, from where animals may be; 0: it does not."""
    keep_out_file: str | None = None
    """File on the drone of people and buildings, over which nothing is flown: GeoJSON, KML or
    .plan (exclusion fences); beside it counts what comes with an order."""
    terrain: str | None = None
    """File or folder on the drone of heights of the ground (SRTM tiles, GeoTIFF): ways and ways
    home keep lowest_m above it, and a search knows what hides behind it. Without it the ground
    is taken to be level."""
    planner: str = "mi_rate"
    """Who decides in a search where to fly next."""
    headings: Annotated[int, Interval(ge=8, le=16)] = 12
    """Steps of a turn on PX4; ArduPilot turns by one command."""
    link_lost: Literal["hold", "return", "go on"] = "hold"
    """When who confirmed was not heard for 5 s; ``hold``: and return after return_after_s."""
    return_after_s: Annotated[float, Interval(ge=0.0, le=3600.0)] = 60.0
    """How long it holds."""
    unwatched_channels: tuple[Annotated[int, Interval(ge=5, le=18)], ...] = ()
    """RC channels whose steps end no order, like [16] for one that carries the RSSI; each other
    channel of the receiver is a pilot's hand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UdpChannelSettings:
    """``[udp_channels]``: the tags' channels for the original's detectors as well."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    enabled: bool = False
    """Send each tag's channel as UDP datagrams: 1024 samples at 3750 a second."""
    host: str = "127.0.0.1"
    """Where to."""
    ports: Literal["current", "thesis"] = "current"
    """``current``: 20000 + 2 × (channel - 1), and the next for a tag's second rate;
    ``thesis``: 20000 + channel - 1. The flight's ``detectorConfig.txt`` names each port."""
    stamps: Literal["seconds", "milliseconds"] = "seconds"
    """``seconds`` and nanoseconds as the current original, or the thesis's ``milliseconds``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ros2Settings:
    """``[ros2]``: the gateway to ROS 2; needs the extra ``uavrt[ros2]``."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    enabled: bool = False
    """Show the drone side as ROS 2 nodes and topics."""
    interfaces: tuple[str, ...] = ()
    """Network interfaces besides the loopback, like ["eth0"]; whoever is on them may listen,
    and command unless accept_commands is false."""
    namespace: Annotated[str, Predicate(is_ros_namespace)] = ""
    """Put before all nodes and topics, like "drone1": one for each vehicle of a ROS domain."""
    domain_id: Annotated[int, Interval(ge=0, le=232)] | None = None
    """ROS domain; left out: the environment's ROS_DOMAIN_ID, else 0."""
    node_per_tag: bool = False
    """A node for each tag's detector, Detector_tag_2, that publishes its pulses, as in the
    original; false: DetectorComponent publishes all."""
    gid_bytes: Literal[16, 24] = 16
    """Size of an identifier in ROS 2's node list: 24 for Humble and Galactic, else 16."""
    accept_commands: bool = True
    """Take tags, start and stop from ROS 2; false: only show."""
    parameter_services: bool = False
    """Have ROS 2's parameter services, for `ros2 param list`, get and set with
    RMW_IMPLEMENTATION=rmw_cyclonedds_cpp; to set obeys accept_commands and the commander."""
    accept_pulses: bool = False
    """Take pulses that detectors on other computers publish; they get a pose and go to the
    ground like our own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All of ``uavrt.toml``."""

    __pydantic_config__: ClassVar[dict[str, Any]] = STRICT

    radio: RadioSettings = field(default_factory=RadioSettings)
    mavlink: MavlinkSettings = field(default_factory=MavlinkSettings)
    pose: PoseSettings = field(default_factory=PoseSettings)
    antenna: AntennaSettings = field(default_factory=AntennaSettings)
    detection: DetectionSettings = field(default_factory=DetectionSettings)
    bearings: BearingSettings = field(default_factory=BearingSettings)
    integration: IntegrationSettings = field(default_factory=IntegrationSettings)
    recording: RecordingSettings = field(default_factory=RecordingSettings)
    guidance: GuidanceSettings = field(default_factory=GuidanceSettings)
    udp_channels: UdpChannelSettings = field(default_factory=UdpChannelSettings)
    ros2: Ros2Settings = field(default_factory=Ros2Settings)
    status_socket: str | None = None
    """Path of a Unix socket on which the supervisor shows its topics as JSON lines; left out:
    ``status.sock`` beside the flights."""
