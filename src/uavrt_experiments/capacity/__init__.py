"""The thesis's §5.4: how fast may messages be sent through an autopilot?"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.capacity.links import LinkRow, run_links
    from uavrt_experiments.capacity.model import CapacityRow, model_row, our_sender_row
    from uavrt_experiments.capacity.thesis import COUNTS, GAPS_MS, RECEIVED

__all__ = [
    "COUNTS",
    "GAPS_MS",
    "RECEIVED",
    "CapacityRow",
    "LinkRow",
    "model_row",
    "our_sender_row",
    "run_links",
]
__getattr__ = lazily(
    __name__,
    {
        "COUNTS": "thesis",
        "CapacityRow": "model",
        "GAPS_MS": "thesis",
        "LinkRow": "links",
        "RECEIVED": "thesis",
        "model_row": "model",
        "our_sender_row": "model",
        "run_links": "links",
    },
)
