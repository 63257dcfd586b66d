"""Compute how strongly the lasting error of losses behind hills affects a level.

Behind a rounded hilltop, in woods, or with an elevation map that is off by some metres, pulses
lose more or less than the map predicts. The error persists while the drone flies along the
same side of the hill. On level ground the same holds for shadowing: plants and the animal's
body change the level by some decibels over tens of metres. If each pulse had an independent
error, twenty pulses would rule out the true position. The error is therefore one unknown,
which pulses update and which decorrelates along the drone's path. Behind hills, the
independent part must be small, because otherwise each pulse would make positions deeper behind
a hill less probable.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.position.tuning import LOSS

_Floats = NDArray[np.floating[Any]]


def doubtful_db(lost_db: _Floats) -> _Floats:
    """Additional loss for a relative error of one unit in the computed loss [dB].

    Where the path just grazes the ground, some metres of height change a loss by up to 6 dB
    (P.526-15, equation 31).
    """
    return np.asarray(
        lost_db - LOSS.grazing_db * np.expm1(lost_db * (-1.0 / LOSS.grazing_fall_db))
    )
