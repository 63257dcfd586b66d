"""Detect a tag's pulses in the samples of a channel."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.config import Receiver
    from uavrt.detection.detector import PulseDetector
    from uavrt.detection.group import DetectorGroup
    from uavrt.detection.modes import OperatingMode
    from uavrt.detection.reporting import report_every_s
    from uavrt.detection.sensitivity import (
        detection_probability,
        enr_needed_db,
        gain_in_words,
    )
    from uavrt.detection.signal import Counters

__all__ = [
    "Counters",
    "DetectorGroup",
    "OperatingMode",
    "PulseDetector",
    "Receiver",
    "detection_probability",
    "enr_needed_db",
    "gain_in_words",
    "report_every_s",
]
__getattr__ = lazily(
    __name__,
    {
        "Counters": "signal",
        "DetectorGroup": "group",
        "OperatingMode": "modes",
        "PulseDetector": "detector",
        "Receiver": "uavrt.config",
        "detection_probability": "sensitivity",
        "enr_needed_db": "sensitivity",
        "gain_in_words": "sensitivity",
        "report_every_s": "reporting",
    },
)
