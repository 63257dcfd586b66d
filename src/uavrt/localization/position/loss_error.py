"""What a map of the ground has wrong, learnt place by place together with a tag's strength.

Behind a round top, in woods, or where the map is some metres off, pulses lose more or less than
the map says, and they do so alike for as long as the drone flies along the same side of the
hill. Taken as an error of each pulse anew, twenty of them would rule out the place where the
tag is; so it is one unknown, which the pulses teach and which the drone's way makes new. What
is new must be little, too: places behind more of a hill would pay for it with every pulse.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.floating[Any]]

USUAL = 0.4
"""Mean of the error: round tops take up to twice a sharp edge's loss (P.526-15, 4.2), woods add
to it."""
SIGMA = 0.5
"""Standard deviation, before anything is heard."""
ALIKE_M = 800.0
"""Of the drone's way, after which two errors are correlated by 1 / e."""
OF_EACH_PULSE = 0.05
"""Standard deviation of what of a loss differs from pulse to pulse, as a share of it."""
_RANGE = (-0.7, 2.5)
_GRAZING_DB = 6.0
_GRAZES_DB = 3.0


def doubtful_db(lost_db: _Floats) -> _Floats:
    """Loss that an error of 1 adds to one by the map.

    Where an edge is just in sight or just not, some metres in its height decide over the 6 dB
    of a ray that grazes it (P.526-15, equation 31).
    """
    return np.asarray(lost_db - _GRAZING_DB * np.expm1(lost_db * (-1.0 / _GRAZES_DB)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LossError:
    """A normal belief of the error for each place, given that the tag is there."""

    mean: _Floats
    variance: _Floats
    with_level_db: _Floats
    """Covariance with the tag's strength."""

    @classmethod
    def unlearnt(cls, shape: tuple[int, ...] | int) -> "LossError":
        """Before anything is heard."""
        return cls(
            mean=np.full(shape, USUAL, np.float32),
            variance=np.full(shape, SIGMA**2, np.float32),
            with_level_db=np.zeros(shape, np.float32),
        )

    @classmethod
    def of_columns(cls, columns: _Floats) -> "LossError | None":
        """From (n, 3) columns; None from (n, 0), where there is no map."""
        if not columns.shape[1]:
            return None
        return cls(mean=columns[:, 0], variance=columns[:, 1], with_level_db=columns[:, 2])

    def columns(self) -> NDArray[np.float32]:
        """(n, 3)"""
        return np.stack((self.mean, self.variance, self.with_level_db), axis=1)

    def after(
        self, was_m: tuple[float, float] | None, now_m: tuple[float, float]
    ) -> "LossError":
        """The same from another place of the drone, from where hills look different."""
        if was_m is None or was_m == now_m:
            return self
        kept = float(np.exp(-np.hypot(now_m[0] - was_m[0], now_m[1] - was_m[1]) / ALIKE_M))
        return LossError(
            mean=USUAL + kept * (self.mean - USUAL),
            variance=SIGMA**2 + kept**2 * (self.variance - SIGMA**2),
            with_level_db=kept * self.with_level_db,
        )

    def learnt(self, doubtful: _Floats, moved: _Floats, shrunk: _Floats) -> "LossError":
        """The same after a pulse; see `LevelBelief.update`.

        `doubtful`: loss [dB] that an error of 1 adds.
        `moved`: of the expected level [dB], over its variance.
        `shrunk`: by which that variance became less, over its square.
        """
        with_pulse = self.with_level_db - doubtful * self.variance
        return replace(
            self,
            mean=np.clip(self.mean + with_pulse * moved, *_RANGE),
            variance=np.maximum(self.variance - with_pulse**2 * shrunk, 1e-6),
        )
