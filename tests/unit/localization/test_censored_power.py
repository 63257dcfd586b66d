"""The regression with missed pulses: its table of the normal distribution, and its parts."""

import numpy as np
import pytest
from scipy.special import log_ndtr, ndtr

from uavrt.localization.position import censored_power
from uavrt.localization.position.censored_power import (
    CensoredSums,
    HeardSums,
    censored_fit,
    normal_tail,
)
from uavrt.localization.position.level_evidence import Propagation


def test_the_table_of_the_normal_distribution_is_as_good_as_its_docstring_says() -> None:
    u = np.linspace(-12.0, 8.0, 100_003)
    below, ratio = normal_tail(u)
    assert np.abs(below - ndtr(u)).max() < 8e-6
    assert np.abs(ratio - np.exp(-0.5 * u * u - log_ndtr(u)) / np.sqrt(2 * np.pi)).max() < 2e-5


def test_beyond_the_table_nothing_is_heard_or_all_and_the_ratio_nears_the_distance() -> None:
    u = np.array([-1e6, -300.0, -40.0, 8.5, 1e6])
    below, ratio = normal_tail(u)
    assert below == pytest.approx([0.0, 0.0, 0.0, 1.0, 1.0], abs=1e-6)
    assert ratio[:3] == pytest.approx(-u[:3], rel=0.01)
    assert ratio[3:] == pytest.approx([0.0, 0.0], abs=1e-6)


def test_places_are_fitted_alike_in_parts_and_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    loss, level = rng.normal(-3.0, 2.0, (50, 30)), rng.normal(0.0, 5.0, (50, 30))
    sums = CensoredSums(
        heard=HeardSums.of(loss, level),
        missed_loss=rng.normal(-6.0, 1.0, (50, 7)),
        limit_db=rng.normal(-8.0, 1.0, (50, 7)),
    )
    at_once = censored_fit(sums, 2.0, Propagation())
    monkeypatch.setattr(censored_power, "_TOGETHER", 70)
    in_parts = censored_fit(sums, 2.0, Propagation())
    np.testing.assert_allclose(in_parts.log_likelihood, at_once.log_likelihood, rtol=1e-12)
    np.testing.assert_allclose(in_parts.level_db, at_once.level_db, rtol=1e-12)
