"""Every interleaving of what can happen to one `Authority`, driven by its public messages.

`World` holds the authority and as much of pilot, guide, link and vehicle as its messages need;
`confirmed` says by plain rules whose confirmation is present.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from explored import Keys, copied

from uavrt.core.errors import CommandRefused
from uavrt.core.messages import FlyThere, GoHome
from uavrt.guidance.autopilot_behaviour import BEHAVIOURS
from uavrt.guidance.control.authority import Authority, ControlStage
from uavrt.guidance.control.observed import (
    BootTimeReport,
    HomeReport,
    LandedReport,
    ModeReport,
    PositionReport,
    TargetReport,
)
from uavrt.guidance.control.order_watch import OrderWatch
from uavrt.guidance.control.vehicle_commands import CommandWriter
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.simulated_flying import MODES

HOME_DEG, HOME_AMSL_M, HEIGHT_M = (47.1, 8.5), 430.0, 40.0
BEAT_S, STEP_M = 1.0, 10.0
"""Time between two rounds of messages, and how far the drone flies in it."""
LOST_S = 3.5
"""Silence after which the confirmation must have ended."""
STOPPED_S = 4.0
"""The same for a drone that stands on its way and says nothing of it."""
OFFER_S = 10.0
PLACES_M = (20.0, 0.0)
OTHER_M = -20.0
METRES_PER_DEGREE = 111_195.0
ORDERS = (1, 2)


def _begun(order: OrderWatch) -> bool:
    return order.motion is not None


def _offer(order: OrderWatch) -> object:
    """The initial state of an order matters until its first command is obeyed."""
    if order.motion is None and order.offer.rests:
        return order.offer
    return order.offer.order_id, None if order.own_mode_seen else order.offer.mode


KEYS = Keys(
    {
        **dict.fromkeys(
            (".counters", ".reason", ".out_s", ".nearest_m", ".behaviour", ".now_s")
        ),
        # Here no message is late, each mode is a heartbeat, and home and landing do not change.
        **dict.fromkeys(
            [f"ObservedVehicle.{one}" for one in ("_lateness", "heartbeat", "landed", "home")]
        ),
        "Offers._withdrawn": None,
        "OrderWatch.confirmed_s": _begun,
        # The same as the vehicle's.
        **dict.fromkeys(("OrderWatch.target", "JumpWatch.before")),
        "Commanded.before": lambda motion: motion.obeyed,
        "Commanded.start": None,
    },
    {
        "": 4.0,
        **dict.fromkeys(("boot_s", "start_boot_s", "moved_boot_s"), 54.0),
        **dict.fromkeys(("made_s", "offered_s", "confirmed_s"), OFFER_S + 1.0),
    },
    {"OrderWatch.offer": _offer},
)


def nonce(order_id: int) -> int:
    return 11 * order_id


@dataclass(slots=True)
class World:
    flavour: Flavour
    authority: Authority = field(init=False)
    now_s: float = 100.0
    mode: int = 0
    target_m: float | None = None
    at_m: float = 0.0
    paused: bool = False
    linked: bool = True
    heard_s: float = 100.0
    stopped_s: float | None = None
    """Since when it stands on its way, as far as messages show."""
    offers: int = 0
    used: set[int] = field(default_factory=set)
    """Offered to this authority; one that starts again has forgotten them."""
    offered: int | None = None
    """Newest offer that a confirmation may follow."""
    offered_s: float | None = None
    confirmed: int | None = None
    """Order whose confirmation is present."""
    moved_by: int | None = None
    """Order that a command just left for."""

    def __post_init__(self) -> None:
        self.mode = MODES[self.flavour]["position"]
        self.restart()

    @classmethod
    def flying(cls, flavour: Flavour) -> "World":
        """Make a world whose vehicle has reported."""
        world = cls(flavour)
        world.beat()
        return world

    @property
    def own_mode(self) -> bool:
        return self.mode == MODES[self.flavour]["hold"]

    def restart(self) -> None:
        self.authority = Authority(CommandWriter(behaviour=BEHAVIOURS[self.flavour]))
        self.confirmed = self.offered = self.stopped_s = None
        self.used.clear()

    @property
    def kind(self) -> str:
        return self.authority.standing.value

    @property
    def events(self) -> tuple[str, ...]:
        return tuple(EVENTS)

    def after(self, event: str) -> None:
        """Apply an event and advance the time by a second."""
        EVENTS[event](self)
        self.beat()

    def check(self) -> None:
        """Check that no order moves the drone unconfirmed, and that *Take back* ends it."""
        authority = self.authority
        if authority.standing is not ControlStage.OUT:
            assert authority.order_id == self.confirmed, (
                f"{authority.standing} for {authority.order_id}, confirmed is {self.confirmed}"
            )
        for order_id in ORDERS:
            if order_id != self.confirmed:
                assert_refused(copied(authority), order_id, self.now_s)
        taken = copied(authority)
        taken.stop(self.now_s)
        assert taken.standing is ControlStage.OUT, "not out after take back"
        for order_id in ORDERS:
            assert_refused(taken, order_id, self.now_s)
            try:
                taken.confirm(order_id, nonce(order_id), self.now_s, sticks_unseen=True)
            except CommandRefused:
                continue
            raise AssertionError(f"order {order_id} was confirmed after take back")

    # ------------------------------------------------------------------ what happens

    def beat(self) -> None:
        """Let a second pass: the drone flies, and reports if the link is up."""
        self.now_s += BEAT_S
        if self.own_mode and self.target_m is not None and not self.paused:
            off = self.target_m - self.at_m
            self.at_m += max(-STEP_M, min(STEP_M, off))
        if self.linked:
            self.report()
        else:
            self.authority.tick(self.now_s)
        if self.now_s - self.heard_s >= LOST_S:
            self.confirmed = None
        if self.offered_s is not None and self.now_s - self.offered_s > OFFER_S:
            self.offered = None
        if self.offered is None:
            self.offered_s = None
        self.authority.planner_alive(self.now_s)
        stands = self.paused and self.own_mode and self.linked
        if not (stands and self.target_m is not None and abs(self.target_m - self.at_m) > 5.0):
            self.stopped_s = None
        elif self.stopped_s is None:
            self.stopped_s = self.now_s
        elif self.now_s - self.stopped_s >= STOPPED_S and self.moved:
            self.confirmed = None

    @property
    def moved(self) -> bool:
        return self.authority.standing is not ControlStage.CONFIRMED

    def report(self) -> None:
        self.heard_s = self.now_s
        observe, now_s, boot_s = self.authority.observe, self.now_s, self.now_s - 50.0
        observe(BootTimeReport(now_s, boot_s, 0.0))
        observe(ModeReport(now_s, self.mode, armed=True))
        observe(HomeReport(now_s, *HOME_DEG, HOME_AMSL_M))
        observe(LandedReport(now_s, on_ground=False))
        observe(
            PositionReport(
                time_s=now_s,
                boot_s=boot_s,
                latitude_deg=latitude_deg(self.at_m),
                longitude_deg=HOME_DEG[1],
                altitude_amsl_m=HOME_AMSL_M + HEIGHT_M,
                altitude_relative_m=HEIGHT_M,
                velocity_m_s=(0.0, 0.0, 0.0),
                yaw_deg=0.0,
            )
        )
        if self.own_mode and self.target_m is not None:
            observe(self.target_seen(self.target_m))
        self.authority.tick(now_s)

    def target_seen(self, north_m: float) -> TargetReport:
        return TargetReport(
            time_s=self.now_s,
            boot_s=self.now_s - 50.0,
            latitude_deg=latitude_deg(north_m),
            longitude_deg=HOME_DEG[1],
            altitude_amsl_m=HOME_AMSL_M + HEIGHT_M,
            yaw_deg=None,
        )

    def offer(self) -> None:
        self._refusable(lambda: self._offer(ORDERS[self.offers]))

    def _offer(self, order_id: int) -> None:
        self.authority.offer(order_id, nonce(order_id), self.now_s)
        assert order_id not in self.used, "a nonce was taken twice"
        self.used.add(order_id)
        self.offers = max(self.offers, order_id)
        self.offered, self.offered_s = order_id, self.now_s

    def offer_again(self) -> None:
        """An order that was offered before: its nonce is used."""
        if self.offers:
            self._refusable(lambda: self._offer(ORDERS[self.offers - 1]))

    def confirm(self) -> None:
        """The newest offer that there was, present or not."""
        self._confirm(ORDERS[max(0, self.offers - 1)])

    def confirm_older(self) -> None:
        self._confirm(ORDERS[0])

    def _confirm(self, order_id: int) -> None:
        present, self.offered = self.offered, None
        try:
            self.authority.confirm(order_id, nonce(order_id), self.now_s, sticks_unseen=True)
        except CommandRefused:
            return
        assert present == order_id, f"order {order_id} confirmed, on offer was {present}"
        self.confirmed = order_id

    def command(self) -> None:
        """The guide wishes for the first place, or for it once more."""
        self._command(PLACES_M[0])

    def command_elsewhere(self) -> None:
        self._command(PLACES_M[1])

    def _command(self, north_m: float) -> None:
        order_id = self.authority.order_id or self.confirmed or ORDERS[0]
        try:
            self.authority.command(order_id, flight(north_m), self.now_s)
        except CommandRefused:
            return
        assert self.confirmed == order_id, f"moved by {order_id}, not by {self.confirmed}"
        if not self.own_mode:
            self.paused = False
        self.mode, self.target_m = MODES[self.flavour]["hold"], north_m
        self.stopped_s = None

    def take_back(self) -> None:
        self.authority.stop(self.now_s)
        self.confirmed = self.offered = None

    def pilot_mode(self) -> None:
        names = MODES[self.flavour]
        other = names["position"] if self.mode == names["return"] else names["return"]
        self.mode, self.paused, self.target_m = other, False, None
        if self.linked:
            self.confirmed = self.offered = None

    def pilot_pause(self) -> None:
        """No message shows it."""
        self.paused = self.own_mode

    def pilot_target(self) -> None:
        """Where the drone has one already, that report does not differ from this."""
        if self.own_mode and self.target_m != OTHER_M:
            self.target_m = OTHER_M
            if self.linked:
                self.confirmed = None

    def reported_as_ours(self) -> None:
        """A report of our target once more, whatever the drone flies to."""
        if self.linked:
            self.authority.observe(self.target_seen(PLACES_M[0]))

    def arrive(self) -> None:
        for _ in range(4):
            self.beat()

    def guide_restarts(self) -> None:
        self.take_back()

    def link_lost(self) -> None:
        self.linked = False
        for _ in range(3):
            self.beat()

    def link_back(self) -> None:
        if not self.linked:
            self.linked = True
            given = self.own_mode and self.target_m == OTHER_M
            if given or self.mode == MODES[self.flavour]["return"]:
                self.confirmed = None

    def _refusable(self, action: Callable[[], None]) -> None:
        try:
            action()
        except (CommandRefused, IndexError):
            return


EVENTS: dict[str, Callable[[World], None]] = {
    "offer": World.offer,
    "offer repeated": World.offer_again,
    "confirmation": World.confirm,
    "late confirmation": World.confirm_older,
    "order": World.command,
    "another order": World.command_elsewhere,
    "take back": World.take_back,
    "pilot's mode": World.pilot_mode,
    "pilot's pause": World.pilot_pause,
    "pilot's target": World.pilot_target,
    "target as ours": World.reported_as_ours,
    "arrival": World.arrive,
    "guide restarted": World.guide_restarts,
    "connection restarted": World.restart,
    "link silent": World.link_lost,
    "link back": World.link_back,
}


def assert_refused(authority: Authority, order_id: int, now_s: float) -> None:
    for manoeuvre in (flight(PLACES_M[0]), GoHome()):
        for stops in (False, True):
            try:
                authority.command(order_id, manoeuvre, now_s, stops=stops)
            except CommandRefused:
                continue
            raise AssertionError(f"{manoeuvre} of order {order_id} was taken")


def flight(north_m: float) -> FlyThere:
    return FlyThere(
        latitude_deg=latitude_deg(north_m),
        longitude_deg=HOME_DEG[1],
        altitude_amsl_m=HOME_AMSL_M + HEIGHT_M,
    )


def latitude_deg(north_m: float) -> float:
    return HOME_DEG[0] + north_m / METRES_PER_DEGREE
