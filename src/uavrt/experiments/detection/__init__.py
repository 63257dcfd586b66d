"""What the detector can do, measured: signals, trials, and the tables of the claims."""

from uavrt.experiments.detection.run import Row, run_detection

__all__ = ["Row", "run_detection"]
