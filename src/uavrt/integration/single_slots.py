"""What the slots of a found train say one by one: where the tag was at that rate, and shows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.integration.heard_train import HeardTrain, noise_reaches, slot_logs
from uavrt.integration.rates import likeliest_states

_LEVELS_DB = np.arange(0.0, 50.0, 1.0)
"""Of the strongest pulse; the one that explains most is taken."""
_IN_NOISE = 0.05
"""Share of the slots of noise whose energy passes for a pulse's."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlotEvidence:
    """What the slots of a train say one by one."""

    at_rate: NDArray[np.bool_]
    """(n,) whether the tag was at the train's rate; all of a tag with one rate."""
    supported: NDArray[np.bool_]
    """(n,) whether it was, and the slot has an energy that 95 % of slots of noise do not."""


def slot_evidence(one: HeardTrain, gain: NDArray[np.float64]) -> SlotEvidence:
    """Judge the slots of a train one by one.

    `one`: of a tag that was found.
    `gain` (slots,): energy of a pulse from the likeliest place in each slot, relative to the
    strongest.
    """
    at_rate = np.ones(len(one.pulses.energy), bool)
    if one.rates > 1:
        at_rate = likeliest_states(slot_logs(one, gain, _LEVELS_DB))
    above = one.pulses.energy > noise_reaches(one, _IN_NOISE)
    return SlotEvidence(at_rate=at_rate, supported=at_rate & above)
