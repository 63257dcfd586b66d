"""What a flight costs: CPU and memory of each process, and how many tags are too many."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.resources.flight import Reading, SteadyFlight
    from uavrt_experiments.resources.report import ResourceReport, Written
    from uavrt_experiments.resources.run import (
        THESIS_MINUTES,
        Plan,
        run_resources,
        run_shapes,
        run_written,
    )

__all__ = [
    "THESIS_MINUTES",
    "Plan",
    "Reading",
    "ResourceReport",
    "SteadyFlight",
    "Written",
    "run_resources",
    "run_shapes",
    "run_written",
]
__getattr__ = lazily(
    __name__,
    {
        "Plan": "run",
        "Reading": "flight",
        "ResourceReport": "report",
        "SteadyFlight": "flight",
        "THESIS_MINUTES": "run",
        "Written": "report",
        "run_resources": "run",
        "run_shapes": "run",
        "run_written": "run",
    },
)
