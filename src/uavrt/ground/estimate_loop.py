"""Repeat the position estimates of a vehicle's flight when new data arrives, using a limited
share of one core.
"""

import asyncio
from collections.abc import Callable, Sequence

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import UavrtError
from uavrt.ground.link.served_vehicle import ServedVehicle
from uavrt.ground.store.estimates import Estimates, Estimator
from uavrt.localization.estimates.flight_estimates import HeardInTurn

ESTIMATE_LEAST_S = 0.4
ESTIMATE_SHARE = 8.0
"""Pause after a position estimate, as a multiple of its duration; 8 limits the load to 11 % of
a core."""
ESTIMATE_SHARE_OF_SEVERAL = 20.0
"""Pause after a position estimate if several vehicles are served, as a multiple of its
duration. Only one vehicle's estimate runs at a time, so 20 limits the load to 5 % of a core."""
ESTIMATES_SHOWN_S = 2.0
"""Interval of sending position estimates to the page while further tags are computed [s]."""


class EstimateLoop:
    """Repeats the estimates of one vehicle's flight; only one vehicle computes at a time."""

    def __init__(
        self,
        vehicle: ServedVehicle,
        companions: Callable[[], Sequence["EstimateLoop"]],
        estimating: asyncio.Lock,
    ) -> None:
        self.latest = Estimates(bearings=[], positions=[])
        self._vehicle, self._companions = vehicle, companions
        self._one_at_a_time = estimating
        self._estimator = Estimator()
        self._due = False
        self._next_s = 0.0
        self._fault = ""
        self._shown_s = 0.0
        self._task: asyncio.Task[None] | None = None

    def soon(self) -> None:
        """Request a new estimate because data arrived from this or another vehicle."""
        self._due = True

    def restart(self) -> None:
        """Discard the estimates and begin with a new flight."""
        self.latest = Estimates(bearings=[], positions=[])
        self._estimator = Estimator()
        for companion in self._companions():
            companion.soon()

    def start_if_due(self) -> None:
        """Start an estimate if one is due and the last was long enough ago."""
        if self._due and monotonic_s() >= self._next_s:
            self._due = False
            self._next_s = float("inf")
            self._task = asyncio.get_running_loop().create_task(self._estimate())

    def stop(self) -> None:
        """Cancel an estimate in progress."""
        if self._task is not None:
            self._task.cancel()

    async def _estimate(self) -> None:
        async with self._one_at_a_time:
            flight_id = self._vehicle.flight.keeper.flight_id
            companions = self._companions()
            begun_s = monotonic_s()
            try:
                found = await self._estimated(flight_id, [one.latest for one in companions])
            except UavrtError as error:
                if str(error) != self._fault:
                    self._fault = str(error)
                    self._vehicle.feed.note(
                        4, f"No bearings or positions could be computed: {error}"
                    )
                return
            finally:
                took_s, others = monotonic_s() - begun_s, len(self._companions())
                share = ESTIMATE_SHARE_OF_SEVERAL * (1 + others) if others else ESTIMATE_SHARE
                self._next_s = monotonic_s() + max(ESTIMATE_LEAST_S, share * took_s)
            if flight_id == self._vehicle.flight.keeper.flight_id:
                self._take(found, flight_id)

    async def _estimated(
        self, flight_id: str | None, companions: Sequence[Estimates]
    ) -> Estimates:
        vehicle, estimator = self._vehicle, self._estimator
        columns = vehicle.flight.keeper.columns()
        antenna = vehicle.store.settings.antenna_choice
        past: Sequence[HeardInTurn] = ()
        if flight_id is not None:
            place = vehicle.store.directory / flight_id
            past = await asyncio.to_thread(estimator.past, place, antenna)
        return await asyncio.to_thread(
            estimator.estimate,
            columns,
            antenna,
            tuple(vehicle.drone.bearings.values()),
            vehicle.drone.sent_tags,
            companions,
            past,
            vehicle.name,
            vehicle.store.chosen_tags,
        )

    def _take(self, found: Estimates, flight_id: str | None) -> None:
        """Send new estimates to the pages and share them with the other vehicles' sessions."""
        if found.outline != self.latest.outline:
            for companion in self._companions():
                companion.soon()
        self.latest, self._fault = found, ""
        self._due |= found.more
        if not found.more or monotonic_s() >= self._shown_s + ESTIMATES_SHOWN_S:
            self._shown_s = monotonic_s()
            record = {"flight_id": flight_id, **found.record()}
            self._vehicle.feed.send("estimates", record)
