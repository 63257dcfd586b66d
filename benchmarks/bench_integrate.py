"""What judging a whole flight costs, by how the drone flew and by which code.

Three ways in one run: all places folded with NumPy, as it was done first; cells chosen by fewer
places, with NumPy; the same with the compiled kernels. They are compared on a fifth of the
frequencies. Flights are noise alone, which nothing shortens.
"""

import time
from dataclasses import replace

import numpy as np

from benchmarks.harness import Table
from uavrt.core.runtime import native
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies
from uavrt.localization.whole_flight.flight_judgement import (
    Weights,
    low_rank_weights,
    search_flight,
)
from uavrt_experiments.integrate.flights import (
    INTERVAL_S,
    Course,
    World,
    lawnmower,
    looked_at,
    silence,
    turning,
)

MINUTES = 20.0
WINDOW_HZ, NARROW_HZ = 500.0, 100.0
KNOWN_S = 0.001
FALSE_ALARM_PROBABILITY = 0.01


def run() -> list[Table]:
    """The two tables of this section."""
    whole, ways = [], []
    for course in _courses():
        whole.append(_whole(course))
        ways.append(_ways(course))
    wide, narrow = f"± {WINDOW_HZ:.0f} Hz, ± 60 ms", f"± {NARROW_HZ:.0f} Hz, ± 60 ms"
    return [
        Table(
            title=f"Judging one tag over {MINUTES:.0f} minutes",
            header=["the drone", "places", "patterns", f"CPU s, {wide}", "CPU s, ± 1 ms"],
            rows=whole,
            notes=["From slot energies on, places and their weights included."],
        ),
        Table(
            title=f"Searching one tag over {MINUTES:.0f} minutes, {narrow}, by three ways",
            header=[
                "the drone",
                "all places, NumPy: CPU s",
                "chosen cells, NumPy",
                "chosen cells, kernels",
                "first over last",
                "log chance of the best, first and last way",
            ],
            rows=ways,
        ),
    ]


def _courses() -> list[Course]:
    """Turning in place, turning on the way, and lanes with the antenna turning as well."""
    still = turning(round(60.0 * MINUTES / INTERVAL_S))
    lanes = lawnmower(tag="inside", legs=6)
    some = slice(0, len(still.east_m))
    lanes = replace(
        lanes,
        name="lanes over 2 km square",
        duration_s=min(still.duration_s, lanes.duration_s),
        east_m=lanes.east_m[some],
        north_m=lanes.north_m[some],
        yaw_deg=lanes.yaw_deg[some],
    )
    return [
        replace(still, name="turns in place"),
        replace(still, name="turns and flies on, 1 m/s", north_m=1.0 * still.time_s),
        replace(still, name="turns and flies on, 5 m/s", north_m=5.0 * still.time_s),
        replace(lanes, name="lanes over 2 km square, hears all round"),
        replace(
            lanes,
            name="the same, turning a directional antenna",
            antenna="RA-23K",
            yaw_deg=20.0 * lanes.time_s,
        ),
    ]


def _world(course: Course, window_hz: float, slack_s: float = 0.060) -> World:
    return World(course=course, slack_s=slack_s, window_hz=window_hz)


def _whole(course: Course) -> list[str]:
    rng = np.random.default_rng(1)
    world = _world(course, WINDOW_HZ)
    energies = world.energies(silence(rng, course))
    costs = []
    for slack_s in (0.060, KNOWN_S):
        looked_at.cache_clear()
        began_s = time.process_time()
        _world(course, WINDOW_HZ, slack_s).judge(energies, FALSE_ALARM_PROBABILITY)
        costs.append(f"{time.process_time() - began_s:.1f}")
    weights = _weights(course, energies)
    return [course.name, str(len(weights.mixing)), str(len(weights.basis)), *costs]


def _weights(course: Course, energies: SlotEnergies) -> Weights:
    places, chosen = looked_at(course)
    return low_rank_weights(places.gain[chosen], places.time_s, energies, INTERVAL_S)


def _ways(course: Course) -> list[str]:
    world = _world(course, NARROW_HZ)
    energies = world.energies(silence(np.random.default_rng(2), course))
    weights = _weights(course, energies)
    with native.numpy_only():
        all_s, first = _searched(world, energies, weights, in_full=True)
        chosen_s, _ = _searched(world, energies, weights, in_full=False)
    kernels_s, last = _searched(world, energies, weights, in_full=False)
    return [
        course.name,
        f"{all_s:.1f}",
        f"{chosen_s:.1f}",
        f"{kernels_s:.2f}",
        f"{all_s / kernels_s:.0f}",
        f"{first:.3f}, {last:.3f}",
    ]


def _searched(
    world: World, energies: SlotEnergies, weights: Weights, *, in_full: bool
) -> tuple[float, float]:
    """CPU seconds, and the logarithm of the chance of the best train."""
    began_s = time.process_time()
    few = {"few_patterns": len(weights.basis)} if in_full else {}
    (best,) = search_flight(energies, weights, world.tag, most=1, **few)
    return time.process_time() - began_s, best.log_probability
