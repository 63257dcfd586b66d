"""Regions of where a tag is, when the fall with distance is not known."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from depth import count, seeds, share

from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.tuning import FLIGHT
from uavrt.localization.whole_flight.ground_cells import Cells, LikelyGround
from uavrt.localization.whole_flight.heard_train import HeardTrain, slot_logs, train_pulses
from uavrt.localization.whole_flight.train_place import _EXPONENT_SHARES
from uavrt.localization.whole_flight.tuning import PLACE
from uavrt_experiments.integrate.flights import (
    PLANE,
    Course,
    add_pulses,
    lawnmower,
    looked_at,
    silence,
)
from uavrt_experiments.integrate.place import placed
from uavrt_experiments.integrate.sensitivity import best_train, narrow_world
from uavrt_experiments.integrate.several import fly_past, worlds

pytestmark = pytest.mark.slow


def test_a_region_holds_for_each_fall_with_distance() -> None:
    # A fall of a tenth of the belief puts the tag to the west, the others to the east.
    by_fall = np.array([[0.96, 0.02, 0.02], [0.02, 0.02, 0.96]])
    cells = Cells(
        plane=PLANE,
        bearing_deg=np.array([270.0, 0.0, 90.0]),
        range_m=np.full(3, 1000.0),
        width_deg=np.full(3, 5.0),
        ratio=np.full(3, 1.1),
        probability=np.array([0.1, 0.9]) @ by_fall,
        by_fall=by_fall,
    )
    assert cells.region(0.85).tolist() == [True, False, True]
    assert cells.holds(-1000.0, 0.0, 0.85)


def ring(probability: np.ndarray, range_m: np.ndarray, ratio: float) -> Cells:
    """Cells one behind the other to the east, for one fall with distance."""
    return Cells(
        plane=PLANE,
        bearing_deg=np.full(len(range_m), 90.0),
        range_m=range_m,
        width_deg=np.full(len(range_m), 5.0),
        ratio=np.full(len(range_m), ratio),
        probability=probability,
        by_fall=probability[np.newaxis],
    )


def east_of(cells: Cells) -> float:
    (part,) = cells.parts()
    return float(PLANE.to_local([part.latitude_deg], [part.longitude_deg])[0][0])


def test_the_place_told_is_the_likeliest_and_not_the_mean_of_a_skewed_belief() -> None:
    range_m = np.geomspace(200.0, 5000.0, 120)
    ratio = float(range_m[1] / range_m[0])
    # Known to a third of the distance, as of a weak tag beside a straight way.
    density = np.exp(-0.5 * (np.log(range_m / 1000.0) / 0.35) ** 2)
    skewed = ring(density * range_m / (density @ range_m), range_m, ratio)
    assert 850.0 < east_of(skewed) < 1020.0
    normal = np.exp(-0.5 * ((range_m - 1500.0) / 150.0) ** 2) * range_m
    assert east_of(ring(normal / normal.sum(), range_m, ratio)) == pytest.approx(1500.0, abs=30)


def test_the_falls_with_distance_are_believed_in_as_by_bearings_and_levels() -> None:
    belief = Propagation()
    mean = float(_EXPONENT_SHARES @ PLACE.exponents)
    assert _EXPONENT_SHARES.sum() == pytest.approx(1.0)
    assert mean == pytest.approx(belief.exponent, abs=0.1)


def test_cells_in_parts_cover_the_same_ground_and_are_parted_where_they_differ() -> None:
    ground = LikelyGround(
        bearing_deg=np.array([0.0, 5.0, 357.0]),
        range_m=np.array([500.0, 500.0, 2.0]),
        width_deg=np.full(3, 5.0),
        ratio=np.full(3, 1.45),
        uneven=np.full(3, np.inf),
        logs=np.array([[0.0, 1.0, 2.0], [0.5, 0.0, 0.0]]),
        level_db=np.zeros((2, 3)),
    )
    assert ground.held.sum() == pytest.approx(1.0)
    which = ground.to_part()
    assert which.tolist() == [0, 1], "the third is small enough"
    parts = ground.parts(which)
    likelihood = np.zeros((2, 18))
    likelihood[0, 4] = 5.0
    finer = ground.with_parts(which, replace(parts, logs=likelihood))
    assert len(finer.range_m) == 19
    assert finer.logs[:, -1].tolist() == [2.0, 0.0]
    assert finer.to_part().tolist() == list(range(9)), "the others are alike"
    assert finer.area.sum() == pytest.approx(ground.area.sum(), rel=1e-3)
    assert parts.width_deg * 3.0 == pytest.approx(np.full(18, 5.0))
    assert parts.ratio**3 == pytest.approx(np.full(18, 1.45))
    assert set(parts.bearing_deg[:9].round(2)) == {0.0, 1.67, 358.33}


@pytest.mark.parametrize(("cell_m", "sigma_m"), [(1.0, FLIGHT.place_sigma_m), (40.0, 0.0)])
def test_an_error_of_the_drones_own_position_widens_narrow_regions(
    cell_m: float, sigma_m: float
) -> None:
    """Regions of tags close to the path were as narrow as for exact drone positions."""
    bearing, out = (one.ravel() for one in np.meshgrid(np.arange(-20, 21), np.arange(-20, 21)))
    turn_deg, count = float(np.degrees(cell_m / 3000.0)), len(out)
    logs = np.zeros((2, count))
    logs[:, count // 2] = 50.0
    ground = LikelyGround(
        bearing_deg=np.asarray(bearing * turn_deg, np.float64),
        range_m=np.asarray(3000.0 + out * cell_m, np.float64),
        width_deg=np.full(count, turn_deg),
        ratio=np.full(count, 1.0 + cell_m / 3000.0),
        uneven=np.zeros(count),
        logs=logs,
        level_db=np.zeros((2, count)),
    )
    shifted = ground.shifted
    assert shifted.sum() == pytest.approx(1.0)
    for across in (bearing * cell_m, out * cell_m):
        spread_m = np.sqrt(shifted.sum(axis=0) @ across**2.0)
        assert spread_m == pytest.approx(sigma_m, abs=0.05)


def lanes(exponent: float = 2.0) -> Course:
    """Four lanes over a square, smaller and flown twice as fast where few seeds are flown."""
    side_m, speed_m_s = float(count(800, 1000)), float(count(20, 10))
    return lawnmower(
        tag="inside", legs=4, side_m=side_m, exponent=exponent, speed_m_s=speed_m_s
    )


@pytest.mark.parametrize("enr_db", share([25.0, 12.0, 30.0], 3))
def test_a_tag_between_lanes_is_where_it_is_said_to_be(enr_db: float) -> None:
    """Regions of 90 % once held two of five at 25 dB, of places 25 m off.

    And it was 2.6 times the bound: what the many weak pulses have wrong in common led it.
    """
    flown = [
        placed(np.random.default_rng((9, seed)), lanes(), enr_db, 0.0) for seed in seeds(2, 5)
    ]
    found = [one for one in flown if one is not None]
    assert len(found) == len(flown)
    assert sum(one.held for one in found) > 0.7 * len(found)
    assert max(one.off_m for one in found) < (60.0 if enr_db < 20.0 else 25.0)
    if enr_db > 20.0:
        assert np.median([one.off_m / one.bound_m for one in found]) < 1.3


def test_levels_of_loud_pulses_are_told_apart() -> None:
    """All above 28 dB were alike: a tag 30 m beside the way was 500 m off."""
    rng = np.random.default_rng(4)
    course = lanes()
    world = narrow_world(course)
    truth = world.truth(rng)
    samples = silence(rng, course)
    add_pulses(rng, samples, world.pulses(rng, truth, 45.0))
    energies = world.energies(samples)
    places, chosen = looked_at(course)
    train = best_train(world, energies)
    pulses = train_pulses(energies, train, places.gain[chosen[train.place]], places.time_s)
    heard = HeardTrain.among(energies, pulses, places, rates=1)
    told_db = 10.0 * np.log10(pulses.energy)
    assert told_db.max() > 42.0
    levels_db = np.arange(-10.0, 55.0, 0.5)
    logs = slot_logs(heard, np.ones(len(told_db)), levels_db)
    loud = told_db > 22.0
    assert levels_db[logs.argmax(axis=0)][loud] == pytest.approx(told_db[loud] + 1.0, abs=1.1)
    # A strength 6 dB beside it is not as likely.
    for beside_db in (-6.0, 6.0):
        at = np.searchsorted(levels_db, told_db + 1.0 + beside_db)
        inside = loud & (at < len(levels_db))
        less = logs.max(axis=0) - logs[np.minimum(at, len(levels_db) - 1), np.arange(len(at))]
        assert less[inside].min() > 3.0


@pytest.mark.parametrize(
    ("fading_db", "exponent"), share([(2.5, 2.0), (0.0, 2.0), (0.0, 3.5)], 2)
)
def test_a_loud_tag_tells_how_much_it_fades(fading_db: float, exponent: float) -> None:
    flown = [
        placed(
            np.random.default_rng((13, seed)), lanes(exponent), 45.0, 0.0, fading_db=fading_db
        )
        for seed in seeds(1, 6)
    ]
    found = [one for one in flown if one is not None]
    assert len(found) == len(flown)
    assert sum(one.held for one in found) > 0.7 * len(found)
    told_db = [one.fading_db for one in found]
    assert np.median(told_db) == pytest.approx(fading_db or 1.0, abs=0.5)
    assert np.median([one.off_m for one in found]) < 8.0
    assert max(one.off_m for one in found) < 25.0


def test_a_strong_tag_as_far_from_both_flights_is_placed() -> None:
    """Where it may be, distances are alike; elsewhere on the ground they are not."""
    each = tuple(
        replace(one, course=replace(one.course, tag_at=lambda _: (0.0, 1640.0)))
        for one in worlds(2, 1000.0)
    )
    flown = fly_past(np.random.default_rng((1, 1)), each, 26.0)
    assert flown.found
    assert flown.off_m is not None
    assert flown.off_m < 200.0


def test_the_parts_of_many_fine_cells_take_little_memory() -> None:
    """All pairs of these 7200 cells at once took 1.7 GB."""
    range_m = np.geomspace(100.0, 3000.0, 120)
    ratio = float(range_m[1] / range_m[0])
    bearing = np.concatenate([np.arange(0.0, 40.0, 1.0), np.arange(180.0, 200.0, 1.0)])
    around, away = (one.ravel() for one in np.meshgrid(bearing, range_m))
    probability = away**2 / np.sum(away**2)
    cells = Cells(
        plane=PLANE,
        bearing_deg=around,
        range_m=away,
        width_deg=np.ones(len(around)),
        ratio=np.full(len(around), ratio),
        probability=probability,
        by_fall=probability[np.newaxis],
    )
    tracemalloc.start()
    parts = cells.parts()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert [round(part.probability, 1) for part in parts[:2]] == [0.6, 0.3]
    assert peak < 150e6
