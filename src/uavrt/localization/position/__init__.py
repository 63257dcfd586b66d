"""From bearings and powers to a position.

`estimate` is the entry point to all estimators: `bayes_fix` is the default, `lenth` has those
of the literature. `bearing_evidence` and `power_evidence` compute likelihoods, `common_errors`
finds errors that bearings share, `trackers` follow a tag in flight, `regions` outlines it.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.localization.position.bayes_fix import Area
    from uavrt.localization.position.common_errors import (
        WALKING_M_S,
        WALKING_SHARE,
        WRONG_COMPASS_DEG,
        WRONG_COMPASS_SHARE,
    )
    from uavrt.localization.position.estimate import (
        ADDED_METHODS,
        HEADING_SIGMA_DEG,
        LEAST_EXTENT_M,
        estimate_position,
    )
    from uavrt.localization.position.level_belief import (
        ANY_STRENGTH,
        REFERENCE_M,
        antenna_gain_db,
        by_chance_density,
    )
    from uavrt.localization.position.level_evidence import Propagation
    from uavrt.localization.position.loss_error import ALIKE_M, LossError, doubtful_db
    from uavrt.localization.position.over_hills import FACTORS, OverHills
    from uavrt.localization.position.power_evidence import (
        PowerEvidence,
        PowerFit,
        PowerTrack,
        fit_each,
    )
    from uavrt.localization.position.power_law import (
        FADINGS_DB,
        LEVEL_STEP_DB,
        OUTLIER_SHARE,
        PowerTables,
        power_tables,
    )
    from uavrt.localization.position.stations import Stations
    from uavrt.localization.position.strengths import Strengths

__all__ = [
    "ADDED_METHODS",
    "ALIKE_M",
    "ANY_STRENGTH",
    "FACTORS",
    "FADINGS_DB",
    "HEADING_SIGMA_DEG",
    "LEAST_EXTENT_M",
    "LEVEL_STEP_DB",
    "OUTLIER_SHARE",
    "REFERENCE_M",
    "WALKING_M_S",
    "WALKING_SHARE",
    "WRONG_COMPASS_DEG",
    "WRONG_COMPASS_SHARE",
    "Area",
    "LossError",
    "OverHills",
    "PowerEvidence",
    "PowerFit",
    "PowerTables",
    "PowerTrack",
    "Propagation",
    "Stations",
    "Strengths",
    "antenna_gain_db",
    "by_chance_density",
    "doubtful_db",
    "estimate_position",
    "fit_each",
    "power_tables",
]
__getattr__ = lazily(
    __name__,
    {
        "ADDED_METHODS": "estimate",
        "ALIKE_M": "loss_error",
        "ANY_STRENGTH": "level_belief",
        "Area": "bayes_fix",
        "FADINGS_DB": "power_law",
        "HEADING_SIGMA_DEG": "estimate",
        "LEAST_EXTENT_M": "estimate",
        "LEVEL_STEP_DB": "power_law",
        "OUTLIER_SHARE": "power_law",
        "FACTORS": "over_hills",
        "OverHills": "over_hills",
        "PowerEvidence": "power_evidence",
        "PowerFit": "power_evidence",
        "PowerTables": "power_law",
        "PowerTrack": "power_evidence",
        "Propagation": "level_evidence",
        "REFERENCE_M": "level_belief",
        "LossError": "loss_error",
        "Stations": "stations",
        "Strengths": "strengths",
        "WALKING_M_S": "common_errors",
        "WALKING_SHARE": "common_errors",
        "WRONG_COMPASS_DEG": "common_errors",
        "WRONG_COMPASS_SHARE": "common_errors",
        "antenna_gain_db": "level_belief",
        "by_chance_density": "level_belief",
        "doubtful_db": "loss_error",
        "estimate_position": "estimate",
        "fit_each": "power_evidence",
        "power_tables": "power_law",
    },
)
