"""Estimate the lasting error of received levels for each tag position, together with the tag's
strength.

Behind a rounded hilltop, in woods, or with an elevation map that is off by some metres, pulses
lose more or less than the map predicts. The error persists while the drone flies along the same
side of the hill. On level ground the same holds for shadowing: reflections from the ground,
plants, and the animal's body change the level by some decibels over tens of metres. If each
pulse had an independent error, twenty pulses would rule out the true position. The error is
therefore one unknown, which pulses update and which decorrelates along the drone's path. Behind
hills, the independent part must be small, because otherwise each pulse would make positions
deeper behind a hill less probable.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.position.tuning import LOSS, LastingError

_Floats = NDArray[np.floating[Any]]


def doubtful_db(lost_db: _Floats) -> _Floats:
    """Additional loss for a relative error of one unit in the computed loss [dB].

    Where the path just grazes the ground, some metres of height change a loss by up to 6 dB
    (P.526-15, equation 31).
    """
    return np.asarray(
        lost_db - LOSS.grazing_db * np.expm1(lost_db * (-1.0 / LOSS.grazing_fall_db))
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LossError:
    """Normal distribution of the lasting error of levels, for each possible tag position.

    Behind hills the error is relative to the loss; on level ground it is in standard deviations
    of the shadowing.
    """

    law: LastingError
    mean: _Floats
    variance: _Floats
    with_level_db: _Floats
    """Covariance of the lasting error with the tag's strength [dB]."""

    @classmethod
    def before_pulses(cls, law: LastingError, shape: tuple[int, ...] | int) -> "LossError":
        """Distribution of the error before any pulse."""
        return cls(
            law=law,
            mean=np.full(shape, law.mean, np.float32),
            variance=np.full(shape, law.sigma**2, np.float32),
            with_level_db=np.zeros(shape, np.float32),
        )

    @classmethod
    def of_columns(cls, law: LastingError | None, columns: _Floats) -> "LossError | None":
        """Convert columns (n, 3) to a distribution; None if its constants `law` are None."""
        if law is None:
            return None
        return cls(
            law=law, mean=columns[:, 0], variance=columns[:, 1], with_level_db=columns[:, 2]
        )

    def columns(self) -> NDArray[np.float32]:
        """Mean and variance of the error, and its covariance with the tag's strength, shape (n,
        3).
        """
        return np.stack((self.mean, self.variance, self.with_level_db), axis=1)

    def after(
        self, was_m: tuple[float, float] | None, now_m: tuple[float, float]
    ) -> "LossError":
        """Return the distribution after a movement of the drone, which partly decorrelates the
        error.
        """
        if was_m is None or was_m == now_m:
            return self
        law = self.law
        kept = float(
            np.exp(-np.hypot(now_m[0] - was_m[0], now_m[1] - was_m[1]) / law.correlation_m)
        )
        return LossError(
            law=law,
            mean=law.mean + kept * (self.mean - law.mean),
            variance=law.sigma**2 + kept**2 * (self.variance - law.sigma**2),
            with_level_db=kept * self.with_level_db,
        )

    def learnt(self, doubtful: _Floats | float, moved: _Floats, shrunk: _Floats) -> "LossError":
        """Return the distribution after a pulse, given the slope (`moved`) and curvature
        (`shrunk`) of the pulse's log-likelihood.
        """
        with_pulse = self.with_level_db - doubtful * self.variance
        return replace(
            self,
            mean=np.clip(self.mean + with_pulse * moved, *self.law.limits),
            variance=np.maximum(self.variance - with_pulse**2 * shrunk, 1e-6),
        )
