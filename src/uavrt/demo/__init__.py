"""The whole system on this machine."""

from uavrt.demo.run import run_demo
from uavrt.demo.summary import DemoSummary

__all__ = ["DemoSummary", "run_demo"]
