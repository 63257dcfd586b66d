"""The drone side's settings, as in ``uavrt.toml``; the loader is `uavrt.config.loader`.

Each class is one table of the file; each default is what a first flight needs.
"""

from dataclasses import dataclass, field
from typing import Literal

RadioKind = Literal["airspy", "airspyhf", "rtlsdr", "hackrf", "soapy"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioSettings:
    """``[radio]``: which receiver, and how it is set."""

    kind: RadioKind = "airspy"
    program: tuple[str, ...] = ()
    """Program and first arguments in place of the usual one (``airspy_rx`` …); empty: usual."""
    sample_rate_hz: float = 3_000_000.0
    gain: int | None = None
    """Gain in the radio's own steps (Airspy: 0 to 21); None: a sensible one."""
    bias_tee: bool = False
    """Power an amplifier at the antenna through the cable."""
    frequency_correction_ppm: float = 0.0
    serial: str | None = None
    """Serial number of the device, when there are several."""
    center_frequency_hz: float | None = None
    """Radio frequency; None lets the tuner choose it from the tags."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MavlinkSettings:
    """``[mavlink]``: the way to the autopilot."""

    address: str = "serial:///dev/ttyUSB0:57600"
    """``serial:///dev/ttyUSB0:57600``, ``udpin://127.0.0.1:14540``, ``udpout://HOST:PORT``,
    ``tcp://HOST:PORT``; empty for none (cart, bench and field-monitor use)."""
    component_id: int = 191
    tunnel_gap_s: float = 0.020
    """Time between two tunnel messages; never below 0.012 (reference/mavlink.md §1)."""
    attitude_rate_hz: float = 50.0
    position_rate_hz: float = 10.0
    tunnel_generation: Literal["auto", "G0", "G1"] = "auto"
    """Wire format towards the ground; auto answers in the format the ground used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AntennaSettings:
    """``[antenna]``: how the antenna sits on the vehicle."""

    yaw_offset_deg: float = 0.0
    """Antenna boresight clockwise from the vehicle's nose."""
    pitch_offset_deg: float = 0.0
    roll_offset_deg: float = 0.0
    offset_forward_m: float = 0.0
    offset_right_m: float = 0.0
    offset_down_m: float = 0.0
    pose_wait_s: float = 1.0
    """How long a pulse waits for a pose later than itself before it is extrapolated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionSettings:
    """``[detection]``: the search."""

    frequency_window_hz: float = 500.0
    """Half-width of the search around each tag's nominal frequency."""
    workers: int = 0
    """Detector processes; 0: one for each spare core."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSettings:
    """``[recording]``: what is kept."""

    directory: str = "flights"
    """Where flight directories are made."""
    iq: bool = False
    """Also record the decimated band while detecting (cs16 SigMF, about 5.4 GB an hour)."""
    minimum_free_mb: float = 500.0
    """Below this much free space IQ recording stops; pulses and poses go on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All of ``uavrt.toml``."""

    radio: RadioSettings = field(default_factory=RadioSettings)
    mavlink: MavlinkSettings = field(default_factory=MavlinkSettings)
    antenna: AntennaSettings = field(default_factory=AntennaSettings)
    detection: DetectionSettings = field(default_factory=DetectionSettings)
    recording: RecordingSettings = field(default_factory=RecordingSettings)
    status_socket: str | None = None
    """Path of a Unix socket on which the supervisor shows its topics as JSON lines."""
