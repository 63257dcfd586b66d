"""Model the power for flight, correct it by battery readings, and decide when to return."""

from dataclasses import dataclass, replace
from math import hypot, inf, isfinite

import numpy as np

from uavrt.core.errors import ConfigError
from uavrt.planning.drone_model.drone_motion import Vehicle, VehicleState, Wind
from uavrt.planning.tuning import PLANNING


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergyModel:
    """Model of a drone's power, with a scale factor learned from its battery.

    Power at airspeed v is the hover power, less up to 10 % of it in forward flight, plus a drag
    term. The drag grows with v³, such that the power at `cruise_m_s` is `cruise_w`. The scale
    factor multiplies the total.
    """

    hover_w: float = 400.0
    cruise_w: float = 420.0
    cruise_m_s: float = 10.0
    climb_j_per_m: float = 60.0
    """Energy needed for each metre of climb in addition to level flight [J]."""
    scale: float = 1.0
    """Ratio of measured to modelled power, which depends on payload, air and the battery's
    age."""
    scale_sigma: float = 0.2
    """Standard deviation of the ratio of measured to modelled power."""

    def __post_init__(self) -> None:
        if min(self.hover_w, self.cruise_w, self.cruise_m_s) <= 0.0 or self.climb_j_per_m < 0:
            raise ConfigError(
                "the power of hovering and cruising and the cruise speed must be above 0",
                remedy="Compute the powers from a flight's log: volts times amperes",
            )

    def power_w(self, airspeed_m_s: float) -> float:
        """Power in level flight [W]."""
        share = airspeed_m_s / self.cruise_m_s
        relieved = 0.1 * self.hover_w * (1.0 - np.exp(-2.0 * share))
        at_cruise = 0.1 * self.hover_w * (1.0 - np.exp(-2.0))
        drag = (self.cruise_w - self.hover_w + at_cruise) * share**3
        return float(self.scale * max(self.hover_w - relieved + drag, 0.3 * self.hover_w))

    def used_wh(self, duration_s: float, airspeed_m_s: float, climb_m: float = 0.0) -> float:
        """Energy used in a part of a flight [Wh]; a descent recovers no energy."""
        climb = self.scale * self.climb_j_per_m * max(climb_m, 0.0)
        return (self.power_w(airspeed_m_s) * duration_s + climb) / 3600.0  # J in a Wh

    def learnt(self, predicted_wh: float, used_wh: float, sigma_wh: float) -> "EnergyModel":
        """Return a copy whose power scale is updated by the predicted and the used energy of a
        part of the flight.

        An unlikely ratio, as from an unknown payload, is accepted but increases the
        uncertainty, because the drone must reach home in any case. `sigma_wh` is the standard
        error of the used energy. Raises `ConfigError` if the readings are impossible.
        """
        if not (predicted_wh > 0.0 and np.isfinite(used_wh) and sigma_wh > 0.0):
            raise ConfigError(
                f"the battery reports {used_wh} Wh used, but {predicted_wh} Wh were expected",
                remedy="Check the battery monitor's calibration",
            )
        per_scale = predicted_wh / self.scale
        off = used_wh - predicted_wh
        sigma = hypot(self.scale_sigma, PLANNING.scale_drift)
        if abs(off) > 2.0 * hypot(per_scale * sigma, sigma_wh):
            sigma = abs(off) / per_scale
        precision = 1.0 / sigma**2 + (per_scale / sigma_wh) ** 2
        gain = per_scale / sigma_wh**2 / precision
        return replace(
            self,
            scale=float(np.clip(self.scale + gain * off, 0.3, 4.0)),
            scale_sigma=float(precision**-0.5),
        )

    def way_home_wh(
        self,
        vehicle: Vehicle,
        state: VehicleState,
        home_m: tuple[float, float],
        wind: Wind,
        *,
        return_height_m: float = 0.0,
        sigmas: float = 2.0,
    ) -> float:
        """Energy to climb, fly home and descend [Wh]; infinite if the wind is too strong."""
        east, north = np.array([home_m[0]]), np.array([home_m[1]])
        flying = float(vehicle.durations(state, east, north, wind)[0])
        if not isfinite(flying):
            return inf
        way = home_m[0] - state.east_m, home_m[1] - state.north_m
        steady = 1.0 / max(flying, 1e-9)
        airspeed = max(
            vehicle.speed_m_s,
            hypot(way[0] * steady - wind.east_m_s, way[1] * steady - wind.north_m_s),
        )
        climb = max(0.0, return_height_m - state.height_m)
        upright = (
            climb / PLANNING.return_climb_m_s
            + (state.height_m + climb) / PLANNING.return_sink_m_s
        )
        sure = 1.0 + sigmas * self.scale_sigma / self.scale
        used = self.used_wh(flying, airspeed) + self.used_wh(upright, wind.speed_m_s, climb)
        return sure * used


@dataclass(frozen=True, slots=True, kw_only=True)
class Battery:
    """Energy left in the battery, and the energy that must remain at home."""

    remaining_wh: float
    reserve_wh: float = 15.0

    def must_return(self, way_home_wh: float, next_leg_wh: float = 0.0) -> bool:
        """True if after the next path too little energy remains for return and reserve."""
        return self.remaining_wh - next_leg_wh <= way_home_wh + self.reserve_wh
