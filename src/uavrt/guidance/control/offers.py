"""Orders proposed to the operator, and changes that make a proposal invalid; no I/O."""

from dataclasses import dataclass

from uavrt.core.errors import CommandRefused
from uavrt.guidance.control.observed import (
    HomeReport,
    ModeReport,
    Observation,
    PositionReport,
    SticksReport,
    TargetReport,
    between_m,
    same_place,
)
from uavrt.guidance.control.observed_vehicle import ObservedVehicle
from uavrt.guidance.control.rc_watch import RcWatch
from uavrt.guidance.control.yaw import FOREIGN_TURN, RestingYaw
from uavrt.guidance.safety import SAFETY, stops_within_m

PILOT_FLIES = "A pilot flies the drone; request again later"


@dataclass(slots=True, kw_only=True)
class Offer:
    """A proposed order, and the vehicle's state when it was proposed."""

    order_id: int
    takeoff: bool
    nonce: int
    made_s: float
    mode: int
    rests: bool
    """True if, at the proposal, the vehicle hovered in the mode for commands without an
    order."""
    target: TargetReport | None
    """Target reported by a hovering vehicle; a change shows that another station commands
    it."""
    place: PositionReport
    home: HomeReport
    rc: RcWatch | None
    """Monitor of the remote control since the proposal; None without a remote control."""
    yaw: RestingYaw | None
    target_yaw: RestingYaw | None
    """Monitors of the heading and target heading of a hovering vehicle; None if it moves or the
    heading is unknown."""

    def turned(self, seen: PositionReport | TargetReport) -> bool:
        """True if a report shows that another station or a pilot has turned the vehicle."""
        watch = self.yaw if isinstance(seen, PositionReport) else self.target_yaw
        if watch is None or seen.yaw_deg is None:
            return False
        return watch.turned(seen.boot_s, seen.yaw_deg)

    def objection(self, seen: Observation, vehicle: ObservedVehicle) -> str | None:
        """Return how a report shows a pilot's action since the proposal; else None."""
        match seen:
            case ModeReport() if seen.mode != self.mode:  # also if it comes back
                return f"the mode has changed to {vehicle.behaviour.mode_name(seen.mode)}"
            case PositionReport() | TargetReport() if self.turned(seen):
                return f"{FOREIGN_TURN} since the proposal"
            case SticksReport() if self.rc is not None and seen.channels_us:
                return self.rc.observe(seen)
        return None

    def check(self, vehicle: ObservedVehicle) -> None:
        """Raise `CommandRefused` if another station or a pilot has acted since the proposal."""
        then, now, within_m = self.target, vehicle.target, vehicle.behaviour.target_m
        given = then is not None and now is not None and not same_place(then, now, within_m)
        if given or (self.rests and then is None and is_elsewhere(now, self.place)):
            what = "another program has set a target since the proposal"
        elif self.rc is not None and self.rc.unsure:
            what = "a switch of the remote control was moved just now"
        else:
            return
        raise CommandRefused(what, remedy=PILOT_FLIES)


class Offers:
    """Holds the proposed order, if any. Each nonce is valid for one proposal."""

    def __init__(self) -> None:
        self._offer: Offer | None = None
        self._withdrawn: tuple[int, str] | None = None
        """Nonce of the proposal that a pilot's action has ended, and a text on this action."""
        self._used: set[int] = set()

    def add(self, offer: Offer) -> None:
        """Replace the proposed order; raises `CommandRefused` if its nonce was used before."""
        if offer.nonce in self._used:
            raise CommandRefused(
                "the order repeats an earlier nonce", remedy="Request the motion again"
            )
        self._used.add(offer.nonce)
        self._withdrawn, self._offer = None, offer

    def confirmed(self, order_id: int, nonce: int, now_s: float) -> Offer:
        """Remove and return the proposed order.

        Raises `CommandRefused` if another order, or too late a confirmation, is given.
        """
        offer, self._offer = self._offer, None
        if offer is None and self._withdrawn is not None and self._withdrawn[0] == nonce:
            raise CommandRefused(self._withdrawn[1], remedy=PILOT_FLIES)
        if offer is None or (offer.order_id, offer.nonce) != (order_id, nonce):
            raise CommandRefused(
                "the confirmed order is not the proposed one",
                remedy="Request the motion again, then confirm",
            )
        if now_s - offer.made_s > SAFETY.offer_holds_s:
            within = f"{SAFETY.offer_holds_s:.0f} s"
            raise CommandRefused(
                f"the order has expired: it was requested {now_s - offer.made_s:.0f} s ago",
                remedy=f"Request the motion again, then confirm within {within}",
            )
        return offer

    def clear(self) -> None:
        """Withdraw the proposed order."""
        self._offer = None

    def observe(self, seen: Observation, vehicle: ObservedVehicle) -> None:
        """Withdraw the proposed order if a report shows a pilot's action or a moved home."""
        offer = self._offer
        if offer is None:
            return
        why = offer.objection(seen, vehicle)
        if why is not None:  # a confirmation of it is refused with the reason
            self._withdrawn, self._offer = (offer.nonce, why), None
        elif isinstance(seen, HomeReport) and between_m(seen, offer.home) > SAFETY.home_moved_m:
            self._offer = None


def resting(
    seen: PositionReport | TargetReport | None, now_s: float, turning: float, tolerance: float
) -> RestingYaw | None:
    """Return a monitor for the heading of a hovering vehicle; None without a heading."""
    if seen is None or seen.yaw_deg is None:
        return None
    boot_s = seen.boot_s + now_s - seen.time_s
    return RestingYaw(
        start_boot_s=boot_s,
        yaw_deg=seen.yaw_deg,
        turning_deg_s=turning,
        tolerance_deg=tolerance,
    )


def is_elsewhere(target: TargetReport | None, place: PositionReport | None) -> bool:
    """True if a first reported target is not where the vehicle hovers or will stop.

    Another station then commands the vehicle. In Guided, ArduPilot reports no target until it
    gets one.
    """
    if target is None or target.latitude_deg is None or place is None:
        return False
    height = target.altitude_amsl_m
    climbs = height is not None and abs(height - place.altitude_amsl_m) > SAFETY.height_error_m
    return climbs or between_m(place, target) > SAFETY.astray_m + stops_within_m(
        place.speed_m_s
    )
