"""Flights over hills, their coverage maps, and the pulses that they truly receive.

The strength of each pulse comes from the simulated world, which has its own propagation model.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import WHOLE_FLIGHT_FALSE_ALARM, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.detection.sensitivity import detection_probability
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.estimates.heard import PoseColumns
from uavrt.localization.headings import Headings
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.localization.terrain.squares import GroundGrid
from uavrt.localization.whole_flight.energies.energy_grid import slot_energies
from uavrt.localization.whole_flight.flight_judgement import pulse_weights
from uavrt.localization.whole_flight.tag_places import distinct, places_around
from uavrt.localization.whole_flight.train_judging import judge
from uavrt.planning.detectability.detection_coverage import (
    AntennaPath,
    coverage_of,
    planned_antenna_path,
)
from uavrt.planning.detectability.link_budget import LinkBudget
from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.propagation import Propagation
from uavrt.simulation.scene.scenario import Home, Scenario, SimulatedTag
from uavrt.simulation.scene.world import World
from uavrt_experiments.detection.signals import TruePulse, add_pulse, noise
from uavrt_experiments.search.terrain import PLANE, Hills, elevation_of

_Floats = NDArray[np.float64]
HALF_M = 1500.0
CELL_M = 30.0
SIGMA_DB = 3.0
_HEIGHT_M = 60.0
_SPEED_M_S = 18.0
_RATE_HZ = 3750.0
_GROUPS_EIRP_DBM, _WHOLE_EIRP_DBM = -63.0, -68.0
"""Radiated powers [dBm] at which about half of the tags on the map are detected: by groups of
pulses, and by whole flights."""
_WINDOW_HZ = 60.0
_TURN_S = 31.35
"""Duration of 25 pulses, the turn at each stop [s]."""
_STOPS = 3
_TAG = Tag(
    tag_id=1,
    frequency_hz=150e6,
    pulse_width_s=0.02,
    pulse_intervals_s=(1.254,),
    interval_uncertainty_s=0.06,
    interval_jitter_s=0.01,
    k=3,
)
_SHARP_TAG = replace(_TAG, interval_uncertainty_s=0.02)
"""The tag with a narrower search, which takes a tenth of the time."""


class _Land:
    """Simulated hills, whose map has no error."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.hills = Hills(seed=int(rng.integers(1 << 30)), relief_m=120.0)
        axis = np.arange(-HALF_M, HALF_M + 1.0, CELL_M)
        height = self.hills(*np.meshgrid(axis, axis))
        self.ground = GroundGrid(
            plane=PLANE,
            west_m=-HALF_M,
            south_m=-HALF_M,
            cell_m=CELL_M,
            known=np.ones(height.shape, bool),
            height_m=height.astype(np.float32),
        )
        self.home_m = float(self.hills(np.zeros(1), np.zeros(1))[0])
        self.flown_m = float(height.max()) - self.home_m + 0.5 * _HEIGHT_M
        """Height of the drone over home that clears all hills [m]."""

    def above_m(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """Height of the drone above the ground beneath it [m], at its constant height over
        home.
        """
        return np.asarray(self.home_m + self.flown_m - self.ground(east_m, north_m))

    def world(self, scenario: Scenario) -> World:
        return World(scenario, ground=lambda north, east: self.hills(east, north))


class GroupsOverHills:
    """A flight in which the detector's own probability decides if a group is found.

    `rng`: draws the hills and the path.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._land = _Land(rng)
        corners = rng.uniform(-900.0, 900.0, (4, 2))
        way = planned_antenna_path(
            [(float(east), float(north)) for east, north in corners],
            height_m=_HEIGHT_M,
            speed_m_s=_SPEED_M_S,
            interval_s=1.254,
        )
        # The drone holds its height over home; the map must know how high that is each time.
        way = replace(way, height_m=self._land.above_m(way.east_m, way.north_m))
        self._pulses = len(way.time_s)
        self._scenario = Scenario(
            antenna=_WHIP,
            propagation=_PROPAGATION,
            flight=_over_corners(corners, self._land.flown_m),
        )
        budget = _budget(_GROUPS_EIRP_DBM)
        self.map = coverage_of(self._land.ground, way, _TAG, budget, level_sigma_db=SIGMA_DB)

    def hears(
        self, east_m: float, north_m: float, error_db: float, rng: np.random.Generator
    ) -> bool:
        """True if a group of K pulses is found, drawn by their mean energy."""
        tag = SimulatedTag(
            **_listed(_TAG),
            north_m=north_m,
            east_m=east_m,
            erp_dbm=_GROUPS_EIRP_DBM + error_db,
            first_pulse_s=0.0,
        )
        world = self._land.world(replace(self._scenario, tag=(tag,)))
        for first in range(0, self._pulses - _TAG.k + 1, _TAG.k):
            pulses = [world.pulse(tag, first + number).enr_db for number in range(_TAG.k)]
            mean = 10.0 * np.log10(np.mean(10.0 ** (np.array(pulses) / 10.0)))
            # In steps of a tenth: the chances are kept.
            if rng.random() < detection_probability(_TAG, round(max(float(mean), -15.0), 1)):
                return True
        return False


class WholeFlightOverHills:
    """A flight whose samples are evaluated as a whole, as `uavrt integrate --dem` does.

    Even ones turn a directional antenna at three stops, odd ones fly lines with a whip.

    `rng`: draws the hills and the path.
    """

    def __init__(self, rng: np.random.Generator, number: int) -> None:
        self._land = _Land(rng)
        turns = number % 2 == 0
        if turns:
            flight = _over_stops(rng.uniform(-500.0, 500.0, (_STOPS, 2)), self._land.flown_m)
        else:
            flight = _over_corners(rng.uniform(-900.0, 900.0, (4, 2)), self._land.flown_m)
        self._scenario = Scenario(
            home=Home(latitude_deg=PLANE.latitude_deg, longitude_deg=PLANE.longitude_deg),
            antenna=_YAGI if turns else _WHIP,
            propagation=_PROPAGATION,
            flight=flight,
            duration_s=flight.duration_s,
        )
        pattern = PATTERNS["RA-23K" if turns else "isotropic"]
        self._places = places_around(
            self._poses(0.2),
            pattern,
            start_ns=self._scenario.start_time_ns,
            end_ns=self._end_ns,
            hills=HillLosses(
                elevation_of(self._land.hills),
                latitude_deg=PLANE.latitude_deg,
                longitude_deg=PLANE.longitude_deg,
                frequency_hz=_SHARP_TAG.frequency_hz,
            ),
        )
        self._chosen = distinct(pulse_weights(self._places.gain))
        self.map = coverage_of(
            self._land.ground,
            self._way(),
            _SHARP_TAG,
            _budget(_WHOLE_EIRP_DBM),
            pattern=pattern,
            level_sigma_db=SIGMA_DB,
            frequency_window_hz=_WINDOW_HZ,
            whole_flight=True,
        )

    @property
    def _end_ns(self) -> int:
        return self._scenario.start_time_ns + ns_from_s(self._scenario.duration_s)

    def _poses(self, step_s: float) -> PoseColumns:
        count = int(self._scenario.duration_s / step_s) + 1
        start_ns = self._scenario.start_time_ns
        return PoseColumns.of(
            self._scenario.antenna_pose(start_ns + ns_from_s(at * step_s))
            for at in range(count)
        )

    def _way(self) -> AntennaPath:
        """Path at the times of the tag's pulses, for the map; the first is at the start of the
        flight.
        """
        poses = self._poses(_SHARP_TAG.pulse_intervals_s[0])
        east, north = PLANE.to_local(poses.latitude_deg, poses.longitude_deg)
        return AntennaPath(
            time_s=(poses.time_ns - poses.time_ns[0]) / NANOSECONDS_PER_SECOND,
            east_m=east,
            north_m=north,
            height_m=self._land.above_m(east, north),
            headings=Headings.from_quaternions(poses.quaternion_wxyz),
        )

    def hears(
        self, east_m: float, north_m: float, error_db: float, rng: np.random.Generator
    ) -> bool:
        """True if the evaluation of the channel's samples finds the tag."""
        tag = _SHARP_TAG
        true = SimulatedTag(
            **_listed(tag),
            north_m=north_m,
            east_m=east_m,
            erp_dbm=_WHOLE_EIRP_DBM + error_db,
            interval_error_s=0.8 * tag.interval_uncertainty_s * rng.uniform(-1.0, 1.0),
            frequency_offset_hz=0.8 * _WINDOW_HZ * rng.uniform(-1.0, 1.0),
            jitter_s=tag.interval_jitter_s,
            first_pulse_s=rng.uniform(tag.interval_jitter_s, tag.pulse_intervals_s[0]),
        )
        seed = int(rng.integers(1 << 32))
        scenario = replace(self._scenario, tag=(true,), seed=seed)
        samples = noise(rng, round(scenario.duration_s * _RATE_HZ))
        for pulse in self._land.world(scenario).truth(scenario.start_time_ns, self._end_ns):
            add_pulse(
                samples,
                TruePulse(
                    start_s=scenario.elapsed_s(pulse.start_time_ns),
                    offset_hz=pulse.frequency_hz - tag.frequency_hz,
                    enr_db=pulse.enr_db,
                ),
                sample_rate_hz=_RATE_HZ,
                width_s=tag.pulse_width_s,
                phase=pulse.phase_rad,
            )
        energies = slot_energies(
            samples,
            np.ones(len(samples), bool),
            tag=tag,
            start_ns=scenario.start_time_ns,
            sample_rate_hz=_RATE_HZ,
            center_frequency_hz=tag.frequency_hz,
            frequency_window_hz=_WINDOW_HZ,
        )
        judged = judge(
            energies,
            self._places.gain[self._chosen],
            self._places.time_s,
            tag,
            false_alarm_probability=WHOLE_FLIGHT_FALSE_ALARM,
        )
        return judged.train.false_alarm_probability <= WHOLE_FLIGHT_FALSE_ALARM


_WHIP = Antenna(pattern="isotropic", gain_dbi=4.0, polarization="any")
_YAGI = Antenna(pattern="RA-23K", gain_dbi=4.0, polarization="any")
_PROPAGATION = Propagation(model="two_ray", doppler=False)


def _over_corners(corners: _Floats, height_m: float) -> Flight:
    """Path along straight lines between corners (east, north)."""
    legs = []
    for before, here in pairwise(corners):
        way_m = float(np.hypot(*(here - before)))
        legs.append(
            Leg(duration_s=way_m / _SPEED_M_S, north_m=float(here[1]), east_m=float(here[0]))
        )
    return Flight(
        north_m=float(corners[0, 1]),
        east_m=float(corners[0, 0]),
        height_m=height_m,
        wobble_deg=0.0,
        leg=tuple(legs),
    )


def _over_stops(stops: _Floats, height_m: float) -> Flight:
    """Path along straight lines between corners, with a full turn at each."""
    flight = _over_corners(stops, height_m)
    turn = Leg(duration_s=_TURN_S, turn_deg=360.0)
    legs = [turn]
    for leg in flight.leg:
        legs += [leg, turn]
    return replace(flight, leg=tuple(legs), wobble_deg=1.0)


def _budget(eirp_dbm: float) -> LinkBudget:
    return LinkBudget(
        frequency_hz=_TAG.frequency_hz,
        pulse_width_s=_TAG.pulse_width_s,
        tag_eirp_dbm=eirp_dbm,
        drone_height_m=_HEIGHT_M,
        mismatch_db=0.0,
    )


def _listed(tag: Tag) -> dict[str, Any]:
    """Tag list entry of a simulated tag."""
    return {
        "tag_id": tag.tag_id,
        "frequency_hz": tag.frequency_hz,
        "pulse_width_s": tag.pulse_width_s,
        "pulse_intervals_s": tag.pulse_intervals_s,
    }
