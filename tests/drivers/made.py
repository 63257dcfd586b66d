"""Records and frames for tests that care about some of their numbers only.

Each maker fills in what a test does not say; further fields are given by their names.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, SupportsFloat

import numpy as np
from numpy.typing import NDArray

from uavrt.config.settings import Settings
from uavrt.core.commands import SystemState
from uavrt.core.earth.attitude import from_euler_deg
from uavrt.core.messages import (
    Beep,
    BeepKind,
    ChannelBlock,
    Command,
    CommandReply,
    FlightInfo,
    Health,
    IQBlock,
    LiveBearing,
    Pose,
    ProcessStatus,
    Pulse,
    PulsePose,
    SearchReport,
    SystemStatus,
    Tag,
    VehicleFence,
)
from uavrt.detection.detector import PulseDetector
from uavrt.drone.supervisor.mission.operator_commands import Mission
from uavrt.drone.supervisor.mission.saved_state import StateStore
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.reading.flight_reader import Flight as RecordedFlight
from uavrt.guidance.files.mission import (
    ABSOLUTE_FRAME,
    CIRCLE_OUTSIDE,
    CIRCLE_WITHIN,
    CORNER_OUTSIDE,
    CORNER_WITHIN,
    MissionItem,
)
from uavrt.link.mavlink import dialect
from uavrt.link.tunnel.generations.g1 import TagG1
from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.flight import Flight
from uavrt.simulation.scene.propagation import Propagation
from uavrt.simulation.scene.scenario import Radio, Scenario, SimulatedTag
from uavrt.simulation.vehicle.simulated_flying import NOT_GIVEN
from uavrt_experiments.detection.signals import TruePulse, pulse_train

FREQUENCY_HZ = 148.71e6
PARAMS = ("param1", "param2", "param3", "param4")


def tag(
    tag_id: int = 2, frequency_hz: float = FREQUENCY_HZ, *intervals_s: float, **fields: Any
) -> Tag:
    """Make a tag that beeps for 20 ms, each 1.254 s unless other intervals are given."""
    usual: dict[str, Any] = {
        "pulse_width_s": 0.02,
        "pulse_intervals_s": intervals_s or (1.254,),
    }
    return Tag(tag_id=tag_id, frequency_hz=frequency_hz, **(usual | fields))


def simulated_tag(
    tag_id: int = 2, frequency_hz: float = FREQUENCY_HZ, *intervals_s: float, **fields: Any
) -> SimulatedTag:
    """Make an animal's tag that beeps for 20 ms, each 1.254 s unless intervals are given."""
    usual: dict[str, Any] = {
        "pulse_width_s": 0.02,
        "pulse_intervals_s": intervals_s or (1.254,),
    }
    return SimulatedTag(tag_id=tag_id, frequency_hz=frequency_hz, **(usual | fields))


STILL_TAG = simulated_tag(1, 150_001_000.0, 1.0, north_m=100.0, height_m=30.0, erp_dbm=-80.0)
"""100 m north of home, received with a calculable level."""


def still_scenario(**changes: Any) -> Scenario:
    """Make a drone at rest 30 m above home, without reflections and fading, at 48 kS/s."""
    scenario = Scenario(
        seed=5,
        radio=Radio(sample_rate_hz=48_000.0, center_frequency_hz=150e6, dc_offset=0.0),
        antenna=Antenna(pattern="isotropic", gain_dbi=0.0, polarization="any"),
        propagation=Propagation(),
        tag=(STILL_TAG,),
        flight=Flight(height_m=30.0, wobble_deg=0.0),
    )
    return replace(scenario, **changes)


def pulse(start_time_ns: int, **fields: Any) -> Pulse:
    """Make a confirmed pulse of 20 ms and 20 dB of tag 2."""
    snr_db = fields.get("snr_db", 20.0)
    usual: dict[str, Any] = {
        "tag_id": 2,
        "frequency_hz": FREQUENCY_HZ,
        "end_time_ns": start_time_ns + 20_000_000,
        "snr_db": snr_db,
        "group_snr_db": snr_db,
        "score": 2.0,
        "group_index": 1,
        "group_sequence": 1,
        "noise_psd": 1e-12,
        "detection_status": "confirmed",
        "confirmed": True,
        "rate": 1,
        "predicted_next_start_ns": None,
        "predicted_next_end_ns": None,
    }
    return Pulse(start_time_ns=start_time_ns, **(usual | fields))


def pulse_of_group(first_ns: int, number: int, frequency_hz: float) -> Pulse:
    """Make a pulse of the thesis's tag, with a value in each field that a message has."""
    start_ns = first_ns + number * 1_254_000_000
    return pulse(
        start_ns,
        frequency_hz=frequency_hz,
        snr_db=20.5,
        group_snr_db=20.25,
        score=2.5,
        group_index=1 + number % 3,
        group_sequence=number // 3,
        noise_psd=1e-9,
        predicted_next_start_ns=start_ns + 1_194_000_000,
        predicted_next_end_ns=start_ns + 1_314_000_000,
    )


def pose(
    time_ns: int = 0,
    latitude_deg: SupportsFloat = 46.5,
    longitude_deg: SupportsFloat = 8.0,
    *,
    yaw_deg: float = 0.0,
    **fields: Any,
) -> Pose:
    """Make a level pose 40 m above the take-off point, at 1000 m."""
    usual: dict[str, Any] = {
        "altitude_amsl_m": 1000.0,
        "altitude_relative_m": 40.0,
        "quaternion_wxyz": from_euler_deg(yaw_deg, 0.0, 0.0),
    }
    usual |= {"latitude_deg": float(latitude_deg), "longitude_deg": float(longitude_deg)}
    return Pose(time_ns=time_ns, **(usual | fields))


def flight_info(directory: Path | str, tags: tuple[Tag, ...] = (), **fields: Any) -> FlightInfo:
    """Make what starts a flight at 148.7 MHz with 3 MS/s."""
    usual: dict[str, Any] = {
        "start_time_ns": 0,
        "clock_offset_ns": 0,
        "center_frequency_hz": 148.7e6,
        "sample_rate_hz": 3e6,
    }
    return FlightInfo(directory=str(directory), tags=tags, **(usual | fields))


def flight(
    info: FlightInfo,
    settings: Settings | None = None,
    *,
    poses: Iterable[Pose] = (),
    pulse_poses: Iterable[PulsePose] = (),
    pulses: Iterable[Pulse] = (),
) -> Path:
    """Record a whole flight; its directory."""
    recorder = FlightRecorder.create(info, settings)
    recorder.write(*poses)
    recorder.write_pulses(pulse_poses)
    recorder.write_pulses(pulses)
    recorder.close()
    return Path(info.directory)


def recorded_flight(
    info: FlightInfo, poses: Iterable[Pose], pulse_poses: Iterable[PulsePose] = ()
) -> RecordedFlight:
    """Make what is read of a flight, without a file."""
    return RecordedFlight(
        info=info,
        settings_json=None,
        pulse_poses=tuple(pulse_poses),
        poses=tuple(poses),
        status_texts=(),
        notes=(),
    )


def search_report(tag_id: int, time_ns: int, **fields: Any) -> SearchReport:
    """Make a report that nothing was found."""
    usual: dict[str, Any] = {
        "frequency_hz": FREQUENCY_HZ,
        "noise_psd": 1e-12,
        "best_score": 0.5,
    }
    return SearchReport(tag_id=tag_id, time_ns=time_ns, **(usual | fields))


def live_bearing(tag_id: int = 2, **fields: Any) -> LiveBearing:
    """Make an accepted bearing of a whole turn with 24 pulses."""
    usual: dict[str, Any] = {
        "turned_deg": 360.0,
        "latitude_deg": 46.5,
        "longitude_deg": 8.0,
        "level_db": 20.0,
        "pulses": 24,
        "accepted": True,
        "ambiguous": False,
        "multipath_suspected": False,
    }
    return LiveBearing(tag_id=tag_id, **(usual | fields))


def beep(kind: BeepKind = BeepKind.OFF_LABEL, **fields: Any) -> Beep:
    """Make a sender of pulses at 148.71 MHz every 1.254 s."""
    usual: dict[str, Any] = {
        "time_ns": 0,
        "frequency_hz": 148_710_000.0,
        "interval_s": 1.254,
        "jitter_s": 0.005,
        "pulses": 12,
        "level_db": 20.0,
        "offsets_hz": (0.0,) * len(fields.get("tag_ids", ())),
    }
    return Beep(kind=kind, **(usual | fields))


def system_status(time_ns: int = 0, **fields: Any) -> SystemStatus:
    """Make the status of a drone that detects without tags and processes."""
    usual: dict[str, Any] = {
        "state": SystemState.DETECTING,
        "flight_directory": None,
        "center_frequency_hz": None,
        "tags": (),
        "processes": (),
    }
    return SystemStatus(time_ns=time_ns, **(usual | fields))


def process_status(process: str, status: str, **fields: Any) -> ProcessStatus:
    """Make the status of a process that runs and has used nothing."""
    usual: dict[str, Any] = {
        "running": True,
        "pid": 1,
        "ok": True,
        "restarts": 0,
        "cpu_s": 0.0,
        "memory_mb": 0.0,
    }
    return ProcessStatus(process=process, status=status, **(usual | fields))


def health(process: str, time_ns: int = 0, **fields: Any) -> Health:
    """Make what a process says of itself that is ready."""
    usual: dict[str, Any] = {"status": "ready", "ok": True}
    return Health(process=process, time_ns=time_ns, **(usual | fields))


def reply(command: Command, message: str = "", *, accepted: bool = True) -> CommandReply:
    """Make the answer to a command."""
    return CommandReply(
        request_id=command.request_id, name=command.name, accepted=accepted, message=message
    )


def iq_block(
    samples: NDArray[Any], sample_index: int, rate_hz: float, start_ns: int = 0, **fields: Any
) -> IQBlock:
    """Make a block of a stream that began at `start_ns`."""
    usual: dict[str, Any] = {"time_ns": start_ns + round(sample_index * 1e9 / rate_hz)}
    return IQBlock(
        samples=samples, sample_index=sample_index, sample_rate_hz=rate_hz, **(usual | fields)
    )


def channel_block(
    samples: NDArray[Any], sample_index: int, rate_hz: float, start_ns: int = 0, **fields: Any
) -> ChannelBlock:
    """Make a block of channel 0 of a stream that began at `start_ns`."""
    usual: dict[str, Any] = {
        "channel": 0,
        "center_frequency_hz": FREQUENCY_HZ,
        "time_ns": start_ns + round(sample_index * 1e9 / rate_hz),
    }
    return ChannelBlock(
        samples=samples, sample_index=sample_index, sample_rate_hz=rate_hz, **(usual | fields)
    )


def train(
    rng: np.random.Generator,
    duration_s: float,
    enr_db: float | Callable[[float], float],
    **fields: Any,
) -> list[TruePulse]:
    """Make the pulses that a tag sends, each 1.254 s on its frequency."""
    usual: dict[str, Any] = {"interval_s": 1.254, "offset_hz": 0.0}
    return pulse_train(rng, duration_s=duration_s, enr_db=enr_db, **(usual | fields))


def detector(tag: Tag, rate_hz: float = 3750.0, **options: Any) -> PulseDetector:
    """Make a tag's detector on a channel around the tag's frequency."""
    usual: dict[str, Any] = {"center_frequency_hz": tag.frequency_hz}
    return PulseDetector(tag, sample_rate_hz=rate_hz, **(usual | options))


def mission(settings: Settings, directory: Path, **options: Any) -> Mission:
    """Make a supervisor's mission whose events go nowhere."""
    usual: dict[str, Any] = {
        "notify": lambda _severity, _text: None,
        "on_start": lambda _flight: None,
        "on_stop": lambda: None,
    }
    return Mission(settings, StateStore(directory), **(usual | options))


def heartbeat(**fields: Any) -> dialect.Heartbeat:
    """Make the heartbeat of a companion computer, or of what the fields say."""
    usual: dict[str, Any] = {
        "type": 18,
        "autopilot": 8,
        "base_mode": 0,
        "custom_mode": 0,
        "system_status": 4,
    }
    return dialect.Heartbeat(mavlink_version=3, **(usual | fields))


def tunnel(payload_type: int, payload: bytes, **fields: Any) -> dialect.Tunnel:
    """Make a TUNNEL message to the ground station 254/190."""
    usual: dict[str, Any] = {
        "target_system": 254,
        "target_component": 190,
        "payload_length": len(payload),
    }
    return dialect.Tunnel(payload_type=payload_type, payload=payload, **(usual | fields))


def tunnel_tag(**fields: Any) -> TagG1:
    """Make the thesis's tag as version 1 of the tunnel sends it."""
    usual: dict[str, Any] = {
        "tag_id": 2,
        "frequency_hz": 148_710_000,
        "pulse_width_ms": 20,
        "interval1_ms": 1254,
        "interval2_ms": 0,
        "interval_uncertainty_ms": 60,
        "interval_jitter_ms": 10,
        "k": 3,
        "false_alarm_probability": 0.005,
    }
    return TagG1(**(usual | fields))


def mission_items(
    items: Iterable[MissionItem], kind: int = 0
) -> tuple[dialect.MissionItemInt, ...]:
    """Make the messages of a mission (0) or fence (1), as any ground station uploads them."""
    return tuple(
        dialect.MissionItemInt(
            target_system=1,
            target_component=1,
            seq=number,
            frame=one.frame,
            command=one.command,
            current=0,
            autocontinue=1,
            **dict(zip(PARAMS, one.params, strict=True)),
            x=one.x,
            y=one.y,
            z=one.z,
            mission_type=kind,
        )
        for number, one in enumerate(items)
    )


def reposition(**fields: Any) -> dialect.CommandInt:
    """Make a DO_REPOSITION that holds the vehicle where it is."""
    usual: dict[str, Any] = {
        "target_system": 1,
        "target_component": 1,
        "frame": 0,
        "current": 0,
        "autocontinue": 0,
        "param1": -1.0,
        "param2": 1.0,
        "param3": 0.0,
        "param4": math.nan,
        "x": NOT_GIVEN,
        "y": NOT_GIVEN,
        "z": math.nan,
    }
    command = dialect.MavCmd.DO_REPOSITION
    return dialect.CommandInt(command=command, **(usual | fields))


def command_long(command: int, *params: float, **fields: Any) -> dialect.CommandLong:
    """Make a COMMAND_LONG to the autopilot 1/1; parameters that are not given are 0."""
    usual: dict[str, Any] = {"target_system": 1, "target_component": 1, "confirmation": 0}
    usual |= {f"param{n}": 0.0 for n in range(1, 8)}
    usual |= {f"param{n}": param for n, param in enumerate(params, 1)}
    return dialect.CommandLong(command=command, **(usual | fields))


def fence_items(fence: VehicleFence) -> tuple[MissionItem, ...]:
    """Make the mission items of a fence, as a ground station uploads them."""
    found: list[MissionItem] = []
    for areas, corner, circle in (
        (fence.within, CORNER_WITHIN, CIRCLE_WITHIN),
        (fence.keep_out, CORNER_OUTSIDE, CIRCLE_OUTSIDE),
    ):
        for one in areas:
            command = corner if one.radius_m is None else circle
            first = float(len(one.places)) if one.radius_m is None else one.radius_m
            found += [
                MissionItem.at(command, ABSOLUTE_FRAME, place, first=first)
                for place in one.places
            ]
    return tuple(found)
