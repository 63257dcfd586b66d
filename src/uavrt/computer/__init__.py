"""The companion computer itself: is it fit to fly, and does uavrt start with it?"""

from uavrt.computer.autopilot_setup import examine_autopilot
from uavrt.computer.checks import Finding, examine
from uavrt.computer.service import ServicePlan, install, remove, status

__all__ = [
    "Finding",
    "ServicePlan",
    "examine",
    "examine_autopilot",
    "install",
    "remove",
    "status",
]
