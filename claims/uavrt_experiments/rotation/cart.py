"""The thesis's rotation test (§5.5) as a simulated world, received by the real chain.

A cart at 35°10'29.5" N, 111°39'26.5" W points at the tag, stands, turns once in a minute and
stands again: 76 s in all, as from 17:46:19 to 17:47:35. Samples go through the front end and
the detector. The autopilot's poses go as MAVLink bytes through the frame parser and the stored
poses. The thesis does not give the tag's distance; 60 m is assumed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from uavrt.analysis.measure.recorded_pulses import DetectionChain
from uavrt.core.messages import Pose, Pulse, PulsePose
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s, wrap_degrees_360
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.pose_samples import attitude_sample, position_sample
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.localization.pose.attacher import PoseAttacher
from uavrt.localization.pose.ring import PoseRing
from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.geometry import from_euler_deg
from uavrt.simulation.scene.propagation import Propagation, Wall
from uavrt.simulation.scene.scenario import Home, Scenario, SimulatedTag
from uavrt.simulation.vehicle.vehicle_telemetry import telemetry_message
from uavrt_experiments.simulated_source import SimulatedSource

MAGNETIC_HEADING_DEG = 351.0
"""Magnetic heading of the tag from the cart in the thesis [deg]."""
DECLINATION_DEG = 10.0
"""Declination at Flagstaff in 2023 [deg], rounded; the autopilot's headings are true."""
BEARING_DEG = wrap_degrees_360(MAGNETIC_HEADING_DEG + DECLINATION_DEG)
STILL_S, TURN_S = 8.0, 60.0
DISTANCE_M = 60.0
LEAD_S = 120.0
"""Time from the program's start to the recording's [s], in which the cart may have
been turned."""
_POSE_HZ = 50
_BOOT_MS = 200_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Cart:
    """Parameters of the test that differ from run to run."""

    walls: tuple[Wall, ...] = ()
    mismatch_deg: float = 0.0
    """Angle between the polarizations of tag and antenna [deg]."""
    erp_dbm: float = -72.0
    """Radiated power of the tag [dBm]; -72 gives a pulse of 30 dB on boresight at 60 m."""
    seed: int = 1

    @property
    def scenario(self) -> Scenario:
        """The simulated world with these parameters."""
        return Scenario(
            name="rotation test",
            seed=self.seed,
            start_time_ns=1_680_828_379_000_000_000,  # 2023-04-07 00:46:19 UTC
            duration_s=2 * STILL_S + TURN_S,
            home=Home(latitude_deg=35.174861, longitude_deg=-111.657361),
            antenna=Antenna(pattern="RA-23K"),
            propagation=Propagation(wall=self.walls),
            flight=Flight(
                height_m=1.0,
                heading_deg=BEARING_DEG,
                wobble_deg=0.0,
                leg=(
                    Leg(duration_s=STILL_S),
                    Leg(duration_s=TURN_S, turn_deg=360.0),
                    Leg(duration_s=STILL_S),
                ),
            ),
            tag=(self._tag(),),
        )

    def _tag(self) -> SimulatedTag:
        forward, right, _ = _towards(BEARING_DEG, DISTANCE_M)
        return SimulatedTag(
            tag_id=2,
            frequency_hz=148_710_000.0,
            pulse_width_s=0.02,
            pulse_intervals_s=(1.254,),
            interval_uncertainty_s=0.06,
            interval_jitter_s=0.01,
            north_m=forward,
            east_m=right,
            height_m=1.0,
            erp_dbm=self.erp_dbm,
            polarization_deg=90.0 - self.mismatch_deg,
        )


def building(bearing_deg: float, distance_m: float, reflection: float) -> Wall:
    """Wall at a distance in a direction, facing the cart."""
    north, east, _ = _towards(bearing_deg, distance_m)
    facing = wrap_degrees_360(bearing_deg + 180.0)
    return Wall(north_m=north, east_m=east, facing_deg=facing, reflection=reflection)


def heard(scenario: Scenario, sample_rate_hz: float) -> list[Pulse]:
    """Pulses that front end and detector find in the world's samples."""
    center_hz = scenario.tag[0].frequency_hz + 1000.0
    source = SimulatedSource(
        scenario, center_frequency_hz=center_hz, sample_rate_hz=sample_rate_hz
    )
    chain = DetectionChain(
        scenario.tags, sample_rate_hz=sample_rate_hz, center_frequency_hz=center_hz
    )
    found: list[Pulse] = []
    while True:
        try:
            block = source.read()
        except EOFError:
            break
        if block is not None:
            found += chain.process(block)
    found += chain.flush()
    return sorted(found, key=lambda pulse: pulse.start_time_ns)


def with_poses(scenario: Scenario, pulses: Sequence[Pulse]) -> list[PulsePose]:
    """Pulses with poses as our chain attaches them: from MAVLink bytes, interpolated at the
    pulse.
    """
    ring = PoseRing()
    writer, parser = FrameWriter(1, 1), FrameParser()
    step_ns = NANOSECONDS_PER_SECOND // _POSE_HZ
    steps = int((scenario.duration_s + 1.0) * _POSE_HZ)
    for step in range(steps):
        time_ns = scenario.start_time_ns + step * step_ns
        boot_ms = _BOOT_MS + step * 1000 // _POSE_HZ
        pose = scenario.vehicle_pose(time_ns)
        for message_id in (dialect.AttitudeQuaternion.ID, dialect.GlobalPositionInt.ID):
            message = telemetry_message(message_id, pose, boot_ms, time_ns)
            for frame in parser.feed(writer.encode(message)):
                _take(ring, frame.message(), scenario.start_time_ns)
    attacher = PoseAttacher(ring, wait_s=0.0)
    for pulse in pulses:
        attacher.add(pulse, pulse.end_time_ns)
    return attacher.flush()


def original_samples(scenario: Scenario, first_heading_deg: float) -> list[Pose]:
    """Poses every 500 ms since the original program's start.

    It was started `LEAD_S` before with the cart at `first_heading_deg`, which was turned to the
    tag half a minute later.
    """
    end_s = scenario.duration_s + 10.0
    count = int((LEAD_S + end_s) / 0.5)
    found = []
    for number in range(count):
        elapsed_s = number * 0.5 - LEAD_S
        time_ns = scenario.start_time_ns + ns_from_s(elapsed_s) + 130_000_000
        pose = scenario.vehicle_pose(max(time_ns, scenario.start_time_ns))
        if elapsed_s < 30.0 - LEAD_S:
            attitude = from_euler_deg(0.0, 0.0, first_heading_deg)
            pose = replace(pose, quaternion_wxyz=attitude)
        found.append(replace(pose, time_ns=time_ns))
    return found


def _take(ring: PoseRing, message: object, start_ns: int) -> None:
    if isinstance(message, dialect.AttitudeQuaternion):
        time_ns = start_ns + (message.time_boot_ms - _BOOT_MS) * 1_000_000
        attitude = attitude_sample(message, time_ns)
        if attitude is not None:
            ring.add_attitude(attitude)
    elif isinstance(message, dialect.GlobalPositionInt):
        time_ns = start_ns + (message.time_boot_ms - _BOOT_MS) * 1_000_000
        position = position_sample(message, time_ns)
        if position is not None:
            ring.add_position(position)


def _towards(bearing_deg: float, distance_m: float) -> tuple[float, float, float]:
    angle = math.radians(bearing_deg)
    return distance_m * math.cos(angle), distance_m * math.sin(angle), 0.0
