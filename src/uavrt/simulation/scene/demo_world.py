"""Define the built-in world of ``uavrt demo``: three tags, and a drone that turns at 3 points.

With coded tags, the world has two more tags, which share a frequency.
"""

import math
from dataclasses import replace

from uavrt.core.errors import ConfigError
from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.propagation import Fading, Propagation
from uavrt.simulation.scene.scenario import Interferer, Radio, Scenario, SimulatedTag
from uavrt.simulation.scene.world import World

SHORTEST_S = 40.0
"""Shortest duration of the demo [s]; it leaves 4.3 s for the flight between two turns."""
SEARCHED_ENR_DB = 24.0
"""Ratio of pulse energy to noise power density of the animals in a search [dB], as received at
home with the antenna pointed at the animal."""
SEARCH_HEIGHT_M = 40.0
_SHORTEST_TURN_S = 7.8
"""Shortest duration of a full turn [s]; the turn rate is then 46°/s on average and 57.7°/s at
most."""
CODED_HZ = 148_640_000.0
_APART_M = 120.0
_ABOVE_M = 10.0
_PEAK_ENR_DB = 33.0
"""Ratio of pulse energy to noise power density without fading [dB], as received at the centre
of the three points with the antenna pointed at a tag."""


def demo_scenario(duration_s: float = 60.0, seed: int = 1, *, coded: bool = False) -> Scenario:
    """Create the demo's world, scaled to a duration; raises `ConfigError` below 40 s."""
    if not SHORTEST_S <= duration_s < math.inf:
        raise ConfigError(
            f"a demo of {duration_s:g} s is too short for its three turns",
            remedy=f"Give a duration of at least {SHORTEST_S:g} s",
        )
    scenario = Scenario(
        name="demo",
        seed=seed,
        duration_s=duration_s,
        radio=Radio(center_frequency_hz=148_680_000.0),
        antenna=Antenna(pattern="RA-23K"),
        propagation=Propagation(
            model="two_ray",
            fading=Fading(kind="rician", k_factor_db=12.0, correlation_time_s=0.5),
        ),
        tag=_tags(duration_s) + (_coded_tags() if coded else ()),
        interferer=(Interferer(kind="carrier", frequency_hz=148_655_400.0, power_dbm=-128.0),),
        flight=_flight(duration_s),
    )
    return _with_power(scenario, _centre(duration_s), _PEAK_ENR_DB)


def fleet_scenarios(drones: int, first: Scenario) -> list[Scenario]:
    """Create a world for each of several drones.

    Each drone starts 120 m south of the previous drone and 10 m higher.
    """
    return [
        replace(first, flight=_moved(first.flight, number * -_APART_M, number * _ABOVE_M))
        for number in range(drones)
    ]


def _moved(flight: Flight, north_m: float, up_m: float) -> Flight:
    legs = tuple(
        replace(
            leg,
            north_m=None if leg.north_m is None else leg.north_m + north_m,
            height_m=None if leg.height_m is None else leg.height_m + up_m,
        )
        for leg in flight.leg
    )
    return replace(flight, north_m=flight.north_m + north_m, leg=legs)


def search_scenario(seed: int = 1, *, coded: bool = False) -> Scenario:
    """Create the world of ``uavrt demo --search``: three animals, one of which walks.

    The drone hovers above home until it is commanded. There it receives an animal's tag only if
    its antenna points towards the animal. The walking animal stays in the area, so that the
    drone can pass it on every side.
    """
    places = ((150.0, 90.0), (-40.0, 170.0), (-120.0, -130.0))
    lynx, otter, badger = _tags(SHORTEST_S)
    worn: tuple[SimulatedTag, ...] = (lynx, replace(otter, heading_deg=300.0), badger)
    if coded:
        _, *others = worn
        worn = (
            lynx,
            *(
                replace(tag, speed_m_s=other.speed_m_s, heading_deg=other.heading_deg)
                for tag, other in zip(_coded_tags(), others, strict=True)
            ),
        )
    tags = tuple(
        replace(
            tag,
            north_m=north_m,
            east_m=east_m,
            pulse_intervals_s=tag.pulse_intervals_s[:1],
            rate_switches_s=(),
        )
        for tag, (north_m, east_m) in zip(worn, places, strict=True)
    )
    scenario = replace(
        demo_scenario(SHORTEST_S, seed),
        name="search",
        duration_s=3600.0,
        tag=tags,
        flight=Flight(height_m=SEARCH_HEIGHT_M),
    )
    return _with_power(scenario, scenario.flight, SEARCHED_ENR_DB)


def searched_scenario(scenario: Scenario, seconds: float) -> Scenario:
    """Copy a world for at least `seconds`; the drone hovers there until commanded."""
    return replace(
        scenario,
        duration_s=max(scenario.duration_s, seconds),
        flight=Flight(height_m=SEARCH_HEIGHT_M),
    )


def _tags(duration_s: float) -> tuple[SimulatedTag, ...]:
    return (
        SimulatedTag(
            tag_id=2,
            name="lynx",
            frequency_hz=148_612_000.0,
            pulse_width_s=0.020,
            pulse_intervals_s=(1.254,),
            interval_uncertainty_s=0.06,
            interval_jitter_s=0.01,
            north_m=210.0,
            east_m=90.0,
            frequency_offset_hz=140.0,
            polarization_deg=80.0,
            interval_error_s=0.008,
            jitter_s=0.004,
            first_pulse_s=0.61,
        ),
        SimulatedTag(
            tag_id=4,
            name="otter",
            frequency_hz=148_697_000.0,
            pulse_width_s=0.015,
            pulse_intervals_s=(1.333, 2.0),
            interval_uncertainty_s=0.06,
            interval_jitter_s=0.02,
            north_m=-60.0,
            east_m=250.0,
            speed_m_s=0.4,
            heading_deg=30.0,
            frequency_offset_hz=-210.0,
            frequency_drift_hz_s=0.05,
            polarization_deg=100.0,
            interval_error_s=-0.012,
            jitter_s=0.006,
            first_pulse_s=0.93,
            rate_switches_s=(round(0.55 * duration_s, 3),),
        ),
        SimulatedTag(
            tag_id=6,
            name="badger",
            frequency_hz=148_731_000.0,
            pulse_width_s=0.018,
            pulse_intervals_s=(1.62,),
            interval_uncertainty_s=0.06,
            interval_jitter_s=0.01,
            north_m=-170.0,
            east_m=-190.0,
            frequency_offset_hz=60.0,
            polarization_deg=85.0,
            interval_error_s=0.005,
            jitter_s=0.003,
            first_pulse_s=0.27,
        ),
    )


def _coded_tags() -> tuple[SimulatedTag, ...]:
    """Two coded tags on one frequency that differ only in their gaps and burst intervals."""
    return (
        SimulatedTag(
            tag_id=12,
            name="robin",
            frequency_hz=CODED_HZ,
            pulse_width_s=0.0025,
            pulse_intervals_s=(2.3,),
            interval_uncertainty_s=0.004,
            k=10,
            gaps_s=(0.022, 0.0488, 0.0366),
            north_m=170.0,
            east_m=-130.0,
            frequency_offset_hz=90.0,
            polarization_deg=85.0,
            crystal_error_ppm=40.0,
            first_pulse_s=0.4,
        ),
        SimulatedTag(
            tag_id=14,
            name="bat",
            frequency_hz=CODED_HZ,
            pulse_width_s=0.0025,
            pulse_intervals_s=(2.9,),
            interval_uncertainty_s=0.004,
            k=10,
            gaps_s=(0.0317, 0.0268, 0.0561),
            north_m=-190.0,
            east_m=90.0,
            frequency_offset_hz=-70.0,
            polarization_deg=95.0,
            crystal_error_ppm=-25.0,
            first_pulse_s=1.1,
        ),
    )


def _turn_s(duration_s: float) -> float:
    return max(_SHORTEST_TURN_S, 0.16 * duration_s)


def _move_s(duration_s: float) -> float:
    """Duration of each flight between turns [s].

    Four fifths of the demo, minus the turns, are divided between the flights.
    """
    return (0.8 * duration_s - 3.0 * _turn_s(duration_s)) / 2.0


def _height_m(duration_s: float) -> float:
    """Height of the turns [m], at most 40 m, so that the mean climb rate is 4 m/s at most."""
    return min(40.0, 4.0 * 0.08 * duration_s)


def _points(duration_s: float) -> tuple[tuple[float, float], ...]:
    """Corners of a triangle with sides of at most 150 m, flown with at most 4 m/s²."""
    side_m = min(150.0, 0.6 * _move_s(duration_s) ** 2)
    return (0.0, 0.0), (side_m, 0.0), (side_m / 2, side_m * math.sqrt(0.75))


def _flight(duration_s: float) -> Flight:
    first, second, third = _points(duration_s)
    turn = Leg(duration_s=_turn_s(duration_s), turn_deg=360.0)
    move_s = _move_s(duration_s)
    return Flight(
        heading_deg=20.0,
        north_m=first[0],
        east_m=first[1],
        leg=(
            Leg(duration_s=0.04 * duration_s),
            Leg(duration_s=0.08 * duration_s, height_m=_height_m(duration_s)),
            turn,
            Leg(duration_s=move_s, north_m=second[0], east_m=second[1]),
            turn,
            Leg(duration_s=move_s, north_m=third[0], east_m=third[1]),
            turn,
            Leg(duration_s=0.08 * duration_s),
        ),
    )


def _centre(duration_s: float) -> Flight:
    corners = _points(duration_s)
    return Flight(
        north_m=sum(corner[0] for corner in corners) / 3,
        east_m=sum(corner[1] for corner in corners) / 3,
        height_m=_height_m(duration_s),
    )


def _with_power(scenario: Scenario, stand: Flight, enr_db: float) -> Scenario:
    """Copy a world with tag powers that give `enr_db` at `stand` on the antenna's boresight."""
    probe = replace(
        scenario,
        flight=replace(stand, wobble_deg=0.0),
        antenna=replace(scenario.antenna, pattern="isotropic", polarization="any"),
        propagation=replace(scenario.propagation, fading=Fading()),
    )
    world = World(probe)
    return replace(
        scenario,
        tag=tuple(
            replace(tag, erp_dbm=round(tag.erp_dbm + enr_db - world.pulse(tag, 0).enr_db, 1))
            for tag in scenario.tag
        ),
    )
