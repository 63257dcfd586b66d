"""How often pulses come together by chance, against trains drawn at random."""

import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.detection.track.transmitters.coincidence import by_chance, of_ghosts


def drawn(
    rng: np.random.Generator,
    *,
    pulses: int,
    near_s: float,
    interval_s: float,
    uncertainty_s: float,
    trials: int = 400_000,
) -> NDArray[np.int64]:
    """Pulses of a lattice that come with those of another, whose phase is anything."""
    phase_s = rng.uniform(0.0, interval_s, (trials, 1))
    drift_s = rng.uniform(-uncertainty_s, uncertainty_s, (trials, 1))
    late_s = phase_s + drift_s * np.arange(pulses)
    apart_s = np.abs((late_s + interval_s / 2.0) % interval_s - interval_s / 2.0)
    counts: NDArray[np.int64] = (apart_s < near_s).sum(axis=1, dtype=np.int64)
    return counts


@pytest.mark.parametrize(
    ("together", "pulses", "near_ms", "uncertainty_ms"),
    [
        (3, 3, 4.0, 60.0),
        (3, 6, 4.0, 60.0),
        (4, 6, 4.0, 5.0),
        (6, 6, 4.0, 1.0),
        (3, 6, 2.0, 1.0),
    ],
)
def test_the_chance_is_that_of_trains_drawn_at_random(
    together: int, pulses: int, near_ms: float, uncertainty_ms: float
) -> None:
    near_s, uncertainty_s = 1e-3 * near_ms, 1e-3 * uncertainty_ms
    counts = drawn(
        np.random.default_rng(3),
        pulses=pulses,
        near_s=near_s,
        interval_s=1.254,
        uncertainty_s=uncertainty_s,
    )
    chance = by_chance(
        together, pulses, near_s=near_s, interval_s=1.254, uncertainty_s=uncertainty_s
    )
    assert chance == pytest.approx(float(np.mean(counts >= together)), rel=0.25, abs=2e-5)


def test_the_faster_another_sends_the_likelier_its_pulses_come_together_with_a_tags() -> None:
    slow, fast = (
        by_chance(3, 4, near_s=0.004, interval_s=interval_s, uncertainty_s=0.06)
        for interval_s in (2.0, 0.1)
    )
    assert fast > 15.0 * slow


def test_of_a_ghosts_pulses_few_are_heard_without_its_original() -> None:
    assert of_ghosts(6, 6) == 1.0
    assert of_ghosts(5, 6) > 0.4
    assert of_ghosts(3, 6) < 0.02
