"""The thesis's §5.4: how fast may messages be sent through an autopilot?"""

from uavrt.experiments.capacity.links import run_links
from uavrt.experiments.capacity.model import CapacityRow, model_row, our_sender_row
from uavrt.experiments.capacity.thesis import COUNTS, GAPS_MS, RECEIVED

__all__ = [
    "COUNTS",
    "GAPS_MS",
    "RECEIVED",
    "CapacityRow",
    "model_row",
    "our_sender_row",
    "run_links",
]
