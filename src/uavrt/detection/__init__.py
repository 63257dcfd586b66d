"""Finding a tag's pulses in the samples of a channel."""

from uavrt.config.ghost_places import Receiver
from uavrt.detection.detector import PulseDetector
from uavrt.detection.group import DetectorGroup
from uavrt.detection.modes import OperatingMode
from uavrt.detection.samples import Counters

__all__ = ["Counters", "DetectorGroup", "OperatingMode", "PulseDetector", "Receiver"]
