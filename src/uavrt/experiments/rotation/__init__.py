"""The thesis's rotation test (§5.5) again: where its 50° came from."""

from uavrt.experiments.rotation.cart import BEARING_DEG
from uavrt.experiments.rotation.real import RealRotation, real_rotations
from uavrt.experiments.rotation.run import (
    Case,
    WallSurvey,
    cases,
    polarization_table,
    start_sweep,
    wall_survey,
)

__all__ = [
    "BEARING_DEG",
    "Case",
    "RealRotation",
    "WallSurvey",
    "cases",
    "polarization_table",
    "real_rotations",
    "start_sweep",
    "wall_survey",
]
