"""Assign trains to tags by likelihood, at most one to one; compute the loss of alternatives.

Trains and tags that may belong together form a graph with few edges. Its connected parts are
solved one by one. Trains are added one after the other, and each time the assignment changes
along the path with the smallest loss (successive shortest paths with Dijkstra's algorithm:
Edmonds and Karp, Journal of the ACM 19, 1972). The loss of giving a train another tag is the
length of the shortest path back to the assignment, by Floyd and Warshall's algorithm.

`scipy.optimize.linear_sum_assignment` is not used, because it does not give the second best
assignment, from which the other possible tags of a pulse are found.
"""

import heapq
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray


def parts(able: Sequence[Mapping[int, float]]) -> list[list[int]]:
    """Group the trains that compete for tags; `able`: value of each possible tag, by train."""
    trains_of: dict[int, list[int]] = {}
    for at, worth in enumerate(able):
        for to in worth:
            trains_of.setdefault(to, []).append(at)
    seen: set[int] = set()
    found = []
    for start, worth in enumerate(able):
        if start in seen or not worth:
            continue
        seen.add(start)
        part, open_tags = [start], list(worth)
        while open_tags:
            for at in trains_of.pop(open_tags.pop(), ()):
                if at not in seen:
                    seen.add(at)
                    part.append(at)
                    open_tags += able[at]
        found.append(sorted(part))
    return found


def best_assignment(able: Sequence[Mapping[int, float]]) -> list[int | None]:
    """Tag of each train (None: none) that gives the largest sum of the values in `able`."""
    made = _AssignmentSoFar(able)
    for start in range(len(able)):
        made.add(start)
    return made.chosen


class _AssignmentSoFar:
    """Best assignment of the trains added so far. Each tag has a price, the dual variable: with
    prices deducted, no train gains by another tag or by none.
    """

    def __init__(self, able: Sequence[Mapping[int, float]]) -> None:
        self._able = able
        self.chosen: list[int | None] = [None] * len(able)
        self._owner: dict[int, int] = {}
        self._price: dict[int, float] = {}
        self._gain = [0.0] * len(able)

    def add(self, start: int) -> None:
        price, gain = self._price, self._gain
        gains = (worth - price.get(to, 0.0) for to, worth in self._able[start].items())
        gain[start] = max(0.0, max(gains, default=0.0))
        least, last, free = np.inf, start, None
        lost: dict[int, float] = {}
        came: dict[int, tuple[int, int]] = {}
        waiting: list[tuple[float, int, tuple[int, int] | None]] = [(0.0, start, None)]
        while waiting:
            loss, at, by = heapq.heappop(waiting)
            if loss >= least:
                break
            if at in lost:
                continue
            lost[at] = loss
            if by is not None:
                came[at] = by
            if loss + gain[at] < least:
                least, last, free = loss + gain[at], at, None
            for to, worth in self._able[at].items():
                total = loss + max(0.0, gain[at] + price.get(to, 0.0) - worth)
                holder = self._owner.get(to)
                if total >= least or holder in lost:
                    continue
                if holder is None:
                    least, last, free = total, at, to
                else:
                    heapq.heappush(waiting, (total, holder, (at, to)))
        for at, loss in lost.items():
            gain[at] -= least - loss
            held = self.chosen[at]
            if held is not None:
                price[held] = price.get(held, 0.0) + least - loss
        self._exchange(start, last, free, came)

    def _exchange(
        self, start: int, last: int, free: int | None, came: Mapping[int, tuple[int, int]]
    ) -> None:
        while True:
            self.chosen[last] = free
            if free is not None:
                self._owner[free] = last
            if last == start:
                return
            last, free = came[last]


def losses(
    able: Sequence[Mapping[int, float]], chosen: Sequence[int | None]
) -> list[dict[int, float]]:
    """For each train, loss of total value if it got another tag, by tag; 0 for its own tag."""
    owner = {to: at for at, to in enumerate(chosen) if to is not None}
    back = _path_losses(able, chosen, owner)
    free = len(able)
    found = []
    for at, worth in enumerate(able):
        own = chosen[at]
        now = 0.0 if own is None else worth[own]
        found.append(
            {
                to: 0.0 if to == own else now - value + float(back[owner.get(to, free), at])
                for to, value in worth.items()
            }
        )
    return found


def _path_losses(
    able: Sequence[Mapping[int, float]], chosen: Sequence[int | None], owner: Mapping[int, int]
) -> NDArray[np.float64]:
    """Smallest loss of value, by pair of trains, if the first gets the tag of the second.

    The last row and column represent unassigned tags and trains without a tag. A loss may
    include further changes of tags.
    """
    free = len(able)
    loss_of = np.full((free + 1, free + 1), np.inf)
    np.fill_diagonal(loss_of, 0.0)
    loss_of[free, :] = 0.0
    for at, worth in enumerate(able):
        own = chosen[at]
        now = 0.0 if own is None else worth[own]
        loss_of[at, free] = now
        for to, value in worth.items():
            other = owner.get(to, free)
            if other != at:
                loss_of[at, other] = min(loss_of[at, other], now - value)
    for via in range(free + 1):
        np.minimum(loss_of, loss_of[:, via, np.newaxis] + loss_of[via], out=loss_of)
    return loss_of
