"""In which slots of a train its tag was at that rate, and in which a pulse stands out.

A tag of several rates uses each for a part of a flight. The train of one has slots in all of
it; where the tag was at another rate, these hold noise. A path of two states tells them apart:
at the rate a slot counts the logarithm of its likelihood ratio, else nothing, and each change
of state costs as much as `_CHANGE` (Viterbi 1967, IEEE Trans. Inf. Theory 13, 260).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.integration.train_place import HeardTrain, noise_reaches, slot_logs

_CHANGE = 7.0
"""Once in a thousand slots."""
_MOST = 5.0
"""That one slot counts: a pulse of another rate may lie in it by chance, however strong."""
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


def slot_evidence(one: HeardTrain, gain: NDArray[np.float64], rates: int) -> SlotEvidence:
    """Judge the slots of a train one by one.

    Parameters
    ----------
    one : HeardTrain
        Of a tag that was found.
    gain : ndarray of float64, shape (slots,)
        Energy of a pulse from the likeliest place in each slot, relative to the strongest.
    rates : int
        That the tag has.
    """
    at_rate = np.ones(len(one.pulses.energy), bool)
    if rates > 1:
        at_rate = _stretches(np.minimum(slot_logs(one, gain, _LEVELS_DB), _MOST))
    above = one.pulses.energy > noise_reaches(one, _IN_NOISE)
    return SlotEvidence(at_rate=at_rate, supported=at_rate & above)


def _stretches(logs: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where the likeliest path of the best level is at the rate; logs (levels, slots)."""
    levels, slots = logs.shape
    on, off = np.zeros(levels), np.zeros(levels)
    came_on, came_off = np.ones((slots, levels), bool), np.zeros((slots, levels), bool)
    for slot in range(slots):
        if slot:
            came_on[slot] = on >= off - _CHANGE
            came_off[slot] = on - _CHANGE > off
        before_on, before_off = on, off
        on = np.where(came_on[slot], before_on, before_off - _CHANGE) + logs[:, slot]
        off = np.where(came_off[slot], before_on - _CHANGE, before_off)
    best = int(np.argmax(np.maximum(on, off)))
    state, path = bool(on[best] >= off[best]), np.zeros(slots, bool)
    for slot in range(slots - 1, -1, -1):
        path[slot] = state
        state = bool(came_on[slot, best] if state else came_off[slot, best])
    return path
