"""Default bearing estimator: posterior probability of each bearing from antenna pattern and
signal powers.

It computes the probability of each pulse's power at its known time for each bearing, with
unknown tag strength and fading. No threshold is needed; missed pulses count as "below the
threshold".
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.bearing.lasting_fading import Whitened, variance_factor
from uavrt.localization.bearing.pattern_likelihood import (
    GRID_DEG,
    BearingLikelihood,
    bearing_likelihood,
)
from uavrt.localization.bearing.posterior import (
    blurred,
    lobe_mean_deg,
    lobe_moments,
    log_mean_exp,
    peak_deg,
    shortest_arc,
    whole_degrees,
)
from uavrt.localization.bearing.tuning import PATTERN
from uavrt.localization.bearing.two_paths import TwoPaths, two_paths
from uavrt.localization.headings import Headings
from uavrt.localization.power_law import power_tables
from uavrt.localization.results import Bearing
from uavrt.localization.tuning import POWER_LAW


def pattern_ml(
    headings: Headings,
    matched_power: NDArray[np.float64],
    missed_below: NDArray[np.float64],
    noise_db: NDArray[np.float64],
    *,
    pattern: AntennaPattern,
    elevation_deg: float = 0.0,
    folds: int = 1,
    fading_db: float | None = None,
    heading_sigma_deg: float = 0.0,
) -> Bearing:
    """Estimate a bearing with its complete posterior.

    `headings`: headings at the n received pulses, followed by those at the m missed pulses.
    `matched_power` (n,): matched-filter power over noise power, noise included (mean S + 1).
    `missed_below` (m,): upper limit of the missed pulses' power. `noise_db` (n + m,): noise at
    each pulse relative to the median noise [dB]. `folds`: number of pulses summed in each
    value.
    """
    turn = _Turn(
        headings=headings,
        matched_power=matched_power,
        missed_below=missed_below,
        noise_db=noise_db,
        pattern=pattern,
        elevation_deg=elevation_deg,
        folds=folds,
        fading_db=fading_db,
        heading_sigma_deg=heading_sigma_deg,
    )
    return _bearing(turn, _fitted(turn))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Turn:
    headings: Headings
    matched_power: NDArray[np.float64]
    missed_below: NDArray[np.float64]
    noise_db: NDArray[np.float64]
    pattern: AntennaPattern
    elevation_deg: float
    folds: int
    fading_db: float | None
    heading_sigma_deg: float

    @property
    def heard(self) -> int:
        return len(self.matched_power)

    def gain(self, bearing_deg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Gain of the antenna at each pulse towards each bearing [dB], shape (n + m,
        bearings).
        """
        return self.headings.gain_db(self.pattern, bearing_deg, self.elevation_deg)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Fit:
    likelihood: BearingLikelihood
    best_deg: float
    misfit: "_Misfit"
    lasting: float
    """Factor, at least 1, by which correlated fading increases the bearing's variance."""
    double: TwoPaths | None


def _fitted(turn: _Turn) -> _Fit:
    """Fit a turn's powers with one propagation path and with two; some pulses may come from
    other senders.
    """
    known, heard = turn.fading_db, turn.heard
    tables = power_tables(
        turn.matched_power,
        turn.missed_below,
        folds=turn.folds,
        fadings_db=POWER_LAW.fadings_db if known is None else (max(known, 0.3),),
    )
    found = bearing_likelihood(tables, turn.gain, turn.noise_db)
    best_deg = peak_deg(found.log_density)
    noise_db = turn.noise_db[:heard]
    model_db = found.level_db + turn.gain(np.array([best_deg]))[:heard, 0] - noise_db
    yaw_deg = turn.headings.yaw_deg[:heard]
    power, fading_db, folds = turn.matched_power, found.fading_db, turn.folds
    misfit = _misfit(yaw_deg, power, turn.missed_below, model_db, fading_db, folds)
    sure = misfit.sure
    around = turn.gain(np.array([best_deg - 1.0, best_deg + 1.0]))[:heard]
    slope = 0.5 * (around[:, 1] - around[:, 0])
    whitened = _whitened(power, model_db, slope, sure, fading_db, folds)
    return _Fit(
        likelihood=found,
        best_deg=best_deg,
        misfit=misfit,
        lasting=max(misfit.inflation, variance_factor(whitened)),
        double=two_paths(
            yaw_deg[sure],
            power[sure],
            noise_db[sure],
            pattern=turn.pattern,
            level_db=found.level_db,
            fading_db=fading_db,
            folds=folds,
        ),
    )


def _bearing(turn: _Turn, fit: _Fit) -> Bearing:
    found, misfit = fit.likelihood, fit.misfit
    inflation = fit.lasting
    if turn.fading_db is not None and misfit.reduced_chi2 is not None:
        inflation *= max(1.0, misfit.reduced_chi2)
    log_density = found.log_density / inflation
    density = np.exp(log_density - log_density.max())
    density /= density.sum()
    paths_deg = None
    if fit.double is not None:
        paths_deg = fit.double.bearings_deg
        spread = np.interp(GRID_DEG, np.arange(360.0), fit.double.density, period=360.0)
        density = 0.5 * density + 0.5 * spread / spread.sum()
    density = blurred(density, turn.heading_sigma_deg)
    bearing_deg = lobe_mean_deg(density, fit.best_deg)
    sigma, second = lobe_moments(density, bearing_deg)
    directional = log_mean_exp(found.log_density)
    return Bearing(
        bearing_deg=bearing_deg,
        method="pattern_ml",
        pulses=len(turn.noise_db),
        sigma_deg=sigma,
        interval90_deg=shortest_arc(density, 0.9),
        second_lobe_probability=second,
        # A misfit makes the odds less certain, as well as the direction.
        evidence=(directional - found.log_flat) / inflation,
        reduced_chi2=misfit.reduced_chi2,
        multipath_suspected=paths_deg is not None,
        paths_deg=paths_deg,
        fading_db=found.fading_db,
        level_db=found.level_db,
        level_sigma_db=found.level_sigma_db * inflation**0.5,
        posterior=whole_degrees(density),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Misfit:
    """Deviations of the powers from the model at the best bearing."""

    sure: NDArray[np.bool_]
    """True for received pulses too strong to be missed, shape (n,)."""
    correlation: float
    """Correlation of neighbouring pulses' deviations, 0 to 0.9, after subtraction of its level
    by chance."""
    reduced_chi2: float | None

    @property
    def marked(self) -> bool:
        """True if the correlation of the deviations is significant (3.3 standard deviations, by
        chance 1 in 1000).
        """
        count = int(self.sure.sum())
        return count > 0 and self.correlation > 2.3 / math.sqrt(count)

    @property
    def inflation(self) -> float:
        """Factor by which a significant correlation increases the bearing's variance; 1
        otherwise.
        """
        return (1.0 + self.correlation) / (1.0 - self.correlation) if self.marked else 1.0


def _misfit(
    yaw_deg: NDArray[np.float64],
    matched_power: NDArray[np.float64],
    missed_below: NDArray[np.float64],
    model_db: NDArray[np.float64],
    fading_db: float,
    folds: int,
) -> _Misfit:
    """Compute how received powers (n,) deviate from the model, without pulses near the
    threshold.
    """
    residual = _residuals(matched_power, model_db, fading_db, folds)
    sure = np.ones(len(residual), bool)
    if len(missed_below):
        sure = model_db > 10.0 * np.log10(missed_below.max()) + 1.5 * fading_db
    degrees = max(1, len(residual) - 2)
    return _Misfit(
        sure=sure,
        correlation=_correlation(residual[sure], yaw_deg[sure]),
        reduced_chi2=float(np.sum(residual**2)) / degrees if len(residual) else None,
    )


def _whitened(
    matched_power: NDArray[np.float64],
    model_db: NDArray[np.float64],
    slope: NDArray[np.float64],
    sure: NDArray[np.bool_],
    fading_db: float,
    folds: int,
) -> Whitened:
    """Return residuals and slopes of powers that are too strong to be missed [standard
    deviations].
    """
    s = 10.0 ** (model_db[sure] / 10.0)
    follow = s / (1.0 + s)
    noise = 18.86 * (1.0 + 2.0 * s) / (folds * (1.0 + s) ** 2)
    sigma = np.sqrt(noise + (fading_db * follow) ** 2)
    return Whitened(
        residual=_residuals(matched_power[sure], model_db[sure], fading_db, folds),
        level_slope=follow / sigma,
        bearing_slope=follow * slope[sure] / sigma,
        fading_part=fading_db * follow / sigma,
    )


def _residuals(
    matched_power: NDArray[np.float64],
    model_db: NDArray[np.float64],
    fading_db: float,
    folds: int,
) -> NDArray[np.float64]:
    """Measured minus expected power in decibels, divided by its standard deviation and limited
    to ± 4.

    The variance is that of noise and fading together: (4.34)² (1 + 2 S) / (folds (1 + S)²) +
    (fading S / (1 + S))², where S is the expected SNR.
    """
    s = 10.0 ** (model_db / 10.0)
    measured = 10.0 * np.log10(np.maximum(matched_power, 0.1))
    expected = 10.0 * np.log10(1.0 + s)
    noise = 18.86 * (1.0 + 2.0 * s) / (folds * (1.0 + s) ** 2)
    residual = (measured - expected) / np.sqrt(noise + (fading_db * s / (1.0 + s)) ** 2)
    return np.asarray(np.clip(residual, -4.0, 4.0))


def _correlation(residual: NDArray[np.float64], yaw_deg: NDArray[np.float64]) -> float:
    """Correlation of neighbouring pulses' residuals, 0 to 0.9, after subtraction of its level
    by chance.
    """
    count = len(residual)
    if count < PATTERN.correlation_pulses:
        return 0.0
    power = float(residual @ residual)
    turned = residual[np.argsort(yaw_deg, kind="stable")]
    in_time = float(residual[1:] @ residual[:-1]) / power
    over_heading = float(turned @ np.roll(turned, 1)) / power
    return float(np.clip(max(in_time, over_heading) - count**-0.5, 0.0, 0.9))
