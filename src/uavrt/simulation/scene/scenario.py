"""The simulated world as data: tags, antenna, propagation, interferers, flight, radio.

A `Scenario` is immutable and complete. The world depends only on the scenario and the absolute
time, so a restarted radio program continues in the same world.
"""

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Len

from uavrt.config.tags.code_rules import BURST_TOLERANCE_MS, CODED_K
from uavrt.config.tags.tag_rules import MAX_FREQUENCY_HZ, MIN_FREQUENCY_HZ
from uavrt.core.messages import DEFAULT_FALSE_ALARM_PROBABILITY, Pose, Tag
from uavrt.simulation.scene import geometry
from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.flight import Flight, VehicleState, vehicle_state
from uavrt.simulation.scene.propagation import Propagation
from uavrt.simulation.scene.record import ScenarioRecord
from uavrt.simulation.scene.relief import Terrain

Positive = Annotated[float, Gt(0)]
NonNegative = Annotated[float, Ge(0)]
Carrier = Annotated[float, Ge(MIN_FREQUENCY_HZ), Le(MAX_FREQUENCY_HZ)]
"""Type of a carrier frequency [Hz]; a value that was typed in megahertz is rejected, as in tag
files."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Home(ScenarioRecord):
    """Take-off point, and origin of all positions in metres north and east."""

    latitude_deg: Annotated[float, Ge(-89), Le(89)] = 35.178241
    longitude_deg: Annotated[float, Ge(-180), Le(180)] = -111.656587
    altitude_amsl_m: float = 2107.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Radio(ScenarioRecord):
    """The simulated receiver and its defects."""

    sample_rate_hz: Positive = 3_000_000.0
    center_frequency_hz: Carrier | None = None
    """Radio frequency unless the command line sets it [Hz]; None: the middle of the tags'
    frequencies."""
    gain: Annotated[int, Ge(0), Le(21)] = 21
    gain_step_db: Annotated[float, Ge(0), Le(6)] = 2.0
    noise_figure_db: Annotated[float, Ge(0), Le(60)] = 8.0
    """Noise of antenna and receiver, relative to the thermal noise at 290 K [dB]."""
    noise_rms: Annotated[float, Gt(0), Le(0.3)] = 5e-3
    """Rms of the complex noise at `sample_rate_hz` and gain 21 [full scale]."""
    dc_offset: Annotated[float, Ge(0), Le(0.5)] = 2e-4
    """Constant part of the samples' I and Q [full scale]."""
    sample_rate_error_ppm: Annotated[float, Ge(-200), Le(200)] = 0.0
    tuning_error_ppm: Annotated[float, Ge(-200), Le(200)] = 0.0
    loss_share: Annotated[float, Ge(0), Le(0.5)] = 0.0
    """Fraction of the samples that the simulated radio loses silently."""
    loss_s: Annotated[float, Ge(1e-4), Le(10)] = 0.005
    """Duration of each silent loss of samples [s]."""
    arrival_jitter_s: Annotated[float, Ge(0), Le(0.1)] = 0.0
    """Mean delay of each write of the simulated radio, exponentially distributed [s]."""
    stall_share: Annotated[float, Ge(0), Le(0.5)] = 0.0
    """Fraction of the radio's writes that are delayed by 50 to 300 ms; the writes that follow
    are late too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedTag(ScenarioRecord):
    """A simulated tag, first as in the operator's list, then with its true properties."""

    tag_id: Annotated[int, Ge(1)]
    frequency_hz: Carrier
    pulse_width_s: Annotated[float, Gt(0), Le(1)]
    pulse_intervals_s: Annotated[tuple[Positive, ...], Len(1, 2)]
    interval_uncertainty_s: NonNegative | None = None
    """Uncertainty of the interval in the tag list [s]; None: 0, or the usual tolerance of a
    coded tag."""
    interval_jitter_s: NonNegative = 0.0
    k: Annotated[int, Ge(1)] | None = None
    """Number of pulses in a group; None: 3 pulses, or 10 bursts for a coded tag."""
    false_alarm_probability: Annotated[float, Gt(0), Le(1)] = DEFAULT_FALSE_ALARM_PROBABILITY
    name: str | None = None
    gaps_s: tuple[Positive, ...] = ()
    """Gaps between the pulses in a coded tag's burst [s]; the tag's intervals are then those
    between bursts."""

    listed: bool = True
    """True if the operator searches for the tag; False for an unlisted tag in the area."""
    north_m: float = 0.0
    """Position at the start: distance north of home [m]."""
    east_m: float = 0.0
    height_m: NonNegative = 0.5
    speed_m_s: NonNegative = 0.0
    """Speed of an animal that walks straight on [m/s]."""
    heading_deg: float = 0.0
    erp_dbm: Annotated[float, Ge(-120), Le(40)] = -30.0
    """Radiated power, equal in all directions [dBm]."""
    polarization_deg: float = 90.0
    """Tilt of the wave's electric field from vertical [°]; 90 is horizontal."""
    water_depth_m: NonNegative = 0.0
    water_conductivity_s_m: NonNegative = 0.01
    extra_loss_db: float = 0.0
    """Loss by leaves, a burrow or the body of the animal [dB]."""
    frequency_offset_hz: float = 0.0
    """Error of the carrier frequency [Hz], in addition to that of `frequency_offset_ppm`."""
    frequency_offset_ppm: Annotated[float, Ge(-1000), Le(1000)] = 0.0
    frequency_drift_hz_s: float = 0.0
    true_pulse_width_s: Annotated[float, Gt(0), Le(1)] | None = None
    interval_error_s: float = 0.0
    """Error added to each listed interval when the tag transmits [s]."""
    crystal_error_ppm: Annotated[float, Ge(-20_000), Le(20_000)] = 0.0
    """Relative error of all the tag's gaps and intervals [ppm]."""
    jitter_s: NonNegative = 0.0
    """Largest random shift of a pulse [s]; shifts are uniformly distributed and do not
    accumulate."""
    first_pulse_s: NonNegative = 0.5
    """Start of the first pulse after the start of the scenario [s]."""
    rate_switches_s: tuple[NonNegative, ...] = ()
    """Times at which the tag changes between its two rates [s]; it starts with the first
    rate."""
    rate_pattern: tuple[Annotated[int, Ge(1), Le(2)], ...] = ()
    """Rates of consecutive intervals, repeated endlessly; used in place of
    `rate_switches_s`."""

    @property
    def tag(self) -> Tag:
        """The tag as in the operator's list, whose values may differ from the true ones."""
        usual_s, usual_k = (1e-3 * BURST_TOLERANCE_MS, CODED_K) if self.gaps_s else (0.0, 3)
        slack_s = self.interval_uncertainty_s
        return Tag(
            tag_id=self.tag_id,
            frequency_hz=self.frequency_hz,
            pulse_width_s=self.pulse_width_s,
            pulse_intervals_s=self.pulse_intervals_s,
            interval_uncertainty_s=usual_s if slack_s is None else slack_s,
            interval_jitter_s=self.interval_jitter_s,
            k=usual_k if self.k is None else self.k,
            false_alarm_probability=self.false_alarm_probability,
            name=self.name,
            gaps_s=self.gaps_s,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Interferer(ScenarioRecord):
    """Source of interference that the radio receives: a carrier or impulses."""

    kind: Literal["carrier", "impulses"]
    frequency_hz: Carrier | None = None
    """Frequency of an interfering carrier [Hz]; None for impulses."""
    power_dbm: Annotated[float, Ge(-200), Le(0)] = -130.0
    """Power at the antenna connector [dBm]; for impulses, the power during an impulse."""
    impulses_per_s: NonNegative = 0.0
    """Mean rate of random interfering impulses [1/s]."""
    impulse_width_s: Annotated[float, Gt(0), Le(0.01)] = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario(ScenarioRecord):
    """A simulated world that starts at `start_time_ns`; see `uavrt.simulation.scene.world`."""

    name: str = "scenario"
    seed: Annotated[int, Ge(0), Le(2**32 - 1)] = 1
    start_time_ns: Annotated[int, Ge(0)] = 1_700_205_419_000_000_000
    duration_s: Positive = 60.0
    home: Home = field(default_factory=Home)
    radio: Radio = field(default_factory=Radio)
    antenna: Antenna = field(default_factory=Antenna)
    propagation: Propagation = field(default_factory=Propagation)
    terrain: Terrain = field(default_factory=Terrain)
    tag: tuple[SimulatedTag, ...] = ()
    interferer: tuple[Interferer, ...] = ()
    flight: Flight = field(default_factory=Flight)

    @property
    def tags(self) -> tuple[Tag, ...]:
        """The tags that are in the operator's list."""
        return tuple(tag.tag for tag in self.tag if tag.listed)

    @property
    def plane(self) -> geometry.TangentPlane:
        """Tangent plane at home, with coordinates in metres north and east."""
        return geometry.TangentPlane(
            latitude_deg=self.home.latitude_deg,
            longitude_deg=self.home.longitude_deg,
            altitude_amsl_m=self.home.altitude_amsl_m,
        )

    @property
    def center_frequency_hz(self) -> float:
        """Radio frequency [Hz]; if it is not set, the middle of the tags' frequencies."""
        if self.radio.center_frequency_hz is not None:
            return self.radio.center_frequency_hz
        frequencies = [tag.frequency_hz for tag in self.tag] or [150e6]
        return round((min(frequencies) + max(frequencies)) / 2, -3)

    def starting_at(self, start_time_ns: int) -> "Scenario":
        """Copy the world with another start time [ns, UTC]."""
        return replace(self, start_time_ns=start_time_ns)

    def elapsed_s(self, time_ns: int) -> float:
        """Time since the start of the scenario [s]."""
        return (time_ns - self.start_time_ns) * 1e-9

    def vehicle_state(self, time_ns: int) -> VehicleState:
        """Position, attitude and velocity of the drone in metres from home."""
        return vehicle_state(self.flight, self.elapsed_s(time_ns))

    def vehicle_pose(self, time_ns: int) -> Pose:
        """Pose of the autopilot, body frame FRD to NED, at a time [ns, UTC]."""
        state = self.vehicle_state(time_ns)
        return self._pose(time_ns, state.position_ned_m, state.quaternion_wxyz)

    def antenna_state(self, time_ns: int) -> tuple[geometry.Vector, geometry.Quaternion]:
        """Position from home [m, NED] and attitude of the antenna at a time [ns, UTC]."""
        return self.antenna_on(self.vehicle_state(time_ns))

    def antenna_on(self, state: VehicleState) -> tuple[geometry.Vector, geometry.Quaternion]:
        """Position [m, NED] and attitude of the antenna for a state of the vehicle."""
        antenna = self.antenna
        arm = (antenna.offset_forward_m, antenna.offset_right_m, antenna.offset_down_m)
        mounting = geometry.from_euler_deg(
            antenna.roll_offset_deg, antenna.pitch_offset_deg, antenna.yaw_offset_deg
        )
        return (
            geometry.add(state.position_ned_m, geometry.rotate(state.quaternion_wxyz, arm)),
            geometry.multiply(state.quaternion_wxyz, mounting),
        )

    def antenna_pose(self, time_ns: int) -> Pose:
        """Pose of the antenna, frame (boresight, right, down) to NED, at a time [ns, UTC]."""
        return self._pose(time_ns, *self.antenna_state(time_ns))

    def tag_position_ned_m(self, tag: SimulatedTag, time_ns: int) -> geometry.Vector:
        """Position of a tag from home at a time in UTC [m, north-east-down]."""
        walked = tag.speed_m_s * max(0.0, self.elapsed_s(time_ns))
        north, east, _ = geometry.rotate(
            geometry.from_euler_deg(0.0, 0.0, tag.heading_deg), (walked, 0.0, 0.0)
        )
        return (tag.north_m + north, tag.east_m + east, -tag.height_m)

    def tag_position(self, tag_id: int, time_ns: int) -> tuple[float, float]:
        """Latitude and longitude of a tag [°]; raises `KeyError` for an unknown tag."""
        for tag in self.tag:
            if tag.tag_id == tag_id:
                return self.plane.to_geodetic(*self.tag_position_ned_m(tag, time_ns)[:2])
        raise KeyError(tag_id)

    def _pose(
        self, time_ns: int, place: geometry.Vector, quaternion: geometry.Quaternion
    ) -> Pose:
        latitude, longitude = self.plane.to_geodetic(place[0], place[1])
        return Pose(
            time_ns=time_ns,
            latitude_deg=latitude,
            longitude_deg=longitude,
            altitude_amsl_m=self.home.altitude_amsl_m - place[2],
            altitude_relative_m=-place[2],
            quaternion_wxyz=quaternion,
        )
