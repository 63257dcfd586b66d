"""The thesis's rotation test (§5.5) again: where its 50° came from."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.rotation.cart import BEARING_DEG
    from uavrt_experiments.rotation.figures import rotation_page
    from uavrt_experiments.rotation.real import RealRotation, real_rotations
    from uavrt_experiments.rotation.run import (
        Case,
        WallSurvey,
        cases,
        polarization_table,
        start_sweep,
        wall_survey,
    )
    from uavrt_experiments.rotation.words import (
        case_lines,
        legend_lines,
        polarization_lines,
        sweep_lines,
        verdict_lines,
        wall_lines,
    )

__all__ = [
    "BEARING_DEG",
    "Case",
    "RealRotation",
    "WallSurvey",
    "case_lines",
    "cases",
    "legend_lines",
    "polarization_lines",
    "polarization_table",
    "real_rotations",
    "rotation_page",
    "start_sweep",
    "sweep_lines",
    "verdict_lines",
    "wall_lines",
    "wall_survey",
]
__getattr__ = lazily(
    __name__,
    {
        "BEARING_DEG": "cart",
        "Case": "run",
        "RealRotation": "real",
        "WallSurvey": "run",
        "case_lines": "words",
        "cases": "run",
        "legend_lines": "words",
        "polarization_lines": "words",
        "polarization_table": "run",
        "real_rotations": "real",
        "rotation_page": "figures",
        "start_sweep": "run",
        "sweep_lines": "words",
        "verdict_lines": "words",
        "wall_lines": "words",
        "wall_survey": "run",
    },
)
