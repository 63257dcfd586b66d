"""Motion control at the link: orders in, commands out, the authority in between.

Belongs to the connection process. The autopilot's messages reach `Authority` here before
anything else is done with them; what the guide wishes becomes a command here or is dropped.
Orders come sealed, but for a simulator that says that it is one, on this computer.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf

from uavrt.clock import monotonic_s
from uavrt.commands import CommandName
from uavrt.config.settings import GuidanceSettings
from uavrt.errors import CommandRefused, TunnelError
from uavrt.guidance.authority import Authority, Standing
from uavrt.guidance.commanded import STALL_S
from uavrt.guidance.heights import target_amsl_m
from uavrt.guidance.manners import MANNERS, AutopilotName
from uavrt.guidance.observed import Boot
from uavrt.guidance.offers import WHEN_YOURS
from uavrt.guidance.wishes import CommandWriter
from uavrt.log import get_logger
from uavrt.mavlink import dialect
from uavrt.mavlink.address import Address
from uavrt.mavlink.message import Message
from uavrt.mavlink.vehicle_messages import command_message, kind_of, observations
from uavrt.mavlink.wind import wind_of
from uavrt.messages import (
    Command,
    CommandReply,
    FlyThere,
    MotionOffer,
    MotionRequest,
    StatusText,
    VehicleReport,
    VehicleWish,
    Wish,
)
from uavrt.processes.fence_watch import FenceWatch
from uavrt.tunnel.motion import (
    MotionConfirmation,
    MotionState,
    MotionStop,
    StateKind,
    decode_motion,
    encode_state,
)
from uavrt.tunnel.neighbours import decode_neighbour

log = get_logger()

Asker = tuple[int, int]
REPORT_S = 0.1
STATE_S = 1.0
IDENTITY_S = 3.0
PENDING = 16
NEVER_S = 1e6
STANDS_WITHIN_S = 1.5
"""After this a stop is one without the command to stand."""
LATE_S = 0.2
"""Between two turns of the process, which come every 50 ms: beyond `STALL_S` it is out, beyond
this what the autopilot said meanwhile is read before a command is sent, and before it
counts as silent."""
LATE_TURNS = 2
"""So many turns later it is read: the hub and the link wait for one turn together, in whatever
order they are served, and whatever comes from the hub first."""
ANSWERS_WITHIN_S = 2.0
"""The supervisor on a confirmation, then who confirmed has given up."""
BATTERY_AGE_S, WIND_AGE_S = 10.0, 30.0
TELLER_S = 10.0
"""Who told of other drones so lately is the only one that may: two would give the same way."""
UNKNOWN = "the autopilot is not known. Fly a multirotor with PX4 or ArduPilot"
TCP_IS_LATE = (
    "orders of motion are not flown over TCP to another computer: a command could arrive "
    "seconds late. Use a serial port or UDP for mavlink.address"
)
SIMULATOR_NUMBER = 0x75617672
"""AUTOPILOT_VERSION's uid of `uavrt.simulation.fake_autopilot`: ``uavr``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Question:
    """What the supervisor was asked."""

    name: CommandName
    about: MotionRequest | tuple[MotionConfirmation, Asker]
    asked_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Outlets:
    """Where a desk sends its messages."""

    command: Callable[[Message], None]
    """To the autopilot, now."""
    leaves: Callable[[], bool]
    """Whether a command would leave now."""
    state: Callable[[bytes, Asker | None], None]
    """A payload of type 60006: to who asked, or to all."""
    ask: Callable[[Command], None]
    """To the supervisor."""
    record: Callable[[str, object], None]
    """To the guide, by the hub."""
    tell: Callable[[StatusText], None]
    """To the operator."""


class MotionDesk:
    """The state of the desk.

    `settings`: the drone's.
    `outlets`: where its words go.
    `own_place`: our system and component id; the vehicle's system is the same.
    `next_request_id`: numbers for commands.
    `autopilot_link`: by which the autopilot is reached.
    """

    def __init__(
        self,
        settings: GuidanceSettings,
        outlets: Outlets,
        *,
        own_place: Callable[[], tuple[int, int]],
        next_request_id: Callable[[], int],
        autopilot_link: Address | None,
    ) -> None:
        self._settings, self._out = settings, outlets
        self._own_place, self._next_request_id = own_place, next_request_id
        self._on_loopback = autopilot_link is not None and autopilot_link.is_loopback
        by_tcp = autopilot_link is not None and autopilot_link.kind == "tcp"
        self._link_fault = TCP_IS_LATE if by_tcp and not self._on_loopback else None
        self._fence = FenceWatch(
            outlets.command, lambda fence: outlets.record("vehicle_fence", fence), own_place
        )
        self._kind: AutopilotName | None = None
        self._authority: Authority | None = None
        self._simulated: bool | None = None
        self._asked_identity_s = -inf
        self._battery_percent: float | None = None
        self._battery_s = -inf
        self._wind_m_s: tuple[float, float] | None = None
        self._wind_s = -inf
        self._pending: dict[int, _Question] = {}
        self._order_id = 0
        self._asker: Asker | None = None
        self._confirmer: Asker | None = None
        """Who confirmed the order: its silence counts, whoever else is heard."""
        self._late_told = False
        """The operator knows that this order waits for a late link."""
        self._asked: tuple[Asker, int] | None = None
        self._answered: bytes | None = None
        self._sent = self._refused = 0
        self._said = ""
        self._awake_s = monotonic_s()
        self._late_turns = 0
        self._silence_counts_from_s = 0.0
        """Then silence counts again, however late the turns of this process come."""
        self._stop_by_s = 0.0
        self._silent_s: Mapping[Asker, float] = {}
        self._teller: tuple[Asker | None, float] = (None, -inf)
        """Who tells of other drones, and when last."""
        self._standing = Standing.OUT
        self._next_report_s = self._next_state_s = 0.0
        self.refused_orders = self.refused_neighbours = 0
        """Orders that were not sealed, or could not be read."""

    # ------------------------------------------------------------- from the autopilot

    def autopilot_found(self) -> None:
        """Start over: it is another autopilot, or the first."""
        now_s = monotonic_s()
        if self._authority is not None:
            self._authority.see(Boot(now_s))
            self._watch(now_s)
        self._kind, self._authority, self._simulated = None, None, None
        self._asked_identity_s = self._battery_s = self._wind_s = -inf
        self._fence.autopilot_found()

    def vehicle(
        self, message: Message, age_s: float = 0.0, late_s: float | None = None
    ) -> None:
        """Handle a message of the autopilot.

        `age_s`: how long ago it arrived.
        `late_s`: how long it was on its way, where the autopilot's clock is known.
        """
        now_s = monotonic_s()
        self._look_at_gap(now_s)
        if isinstance(message, dialect.Heartbeat):
            self._know(kind_of(message))
            self._watch(now_s)
        if isinstance(message, dialect.AutopilotVersion) and self._simulated is not False:
            self._simulated = message.uid == SIMULATOR_NUMBER
        if isinstance(message, dialect.SysStatus):
            left = message.battery_remaining
            self._battery_percent = float(left) if 0 <= left <= 100 else None
            self._battery_s = now_s - age_s
        if isinstance(message, dialect.Wind | dialect.WindCov):
            self._wind_m_s, self._wind_s = wind_of(message), now_s - age_s
        if self._authority is None:
            return
        for seen in observations(message, now_s - age_s, late_s):
            self._authority.see(seen)
        self._watch(now_s)
        self._fence.vehicle(message, now_s)

    def _know(self, kind: AutopilotName | None) -> None:
        if kind == self._kind:
            return
        self._kind = kind
        if kind is None:
            self._authority = None
            return
        settings = self._settings
        writer = CommandWriter(
            manners=MANNERS[kind],
            lowest_m=settings.lowest_m,
            highest_m=settings.highest_m,
            farthest_m=settings.fence_m,
        )
        self._authority = Authority(
            writer,
            may_take_off=settings.may_take_off,
            unwatched_channels=frozenset(settings.unwatched_channels),
        )

    # ----------------------------------------------------------------- from the ground

    def receive(
        self, payload: bytes, asker: Asker, refusal: str | None, *, sealed: bool
    ) -> None:
        """Handle a ground station's message about motion.

        `payload`: of type 60005, its seal opened.
        `asker`: the station.
        `refusal`: why this station may not command.
        `sealed`: it proved the drone's key.
        """
        try:
            message = decode_motion(payload, asker)
        except TunnelError as error:
            self.refused_orders += 1
            log.seldom(self.refused_orders, "order of motion refused", reason=error.message)
            return
        if refusal is None and not sealed and not self._takes_unsealed:
            refusal = "orders of motion must be sealed: give drone and ground a key"
        if refusal is None and not isinstance(message, MotionStop):
            refusal = self._link_fault
        if refusal is not None:
            self.refused_orders += 1
            self._answer("refused", refusal, asker, message.request_id)
        elif isinstance(message, MotionStop):
            self._stop(asker, message)
        elif isinstance(message, MotionRequest):
            if (asker, message.request_id) == self._asked:
                if self._answered is not None:  # else the answer is on its way
                    self._out.state(self._answered, asker)
                return
            self._asked, self._answered = (asker, message.request_id), None
            self._ask("fly", message, asker, sealed=sealed)
        else:
            self._ask("confirm_motion", (message, asker), asker, sealed=sealed)

    def neighbour(
        self, payload: bytes, asker: Asker, refusal: str | None, *, sealed: bool
    ) -> None:
        """Handle what a ground station tells of another drone: the guide is to know it.

        Parameters as of `receive`; the payload is of type 60010.
        """
        now_s = monotonic_s()
        try:
            told = decode_neighbour(payload)
        except TunnelError as error:
            self.refused_neighbours += 1
            log.seldom(self.refused_neighbours, "neighbour refused", reason=error.message)
            return
        proven = sealed or self._takes_unsealed
        teller, told_s = self._teller
        another = teller not in (None, asker) and now_s - told_s < TELLER_S
        own = told.vehicle == self._own_place()[0]
        if refusal is not None or not proven or another or own:
            self.refused_neighbours += 1
            return
        self._teller = (asker, now_s)
        self._out.record("neighbour", told)

    @property
    def _takes_unsealed(self) -> bool:
        """Whether it is the simulator: anybody on a network could say so, here nobody else."""
        return bool(self._simulated) and self._on_loopback

    def _ask(
        self,
        name: CommandName,
        what: MotionRequest | tuple[MotionConfirmation, Asker],
        asker: Asker,
        *,
        sealed: bool,
    ) -> None:
        """Ask the supervisor whether this station commands."""
        number = self._next_request_id()
        self._pending[number] = _Question(name=name, about=what, asked_s=monotonic_s())
        while len(self._pending) > PENDING:
            del self._pending[next(iter(self._pending))]
        self._out.ask(
            Command(
                name=name,
                request_id=number,
                source=f"mavlink {asker[0]}/{asker[1]}",
                sealed=sealed,
            )
        )

    def reply(self, reply: CommandReply) -> None:
        """Handle the supervisor's word on a command."""
        question = self._pending.get(reply.request_id)
        if question is None or question.name != reply.name:
            return
        del self._pending[reply.request_id]
        if isinstance(question.about, MotionRequest):
            request = question.about
            if reply.accepted:
                self._out.record("motion", request)
            else:
                self._answer("refused", reply.message, request.asker, request.request_id)
            return
        confirmation, asker = question.about
        waited_s = monotonic_s() - question.asked_s
        if not reply.accepted:
            self._answer("refused", reply.message, asker, confirmation.request_id)
        elif waited_s > ANSWERS_WITHIN_S:
            text = f"the confirmation waited {waited_s:.0f} s on the drone: ask again"
            self._answer("refused", text, asker, confirmation.request_id)
        else:
            self._confirm(confirmation, asker)

    def _confirm(self, confirmation: MotionConfirmation, asker: Asker) -> None:
        now_s = monotonic_s()
        try:
            if self._authority is None:
                raise CommandRefused("the autopilot is not known")
            if asker != self._asker:
                raise CommandRefused("another station asked", remedy="Ask for it yourself")
            self._authority.confirm(
                confirmation.order_id,
                confirmation.nonce,
                now_s,
                sticks_unseen=confirmation.sticks_unseen,
            )
        except CommandRefused as error:
            self._answer("refused", str(error), asker, confirmation.request_id)
            return
        self._sent = self._refused = 0
        self._confirmer, self._late_told = asker, False
        self._said, self._order_id = "confirmed", confirmation.order_id
        self._answer("state", self._said, asker, confirmation.request_id)
        log.info("motion confirmed", order=confirmation.order_id, source=asker)
        self._report(now_s)

    def _stop(self, asker: Asker, stop: MotionStop) -> None:
        """Let the drone stand where it is, if it is ours, and be out; end what is offered."""
        now_s, authority = monotonic_s(), self._authority
        self._look_at_gap(now_s)
        if authority is not None:
            self._stop_by_s = self._stop_by_s or now_s + STANDS_WITHIN_S
            self._go_on_stopping(authority, now_s)
        self._answer("state", self._words(), asker, stop.request_id)

    def _go_on_stopping(self, authority: Authority, now_s: float) -> None:
        """Give up control once the drone was told to stop and no command is under way."""
        if authority.taking_off:
            climbs = ": it climbs on to its height" if authority.climbs else ""
            authority.stop(now_s, f"stopped by the operator{climbs}")
        if not authority.flies_ours or self._stand(authority, now_s):
            authority.stop(now_s)
        elif now_s >= self._stop_by_s:
            authority.stop(now_s, "stopped by the operator: it flies on to its last target")
        if authority.standing is Standing.OUT:
            self._stop_by_s = 0.0
        self._watch(now_s)

    def _stand(self, authority: Authority, now_s: float) -> bool:
        if self._late_turns > 0:
            return False
        now, order_id = authority.vehicle_seen(), authority.order_id
        if now is None or order_id is None:
            return False
        height = max(now.altitude_relative_m, self._settings.lowest_m)
        here = FlyThere(
            latitude_deg=now.latitude_deg,
            longitude_deg=now.longitude_deg,
            altitude_amsl_m=target_amsl_m(
                now.altitude_amsl_m,
                now.altitude_relative_m,
                min(height, self._settings.highest_m),
            ),
        )
        return self._command(authority, order_id, here, now_s, stops=True)

    # ---------------------------------------------------------------- from the guide

    def offer(self, offer: MotionOffer) -> None:
        """Handle what the guide would fly, or why not; report it to who asked."""
        if offer.refused:
            self._answer("refused", offer.summary, offer.asker, offer.request_id)
            return
        try:
            if self._authority is None:
                raise CommandRefused("the autopilot is not known")
            if offer.mode != self._authority.vehicle.mode_name:
                raise CommandRefused(
                    f"the mode is {self._authority.vehicle.mode_name} now",
                    remedy=WHEN_YOURS,
                )
            self._authority.offer(
                offer.order_id, offer.nonce, monotonic_s(), takeoff=offer.takeoff
            )
        except CommandRefused as error:
            self._answer("refused", str(error), offer.asker, offer.request_id)
            return
        self._asker = offer.asker
        self._answer(
            "offer",
            offer.summary,
            offer.asker,
            offer.request_id,
            order_id=offer.order_id,
            nonce=offer.nonce,
        )

    def wish(self, wish: VehicleWish) -> None:
        """Handle the guide's wishes for the vehicle."""
        authority, now_s = self._authority, monotonic_s()
        self._look_at_gap(now_s)
        late = self._late_turns > 0
        if authority is None or wish.order_id is None or wish.order_id != authority.order_id:
            if authority is not None and wish.ends and wish.order_id is None:
                authority.stop(now_s, "the guide has restarted")
                self._watch(now_s)
                self._fence.repeat()
            return
        authority.planner_alive(now_s)
        if self._stop_by_s:
            return
        self._said = wish.said or self._said
        if wish.ends:
            behind = "" if authority.vehicle.late is None else f": {authority.vehicle.late}"
            authority.stop(now_s, f"{wish.said}{behind}")
        elif wish.wish is not None:
            if not late and self._command(authority, wish.order_id, wish.wish, now_s):
                self._sent += 1
            else:
                self._refused += 1
            self._report(now_s)
        self._watch(now_s)

    def _command(
        self,
        authority: Authority,
        order_id: int,
        wish: Wish,
        now_s: float,
        *,
        stops: bool = False,
    ) -> bool:
        try:
            if not self._out.leaves():
                raise CommandRefused("other bytes wait for the link to the autopilot")
            command = authority.command(order_id, wish, now_s, stops=stops)
        except CommandRefused as error:
            log.info("wish refused", reason=error.message)
            self._tell_late(authority)
            return False
        self._out.command(command_message(command, self._own_place()[0]))
        nearest_m = authority.nearest_m
        log.info("commanded", command=command.name, order=order_id, nearest_m=nearest_m)
        return True

    def _tell_late(self, authority: Authority) -> None:
        """Say once what keeps an order from being flown, if it is the link."""
        late = authority.vehicle.late
        if late is None or authority.standing is Standing.OUT or self._late_told:
            return
        self._late_told = True
        self._out.tell(StatusText(severity=4, text=f"Not commanded: {late}"))

    # ------------------------------------------------------------------------- words

    def tick(self, silent_s: Mapping[Asker, float]) -> None:
        """Do what is due.

        `silent_s`: for how long each ground station was not heard.
        """
        now_s = monotonic_s()
        if self._look_at_gap(now_s) <= LATE_S:
            self._late_turns = max(0, self._late_turns - 1)
        self._silent_s = silent_s
        if self._authority is not None:
            if not self._late_turns or now_s >= self._silence_counts_from_s:
                self._authority.tick(now_s)
            if self._stop_by_s:
                self._go_on_stopping(self._authority, now_s)
            self._watch(now_s)
        asks = self._kind is not None and self._simulated is not False
        if asks and now_s - self._asked_identity_s > IDENTITY_S:
            self._asked_identity_s = now_s
            self._out.command(_identity_request(self._own_place()[0]))
        if self._authority is not None:
            self._fence.tick(now_s, resting=self._standing is Standing.OUT)
        if now_s >= self._next_report_s:
            self._report(now_s)
        if now_s >= self._next_state_s:
            self._tell_state(now_s)

    def _look_at_gap(self, now_s: float) -> float:
        """Give up control after this process stalled: what it hears now may be old."""
        gap_s, self._awake_s = now_s - self._awake_s, now_s
        if gap_s > LATE_S:
            if not self._late_turns:
                self._silence_counts_from_s = now_s + STALL_S
            self._late_turns = LATE_TURNS
        if gap_s > STALL_S and self._authority is not None:
            self._authority.stop(now_s, f"the drone side stood still for {gap_s:.0f} s")
            self._watch(now_s)
        return gap_s

    def _watch(self, now_s: float) -> None:
        """Report at once that the standing has changed."""
        standing = Standing.OUT if self._authority is None else self._authority.standing
        if standing is self._standing:
            return
        self._standing = standing
        ended = self._authority if standing is Standing.OUT else None
        log.info(
            "standing",
            standing=standing.value,
            reason=self._words(),
            nearest_m=None if ended is None else ended.nearest_m,
        )
        if standing is Standing.OUT:
            self._out.tell(StatusText(severity=5, text=f"Not flying: {self._words()}"))
        self._tell_state(now_s)
        self._report(now_s)

    def _words(self) -> str:
        if self._authority is None:
            return "the autopilot is not known"
        if self._authority.standing is Standing.OUT:
            return self._authority.reason
        late = self._authority.vehicle.late
        return self._said if late is None else f"{late}: nothing is commanded"

    @property
    def _ground_silent_s(self) -> float:
        """Of the station that confirmed what is flown; without an order, of any."""
        silent_s = self._silent_s
        if self._standing is Standing.OUT or self._confirmer is None:
            return min((NEVER_S, *silent_s.values()))
        return min(NEVER_S, silent_s.get(self._confirmer, NEVER_S))

    def _tell_state(self, now_s: float) -> None:
        self._next_state_s = now_s + STATE_S
        self._answer("state", self._words(), None, 0)

    def _answer(
        self,
        kind: StateKind,
        text: str,
        asker: Asker | None,
        request_id: int,
        *,
        order_id: int = 0,
        nonce: int = 0,
    ) -> None:
        authority = self._authority
        state = MotionState(
            kind=kind,
            standing="out" if authority is None else authority.standing.value,
            text=text,
            request_id=request_id,
            order_id=self._order_id if kind == "state" else order_id,
            nonce=nonce,
        )
        payload = encode_state(state)
        if asker is not None and (asker, request_id) == self._asked:
            self._answered = payload
        self._out.state(payload, asker)

    def _report(self, now_s: float) -> None:
        """Show the guide how things are."""
        self._next_report_s = now_s + REPORT_S
        self._out.record("vehicle", self._vehicle_report(now_s))

    def _vehicle_report(self, now_s: float) -> VehicleReport:
        authority = self._authority
        if authority is None:
            return VehicleReport(autopilot=None, fault=UNKNOWN, takeoff_fault=UNKNOWN)
        battery = self._battery_percent
        return VehicleReport(
            autopilot=self._kind,
            fault=self._fault(authority, now_s),
            takeoff_fault=self._fault(authority, now_s, takeoff=True),
            standing=authority.standing.value,
            reason=authority.reason,
            order_id=authority.order_id,
            mode=authority.vehicle.mode_name,
            seen=authority.vehicle_seen(
                battery_percent=battery if now_s - self._battery_s <= BATTERY_AGE_S else None,
                wishes_sent=self._sent,
                wishes_refused=self._refused,
                ground_silent_s=self._ground_silent_s,
            ),
            wind_m_s=self._wind_m_s if now_s - self._wind_s <= WIND_AGE_S else None,
        )

    def _fault(
        self, authority: Authority, now_s: float, *, takeoff: bool = False
    ) -> str | None:
        """Why nothing, or no take-off, can be offered now."""
        fault = authority.fault(now_s, takeoff=takeoff)
        return self._link_fault if fault is None else f"{fault[0]}. {fault[1]}"

    def counters(self) -> dict[str, float]:
        """Counts with names for a health record."""
        counts = {} if self._authority is None else self._authority.counters
        return {
            "motion_orders_refused": self.refused_orders,
            "neighbours_refused": self.refused_neighbours,
            **self._fence.counters(),
            **{f"motion_{name}": float(count) for name, count in counts.items()},
        }


def _identity_request(system_id: int) -> dialect.CommandLong:
    """Ask which autopilot this is."""
    return dialect.CommandLong(
        target_system=system_id,
        target_component=1,
        command=dialect.MavCmd.REQUEST_MESSAGE,
        param1=float(dialect.AutopilotVersion.ID),
    )
