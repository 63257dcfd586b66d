"""Single slots of a found train: whether the tag was at that rate, and is visible there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.integration.heard_train import HeardTrain, noise_reaches, slot_logs
from uavrt.integration.rates import likeliest_states
from uavrt.integration.tuning import PLACE

_LEVELS_DB = np.arange(0.0, 50.0, 1.0)
"""Levels of the strongest pulse that are tried [dB]; the best is used."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlotEvidence:
    """Evidence of each slot of a train."""

    at_rate: NDArray[np.bool_]
    """Whether the tag was at the train's rate, (n,); always with a single rate."""
    supported: NDArray[np.bool_]
    """Whether it was, and the slot's energy exceeds that of 95 % of noise slots, (n,)."""


def slot_evidence(one: HeardTrain, gain: NDArray[np.float64]) -> SlotEvidence:
    """Judge the slots of a train one by one.

    `one`: of a tag that was found. `gain` (slots,): energy of a pulse from the likeliest place
    in each slot, relative to the strongest.
    """
    at_rate = np.ones(len(one.pulses.energy), bool)
    if one.rates > 1:
        at_rate = likeliest_states(slot_logs(one, gain, _LEVELS_DB))
    above = one.pulses.energy > noise_reaches(one, PLACE.noise_share)
    return SlotEvidence(at_rate=at_rate, supported=at_rate & above)
