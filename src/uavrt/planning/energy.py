"""What flying costs, learnt from the battery, and when it is time to go home."""

from dataclasses import dataclass, replace

import numpy as np

from uavrt.errors import ConfigError
from uavrt.planning.vehicle import Vehicle, VehicleState, Wind

_J_PER_WH = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergyModel:
    """Power of a drone, and what its battery has shown it to be.

    Power at an airspeed v is that of hovering, less by `translation_share` at most once the
    rotors meet fresh air, and a drag that grows with v³, such that it is `cruise_w` at
    `cruise_m_s`. All is multiplied by a factor that readings of the battery teach.
    """

    hover_w: float = 400.0
    cruise_w: float = 420.0
    cruise_m_s: float = 10.0
    climb_j_per_m: float = 60.0
    """On top, for each metre upwards."""
    scale: float = 1.0
    """Power that is used over that of the model: payload, air, age of the battery."""
    scale_sigma: float = 0.2
    """How sure that is."""

    def __post_init__(self) -> None:
        if min(self.hover_w, self.cruise_w, self.cruise_m_s) <= 0.0 or self.climb_j_per_m < 0:
            raise ConfigError(
                "the power of hovering and cruising and the cruise speed must be above 0",
                remedy="Read them off a flight's log: volts times amperes",
            )

    def power_w(self, airspeed_m_s: float) -> float:
        """Power in level flight."""
        share = airspeed_m_s / self.cruise_m_s
        relieved = 0.1 * self.hover_w * (1.0 - np.exp(-2.0 * share))
        at_cruise = 0.1 * self.hover_w * (1.0 - np.exp(-2.0))
        drag = (self.cruise_w - self.hover_w + at_cruise) * share**3
        return float(self.scale * max(self.hover_w - relieved + drag, 0.3 * self.hover_w))

    def used_wh(self, duration_s: float, airspeed_m_s: float, climb_m: float = 0.0) -> float:
        """Energy of a stretch of flight; coming down gives nothing back."""
        climb = self.scale * self.climb_j_per_m * max(climb_m, 0.0)
        return (self.power_w(airspeed_m_s) * duration_s + climb) / _J_PER_WH

    def learnt(self, predicted_wh: float, used_wh: float, sigma_wh: float) -> "EnergyModel":
        """Update with what the battery gave over a stretch for which this model told another.

        Parameters
        ----------
        predicted_wh, used_wh : float
            By this model, and by the battery's readings.
        sigma_wh : float
            Of the difference of two readings.

        Raises
        ------
        ConfigError
            The readings cannot be.
        """
        if not (predicted_wh > 0.0 and np.isfinite(used_wh) and sigma_wh > 0.0):
            raise ConfigError(
                f"a battery that gave {used_wh} Wh where {predicted_wh} Wh were expected",
                remedy="Check the battery monitor's calibration",
            )
        per_scale = predicted_wh / self.scale
        precision = 1.0 / self.scale_sigma**2 + (per_scale / sigma_wh) ** 2
        gain = per_scale / sigma_wh**2 / precision
        scale = self.scale + gain * (used_wh - predicted_wh)
        return replace(
            self,
            scale=float(np.clip(scale, 0.3, 4.0)),
            scale_sigma=float(max(precision**-0.5, 0.02)),
        )

    def way_home_wh(
        self,
        vehicle: Vehicle,
        state: VehicleState,
        home_m: tuple[float, float],
        wind: Wind,
        *,
        sigmas: float = 2.0,
    ) -> float:
        """Energy to fly home and come down, of a drone that uses more than is believed.

        Infinite against a wind that is too strong.
        """
        east, north = np.array([home_m[0]]), np.array([home_m[1]])
        flying = float(vehicle.durations(state, east, north, wind)[0])
        landing = state.height_m / 1.5
        sure = 1.0 + sigmas * self.scale_sigma / self.scale
        if not np.isfinite(flying):
            return float("inf")
        return sure * (self.used_wh(flying, vehicle.speed_m_s) + self.used_wh(landing, 0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Battery:
    """Energy left, and the reserve required back home."""

    remaining_wh: float
    reserve_wh: float = 15.0

    def must_return(self, way_home_wh: float, next_leg_wh: float = 0.0) -> bool:
        """Whether it is time to go: the next leg would use what the way home needs."""
        return self.remaining_wh - next_leg_wh <= way_home_wh + self.reserve_wh
