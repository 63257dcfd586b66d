"""What silence and weak pulses say over hills (`uavrt coverage`, `uavrt localize --dem`)."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.coverage.absence import (
        FOLDERS,
        SILENCES,
        Silence,
        seek_tags,
        silence_rows,
    )
    from uavrt_experiments.coverage.shadow import CASES, shadow_rows, survey_hills

__all__ = [
    "CASES",
    "FOLDERS",
    "SILENCES",
    "Silence",
    "seek_tags",
    "shadow_rows",
    "silence_rows",
    "survey_hills",
]
__getattr__ = lazily(
    __name__,
    {
        "CASES": "shadow",
        "FOLDERS": "absence",
        "SILENCES": "absence",
        "Silence": "absence",
        "seek_tags": "absence",
        "shadow_rows": "shadow",
        "silence_rows": "absence",
        "survey_hills": "shadow",
    },
)
