"""Planners against each other: published tables, paired seeds, bars."""

from uavrt.experiments.search.campaign import fly_all, plan
from uavrt.experiments.search.catalogue import SCENARIOS
from uavrt.experiments.search.table import results

__all__ = ["SCENARIOS", "fly_all", "plan", "results"]
