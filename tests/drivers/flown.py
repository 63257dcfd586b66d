"""A drone in the air with our authority and pilot on board, in virtual time, without wires."""

import math
import random
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import made

from uavrt.core.errors import CommandRefused, PlanError
from uavrt.core.messages import VehicleReport
from uavrt.guidance.autopilot_behaviour import BEHAVIOURS
from uavrt.guidance.control.authority import Authority, ControlStage
from uavrt.guidance.control.vehicle_commands import CommandWriter
from uavrt.guidance.energy_learning import EnergyLearning
from uavrt.guidance.operator_orders import Limits, Order, VehicleNow
from uavrt.guidance.order_execution import OrderExecution
from uavrt.guidance.plans import plan_of
from uavrt.guidance.vehicle_reports import now_of
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.vehicle_messages import command_message, observations, wind_of
from uavrt.link.mavlink.message import Message
from uavrt.simulation.scene.geometry import TangentPlane
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.simulated_flying import DO_PAUSE_CONTINUE, MODES, FlyingVehicle
from uavrt.simulation.vehicle.vehicle_telemetry import (
    home_message,
    landed_message,
    position_message,
    target_message,
    wind_message,
)

STEP_S = 0.05
Through = Callable[[float, Iterable[Message]], Iterable[Message]]
"""A link: what arrives at a time, of what is told then."""
HOME = TangentPlane(latitude_deg=47.1, longitude_deg=8.5, altitude_amsl_m=430.0)
METRES_PER_DEGREE = 111_195.0
CENTRED = (1500, 1500, 1400, 1500)


class Flown:
    """The drone; `commands` holds the time and message of everything that we sent it."""

    def __init__(
        self,
        flavour: Flavour,
        *,
        sticks: bool = False,
        frame: Frame | None = None,
        limits: Limits | None = None,
        phase_s: float = 0.0,
        loss: float = 0.0,
        seed: int = 1,
        on_ground: bool = False,
        may_take_off: bool = True,
        unwatched_channels: frozenset[int] = frozenset(),
    ) -> None:
        self.loss, self.lost, self.rng = loss, 0, random.Random(seed)
        self.vehicle = FlyingVehicle(
            flavour, HOME, frame or Frame(), height_m=0.0 if on_ground else 40.0
        )
        self.vehicle.body.elapsed_s = phase_s
        self.flavour = flavour
        self.limits = limits or Limits(battery_wh=120.0)
        self.authority = Authority(
            CommandWriter(behaviour=BEHAVIOURS[flavour], farthest_m=self.limits.fence_m),
            may_take_off=may_take_off,
            unwatched_channels=unwatched_channels,
        )
        self.through: Through = lambda _, told: told
        self.each_step: Callable[[], None] = lambda: None
        self.execution: OrderExecution | None = None
        self.lessons = EnergyLearning(self.limits.hover_w, self.limits.battery_wh)
        self.wind_m_s: tuple[float, float] | None = None
        """As told."""
        self.time_s = 100.0
        self.steps = 0
        self.commands: list[tuple[float, Any]] = []
        self.sent = self.refused = 0
        self.channels: tuple[int, ...] = CENTRED if sticks else ()
        self.switches: tuple[int, ...] = ()
        """Channels from 5 on."""
        self.sticks_every = 4
        """Steps."""
        self.home_north_m = self.home_up_m = 0.0
        self.jump_m = 0.0
        self.boot_s = 50.0
        self.failsafe = ""
        self.position = self.mode_told = self.alive = True
        self.position_told = self.target_told = self.heartbeat_told = True
        self.status_told = self.landed_told = self.wind_told = True
        self.kind = 2  # MAV_TYPE_QUADROTOR
        self.ground_silent_s = 0.0
        self.out_s: float | None = None
        self.next_id = 0
        self.run(1.2)

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.step()
            if until():
                return

    def step(self) -> None:
        self.steps += 1
        self.time_s += STEP_S
        self.boot_s += STEP_S
        self.vehicle.advance(STEP_S)
        self.control()
        self.each_step()

    def control(self) -> None:
        """What the drone side does in a step."""
        for message in self.through(self.time_s, self.telemetry()):
            self.wind_m_s = wind_of(message) or self.wind_m_s
            for seen in observations(message, self.time_s):
                self.authority.observe(seen)
        self.authority.tick(self.time_s)
        if self.out_s is None and self.began and self.authority.standing is ControlStage.OUT:
            self.out_s = self.time_s
        if self.alive:
            self.authority.planner_alive(self.time_s)
            self.request_motion()

    @property
    def began(self) -> bool:
        return bool(self.commands)

    def request_motion(self) -> None:
        now = self.now()
        if self.execution is None or now is None:
            return
        manoeuvre = self.execution.next(now)
        if self.execution.ended is not None:
            self.authority.stop(self.time_s, self.execution.ended)
        if manoeuvre is None:
            return
        try:
            command = self.authority.command(
                self.execution.order.order_id, manoeuvre, self.time_s
            )
        except CommandRefused:
            self.refused += 1
            return
        self.sent += 1
        message: Any = command_message(command, 1)
        self.commands.append((self.time_s, message))
        if self.rng.random() < self.loss:
            self.lost += 1
        else:
            self.vehicle.command(message)

    def now(self) -> VehicleNow | None:
        """As the guide sees it; the battery in whole percents, as SYS_STATUS tells it."""
        seen = self.authority.vehicle_seen(
            battery_percent=round(self.vehicle.body.battery_percent)
            if self.status_told
            else None,
            requests_sent=self.sent,
            requests_refused=self.refused,
            ground_silent_s=self.ground_silent_s,
        )
        report = VehicleReport(
            autopilot=self.flavour,
            fault=None,
            standing=self.authority.standing.value,
            order_id=self.authority.order_id,
            seen=seen,
            wind_m_s=self.wind_m_s,
        )
        now = now_of(report, self.time_s)
        return None if now is None else self.lessons.learn(now)

    def order(self, action: Any, **values: Any) -> OrderExecution:
        """Ask for a motion and confirm it."""
        self.next_id += 1
        order = Order(order_id=self.next_id, action=action, **values)
        now = self.now()
        if now is None:
            raise PlanError("no position")
        plan = plan_of(order, now, self.limits, BEHAVIOURS[self.flavour])
        self.confirm(order)
        self.execution = OrderExecution(order, plan, self.limits)
        return self.execution

    def confirm(self, order: Order) -> None:
        """Offer an order, and confirm it at once."""
        nonce = nonce_of(order.order_id)
        taking_off = order.action == "takeoff"
        self.authority.offer(order.order_id, nonce, self.time_s, takeoff=taking_off)
        self.authority.confirm(
            order.order_id, nonce, self.time_s, sticks_unseen=not self.channels
        )
        self.sent = self.refused = 0

    def place(self, north_m: float, east_m: float) -> tuple[float, float]:
        return HOME.to_geodetic(north_m, east_m)

    # ------------------------------------------------------------------ what it tells

    def telemetry(self) -> Iterator[Message]:
        px4, boot_ms = self.flavour == "px4", max(0, round(self.boot_s * 1e3))
        if self.steps % 2 == 0:
            if self.position_told:
                yield self._position(boot_ms)
            target = target_message(self.vehicle, boot_ms)
            if target is not None and self.target_told:
                yield target
        if self.steps % self.sticks_every == 1 and self.channels:
            yield self._sticks(boot_ms)
        if self.mode_told and self.heartbeat_told and self.steps % (20 if px4 else 2) == 0:
            yield self._heartbeat()
        if self.mode_told and px4 and self.steps % 10 == 5:
            mode = self.vehicle.mode
            yield dialect.CurrentMode(custom_mode=mode, intended_custom_mode=mode)
        if self.status_told and self.steps % 10 == 3:
            yield self._status()
        if self.steps % 20 == 7:
            yield self._home()
        if self.wind_told and self.steps % 100 == 9:
            yield wind_message(self.vehicle, boot_ms)
        if self.landed_told and self.steps % 10 == 8:
            yield landed_message(self.vehicle)

    def _position(self, boot_ms: int) -> Message:
        message = position_message(self.vehicle, boot_ms)
        if not self.position:
            message.lat = message.lon = 0
        message.alt += round(self.jump_m * 1e3)
        message.relative_alt += round((self.jump_m - self.home_up_m) * 1e3)
        return message

    def _sticks(self, boot_ms: int) -> Message:
        unused = {f"chan{n}_raw": 65_535 for n in range(5, 19)}
        unused |= {f"chan{n}_raw": one for n, one in enumerate(self.switches, 5)}
        return dialect.RcChannels(
            time_boot_ms=boot_ms,
            chancount=max(8, 4 + len(self.switches)),
            chan1_raw=self.channels[0],
            chan2_raw=self.channels[1],
            chan3_raw=self.channels[2],
            chan4_raw=self.channels[3],
            rssi=200,
            **unused,
        )

    def _heartbeat(self) -> Message:
        armed = dialect.MavModeFlag.SAFETY_ARMED if self.vehicle.armed else 0
        state = dialect.MavState
        return made.heartbeat(
            type=self.kind,
            autopilot=12 if self.flavour == "px4" else 3,
            base_mode=1 | armed,
            custom_mode=self.vehicle.mode,
            system_status=state.CRITICAL if self.failsafe == "heartbeat" else state.ACTIVE,
        )

    def _status(self) -> Message:
        bits = {"fence": 1 << 20, "battery": 1 << 25}
        ill = bits.get(self.failsafe, 0)
        return dialect.SysStatus(
            onboard_control_sensors_present=ill,
            onboard_control_sensors_enabled=ill,
            load=300,
            voltage_battery=16_000,
            current_battery=-1,
            battery_remaining=round(self.vehicle.body.battery_percent),
        )

    def _home(self) -> Message:
        message = home_message(self.vehicle)
        message.latitude += round(self.home_north_m / METRES_PER_DEGREE * 1e7)
        message.altitude += round(self.home_up_m * 1e3)
        return message

    # ----------------------------------------------------- QGroundControl beside us

    def _reposition(self, **values: Any) -> None:
        self.vehicle.command(made.reposition(**values))

    def pause(self) -> None:
        if self.flavour == "px4":
            self._reposition()
        else:
            self.vehicle.set_mode(MODES["ardupilot"]["brake"])

    def pause_by_193(self) -> None:
        """Mission Planner's pause."""
        self.vehicle.command(made.command_long(DO_PAUSE_CONTINUE))

    def go_to(self, north_m: float, east_m: float) -> None:
        latitude, longitude = self.place(north_m, east_m)
        z = HOME.altitude_amsl_m + self.vehicle.body.shown_height_m
        self._reposition(x=round(latitude * 1e7), y=round(longitude * 1e7), z=z)

    def change_height(self, by_m: float) -> None:
        height = self.vehicle.body.shown_height_m + by_m
        if self.flavour == "px4":
            self._reposition(z=HOME.altitude_amsl_m + height)
        else:  # by SET_POSITION_TARGET_LOCAL_NED
            latitude, longitude = self.vehicle.latitude_longitude()
            self._reposition(
                x=round(latitude * 1e7),
                y=round(longitude * 1e7),
                z=HOME.altitude_amsl_m + height,
            )

    def change_heading(self, by_deg: float) -> None:
        wanted = (self.vehicle.heading.yaw_deg + by_deg) % 360.0
        if self.flavour == "px4":
            self._reposition(param4=math.radians(wanted))
        else:
            self.vehicle.heading.turn(by_deg, 40.0)


def nonce_of(order_id: int) -> int:
    """That an order is offered with."""
    return random.Random(order_id).getrandbits(32)
