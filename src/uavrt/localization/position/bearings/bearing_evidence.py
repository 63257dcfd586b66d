"""Likelihood of a position from bearings, each of which is an outlier with some probability."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.angles import difference_deg
from uavrt.localization.position.tuning import BEARING_FIX

_Floats = NDArray[np.float64]


class BearingEvidence:
    """Log-likelihood of positions, given the posteriors (n, 360) of bearings from stations."""

    def __init__(
        self,
        east_m: _Floats,
        north_m: _Floats,
        posterior: _Floats,
        *,
        outlier_share: float,
        heading_sigma_deg: float = 0.0,
    ) -> None:
        turned_steps = _nodes(heading_sigma_deg)
        self._turned_deg = turned_steps * BEARING_FIX.step_deg
        weight = np.exp(-0.5 * (self._turned_deg / max(heading_sigma_deg, 1e-3)) ** 2)
        self._log_turned = np.log(weight / weight.sum())
        self._east_m = east_m
        self._north_m = north_m
        self._outlier = outlier_share / 360.0
        tables = self._blurred(posterior) * (1.0 - outlier_share) + self._outlier
        # The tables go on beyond 360°, so that a heading error is only an offset in them.
        self._offsets = (turned_steps - turned_steps[0])[:, None]
        more = int(turned_steps[-1])
        self._tables = np.pad(tables, ((0, 0), (0, 0), (more, more + 1)), mode="wrap")

    @staticmethod
    def _blurred(density: _Floats) -> _Floats:
        """Density of each bearing per degree, blurred by several cell widths, shape (n, blurs,
        1440).
        """
        stations, steps = density.shape
        count = round(360.0 / BEARING_FIX.step_deg)
        grid = np.arange(count) * BEARING_FIX.step_deg
        places = np.arange(steps) * (360.0 / steps)
        fine = np.stack(
            [np.interp(grid, places, row * (steps / 360.0), period=360.0) for row in density]
        )
        harmonics = np.fft.rfft(fine, axis=1)
        order = np.arange(harmonics.shape[1])
        blurs = np.radians(np.array(BEARING_FIX.blurs_deg))[:, None]
        damping = np.exp(-0.5 * (blurs * order) ** 2)
        tables = np.fft.irfft(harmonics[:, None, :] * damping[None, :, :], count, axis=2)
        return np.asarray(np.maximum(tables, 0.0)).reshape(
            stations, len(BEARING_FIX.blurs_deg), count
        )

    def densities(self, east_m: _Floats, north_m: _Floats, cell_m: _Floats | float) -> _Floats:
        """Density of each bearing for each heading error and position, shape (n, errors,
        places).
        """
        out = np.empty((len(self._east_m), len(self._turned_deg), len(east_m)))
        count, width = round(360.0 / BEARING_FIX.step_deg), self._tables.shape[2]
        for station, (table, high) in enumerate(zip(self._tables, out, strict=True)):
            dx, dy = east_m - self._east_m[station], north_m - self._north_m[station]
            # A cell of width c has a standard deviation of c / √12 across the ray.
            spread = np.degrees(cell_m / 3.46 / np.maximum(np.hypot(dx, dy), cell_m))
            blur = np.searchsorted(BEARING_FIX.blurs_deg[1:], spread * 0.75)
            place = np.remainder(np.degrees(np.arctan2(dx, dy)), 360.0) / BEARING_FIX.step_deg
            below = place.astype(np.intp)
            at = blur * width + below % count + self._offsets
            low = table.ravel().take(at)
            table.ravel().take(at + 1, out=high, mode="clip")
            high -= low
            high *= place - below
            high += low
        return out

    def log_likelihoods(
        self, east_m: _Floats, north_m: _Floats, cell_m: _Floats | float
    ) -> _Floats:
        """Log-likelihood of all bearings plus log-prior of the heading error, shape (errors,
        places).
        """
        return self._log_likelihoods(self.densities(east_m, north_m, cell_m))

    def _log_likelihoods(self, densities: _Floats) -> _Floats:
        return np.asarray(log_product(densities) + self._log_turned[:, None])

    def log_likelihood(
        self, east_m: _Floats, north_m: _Floats, cell_m: _Floats | float
    ) -> _Floats:
        """Log-likelihood of all bearings, integrated over the heading error, shape
        (places,).
        """
        each = self.log_likelihoods(east_m, north_m, cell_m)
        top = each.max(axis=0)
        if len(each) == 1:
            return np.asarray(top)
        return np.asarray(np.log(np.exp(each - top).sum(axis=0)) + top)

    def doubts(
        self, east_m: _Floats, north_m: _Floats, probability: _Floats, cell_m: _Floats
    ) -> "Doubts":
        """Return heading error and outlier probabilities, averaged over a posterior of
        positions.
        """
        # Cells in the far tails are many and have no influence.
        order = np.argsort(-probability)
        count = (
            int(np.searchsorted(np.cumsum(probability[order]), BEARING_FIX.evaluated_share)) + 1
        )
        kept = order[:count]
        held = probability[kept] / probability[kept].sum()
        densities = self.densities(east_m[kept], north_m[kept], cell_m[kept])
        each = self._log_likelihoods(densities)
        share = np.exp(each - each.max(axis=0))
        share *= held / share.sum(axis=0)
        errors = share.sum(axis=1)
        mean = float(errors @ self._turned_deg)
        variance = float(errors @ (self._turned_deg - mean) ** 2)
        outliers = np.einsum("iep,ep->i", self._outlier / densities, share)
        return Doubts(
            heading_error_deg=mean,
            heading_error_sigma_deg=variance**0.5,
            outlier_probabilities=tuple(float(min(1.0, p)) for p in outliers),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubts:
    """Heading error and outlier probabilities, averaged over a posterior of positions."""

    heading_error_deg: float
    """Posterior mean of the error common to all headings [deg]."""
    heading_error_sigma_deg: float
    outlier_probabilities: tuple[float, ...]


def log_product(densities: _Floats) -> _Floats:
    """Logarithm of the product over the first axis, computed with few logarithms.

    Products of `BEARING_FIX.multiplied` densities do not underflow, since each density includes
    the probability of an outlier.
    """
    total = np.zeros(densities.shape[1:])
    for first in range(0, len(densities), BEARING_FIX.multiplied):
        total += np.log(np.prod(densities[first : first + BEARING_FIX.multiplied], axis=0))
    return total


def _nodes(sigma_deg: float) -> NDArray[np.int64]:
    """Trial values of the error common to all headings: about 9, up to three standard
    deviations [table steps].
    """
    step = max(1, round(0.67 * sigma_deg / BEARING_FIX.step_deg))
    reach = int(3.0 * sigma_deg / BEARING_FIX.step_deg / step)
    return np.arange(-reach, reach + 1) * step


def von_mises(bearing_deg: _Floats, sigma_deg: _Floats) -> _Floats:
    """Von Mises probabilities with kappa = 1 / sigma², shape (n, 1440); sigma is at least
    0.3°.
    """
    kappa = 1.0 / np.radians(np.maximum(sigma_deg, 0.3)) ** 2
    grid = np.arange(0.0, 360.0, BEARING_FIX.step_deg)
    off = np.radians(difference_deg(grid[None, :], bearing_deg[:, None]))
    density = np.exp(kappa[:, None] * (np.cos(off) - 1.0))
    return np.asarray(density / density.sum(axis=1, keepdims=True))


def density_of(bearing_deg: float, sigma_deg: float | None) -> _Floats:
    """Probability of whole degrees, shape (360,); if `sigma_deg` is None, a mixture of several
    standard deviations.
    """
    sigmas = np.array(BEARING_FIX.unknown_sigmas_deg if sigma_deg is None else (sigma_deg,))
    each = von_mises(np.full(len(sigmas), bearing_deg), sigmas)[
        :, :: round(1.0 / BEARING_FIX.step_deg)
    ]
    density = np.mean(each / each.sum(axis=1, keepdims=True), axis=0)
    return np.asarray(density)
