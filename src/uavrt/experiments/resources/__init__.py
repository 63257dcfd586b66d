"""What a flight costs: CPU and memory of each process, and how many tags are too many."""

from uavrt.experiments.resources.flight import Reading, SteadyFlight
from uavrt.experiments.resources.report import ResourceReport
from uavrt.experiments.resources.run import Plan, run_resources, run_shapes

__all__ = ["Plan", "Reading", "ResourceReport", "SteadyFlight", "run_resources", "run_shapes"]
