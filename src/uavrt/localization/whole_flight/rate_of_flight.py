"""Determine when a tag with several rates used each rate.

The train of one rate has slots in the whole flight. While the tag used another rate, these
contain noise and sometimes a pulse of that rate. A hidden Markov model with two states
separates them (Rabiner 1989, Proc. IEEE 77, 257): its likelihood over all paths weights a
position, and its most likely path shows in which slots the rate was used.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.whole_flight.tuning import PLACE

_Floats = NDArray[np.float64]


def other_rate_logs(inverses: Iterable[_Floats], shape: tuple[int, ...]) -> _Floats:
    """Logarithm of the gain in likelihood if a tag may have used another rate in some slots.

    `inverses` contains one array for each slot: 1 / likelihood ratio of a pulse at this
    rate.
    """
    total, product, on = np.zeros(shape), np.ones(shape), np.full(shape, 0.5)
    for slot, inverse in enumerate(inverses):
        on *= 1.0 - 2.0 * PLACE.rate_change
        on += PLACE.rate_change
        # A slot's likelihood at the rate is 1, and this at another one:
        both = PLACE.stray_share + (1.0 - PLACE.stray_share) * inverse
        both *= 1.0 - on
        both += on
        on /= both
        product *= both
        if slot % PLACE.log_slots == PLACE.log_slots - 1:
            total += np.log(product)
            product.fill(1.0)
    return total + np.log(product)


def likeliest_states(logs: _Floats) -> NDArray[np.bool_]:
    """True where a tag used a rate, by the most likely path (Viterbi 1967), shape (slots,)."""
    levels, slots = logs.shape
    at_other = np.log1p(PLACE.stray_share * np.expm1(logs))
    change, stay = np.log(PLACE.rate_change), np.log1p(-PLACE.rate_change)
    on, off = np.zeros(levels), np.zeros(levels)
    came_on, came_off = np.ones((slots, levels), bool), np.zeros((slots, levels), bool)
    for slot in range(slots):
        if slot:
            came_on[slot] = on + stay >= off + change
            came_off[slot] = on + change > off + stay
        before_on, before_off = on, off
        on = np.where(came_on[slot], before_on + stay, before_off + change) + logs[:, slot]
        off = np.where(came_off[slot], before_on + change, before_off + stay)
        off = off + at_other[:, slot]
    best = int(np.argmax(np.maximum(on, off)))
    state, path = bool(on[best] >= off[best]), np.zeros(slots, bool)
    for slot in range(slots - 1, -1, -1):
        path[slot] = state
        state = bool(came_on[slot, best] if state else came_off[slot, best])
    return path
