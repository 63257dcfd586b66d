"""The companion computer: pre-flight checks and start at boot."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
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
__getattr__ = lazily(
    __name__,
    {
        "Finding": "checks",
        "ServicePlan": "service",
        "examine": "checks",
        "examine_autopilot": "autopilot_setup",
        "install": "service",
        "remove": "service",
        "status": "service",
    },
)
