"""Estimate a drone's flight power from predicted energy and battery readings; no I/O."""

from dataclasses import replace

from uavrt.guidance.operator_orders import VehicleNow
from uavrt.guidance.search_rules import SEARCH_RULES
from uavrt.planning.drone_model.energy import EnergyModel


def energy_of(hover_w: float | None) -> EnergyModel:
    """Prior estimate of the flight power; `hover_w`: hover power [W], None if unknown."""
    if hover_w is None:
        return EnergyModel(scale_sigma=SEARCH_RULES.unknown_sigma)
    return EnergyModel(
        hover_w=hover_w,
        cruise_w=1.05 * hover_w,
        climb_j_per_m=0.15 * hover_w,
        scale_sigma=SEARCH_RULES.known_sigma,
    )


class EnergyLearning:
    """Estimates one drone's flight power; updated only if the battery's capacity is set."""

    def __init__(self, hover_w: float | None, battery_wh: float | None) -> None:
        self.energy = energy_of(hover_w)
        self.learnt = 0
        """Number of updates of the estimated power so far."""
        self._battery_wh = battery_wh
        self._before_s: float | None = None
        self._percent: float | None = None
        self._begun_percent: float | None = None
        self._predicted_wh = 0.0

    def learn(self, now: VehicleNow) -> VehicleNow:
        """Use a battery reading; return the vehicle's state with the estimated power.

        Readings count only while an order is flown, because the drone is then in the air.
        """
        if self._battery_wh is not None and now.began and now.battery_percent is not None:
            self._read(now, now.battery_percent, self._battery_wh)
        else:
            self._before_s = self._percent = self._begun_percent = None
        return replace(now, energy=self.energy)

    def _read(self, now: VehicleNow, percent: float, battery_wh: float) -> None:
        """Update the power from predicted and used energy between two battery readings."""
        before_s, before = self._before_s, self._percent
        self._before_s, self._percent = now.time_s, percent
        if before_s is None or before is None:
            return
        self._predicted_wh += self.energy.used_wh(now.time_s - before_s, now.speed_m_s)
        if percent == before:
            return
        if percent > before + SEARCH_RULES.swapped_percent:
            self._begun_percent = None
        if self._begun_percent is None:
            self._begun_percent, self._predicted_wh = percent, 0.0
            return
        used_percent = self._begun_percent - percent
        if used_percent < SEARCH_RULES.learns_percent or self._predicted_wh <= 0.0:
            return
        self.energy = self.energy.learnt(
            self._predicted_wh,
            battery_wh * used_percent / 100.0,
            sigma_wh=SEARCH_RULES.reading_share * battery_wh,
        )
        self.learnt += 1
        self._begun_percent, self._predicted_wh = percent, 0.0
