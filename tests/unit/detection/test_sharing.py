"""Trains are given to tags as an exhaustive search would, and hundreds within bounded work."""

import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pytest

from uavrt.detection.track.transmitters.train_assignment import best_assignment, losses, parts

Worth = Mapping[int, float]


def total(able: Sequence[Worth], chosen: Sequence[int | None]) -> float:
    return sum(able[at][to] for at, to in enumerate(chosen) if to is not None)


def every_sharing(able: Sequence[Worth]) -> Iterator[tuple[int | None, ...]]:
    """Each way to give each train to one tag or none, no tag to two."""
    for chosen in itertools.product(*[(None, *worth) for worth in able]):
        given = [to for to in chosen if to is not None]
        if len(given) == len(set(given)):
            yield chosen


def some_trains(rng: np.random.Generator) -> list[dict[int, float]]:
    """A few trains and tags; worths like those of likelihoods, some the same."""
    trains, tags = int(rng.integers(1, 6)), int(rng.integers(1, 6))
    share = rng.uniform(0.2, 1.0)
    return [
        {
            to: 50.0 + float(rng.integers(-15, 8)) + float(rng.choice([0.0, rng.normal()]))
            for to in range(tags)
            if rng.random() < share
        }
        for _ in range(trains)
    ]


@pytest.mark.parametrize("seed", range(60))
def test_trains_are_shared_out_as_an_exhaustive_search_would(seed: int) -> None:
    able = some_trains(np.random.default_rng(seed))
    ways = list(every_sharing(able))
    best = max(total(able, way) for way in ways)
    chosen = best_assignment(able)
    assert tuple(chosen) in ways
    assert total(able, chosen) == pytest.approx(best)
    found = losses(able, chosen)
    for at, worth in enumerate(able):
        assert set(found[at]) == set(worth)
        for to, loss in found[at].items():
            forced = max(total(able, way) for way in ways if way[at] == to)
            assert loss == pytest.approx(best - forced, abs=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_parts_are_shared_out_as_the_whole(seed: int) -> None:
    able = some_trains(np.random.default_rng(seed))
    found = parts(able)
    assert sorted(at for part in found for at in part) == [
        at for at, worth in enumerate(able) if worth
    ]
    tags = [{to for at in part for to in able[at]} for part in found]
    assert all(not one & two for one, two in itertools.combinations(tags, 2))
    alone = sum(
        total(some, best_assignment(some))
        for part in found
        if (some := [able[i] for i in part])
    )
    assert alone == pytest.approx(total(able, best_assignment(able)))


class Counted(dict[int, float]):
    """Counts how often it is looked through."""

    looks = 0

    def items(self):  # type: ignore[no-untyped-def]
        Counted.looks += 1
        return super().items()


@pytest.mark.parametrize("reach", [1, 4])
def test_a_chain_of_400_trains_takes_bounded_work(reach: int) -> None:
    # Each train may be its own tag's or that of the next ones; all could move along by one.
    rng = np.random.default_rng(reach)
    Counted.looks = 0
    able = [
        Counted({at + step: 50.0 + float(rng.normal()) for step in range(reach + 1)})
        for at in range(400)
    ]
    assert len(parts(able)) == 1
    chosen = best_assignment(able)
    given = [to for to in chosen if to is not None]
    assert len(given) == len(set(given)) > 390
    found = losses(able, chosen)
    assert Counted.looks < 400 * 40
    assert min(min(some.values()) for some in found) >= -1e-6
