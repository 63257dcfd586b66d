"""The companion computer itself: is it fit to fly, and does uavrt start with it?"""

from uavrt.computer.checks import Finding, examine
from uavrt.computer.service import ServicePlan, install, remove, status

__all__ = ["Finding", "ServicePlan", "examine", "install", "remove", "status"]
