"""Strength, exponent and reflection of a tag are estimated jointly at each position."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.localization.position.levels.ground_reflection import (
    reflection_shapes,
    two_ray_gain_db,
)
from uavrt.localization.position.levels.level_belief import (
    EXPONENT,
    LASTING,
    LEVEL_AT_100_M,
    GroundEffect,
    LevelBelief,
    Listening,
    packed_rows,
)

GROUND = GroundEffect(doubtful_db=2.0, reflection=reflection_shapes())
MEANS, SIGMAS = [45.0, 3.0, 0.0, 0.0, 0.0], [12.0, 0.7, 1.0, 1.0, 1.0]


def pulse(east_m: float, snr_db: float | None) -> Listening:
    return Listening(east_m=east_m, north_m=0.0, height_m=40.0, snr_db=snr_db)


def covariance_of(belief: LevelBelief, position: int) -> NDArray[np.floating[Any]]:
    rows = np.array(packed_rows(len(belief.mean)))
    return np.asarray(belief.covariance[rows, position])


def test_received_pulses_are_a_linear_regression() -> None:
    """Without false pulses the update equals the textbook's, at every position."""
    belief = LevelBelief.before_pulses(MEANS, SIGMAS, 2)
    tag_m = np.array([0.0, 60.0], np.float32), np.array([30.0, -20.0], np.float32)
    rows, levels = [], []
    for east_m, snr_db in ((-200.0, 25.0), (-90.0, 34.0), (-20.0, 31.0), (80.0, 33.0)):
        heard = pulse(east_m, snr_db)
        expected = belief.expected(heard, *tag_m, None, GROUND)
        belief.update(heard, expected, 3.0, missed_share=0.0, chance_share=0.0)
        slant2 = (tag_m[0] - east_m) ** 2 + tag_m[1] ** 2 + 40.0**2
        known, slopes = GROUND.slopes(slant2, 40.0)
        gain = 10.0 * np.log10(1.0 - 40.0**2 / slant2)
        rows.append(np.stack([np.broadcast_to(one, 2) for one in (1.0, *slopes)]))
        levels.append(snr_db - known - gain)
    for position in (0, 1):
        x = np.stack(rows)[:, :, position]
        information = np.diag(np.array(SIGMAS) ** -2.0) + x.T @ x / 9.0
        y = np.stack(levels)[:, position] - x @ MEANS
        mean = MEANS + np.linalg.solve(information, x.T @ y / 9.0)
        assert belief.mean[:, position] == pytest.approx(mean, abs=2e-3)
        assert covariance_of(belief, position) == pytest.approx(
            np.linalg.inv(information), abs=5e-3
        )


def test_information_on_the_exponent_can_be_withdrawn() -> None:
    belief = LevelBelief.before_pulses(MEANS, SIGMAS, 1)
    heard = pulse(150.0, 25.0)
    place = np.zeros(1, np.float32), np.zeros(1, np.float32)
    belief.update(heard, belief.expected(heard, *place, None, GROUND), 3.0)
    before = belief.mean.copy(), covariance_of(belief, 0).copy()
    given = belief.take(EXPONENT, 8.0, 8.0 * 2.3)
    assert abs(belief.mean[EXPONENT, 0] - 2.3) < 0.2
    taken = belief.take(EXPONENT, -8.0, -8.0 * 2.3)
    assert float(given[0] + taken[0]) == pytest.approx(0.0, abs=1e-3)
    assert belief.mean == pytest.approx(before[0], abs=1e-3)
    assert covariance_of(belief, 0) == pytest.approx(before[1], abs=2e-3)


def test_an_unknown_returns_to_its_prior_and_is_drawn_with_those_that_depend_on_it() -> None:
    belief = LevelBelief.before_pulses(MEANS, SIGMAS, 1)
    heard = pulse(150.0, 20.0)
    place = np.zeros(1, np.float32), np.zeros(1, np.float32)
    belief.update(heard, belief.expected(heard, *place, None, GROUND), 1.0)
    given = belief.drawn(EXPONENT, np.random.default_rng(1))
    assert given.variance(EXPONENT) == pytest.approx(0.0, abs=1e-4)
    assert given.variance(LEVEL_AT_100_M) < belief.variance(LEVEL_AT_100_M)
    belief.relax(LASTING, 0.0, 1.0, kept=0.0)
    assert belief.mean[LASTING] == pytest.approx(0.0)
    assert covariance_of(belief, 0)[LASTING] == pytest.approx([0.0, 0.0, 1.0, 0.0, 0.0])


@pytest.mark.parametrize("height", [0.15, 0.5, 0.75, 1.0])
def test_a_reflection_is_a_mean_and_a_sum_of_few_shapes(height: float) -> None:
    """Without the shapes 1 to 4 dB (rms) remain that strength and exponent do not explain."""
    sine = np.geomspace(0.08, 0.8, 60)
    gain = two_ray_gain_db(sine, height, 0.8)
    line = np.stack([np.ones_like(sine), np.log10(sine)])
    mean, *shapes = reflection_shapes().at(sine)
    off = [
        gain - mean - np.linalg.lstsq(explained.T, gain - mean, rcond=None)[0] @ explained
        for explained in (line, np.vstack([line, shapes]))
    ]
    rms = [float(np.sqrt(np.mean(one**2))) for one in off]
    assert rms[1] < 1.7
    assert rms[1] < 0.6 * rms[0]
