"""What silence and weak pulses say over hills (`uavrt coverage`, `uavrt localize --dem`)."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.coverage.absence import absence_row
    from uavrt_experiments.coverage.shadow import CASES, shadow_rows

__all__ = ["CASES", "absence_row", "shadow_rows"]
__getattr__ = lazily(
    __name__, {"CASES": "shadow", "absence_row": "absence", "shadow_rows": "shadow"}
)
