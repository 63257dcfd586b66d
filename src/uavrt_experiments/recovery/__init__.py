"""Kill every process of a flight, again and again: how fast is it back, and is a pulse lost?"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.recovery.report import RecoveryReport
    from uavrt_experiments.recovery.run import Plan, run_recovery

__all__ = [
    "Plan",
    "RecoveryReport",
    "run_recovery",
]
__getattr__ = lazily(
    __name__,
    {
        "Plan": "run",
        "RecoveryReport": "report",
        "run_recovery": "run",
    },
)
