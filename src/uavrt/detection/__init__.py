"""Detect a tag's pulses in the samples of a channel.

`detector` searches for one tag, `group` for many tags, and `coded` for coded tags. A block of
samples passes through `signal`, `search` and `track`. `beeps` finds unlisted senders.
`sensitivity` computes how weak a tag can be detected, and `search_costs` how much CPU time a
search needs.
"""

from typing import TYPE_CHECKING

from uavrt.core.runtime.lazy import lazily

if TYPE_CHECKING:
    from uavrt.config.ghost_places import Receiver as Receiver
    from uavrt.detection.detector import PulseDetector as PulseDetector
    from uavrt.detection.group import DetectorGroup as DetectorGroup
    from uavrt.detection.modes import OperatingMode as OperatingMode
    from uavrt.detection.reporting import report_every_s as report_every_s
    from uavrt.detection.sensitivity import detection_probability as detection_probability
    from uavrt.detection.sensitivity import enr_needed_db as enr_needed_db
    from uavrt.detection.signal.sample_buffer import Counters as Counters

__all__, __getattr__ = lazily(
    __name__,
    {
        "uavrt.config.ghost_places": "Receiver",
        "detector": "PulseDetector",
        "group": "DetectorGroup",
        "modes": "OperatingMode",
        "reporting": "report_every_s",
        "sensitivity": "detection_probability enr_needed_db",
        "signal.sample_buffer": "Counters",
    },
)
