"""Orders that an operator can give, and the vehicle's state during them. Pure."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Self

from uavrt.config.settings import GuidanceSettings
from uavrt.guidance.ground import GroundAround
from uavrt.messages import KeepOut, Motion, VehicleSeen

if TYPE_CHECKING:
    from uavrt.planning.energy import EnergyModel
    from uavrt.planning.vehicle import Wind

Place = tuple[float, float]
"""Latitude and longitude [deg]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order(Motion):
    """A motion that was asked for, with the number by which it is confirmed."""

    order_id: int

    @classmethod
    def of(cls, motion: Motion, order_id: int = 0) -> Self:
        """Number a motion; 0 for one that is only planned."""
        asked = {field.name: getattr(motion, field.name) for field in fields(Motion)}
        return cls(order_id=order_id, **asked)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits(GuidanceSettings):
    """What no order may go beyond: the drone's settings, and what is around it."""

    ground: GroundAround | None = None
    """The ground around home; None: taken to be level."""
    keep_out: tuple[KeepOut, ...] = ()
    """People and buildings: nothing is flown over them."""
    stay_in: tuple[KeepOut, ...] = ()
    """Areas that nothing leaves: the vehicle's own fence."""
    link_lost_s: float = 5.0
    """Silence of the ground stations after which the link is lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleNow(VehicleSeen):
    """What the pilot sees of the vehicle and of its own authority over it."""

    time_s: float
    order_id: int | None
    """Of the order that is confirmed or in command; None: out."""
    began: bool
    """The first command was sent."""
    wind: "Wind | None" = None
    """By the autopilot; None: not reported."""
    energy: "EnergyModel | None" = None
    """Power of flying, as learnt so far; None: by the limits."""
