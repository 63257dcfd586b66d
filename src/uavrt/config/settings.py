"""Settings of the drone in ``uavrt.toml``, which `uavrt.config.loader` reads.

Each class is one table of the file. The defaults suit a first flight.
"""

import os
import re
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Gt, Interval, Predicate


class _Table:
    """Base class of the classes that each define one table of ``uavrt.toml``."""

    __slots__ = ()
    __pydantic_config__: ClassVar[dict[str, Any]] = {
        "extra": "forbid",
        "strict": True,
        "allow_inf_nan": False,
        "use_attribute_docstrings": True,
    }
    """Options that `uavrt.config.loader` passes to pydantic. This is a plain dict so that
    programs on the drone need not import pydantic."""


def is_ros_namespace(text: str) -> bool:
    """True if a text is a valid ROS 2 namespace: names of letters, digits and single
    underscores, separated by slashes.

    Rules: design.ros2.org, "Topic and Service name mapping to DDS".
    """
    named = re.fullmatch(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*", text)
    return text == "" or (named is not None and "__" not in text and len(text) <= 100)


Shape = Literal["workers", "one"]
OperatingModeName = Literal[
    "freqSearchSoftLock", "freqSearchHardLock", "freqKnownHardLock", "freqAllNeverLock"
]
"""Names of the values of `uavrt.detection.modes.OperatingMode`, as in the original system's
``detectorConfig.txt``."""
NamedValuesName = Literal["all", "snr", "off"]
RADIO_GROUP = "uavrt.radios"
"""Entry point group in which other installed packages register radios
(docs/how-to/extend.md)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioSettings(_Table):
    """``[radio]``: the receiver and its settings."""

    kind: str = "airspy"
    """A radio of the manual's list, such as ``airspy`` (Mini, R2) or ``rtlsdr``; ``soapy`` for
    others; or one that an installed package adds."""
    program: tuple[str, ...] = ()
    """Program and first arguments, instead of the usual one (``airspy_rx`` …); empty: usual."""
    sample_rate_hz: Annotated[float, Interval(ge=3_000.0, le=100e6)] = 3_000_000.0
    """Sample rate of the radio [Hz]."""
    gain: Annotated[int, Ge(0)] | None = None
    """Gain [steps of the radio] (Airspy: 0 to 21); left out: the radio's usual gain."""
    bias_tee: bool = False
    """Power an amplifier at the antenna through the cable."""
    frequency_correction_ppm: Annotated[float, Interval(ge=-200.0, le=200.0)] = 0.0
    """Known error of the radio's crystal [ppm], positive when it runs fast."""
    serial: str | None = None
    """Serial number of the device; needed if several are connected."""
    center_frequency_hz: Annotated[float, Interval(ge=20e6, le=1e9)] | None = None
    """Radio frequency [Hz]; left out: the tuner chooses it from the tags."""
    retry_s: Annotated[float, Interval(ge=0.1, le=60.0)] = 3.0
    """Time between attempts to open a radio that has failed twice within ten seconds [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MavlinkSettings(_Table):
    """``[mavlink]``: connection to autopilot and ground stations."""

    address: str = "serial:///dev/ttyUSB0:57600"
    """``serial:///dev/ttyUSB0:57600``, ``udpin://127.0.0.1:14540``, ``udpout://HOST:PORT``,
    ``tcp://HOST:PORT``; empty for none (cart, bench and field-monitor use)."""
    direct_links: tuple[str, ...] = ()
    """Further links, direct to ground stations, such as ["udpin://0.0.0.0:14560"] over Wi-Fi:
    pulses, answers and files use the first link with a ground station, else the autopilot's."""
    system_id: Annotated[int, Interval(ge=1, le=253)] = 1
    """MAVLink system id without an autopilot; with one, the autopilot's id is used. Each
    station and vehicle needs its own id."""
    component_id: Annotated[int, Interval(ge=1, le=255)] = 191
    """Component id in the vehicle's MAVLink system; 191 is the first onboard computer."""
    tunnel_gap_s: Annotated[float, Interval(ge=0.012, le=1.0)] = 0.020
    """Time between two tunnel messages [s]; at least 0.012."""
    attitude_rate_hz: Annotated[float, Interval(gt=0.0, le=250.0)] = 50.0
    """Rate of attitude messages requested from the autopilot [Hz]."""
    position_rate_hz: Annotated[float, Interval(gt=0.0, le=250.0)] = 10.0
    """Rate of position messages requested from the autopilot [Hz]."""
    parameter_encoding: Literal["auto", "bytewise", "c_cast", "float"] = "auto"
    """Encoding of whole numbers in parameters. auto: as the autopilot (PX4 bytewise, ArduPilot
    cast), which most ground stations expect. float: all parameters are of type float, which
    every ground station reads, also MAVProxy with a PX4."""
    named_values: NamedValuesName = "all"
    """SNR and count of each tag as NAMED_VALUE_FLOAT (``SNR_2``, ``CNT_2``), while another
    ground station than ours is connected; snr: SNR alone, for plots of one tag; off: none."""
    commanders: tuple[Annotated[int, Interval(ge=1, le=255)], ...] = ()
    """System ids of the ground stations that may command; empty: all."""
    first_commands: bool = True
    """true: only the first station that commands a flight, by MAVLink or ROS 2, may command it,
    until it is silent for 60 s or another uses a sealed command. false: all stations may."""
    key_file: str | None = None
    """File with a key of 32 or more hexadecimal digits, as on the ground station. With a key,
    only commands sealed with it are accepted; ground stations without it can only listen."""
    key_required: bool = True
    """If a key is set: true accepts only sealed commands; false also unsealed ones, from the
    first station that commands. A station with the key may command at any time."""
    signing_key_file: str | None = None
    """File with a key of 64 hexadecimal digits: MAVLink 2 signing, for direct links and through
    ArduPilot. PX4 1.17 breaks the signatures of frames that it forwards; use key_file there."""
    accept_unsigned: Literal["none", "autopilot", "all"] = "autopilot"
    """Sources whose unsigned frames are accepted if a signing key is set; of the autopilot,
    only telemetry."""
    tunnel_generation: Literal["auto", "G0", "G1", "G2v1", "G2"] = "auto"
    """Wire format towards the ground; auto: the format of the ground station. Numbered versions
    of the original must be set: G2v1 is version 1, G2 that of tunnel_version."""
    tunnel_version: Annotated[int, Interval(ge=4, le=7)] = 7
    """Protocol version number sent with G2; the ground station must expect exactly this one."""
    tunnel_experimental: bool = False
    """Allow G2, whose layouts were partly inferred and not verified with an original system."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseSettings(_Table):
    """``[pose]``: source of position and heading; a mast or a person has no autopilot."""

    source: Literal["autopilot", "fixed", "nmea", "gpsd"] = "autopilot"
    """``autopilot``; ``fixed``: the values below, for a mast; ``nmea`` or ``gpsd``: a GPS
    receiver, for a person or a cart. All but the autopilot need an empty mavlink.address and
    reach ground stations by mavlink.direct_links."""
    address: str = ""
    """Address of the receiver: NMEA by serial:///dev/ttyACM0:9600, udpin://0.0.0.0:10110 or
    tcp://HOST:PORT; gpsd by HOST:PORT, empty for the one on this computer."""
    latitude_deg: Annotated[float, Interval(ge=-90.0, le=90.0)] | None = None
    """Latitude of a fixed station [°]."""
    longitude_deg: Annotated[float, Interval(ge=-180.0, le=180.0)] | None = None
    """Longitude of a fixed station [°]."""
    altitude_amsl_m: Annotated[float, Interval(ge=-500.0, le=9000.0)] = 0.0
    """Altitude of the ground above mean sea level [m], if no receiver reports it."""
    height_m: Annotated[float, Interval(ge=0.0, le=500.0)] = 2.0
    """Height of the antenna above ground [m]."""
    heading_deg: Annotated[float, Interval(ge=-360.0, le=360.0)] | None = None
    """Direction of the station [°], clockwise from true north; left out: from the receiver's
    compass (NMEA's HDT and THS, gpsd's ATT). The parameter POSE_HEADING sets it at any time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AntennaSettings(_Table):
    """``[antenna]``: mounting of the antenna on the vehicle."""

    yaw_offset_deg: Annotated[float, Interval(ge=-360.0, le=360.0)] = 0.0
    """Yaw of the antenna's boresight from the vehicle's nose [°], clockwise seen from above."""
    pitch_offset_deg: Annotated[float, Interval(ge=-180.0, le=180.0)] = 0.0
    """Pitch of the boresight from the vehicle's level [°], positive up; applied after yaw."""
    roll_offset_deg: Annotated[float, Interval(ge=-180.0, le=180.0)] = 0.0
    """Roll of the antenna around its boresight [°], positive right side down; applied last."""
    offset_forward_m: Annotated[float, Interval(ge=-100.0, le=100.0)] = 0.0
    """Distance of the antenna from the autopilot [m], positive forward."""
    offset_right_m: Annotated[float, Interval(ge=-100.0, le=100.0)] = 0.0
    """Distance of the antenna from the autopilot [m], positive to the right."""
    offset_down_m: Annotated[float, Interval(ge=-100.0, le=100.0)] = 0.0
    """Distance of the antenna from the autopilot [m], positive down."""
    pose_wait_s: Annotated[float, Interval(ge=0.0, le=60.0)] = 1.0
    """Longest time that a pulse waits for a later pose [s]; its pose is then extrapolated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionSettings(_Table):
    """``[detection]``: the search for pulses of the tags."""

    frequency_window_hz: Annotated[float, Gt(0.0)] = 500.0
    """Half-width of the search around each tag's nominal frequency [Hz]."""
    operating_mode: OperatingModeName = "freqSearchSoftLock"
    """Frequency search after a detection: ``freqSearchSoftLock`` (search the window always),
    ``freqSearchHardLock`` (± 100 Hz around a confirmed frequency for the rest of the flight),
    ``freqKnownHardLock`` (± 100 Hz around the nominal frequency), ``freqAllNeverLock`` (the
    whole channel, no track)."""
    workers: Annotated[int, Interval(ge=0, le=64)] = 0
    """Number of detector processes; 0: one for each spare core."""
    shape: Shape = "workers"
    """Processes: ``workers`` (a receiver and several detectors), ``one`` (all in one process,
    for a single core)."""
    maximum_tags: Annotated[int, Interval(ge=0, le=1000)] = 0
    """Maximum number of tags accepted; 0: as many as this computer's cores can search, which is
    measured at the start of a flight with more than 100 tags."""
    k: Annotated[int, Interval(ge=0, le=100)] = 0
    """Number of pulses summed for one decision, for all tags; 0: as in each tag's entry."""
    false_alarm_probability: Annotated[float, Interval(ge=0.0, le=0.5)] = 0.0
    """Probability of a false group per decision, for all tags; 0: as in each tag's entry."""

    @property
    def worker_count(self) -> int:
        """Number of detector processes: the setting, or one less than the number of cores."""
        return self.workers or max(1, (os.cpu_count() or 2) - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingSettings(_Table):
    """``[bearings]``: bearing estimates on the drone."""

    on_drone: bool = False
    """Also estimate bearings on the drone and send them: for a link that loses most pulses."""
    antenna: str = "RA-23K"
    """Antenna pattern used for bearings on the drone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegrationSettings(_Table):
    """``[integration]``: search for tags below the noise during the flight."""

    on_drone: bool = False
    """Search each tag in the whole flight so far, twice a minute or as often as a tenth of a
    core allows, and report finds. Needs ``recording.channels``, and 400 MB of memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSettings(_Table):
    """``[recording]``: files that a flight keeps."""

    directory: str = "flights"
    """Folder that contains the flight directories."""
    iq: bool = False
    """Also record the decimated band while detecting (cs16 SigMF, about 5.4 GB an hour)."""
    channels: bool = True
    """Record the samples of each tag's channel (SigMF, 54 MB an hour for each channel), for
    ``uavrt integrate``; false saves space on the card."""
    channels_mb: Annotated[float, Interval(ge=1.0, le=10e6)] = 2000.0
    """Maximum space for recorded channels of all flights [MB]; the oldest are removed beyond
    it. Channels of starred flights are not removed and do not count."""
    minimum_free_mb: Annotated[float, Ge(0.0)] = 500.0
    """Free space below which IQ recording stops [MB]; channel recording stops below 1.2 times
    as much, and pulses and poses are still recorded."""
    capture_s: Annotated[float, Interval(gt=0.0, le=3600.0)] = 8.0
    """Duration of a raw capture unless it is stopped earlier [s]."""
    save_directory: str | None = None
    """Folder to which "save logs" copies the flights; left out: the only drive under /media."""
    remove_oldest_flights: bool = False
    """Below minimum_free_mb, remove the oldest flight directories, except the present one,
    starred ones and the newest."""
    keep_newest_flights: Annotated[int, Interval(ge=1, le=100_000)] = 3
    """Number of newest flights that are never removed to free space."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GuidanceSettings(_Table):
    """``[guidance]``: flight control; every motion needs a confirmed order."""

    enabled: bool = False
    """Accept motion orders, each confirmed by the operator, over a link with a key."""
    may_take_off: bool = False
    """Take off when an operator confirms the order and a pilot has armed; uavrt never arms."""
    lowest_m: Annotated[float, Interval(ge=5.0, le=500.0)] = 20.0
    """Minimum height above ground [m]; without terrain, ground is level with home."""
    highest_m: Annotated[float, Interval(ge=10.0, le=500.0)] = 120.0
    """Maximum height above ground [m]."""
    fence_m: Annotated[float, Interval(ge=10.0, le=10_000.0)] = 500.0
    """Maximum distance from home [m]."""
    speed_m_s: Annotated[float, Interval(ge=0.5, le=25.0)] = 5.0
    """Flight speed set in the autopilot [m/s]; also used for planned times and energies."""
    airspeed_m_s: Annotated[float, Interval(ge=1.0, le=60.0)] = 12.0
    """Maximum airspeed [m/s]. Headwind reduces ground speed; in wind close to this speed the
    drone only flies home."""
    wind_m_s: Annotated[float, Interval(ge=0.0, le=30.0)] = 8.0
    """Worst expected headwind on the way home [m/s], for an autopilot that reports no wind."""
    return_height_m: Annotated[float, Interval(ge=0.0, le=500.0)] = 60.0
    """Height to which the autopilot climbs before it returns [m]: RTL_RETURN_ALT of PX4,
    RTL_ALT of ArduPilot."""
    hover_w: Annotated[float, Interval(ge=5.0, le=20_000.0)] | None = None
    """Hover power [W]: volts times amperes from a flight's log. Left out: 400 W is assumed, and
    three times as much for the way home, until it is measured in flight."""
    battery_wh: Annotated[float, Gt(0.0)] | None = None
    """Energy of the full battery [Wh]; without it only turns, hold and return are flown."""
    reserve_percent: Annotated[float, Interval(ge=5.0, le=90.0)] = 25.0
    """Battery charge that must remain on arrival at home [%]."""
    keep_away_m: Annotated[float, Interval(ge=0.0, le=500.0)] = 30.0
    """Minimum distance of a search from possible animal positions [m]; 0: no limit."""
    keep_out_file: str | None = None
    """File on the drone with areas that must not be overflown, such as people and buildings:
    GeoJSON, KML or .plan (exclusion fences). Areas in an order are added to it."""
    terrain: str | None = None
    """File or folder on the drone with ground heights (SRTM tiles, GeoTIFF): paths and flights
    home keep lowest_m above it, and a search takes hills into account. Without it level ground
    is assumed."""
    planner: str = "mi_rate"
    """Planner that chooses the next leg of a search."""
    headings: Annotated[int, Interval(ge=8, le=16)] = 12
    """Number of headings in a turn on PX4; ArduPilot turns by one command."""
    link_lost: Literal["hold", "return", "go on"] = "hold"
    """Action after 5 s without contact to the station that confirmed the order; ``hold`` also
    returns after return_after_s."""
    return_after_s: Annotated[float, Interval(ge=0.0, le=3600.0)] = 60.0
    """Time of holding after the link is lost, before the return home [s]."""
    unwatched_channels: tuple[Annotated[int, Interval(ge=5, le=18)], ...] = ()
    """RC channels whose changes do not end an order, like [16] for a channel with the RSSI; a
    change on any other channel is a pilot's takeover."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UdpChannelSettings(_Table):
    """``[udp_channels]``: the tags' channels, sent to the original's detectors as well."""

    enabled: bool = False
    """Send each tag's channel as UDP datagrams of 1024 samples, at a rate of 3750 Hz."""
    host: str = "127.0.0.1"
    """Destination host."""
    ports: Literal["current", "thesis"] = "current"
    """``current``: 20000 + 2 × (channel - 1), and the next for a tag's second rate;
    ``thesis``: 20000 + channel - 1. The flight's ``detectorConfig.txt`` names each port."""
    stamps: Literal["seconds", "milliseconds"] = "seconds"
    """Time stamps: ``seconds`` and nanoseconds as in the current original, or ``milliseconds``
    as in the thesis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ros2Settings(_Table):
    """``[ros2]``: the gateway to ROS 2; needs the extra ``uavrt[ros2]``."""

    enabled: bool = False
    """Publish the drone side as ROS 2 nodes and topics."""
    interfaces: tuple[str, ...] = ()
    """Network interfaces besides the loopback, like ["eth0"]. Every computer on them may
    listen, and also command unless accept_commands is false."""
    namespace: Annotated[str, Predicate(is_ros_namespace)] = ""
    """Prefix of all nodes and topics, like "drone1": one for each vehicle of a ROS domain."""
    domain_id: Annotated[int, Interval(ge=0, le=232)] | None = None
    """ROS domain; left out: the environment's ROS_DOMAIN_ID, else 0."""
    node_per_tag: bool = False
    """A node for each tag's detector, Detector_tag_2, that publishes its pulses, as in the
    original; false: DetectorComponent publishes all."""
    gid_bytes: Literal[16, 24] = 16
    """Size of an identifier in ROS 2's node list: 24 for Humble and Galactic, else 16."""
    accept_commands: bool = True
    """Accept tag lists, and start and stop commands, from ROS 2; false: publish only."""
    parameter_services: bool = False
    """Provide ROS 2's parameter services, for `ros2 param list`, get and set with
    RMW_IMPLEMENTATION=rmw_cyclonedds_cpp; set obeys accept_commands and the commander."""
    accept_pulses: bool = False
    """Accept pulses published by detectors on other computers; they get a pose and are sent to
    the ground like our own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings(_Table):
    """All of ``uavrt.toml``."""

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
    """Path of a Unix socket on which the supervisor sends its topics as JSON lines; left out:
    ``status.sock`` in the folder of the flights."""
