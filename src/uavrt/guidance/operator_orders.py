"""Orders of the operator, their limits, and the vehicle's state during an order."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Self

from uavrt.config.settings import GuidanceSettings
from uavrt.core.messages import KeepOut, Motion, VehicleStatus
from uavrt.guidance.ground_heights import GroundAround

if TYPE_CHECKING:
    from uavrt.planning.drone_model.drone_motion import Wind
    from uavrt.planning.drone_model.energy import EnergyModel

Place = tuple[float, float]
"""A position, as (latitude, longitude) [deg]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order(Motion):
    """A motion that the operator requested, and the number by which it is confirmed."""

    order_id: int

    @classmethod
    def of(cls, motion: Motion, order_id: int = 0) -> Self:
        """Return the order for a requested motion. `order_id` is 0 for a preview."""
        asked = {field.name: getattr(motion, field.name) for field in fields(Motion)}
        return cls(order_id=order_id, **asked)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits(GuidanceSettings):
    """Limits for all orders: guidance settings, ground heights, areas to avoid or stay in."""

    ground: GroundAround | None = None
    """Heights of the ground around home; None if the ground is assumed to be level."""
    keep_out: tuple[KeepOut, ...] = ()
    """Areas that paths must not cross, such as those around people and buildings."""
    stay_in: tuple[KeepOut, ...] = ()
    """Areas in which the drone must stay, such as the autopilot's geofence."""
    link_lost_s: float = 5.0
    """Silence of the ground stations after which the link counts as lost [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleNow(VehicleStatus):
    """State of the vehicle, and of the order that is confirmed or being flown."""

    time_s: float
    order_id: int | None
    """Number of the order that is confirmed or being flown; None without one."""
    began: bool
    """True once the order's first command has been sent."""
    wind: "Wind | None" = None
    """Wind that the autopilot reports; None if it reports none."""
    energy: "EnergyModel | None" = None
    """Estimated flight power; None if it must be computed from the hover power in the
    settings."""
