"""Divide tags among drones into rounds, so that the longest round is as short as possible."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavrt.planning.tuning import PLANNING

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Where and when a drone can begin its round of tags."""

    east_m: float
    north_m: float
    after_s: float = 0.0


def divided(
    starts: Sequence[Start],
    east_m: _Floats,
    north_m: _Floats,
    *,
    speed_m_s: float,
    stay_s: float,
    owners: Sequence[int | None] = (),
) -> list[list[int]]:
    """Divide tags into one round for each drone; return the tags' indices in the order of
    visits.

    Each tag in turn is assigned to the drone that would finish it first (list scheduling). Then
    single tags are moved to other rounds while that shortens the longest round or the total.
    `owners` holds the index of the drone that has each tag now; a change of drone costs
    `PLANNING.transfer_s`.
    """
    rounds = _Rounds(starts, east_m, north_m, speed_m_s, stay_s, owners)
    tours: list[list[int]] = [[] for _ in starts]
    left = set(range(len(east_m)))
    while left:
        _, tag, drone = min(
            (rounds.time_s(drone, [*tour, tag]), tag, drone)
            for drone, tour in enumerate(tours)
            for tag in left
        )
        tours[drone].append(tag)
        left.remove(tag)
    for _ in range(PLANNING.division_passes):
        moved = [rounds.improve(tours, tag) for tag in range(len(east_m))]
        if not any(moved):
            break
    return tours


class _Rounds:
    def __init__(
        self,
        starts: Sequence[Start],
        east_m: _Floats,
        north_m: _Floats,
        speed_m_s: float,
        stay_s: float,
        owners: Sequence[int | None],
    ) -> None:
        def off(x: _Floats, y: _Floats) -> list[list[float]]:
            away = np.hypot(x[:, None] - east_m, y[:, None] - north_m)
            return [list(map(float, row)) for row in away / speed_m_s + stay_s]

        own = np.array([(one.east_m, one.north_m) for one in starts])
        self._between, self._first = off(east_m, north_m), off(own[:, 0], own[:, 1])
        self._owners = owners or [None] * len(east_m)
        self._after = [one.after_s for one in starts]

    def time_s(self, drone: int, tour: Sequence[int]) -> float:
        if not tour:
            return 0.0
        legs = (self._between[a][b] for a, b in pairwise(tour))
        changed = sum(self._owners[tag] not in (None, drone) for tag in tour)
        way = self._first[drone][tour[0]] + sum(legs)
        return self._after[drone] + way + PLANNING.transfer_s * changed

    def improve(self, tours: list[list[int]], tag: int) -> bool:
        """Move a tag to its best place in all rounds; False if it is already there."""
        owner = next(drone for drone, tour in enumerate(tours) if tag in tour)
        times = [self.time_s(drone, tour) for drone, tour in enumerate(tours)]
        without = [one for one in tours[owner] if one != tag]
        best, place = (max(times), sum(times)), None
        for drone, tour in enumerate(tours):
            rest = without if drone == owner else tour
            others = [
                self.time_s(owner, without) if n == owner else time
                for n, time in enumerate(times)
                if n != drone
            ]
            for at in range(len(rest) + 1):
                time = self.time_s(drone, [*rest[:at], tag, *rest[at:]])
                cost = max([time, *others]), time + sum(others)
                if cost < (best[0] - 1e-6, best[1]) or (
                    cost[0] < best[0] + 1e-6 and cost[1] < best[1] - 1e-6
                ):
                    best, place = cost, (drone, at)
        if place is None:
            return False
        drone, at = place
        tours[owner] = without
        tours[drone] = [*tours[drone][:at], tag, *tours[drone][at:]]
        return True
