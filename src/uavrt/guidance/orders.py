"""Orders that an operator can give, and the vehicle's state during them. Pure."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Literal, Self

from uavrt.guidance.ground import GroundAround
from uavrt.guidance.heights import LOWEST_M
from uavrt.messages import KeepOut, Motion, VehicleSeen

if TYPE_CHECKING:
    from uavrt.planning.energy import EnergyModel
    from uavrt.planning.vehicle import Wind

Place = tuple[float, float]
"""Latitude and longitude [deg]."""
LinkLost = Literal["hold", "return", "go on"]
OFFER_HOLDS_S = 10.0
"""From an order's offer to its confirmation: so long the operator may think."""


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
class Limits:
    """What no order may go beyond."""

    lowest_m: float = LOWEST_M
    highest_m: float = 120.0
    """Above ground."""
    fence_m: float = 500.0
    """Radius around home."""
    speed_m_s: float = 5.0
    """Over ground, that the autopilot flies at; for times and energies only."""
    airspeed_m_s: float = 12.0
    """Greatest: against the wind it comes forward the slower."""
    wind_m_s: float = 8.0
    """That blows against the way home where the autopilot tells of none."""
    return_height_m: float = 60.0
    """To which the autopilot climbs before it returns."""
    hover_w: float | None = None
    """Power of hovering; None: not known."""
    battery_wh: float | None = None
    """Of a full battery; None: not known."""
    reserve_percent: float = 25.0
    """That is left at home."""
    ground: GroundAround | None = None
    """The ground around home; None: taken to be level."""
    headings: int = 12
    """Of a turn by steps."""
    keep_away_m: float = 30.0
    """A search keeps so far, over ground, from where animals may be; 0: it does not."""
    keep_out: tuple[KeepOut, ...] = ()
    """People and buildings: nothing is flown over them."""
    stay_in: tuple[KeepOut, ...] = ()
    """Areas that nothing leaves: the vehicle's own fence."""
    link_lost: LinkLost = "hold"
    link_lost_s: float = 5.0
    """So long without a ground station is lost."""
    return_after_s: float = 60.0
    """Of holding without a ground station."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleNow(VehicleSeen):
    """What the pilot sees of the vehicle and of its own authority over it."""

    time_s: float
    order_id: int | None
    """Of the order that is confirmed or in command; None: out."""
    began: bool
    """The first command was sent."""
    wind: "Wind | None" = None
    """By the autopilot; None: it tells of none."""
    energy: "EnergyModel | None" = None
    """What flying takes, as learnt so far; None: as the limits tell."""

    @classmethod
    def of(
        cls,
        seen: VehicleSeen,
        *,
        time_s: float,
        order_id: int | None,
        began: bool,
        wind: "Wind | None" = None,
    ) -> Self:
        """Add what only the pilot knows to what is seen."""
        shown = {field.name: getattr(seen, field.name) for field in fields(seen)}
        return cls(**shown, time_s=time_s, order_id=order_id, began=began, wind=wind)
