"""Orders of the operator, and the vehicle state needed to fly them."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Self

from uavrt.config.settings import GuidanceSettings
from uavrt.core.messages import KeepOut, Motion, VehicleStatus
from uavrt.guidance.ground_heights import GroundAround

if TYPE_CHECKING:
    from uavrt.planning.drone_model.drone_motion import Wind
    from uavrt.planning.drone_model.energy import EnergyModel

Place = tuple[float, float]
"""Position: latitude and longitude [deg]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order(Motion):
    """A requested motion, and the order number for its confirmation."""

    order_id: int

    @classmethod
    def of(cls, motion: Motion, order_id: int = 0) -> Self:
        """Make an order from a requested motion; `order_id`: its number, 0 for a preview."""
        asked = {field.name: getattr(motion, field.name) for field in fields(Motion)}
        return cls(order_id=order_id, **asked)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits(GuidanceSettings):
    """Limits of every order: the drone's settings, and its surroundings."""

    ground: GroundAround | None = None
    """Heights of the ground around home; None: level ground."""
    keep_out: tuple[KeepOut, ...] = ()
    """Excluded areas around people and buildings, which paths must not cross."""
    stay_in: tuple[KeepOut, ...] = ()
    """Areas in which the drone must stay, such as the vehicle's own fence."""
    link_lost_s: float = 5.0
    """Silence of the ground stations after which the link is lost [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleNow(VehicleStatus):
    """State of the vehicle, and of our permission to command it."""

    time_s: float
    order_id: int | None
    """Number of the order that is confirmed or being flown; None without one."""
    began: bool
    """True once the order's first command was sent."""
    wind: "Wind | None" = None
    """Wind reported by the autopilot; None: not reported."""
    energy: "EnergyModel | None" = None
    """Learned flight power; None: computed from the hover power in the settings."""
