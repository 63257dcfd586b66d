"""Area, tags and settings of a search, derived once from its order; no I/O."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import cos, pi, sin

import numpy as np

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import PlanError
from uavrt.core.messages import Tag
from uavrt.guidance.autopilot_behaviour import Behaviour
from uavrt.guidance.energy_learning import energy_of
from uavrt.guidance.height_frames import check_height
from uavrt.guidance.operator_orders import Limits, Order, Place, VehicleNow
from uavrt.guidance.plans import area_of, check_battery, multirotor_of, reserve_wh
from uavrt.guidance.search_rules import SEARCH_RULES
from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.position.trackers import TagPrior
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.planning.area import Polygon
from uavrt.planning.beliefs import Beliefs, TagBelief
from uavrt.planning.drone_model.energy import Battery
from uavrt.planning.keep_away import KeepAway
from uavrt.planning.planners.mi_rate import MiRate
from uavrt.planning.planners.registry import planner_named
from uavrt.planning.search import Search
from uavrt.planning.situation import Planner, SearchSettings
from uavrt.planning.stopping import AccuracyStop


@dataclass(frozen=True, slots=True, kw_only=True)
class Equipment:
    """Antenna, detector and planner of a search, with data on terrain and tags."""

    pattern: AntennaPattern | None
    """Directional antenna pattern; None for a vertical monopole."""
    yaw_offset_deg: float = 0.0
    """Direction of the antenna's main lobe, clockwise from the drone's nose [°]."""
    k: int = 0
    """Number of pulses that the detector searches together; 0 for each tag's own number."""
    planner: str = "mi_rate"
    seed: int = 1
    hills: HillLosses | None = None
    """Model of the signal loss behind hills; None for level ground."""
    known: Mapping[int, TagPrior] = field(default_factory=dict)
    """Priors for power and motion of known tags, by tag id; others have the default."""


class SearchTask:
    """Area, tags and settings of a search order. Raises `PlanError` for an invalid order."""

    def __init__(
        self,
        order: Order,
        listed: Sequence[Tag],
        now: VehicleNow,
        limits: Limits,
        behaviour: Behaviour,
        equipment: Equipment,
    ) -> None:
        self.order, self.limits, self.behaviour = order, limits, behaviour
        self.equipment = equipment
        self.tags = _wanted(order, listed)
        self.plane = TangentPlane(latitude_deg=now.home[0], longitude_deg=now.home[1])
        self.height_m = now.altitude_relative_m if order.height_m is None else order.height_m
        self.outline = order.places or _circle(order, now, self.plane)
        check_height(self.height_m, lowest_m=limits.lowest_m, highest_m=limits.highest_m)

    def search(self, now: VehicleNow) -> Search:
        """Return the search before its first pulse.

        Raises `PlanError` if area, battery or settings do not permit it.
        """
        order, limits, away = self.order, self.limits, self.limits.keep_away_m
        area = area_of(order, self.outline, now, limits)
        check_battery(now, limits, 0.0, self.here_m(now), self.height_m)
        if not (1.0 <= order.accuracy_m <= 1000.0 and 10.0 <= order.duration_s <= 36_000.0):
            raise PlanError(
                f"the accuracy of {order.accuracy_m:g} m or the duration of "
                f"{order.duration_s:g} s is out of range",
                remedy="Give 1 to 1000 m, and 10 s to 10 hours",
            )
        return Search(
            SearchSettings(
                vehicle=multirotor_of(limits),
                area=area,
                stop=AccuracyStop(radius95_m=order.accuracy_m),
                keep_away=KeepAway(
                    radius_m=away,
                    probability=SEARCH_RULES.kept_away,
                    margin=SEARCH_RULES.away_margin,
                )
                if away > 0.0
                else None,
                energy=energy_of(limits.hover_w),
                worst_wind_m_s=limits.wind_m_s,
                return_height_m=limits.return_height_m,
                cycle_s=SEARCH_RULES.cycle_s,
                pulse_s=float(np.mean([max(tag.pulse_intervals_s) for tag in self.tags])),
                threshold_db=10.0,
                tag_height_m=SEARCH_RULES.tag_height_m,
            ),
            self._beliefs(area.search),
            self._planner(),
            np.random.default_rng((self.equipment.seed, 1)),
        )

    def _beliefs(self, area: Polygon) -> Beliefs:
        few = len(self.tags) <= SEARCH_RULES.few_tags
        hills, box = self.equipment.hills, area.box
        if hills is not None:
            hills = hills.at(float(np.median([tag.frequency_hz for tag in self.tags])))
            hills = hills.in_plane(self.plane)
            hills.cover([box.west_m, box.east_m], [box.south_m, box.north_m])
        pattern, known = self.equipment.pattern, self.equipment.known
        usual = TagPrior(area=box)
        return Beliefs(
            *(
                TagBelief(
                    tag.tag_id,
                    replace(
                        known.get(tag.tag_id, usual), area=box, pattern=pattern, hills=hills
                    ),
                    np.random.default_rng((self.equipment.seed, 2, tag.tag_id)),
                    particles=SEARCH_RULES.particles if few else SEARCH_RULES.fewer_particles,
                )
                for tag in self.tags
            )
        )

    def _planner(self) -> Planner:
        """Planner named in the settings; the default one also needs the duration of a turn."""
        if self.equipment.planner != "mi_rate":
            return planner_named(self.equipment.planner)
        turning = self.turn_s
        if self.behaviour.yaw_in_reposition:
            turning += SEARCH_RULES.turn_step_s * self.limits.headings
        return MiRate(rotation_s=turning)

    @property
    def turn_s(self) -> float:
        """Duration of a full turn that allows a pulse of each tag at each heading [s]."""
        interval = max(max(tag.pulse_intervals_s) for tag in self.tags)
        return max(12.0, self.limits.headings * interval)

    def place(self, east_m: float, north_m: float) -> Place:
        """Convert a point in the local plane to latitude and longitude [deg]."""
        latitude, longitude = self.plane.to_geodetic(east_m, north_m)
        return float(latitude), float(longitude)

    def local_m(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """Convert a position to (east, north) in the local plane [m]."""
        east, north = self.plane.to_local(latitude_deg, longitude_deg)
        return float(east), float(north)

    def here_m(self, now: VehicleNow) -> tuple[float, float]:
        """Return the drone's position in the local plane, as (east, north) [m]."""
        return self.local_m(now.latitude_deg, now.longitude_deg)

    def battery(self, now: VehicleNow) -> Battery | None:
        """Return the battery's charge and reserve [Wh]; None if one of them is unknown."""
        size, percent = self.limits.battery_wh, now.battery_percent
        if size is None or percent is None:
            return None
        return Battery(remaining_wh=size * percent / 100.0, reserve_wh=reserve_wh(self.limits))


def _wanted(order: Order, listed: Sequence[Tag]) -> tuple[Tag, ...]:
    """Return the tags to search: those named in the order, or all listed ones.

    Raises `PlanError` if one is unknown.
    """
    if not listed:
        raise PlanError(
            "the drone is not searching for any tag",
            remedy="Send the tags and start detection first",
        )
    known = {tag.tag_id: tag for tag in listed}
    unknown = sorted(set(order.tags) - set(known))
    if unknown:
        raise PlanError(
            f"tag {unknown[0]} is not searched for by the drone",
            remedy=f"Choose from {', '.join(map(str, known))}",
        )
    return tuple(known[tag_id] for tag_id in (order.tags or known))


def _circle(order: Order, now: VehicleNow, plane: TangentPlane) -> tuple[Place, ...]:
    """Return the corners of a circular area around the drone.

    Raises `PlanError` for a missing or invalid radius.
    """
    radius = order.radius_m
    if radius is None or not 10.0 <= radius <= 10_000.0:
        raise PlanError(
            "the search has no area", remedy="Give an outline, or a radius of 10 m or more"
        )
    east, north = plane.to_local(now.latitude_deg, now.longitude_deg)
    angles = [
        2.0 * pi * n / SEARCH_RULES.circle_corners for n in range(SEARCH_RULES.circle_corners)
    ]
    latitude, longitude = plane.to_geodetic(
        [float(east) + radius * sin(a) for a in angles],
        [float(north) + radius * cos(a) for a in angles],
    )
    return tuple((float(a), float(b)) for a, b in zip(latitude, longitude, strict=True))
