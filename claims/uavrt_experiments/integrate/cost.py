"""I5: cost of evaluating a whole flight."""

import resource
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.integrate.false_alarms import NOMINAL
from uavrt_experiments.integrate.flights import INTERVAL_S, World, looked_at, silence, turning
from uavrt_experiments.result import Row


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """Cost of evaluating one tag in one flight."""

    minutes: float
    cpu_s: float
    peak_mb: float


def cost(
    rng: np.random.Generator, minutes: float, *, slack_s: float, window_hz: float = 500.0
) -> Cost:
    """Measure the evaluation of a flight without the tag, places included."""
    course = turning(round(60.0 * minutes / INTERVAL_S))
    world = World(course=course, slack_s=slack_s, window_hz=window_hz)
    samples = silence(rng, course)
    looked_at.cache_clear()
    began = time.process_time()
    world.judge(world.energies(samples), NOMINAL)
    took = time.process_time() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return Cost(minutes=minutes, cpu_s=took, peak_mb=peak)


def _whole_rows(outcomes: Sequence[Cost]) -> list[Row]:
    case = "20 minutes, one tag, ± 500 Hz, ± 60 ms"
    cpu = float(np.median([one.cpu_s for one in outcomes]))
    peak = max(one.peak_mb for one in outcomes)
    count = len(outcomes)
    return [
        Row.counted("I5", "CPU time, s", case, cpu, count, most=60.0),
        Row.counted("I5", "largest memory of the process, MB", case, peak, count, most=1000.0),
    ]


def _known_rows(outcomes: Sequence[Cost]) -> list[Row]:
    cpu = float(np.median([one.cpu_s for one in outcomes]))
    case = "20 minutes, one tag, ± 500 Hz, interval measured before, ± 1 ms"
    return [Row.counted("I5", "CPU time, s", case, cpu, len(outcomes), most=10.0)]


def _growth(rng: np.random.Generator, _: int) -> float:
    short, long = (cost(rng, minutes, slack_s=0.06, window_hz=100.0) for minutes in (5.0, 40.0))
    return long.cpu_s / short.cpu_s / 8.0


def _growth_rows(outcomes: Sequence[float]) -> list[Row]:
    case = "40 minutes over 5, ± 100 Hz, ± 60 ms"
    figure = float(np.median(outcomes))
    return [
        Row.counted(
            "I5", "CPU time over that in proportion", case, figure, len(outcomes), most=1.3
        )
    ]


def _case(
    name: str,
    seconds: float,
    trial: Callable[[np.random.Generator, int], Cost | float],
    rows: Callable[[Sequence[Cost]], list[Row]] | Callable[[Sequence[float]], list[Row]],
) -> Case:
    return Case(name=name, trials=3, seconds=seconds, trial=trial, rows=rows, alone=True)


I5 = Experiment(
    name="I5",
    title="Cost",
    cases=(
        _case("20 minutes", 40.0, lambda rng, _: cost(rng, 20.0, slack_s=0.06), _whole_rows),
        _case(
            "interval known", 5.0, lambda rng, _: cost(rng, 20.0, slack_s=0.001), _known_rows
        ),
        _case("growth", 20.0, _growth, _growth_rows),
    ),
)
