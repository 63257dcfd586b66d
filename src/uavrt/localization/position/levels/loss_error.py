"""Additional loss per unit of the lasting error of losses behind hills.

Behind a rounded hilltop, in woods, or with a map some metres off, pulses lose more or less than
the map predicts. The error persists while the drone flies along the same side of the hill. On
level ground the same holds for shadowing: plants and the animal's body change the level by some
decibels over tens of metres. As an independent error of each pulse, twenty of them would rule
out the truth. It is therefore one unknown that pulses update and that decorrelates along the
drone's path. Behind hills, the independent part must be small:
otherwise each pulse would make positions deeper behind a hill less probable.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.position.tuning import LOSS

_Floats = NDArray[np.floating[Any]]


def doubtful_db(lost_db: _Floats) -> _Floats:
    """Additional loss per unit of the relative error of losses [dB].

    Near grazing, some metres of height change a loss by up to 6 dB (P.526-15, equation 31).
    """
    return np.asarray(
        lost_db - LOSS.grazing_db * np.expm1(lost_db * (-1.0 / LOSS.grazing_fall_db))
    )
