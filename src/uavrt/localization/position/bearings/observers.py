"""Learn the errors of a person who takes bearings by hand, from test trials at known
positions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.core.units import counted, wrap_degrees_360
from uavrt.localization.angles import difference_deg
from uavrt.localization.position.bearings.bearing_evidence import log_product
from uavrt.localization.position.bearings.lenth import Rays
from uavrt.localization.position.tuning import OBSERVER
from uavrt.localization.results import Bearing, Caution

_Floats = NDArray[np.float64]
Displacement = tuple[float, float, float]
"""One possible shift common to all bearings: its probability, and its standard deviation in
each direction, as a share of the mean distance and as a constant [m]."""

AGREEMENT_ALONE = Caution(
    name="observer",
    text="the circle is based only on how well the bearings agree: bearings taken by hand may "
    "agree and still miss the tag; test trials at known places show by how much",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Observer:
    """Standard deviations and mean of a person's errors in taking bearings by hand."""

    name: str
    trials: int
    scatter_deg: float
    """Standard deviation of the error of a single bearing by this person [deg]."""
    heading_error_deg: float
    """Mean error of all bearings by this person [deg], positive clockwise."""
    heading_error_sigma_deg: float
    displaced: float
    """Root mean square of the shift common to a trial's bearings, as a share of the
    distance."""
    displacements: tuple[Displacement, ...]

    def corrected(self, bearing: Bearing, number: int) -> Bearing:
        """Return a bearing without the person's mean error, and with the person's standard
        deviation.

        `number` is the number of this person's bearings in a position estimate that also uses
        other people's bearings; otherwise it is 0. Each bearing gets `number` times the
        variance of their common errors, so that together they count as one bearing.
        """
        shared = np.hypot(self.heading_error_sigma_deg, np.degrees(self.displaced))
        return replace(
            bearing,
            bearing_deg=wrap_degrees_360(bearing.bearing_deg - self.heading_error_deg),
            sigma_deg=float(np.hypot(self.scatter_deg, number**0.5 * shared)),
        )

    @property
    def sentence(self) -> str:
        """Sentence for the operator on these errors."""
        return (
            f"{self.name} by {counted(self.trials, 'test trial')}: scatter "
            f"{self.scatter_deg:.0f}°, error {self.heading_error_deg:+.0f}° ± "
            f"{self.heading_error_sigma_deg:.0f}°, all bearings of a trial displaced by "
            f"{self.displaced:.0%} of the distance"
        )


def learn_observer(name: str, trials: Sequence[Rays]) -> Observer:
    """Learn a person's errors from trials, each given as stations in metres relative to its
    tag.
    """
    share = np.pad(np.geomspace(*OBSERVER.shares), (0, OBSERVER.metres[2]))
    constant_m = np.pad(np.geomspace(*OBSERVER.metres), (OBSERVER.shares[2], 0))
    scatter = np.geomspace(*OBSERVER.scatters_deg)
    heading = np.linspace(*OBSERVER.headings_deg)
    prior = -0.5 * (heading / OBSERVER.heading_sigma_deg) ** 2
    total = np.tile(prior, (len(share), len(scatter), 1))
    away_m = [max(1.0, float(np.mean(np.hypot(one.east_m, one.north_m)))) for one in trials]
    for one, distance_m in zip(trials, away_m, strict=True):
        sigma_m = np.hypot(share * distance_m, constant_m)
        total += _log_evidence(one, distance_m, sigma_m, scatter, heading)
    held = np.exp(total - total.max())
    held /= held.sum()
    likely = held.sum(axis=(1, 2))
    mean = float(held.sum(axis=(0, 1)) @ heading)
    variance = float(
        held.sum(axis=(0, 1)) @ (heading - mean) ** 2 + np.ptp(heading[:2]) ** 2 / 12
    )
    square = likely @ (share**2 + constant_m**2 * float(np.mean(np.power(away_m, -2.0))))
    return Observer(
        name=name,
        trials=len(trials),
        scatter_deg=float(np.exp(held.sum(axis=(0, 2)) @ np.log(scatter))),
        heading_error_deg=mean,
        heading_error_sigma_deg=variance**0.5,
        displaced=float(np.sqrt(square)),
        displacements=tuple(zip(*np.stack([likely, share, constant_m]).tolist(), strict=True)),
    )


def _log_evidence(
    trial: Rays, distance_m: float, sigma_m: _Floats, scatter_deg: _Floats, heading_deg: _Floats
) -> _Floats:
    """Log-probability of a trial's bearings, shape (displacements, scatters, headings)."""
    steps = np.linspace(-1.0, 1.0, OBSERVER.points)
    axis = OBSERVER.reach * distance_m * steps * np.abs(steps)
    east, north = (one.ravel() for one in np.meshgrid(axis, axis))
    area = np.outer(np.gradient(axis), np.gradient(axis)).ravel()
    weight = area * np.exp(-0.5 * (np.hypot(east, north) / sigma_m[:, None]) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    away = east - trial.east_m[:, None], north - trial.north_m[:, None]
    off = difference_deg(trial.bearing_deg[:, None], np.degrees(np.arctan2(*away)))
    variance = np.degrees(np.arctan2(np.sqrt(area / 12.0), np.hypot(*away))) ** 2
    # The first axis is the station. Only the heading error differs between two passes.
    spread = scatter_deg[:, None] ** 2 + variance[:, None, :]
    per_square = -0.5 / spread
    height = (1.0 - OBSERVER.outlier_share) / np.sqrt(2.0 * np.pi * spread)
    found = np.empty((len(sigma_m), len(scatter_deg), len(heading_deg)))
    for column, heading in enumerate(heading_deg):
        squares = difference_deg(off, heading) ** 2
        mixed = np.exp(per_square * squares[:, None, :])
        mixed *= height
        mixed += OBSERVER.outlier_share / 360.0
        density = log_product(mixed)
        top = density.max(axis=1, keepdims=True)
        found[:, :, column] = np.log(weight @ np.exp(density - top).T) + top[:, 0]
    return found
