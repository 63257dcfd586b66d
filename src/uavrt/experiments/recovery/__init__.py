"""Kill every process of a flight, again and again: how fast is it back, and is a pulse lost?"""

from uavrt.experiments.recovery.report import RecoveryReport
from uavrt.experiments.recovery.run import Plan, run_recovery

__all__ = ["Plan", "RecoveryReport", "run_recovery"]
