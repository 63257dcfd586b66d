"""What flying takes, learnt in flight: what was foretold and what the battery gave. Pure."""

from uavrt.planning import EnergyModel

LEARNS_PERCENT = 3.0
"""Of the battery between two lessons."""


class Lessons:
    """What the energy model tells and what the battery gave, stretch by stretch."""

    def __init__(self) -> None:
        self._before_s: float | None = None
        self._percent: float | None = None
        self._begun_percent: float | None = None
        self._predicted_wh = 0.0

    def add(
        self, time_s: float, percent: float, energy: EnergyModel, speed_m_s: float
    ) -> tuple[float, float] | None:
        """Take a reading; give predicted watt-hours and percents used when there are enough.

        A stretch begins and ends where the reading, in whole percents, changes.
        """
        if self._before_s is not None:
            self._predicted_wh += energy.used_wh(time_s - self._before_s, speed_m_s)
        changed = self._percent is not None and percent != self._percent
        self._before_s, self._percent = time_s, percent
        if not changed:
            return None
        if self._begun_percent is None:
            self._begun_percent, self._predicted_wh = percent, 0.0
            return None
        used = self._begun_percent - percent
        if used < LEARNS_PERCENT or self._predicted_wh <= 0.0:
            return None
        predicted_wh, self._predicted_wh, self._begun_percent = self._predicted_wh, 0.0, percent
        return predicted_wh, used
