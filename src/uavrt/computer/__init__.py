"""The companion computer: pre-flight checks, start at boot, exchange of versions."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.computer.autopilot_setup import armed_by_link, examine_autopilot
    from uavrt.computer.bench import Bench, FlightFacts, first_flight
    from uavrt.computer.checks import (
        check_card,
        check_disk,
        check_kept_time,
        check_radio,
        examine,
    )
    from uavrt.computer.finding import Finding
    from uavrt.computer.first_setup import FirstSetup
    from uavrt.computer.service import ServicePlan, install, remove, status
    from uavrt.computer.starter import data_home, install_starter, remove_starter
    from uavrt.computer.trial import Needs, Seen, Trial, Verdict, require_still
    from uavrt.computer.versions import Installation, runs_from

__all__ = [
    "Bench",
    "Finding",
    "FirstSetup",
    "FlightFacts",
    "Installation",
    "Needs",
    "Seen",
    "ServicePlan",
    "Trial",
    "Verdict",
    "armed_by_link",
    "check_card",
    "check_disk",
    "check_kept_time",
    "check_radio",
    "data_home",
    "examine",
    "examine_autopilot",
    "first_flight",
    "install",
    "install_starter",
    "remove",
    "remove_starter",
    "require_still",
    "runs_from",
    "status",
]
__getattr__ = lazily(
    __name__,
    {
        "Bench": "bench",
        "Finding": "finding",
        "FirstSetup": "first_setup",
        "FlightFacts": "bench",
        "Installation": "versions",
        "Needs": "trial",
        "Seen": "trial",
        "ServicePlan": "service",
        "Trial": "trial",
        "Verdict": "trial",
        "armed_by_link": "autopilot_setup",
        "check_card": "checks",
        "check_kept_time": "checks",
        "check_disk": "checks",
        "check_radio": "checks",
        "data_home": "starter",
        "install_starter": "starter",
        "remove_starter": "starter",
        "examine": "checks",
        "examine_autopilot": "autopilot_setup",
        "first_flight": "bench",
        "install": "service",
        "remove": "service",
        "require_still": "trial",
        "runs_from": "versions",
        "status": "service",
    },
)
