"""One tag judged over a whole flight: found below the noise of any group of pulses; no I/O.

`energy_grid` turns a channel's samples into energies, `folding` adds them up for every
interval and phase, `whole_flight` weighs the sums by place and says how likely chance is;
`together` adds up several flights; `places` holds where a tag might be, `heard_train` what the
slots of its pulses say, `train_place` where it is, `cells` how surely.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.integration.drifting import even_time_s, search_drifting
    from uavrt.integration.energy_grid import SlotEnergies, gather, slot_energies
    from uavrt.integration.folding import base_periods, fold, fold_rows, interval_slots
    from uavrt.integration.growing import BLOCK_S, GrowingEnergies
    from uavrt.integration.heard_train import (
        HeardTrain,
        TrainPulses,
        told_energies,
        train_pulses,
    )
    from uavrt.integration.judging import Judgement, OtherTrain, judge
    from uavrt.integration.places import (
        ALIKE,
        Places,
        common_gains,
        distinct,
        places_around,
    )
    from uavrt.integration.single_slots import SlotEvidence, slot_evidence
    from uavrt.integration.together import JointTrain, Listened, search_together
    from uavrt.integration.train_place import (
        PlaceBelief,
        place_belief,
        told_share,
        train_evidence,
    )
    from uavrt.integration.whole_flight import (
        KEPT_VARIANCE,
        FoldedTrain,
        Weights,
        chance,
        hypotheses_of,
        low_rank_weights,
        pulse_weights,
        search_flight,
    )

__all__ = [
    "ALIKE",
    "BLOCK_S",
    "KEPT_VARIANCE",
    "FoldedTrain",
    "GrowingEnergies",
    "HeardTrain",
    "JointTrain",
    "Judgement",
    "Listened",
    "OtherTrain",
    "PlaceBelief",
    "Places",
    "SlotEnergies",
    "SlotEvidence",
    "TrainPulses",
    "Weights",
    "base_periods",
    "chance",
    "common_gains",
    "distinct",
    "even_time_s",
    "fold",
    "fold_rows",
    "gather",
    "hypotheses_of",
    "interval_slots",
    "judge",
    "low_rank_weights",
    "place_belief",
    "places_around",
    "pulse_weights",
    "search_drifting",
    "search_flight",
    "search_together",
    "slot_energies",
    "slot_evidence",
    "told_energies",
    "told_share",
    "train_evidence",
    "train_pulses",
]
__getattr__ = lazily(
    __name__,
    {
        "ALIKE": "places",
        "KEPT_VARIANCE": "whole_flight",
        "GrowingEnergies": "growing",
        "BLOCK_S": "growing",
        "FoldedTrain": "whole_flight",
        "HeardTrain": "heard_train",
        "JointTrain": "together",
        "Judgement": "judging",
        "Listened": "together",
        "OtherTrain": "judging",
        "PlaceBelief": "train_place",
        "Places": "places",
        "SlotEnergies": "energy_grid",
        "SlotEvidence": "single_slots",
        "TrainPulses": "heard_train",
        "Weights": "whole_flight",
        "base_periods": "folding",
        "chance": "whole_flight",
        "common_gains": "places",
        "distinct": "places",
        "even_time_s": "drifting",
        "fold": "folding",
        "fold_rows": "folding",
        "gather": "energy_grid",
        "hypotheses_of": "whole_flight",
        "interval_slots": "folding",
        "judge": "judging",
        "low_rank_weights": "whole_flight",
        "place_belief": "train_place",
        "places_around": "places",
        "pulse_weights": "whole_flight",
        "search_drifting": "drifting",
        "search_flight": "whole_flight",
        "search_together": "together",
        "slot_energies": "energy_grid",
        "slot_evidence": "single_slots",
        "told_energies": "heard_train",
        "told_share": "train_place",
        "train_evidence": "train_place",
        "train_pulses": "heard_train",
    },
)
