"""What the detector can do, measured: signals, trials, and the tables of the claims."""

from uavrt.experiments.detection.campaign import FULL_TRIALS, Experiment, run_experiments
from uavrt.experiments.detection.catalogue import EXPERIMENTS
from uavrt.experiments.result import Row

__all__ = ["EXPERIMENTS", "FULL_TRIALS", "Experiment", "Row", "run_experiments"]
