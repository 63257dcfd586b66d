"""One door to all estimators: what it refuses, and what each method answers."""

from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray
from some import some

from uavrt.core.errors import UsageError
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import PATTERNS, AntennaPattern
from uavrt.localization.bearing.estimate_bearing import estimate_bearing
from uavrt.localization.results import BearingMethod
from uavrt.simulation.scene import antenna as simulation

METHODS = get_args(BearingMethod)


def levels(
    yaw_deg: NDArray[np.float64], bearing_deg: float, snr_db: float = 30.0
) -> NDArray[np.float64]:
    """SNR of each pulse of a rotation without noise or fading."""
    return snr_db + PATTERNS["RA-23K"].gain_db(bearing_deg - yaw_deg)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("bearing_deg", [0.0, 123.0, 359.0])
def test_every_method_finds_a_tag_heard_without_fading(
    method: BearingMethod, bearing_deg: float
) -> None:
    yaw = np.arange(0.0, 360.0, 6.0)
    found = estimate_bearing(yaw, levels(yaw, bearing_deg), method=method)
    assert found.method == method
    assert abs(difference_deg(found.bearing_deg, bearing_deg)) <= 3.0


def test_pca_is_the_principal_axis_of_the_published_definition() -> None:
    rng = np.random.default_rng(7)
    yaw = rng.permutation(np.linspace(3.0, 351.0, 37))
    snr = levels(yaw, 200.0, 18.0) + rng.normal(0, 2, 37)
    noise = rng.uniform(1.0, 2.0, 37)
    kept = snr > 0
    power = noise[kept] * 10 ** (snr[kept] / 10)
    x = (power / power.min())[:, None] * np.column_stack(
        [np.cos(np.deg2rad(yaw[kept])), np.sin(np.deg2rad(yaw[kept]))]
    )
    values, vectors = np.linalg.eigh(np.cov(x.T))  # another road than the product's SVD
    axis = vectors[:, 1] * np.sign(vectors[:, 1] @ x.mean(axis=0))
    found = estimate_bearing(yaw, snr, method="pca", noise_psd=noise)
    expected = np.rad2deg(np.arctan2(axis[1], axis[0]))
    assert difference_deg(found.bearing_deg, expected) == pytest.approx(0.0, abs=1e-6)
    assert found.confidence == pytest.approx(1.0 - values[0] / values[1])


def test_pca_falls_back_to_the_strongest_heading_for_less_than_three_quarters_of_a_turn() -> (
    None
):
    yaw = np.arange(0.0, 265.0, 10.0)
    found = estimate_bearing(yaw, levels(yaw, 104.0), method="pca")
    assert found.bearing_deg == 100.0
    assert found.confidence is None


def test_an_antenna_offset_of_90_degrees_turns_the_bearing_by_90_degrees() -> None:
    yaw = np.arange(0.0, 360.0, 9.0)
    snr = levels(yaw, 77.0) + np.random.default_rng(1).normal(0, 2, len(yaw))
    for method in METHODS:
        plain = estimate_bearing(yaw, snr, method=method).bearing_deg
        turned = estimate_bearing(yaw + 90.0, snr, method=method).bearing_deg
        assert difference_deg(turned, plain + 90.0) == pytest.approx(0.0, abs=0.51)


def test_a_tilted_antenna_is_taken_as_tilted() -> None:
    """On a drone that leans 25° nose down, a quaternion tells more than the yaw does."""
    yaw = np.arange(0.0, 360.0, 12.0)
    half_yaw, half_pitch = np.radians(yaw) / 2, np.radians(-25.0) / 2
    quaternions = np.column_stack(
        [
            np.cos(half_yaw) * np.cos(half_pitch),
            -np.sin(half_yaw) * np.sin(half_pitch),
            np.cos(half_yaw) * np.sin(half_pitch),
            np.sin(half_yaw) * np.cos(half_pitch),
        ]
    )
    towards = np.radians(140.0 - yaw)
    off = np.degrees(np.arccos(np.cos(np.radians(25.0)) * np.cos(towards)))
    snr = 30.0 + PATTERNS["RA-23K"].gain_db(off)
    found = estimate_bearing(None, snr, quaternion_wxyz=quaternions)
    assert abs(difference_deg(found.bearing_deg, 140.0)) < 0.3
    assert found.level_db == pytest.approx(30.0, abs=0.4)


def test_misses_tell_where_the_tag_is_not() -> None:
    """Two strong pulses alone allow a wide arc; the silence elsewhere narrows it."""
    yaw = np.arange(0.0, 360.0, 45.0)
    snr = np.where(np.isin(yaw, [90.0, 135.0]), 16.0, np.nan)
    with_misses = estimate_bearing(yaw, snr, threshold_db=10.0)
    heard = ~np.isnan(snr)
    without = estimate_bearing(yaw[heard], snr[heard])
    assert with_misses.pulses == 8
    assert abs(difference_deg(with_misses.bearing_deg, 112.5)) < 3.0
    assert with_misses.sigma_deg is not None
    assert some(without.second_lobe_probability) > 0.3 > with_misses.second_lobe_probability  # type: ignore[operator]


def test_three_pulses_of_a_turn_that_has_just_begun_give_a_wide_interval() -> None:
    yaw = np.array([0.0, 12.0, 24.0])
    found = estimate_bearing(yaw, levels(yaw, 10.0, 20.0))
    low, high = some(found.interval90_deg)
    assert (high - low) % 360.0 > 60.0


def test_the_posterior_sums_to_one_and_peaks_at_the_bearing() -> None:
    yaw = np.arange(0.0, 360.0, 10.0)
    found = estimate_bearing(yaw, levels(yaw, 251.0, 15.0))
    assert found.posterior is not None
    assert found.posterior.shape == (360,)
    assert found.posterior.sum() == pytest.approx(1.0)
    assert int(np.argmax(found.posterior)) == 251


def test_a_shared_heading_error_widens_the_interval() -> None:
    yaw = np.arange(0.0, 360.0, 6.0)
    sharp = estimate_bearing(yaw, levels(yaw, 40.0))
    blurred = estimate_bearing(yaw, levels(yaw, 40.0), heading_sigma_deg=5.0)
    assert some(sharp.sigma_deg) < 2.0
    assert blurred.sigma_deg == pytest.approx(5.1, abs=0.3)


def test_a_noisier_heading_is_not_a_weaker_signal() -> None:
    yaw = np.arange(0.0, 360.0, 8.0)
    noise = np.where(np.abs(difference_deg(yaw, 60.0)) < 40.0, 30.0, 1.0)
    snr = levels(yaw, 60.0, 40.0) - 10 * np.log10(noise)
    found = estimate_bearing(yaw, snr, noise_psd=noise)
    ignorant = estimate_bearing(yaw, snr)
    assert abs(difference_deg(found.bearing_deg, 60.0)) < 0.5
    assert some(found.fading_db) < some(ignorant.fading_db)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"snr_db": [np.nan, np.nan]}, "no pulse"),
        ({"snr_db": [10.0]}, "headings"),
        ({"snr_db": None}, "missing"),
        ({"snr_db": [10.0, np.inf]}, "infinite"),
        ({"snr_db": [10.0, 12.0], "antenna": "coat hanger"}, "RA-2A"),
        ({"snr_db": [10.0, 12.0], "method": "guess"}, "pearson"),
        ({"snr_db": [10.0, 12.0], "noise_psd": [1.0, 0.0]}, "positive"),
        ({"snr_db": [10.0, 12.0], "quaternion_wxyz": [[0, 0, 0, 0], [1, 0, 0, 0]]}, "pose"),
        ({"snr_db": [-3.0, -np.inf], "method": "pca"}, "pattern_ml"),
    ],
)
def test_what_cannot_be_estimated_is_refused_by_name(
    arguments: dict[str, object], word: str
) -> None:
    with pytest.raises(UsageError, match=word):
        estimate_bearing([0.0, 90.0], **arguments)  # type: ignore[arg-type]


def test_an_antenna_of_ones_own_is_used() -> None:
    own = AntennaPattern(name="loop", e_plane_db=(0.0, -3.0, -20.0, -3.0, -1.0))
    yaw = np.arange(0.0, 360.0, 5.0)
    found = estimate_bearing(yaw, 30.0 + own.gain_db(33.0 - yaw), antenna=own)
    assert abs(difference_deg(found.bearing_deg, 33.0)) < 0.5
    with pytest.raises(UsageError, match="loop"):
        AntennaPattern(name="loop", e_plane_db=(0.0,))


@pytest.mark.parametrize("name", ["RA-2A", "RA-23K"])
def test_the_simulated_antenna_and_the_assumed_one_are_the_same(name: str) -> None:
    """Two implementations on purpose (decision 0041): they must agree, tilted too."""
    simulated = simulation.Antenna(pattern=name)  # type: ignore[arg-type]
    rng = np.random.default_rng(9)
    for direction in rng.normal(size=(50, 3)):
        forward, right, down = direction / np.linalg.norm(direction)
        assumed = PATTERNS[name].gain_towards_db(
            np.array([forward]), np.array([right]), np.array([down])
        )
        there = simulation.pattern_db(simulated, (float(forward), float(right), float(down)))
        assert there == pytest.approx(float(assumed[0]), abs=1e-9)
