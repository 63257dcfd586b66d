"""The regression with missed pulses: its table of the normal distribution, and its parts."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import log_ndtr, ndtr

from uavrt.localization.position.levels import power_evidence
from uavrt.localization.position.levels.censored_power import normal_tail, thinned
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.position.levels.power_evidence import PowerEvidence, PowerTrack
from uavrt.localization.position.tuning import POWER
from uavrt_experiments.localization.position_bars import flown_lines, survey


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


def test_a_miss_stands_for_others_only_within_its_stretch() -> None:
    missed = np.concatenate([np.arange(100, 350), [400, 410, 420]])
    kept, weight = thinned(missed)
    assert kept[-3:].tolist() == [400, 410, 420]
    assert weight[-3:].tolist() == [1.0, 1.0, 1.0]
    assert weight.sum() == len(missed)
    assert len(kept) <= POWER.most_misses + 4
    assert [len(one) for one in thinned(missed[:0])] == [0, 0]


@pytest.mark.parametrize(("alike", "least", "most"), [(0.0, 0.0, 0.06), (0.7, 0.5, 0.7)])
def test_fading_of_weak_pulses_is_as_correlated_as_it_is(
    alike: float, least: float, most: float
) -> None:
    """By the received half alone, independent fading had a correlation of 0.34."""
    grid = (one.ravel() for one in np.meshgrid(*(np.linspace(-60.0, 360.0, 14),) * 2))
    places, found = tuple(grid), []
    for number in range(12):
        rng = np.random.default_rng([8, number])
        tag = float(rng.uniform(50.0, 250.0)), float(rng.uniform(50.0, 250.0))
        track = survey(rng, 300.0, 50.0, 4.0, alike, tag)
        limit_db = float(np.median(track.snr_db))
        weak = np.where(track.snr_db < limit_db, np.nan, track.snr_db)
        track = replace(track, snr_db=weak, threshold_db=limit_db)
        evidence = PowerEvidence(*flown_lines(300.0, 50.0)[:2], track, Propagation())
        found.append(evidence.correlation_at_best(*places))
    assert least <= np.mean(found) <= most


@pytest.mark.parametrize("missed", [0, 7])
def test_places_are_fitted_alike_in_parts_and_at_once(
    missed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(3)
    track = PowerTrack(
        latitude_deg=np.zeros(30),
        longitude_deg=np.zeros(30),
        height_m=np.full(30, 40.0),
        snr_db=np.concatenate([np.full(missed, np.nan), rng.normal(20.0, 5.0, 30 - missed)]),
    )
    east, north = rng.uniform(0.0, 200.0, (2, 30))
    evidence = PowerEvidence(east, north, track, Propagation())
    places = rng.uniform(0.0, 200.0, (2, 50))
    at_once = evidence.fit(*places)
    monkeypatch.setattr(power_evidence, "POWER", replace(POWER, together=70))
    in_parts = evidence.fit(*places)
    np.testing.assert_allclose(in_parts.log_likelihood, at_once.log_likelihood, rtol=1e-6)
    np.testing.assert_allclose(in_parts.level_db, at_once.level_db, rtol=1e-6)


def test_likelihoods_are_summed_over_all_correlations_of_the_fading() -> None:
    rng = np.random.default_rng(5)
    count, height_m = 340, 30.0
    along = np.linspace(0.0, 542.4, count)
    east, north = along % 80.0, along // 80.0 * 12.0
    places = np.array([[30.0], [40.0]]) + rng.uniform(-8.0, 8.0, (2, 20))
    square = (places[0][:, None] - east) ** 2 + (places[1][:, None] - north) ** 2
    x = -5.0 * np.log10((square + height_m**2) / 100.0**2)
    gain = 10.0 * np.log10(np.maximum(square / (square + height_m**2), 1e-3))
    fading = 1.6 * lfilter([0.8], [1.0, -0.6], rng.normal(size=count))
    z = 30.0 + 2.5 * x[0] + gain[0] + fading
    track = PowerTrack(
        latitude_deg=np.zeros(count),
        longitude_deg=np.zeros(count),
        height_m=np.full(count, height_m),
        snr_db=z,
    )
    found = PowerEvidence(east, north, track, Propagation()).fit(*places).log_likelihood
    ones, expected = np.ones((20, count)), []
    for rho in np.tanh(np.arange(0.0, 1.66, 0.01)):
        root = (1.0 - rho**2) ** 0.5
        rows = np.stack([ones, x, z - gain])
        rows = np.concatenate([rows[..., :1], (rows[..., 1:] - rho * rows[..., :-1]) / root], 2)
        products = np.einsum("apn,bpn->pab", rows, rows)
        products += (4.0 / 0.7) ** 2 * np.outer([0.0, 1.0, 2.5], [0.0, 1.0, 2.5])
        _, both = np.linalg.slogdet(products[:, :2, :2])
        _, whole = np.linalg.slogdet(products)
        size = np.exp(whole - both) + 4.0**2
        expected.append(-(count - 1) * np.log(root) - 0.5 * (both + count * np.log(size)))
    assert np.ptp(found - np.logaddexp.reduce(expected)) < 0.05
