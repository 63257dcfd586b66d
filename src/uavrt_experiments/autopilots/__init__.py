"""Rehearse every order and every takeover on real autopilots in simulation.

An integrator gives the builds that will fly: PX4 with its SIH physics, ArduCopter's SITL. The
drone's side is the product itself; the pilot who arms, takes off and takes over is a client of
this experiment alone (`uavrt_experiments.autopilots.hand`), and no code of the product.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.autopilots.builds import (
        arducopter_build,
        px4_build,
        simulated_build,
    )
    from uavrt_experiments.autopilots.flights import Asked, planned, rehearse
    from uavrt_experiments.autopilots.table import as_json, as_page

__all__ = [
    "Asked",
    "arducopter_build",
    "as_json",
    "as_page",
    "planned",
    "px4_build",
    "rehearse",
    "simulated_build",
]
__getattr__ = lazily(
    __name__,
    {
        "Asked": "flights",
        "arducopter_build": "builds",
        "as_json": "table",
        "as_page": "table",
        "planned": "flights",
        "px4_build": "builds",
        "rehearse": "flights",
        "simulated_build": "builds",
    },
)
