"""Decide for each slot of a found train whether the tag used that rate and whether its pulse
was received.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.whole_flight.heard_train import HeardTrain, noise_reaches, slot_logs
from uavrt.localization.whole_flight.rate_of_flight import likeliest_states
from uavrt.localization.whole_flight.tuning import PLACE

_LEVELS_DB = np.arange(0.0, 50.0, 1.0)
"""Candidate levels of the train's strongest pulse [dB], of which the best is used."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlotEvidence:
    """Evidence for a pulse in each slot of a train."""

    at_rate: NDArray[np.bool_]
    """True if the tag sent at the train's rate in the slot, shape (n,); always True for a tag
    with one rate."""
    supported: NDArray[np.bool_]
    """True if the tag sent at that rate and the slot's energy exceeds that of 95 % of noise
    slots, shape (n,)."""


def slot_evidence(one: HeardTrain, gain: NDArray[np.float64]) -> SlotEvidence:
    """Test for each slot of a tag's train whether it contains a pulse at the train's rate."""
    at_rate = np.ones(len(one.pulses.energy), bool)
    if one.rates > 1:
        at_rate = likeliest_states(slot_logs(one, gain, _LEVELS_DB))
    above = one.pulses.energy > noise_reaches(one, PLACE.noise_share)
    return SlotEvidence(at_rate=at_rate, supported=at_rate & above)
