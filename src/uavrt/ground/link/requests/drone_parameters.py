"""List and set the drone's parameters by MAVLink; with a key, requests are authenticated."""

import asyncio
import math
from collections import defaultdict
from collections.abc import Callable
from contextlib import suppress

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import CommandRefused, LinkError
from uavrt.ground.link.protocol import GroundProtocol
from uavrt.ground.link.vehicles.vehicle_identity import DRONE_COMPONENT
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.waiting import within
from uavrt.link.mavlink.dialect import MavParamType, MavProtocolCapability
from uavrt.link.mavlink.discovery import Peer, request_message
from uavrt.link.mavlink.frame import Frame
from uavrt.link.mavlink.message import Message
from uavrt.link.mavlink.services.parameter_service import decode_value

TRIES = 5
QUIET_S = 0.5
"""Time without a parameter value after which missing parameters are requested again [s]; values
arrive 20 ms apart."""


class DroneParameters:
    """Lists and sets the drone's parameters by the MAVLink parameter protocol."""

    def __init__(
        self,
        protocol: GroundProtocol,
        send: Callable[[Message], None],
        answer_wait_s: float = 2.0,
    ) -> None:
        self._protocol, self._send = protocol, send
        self._wait_s = answer_wait_s
        self._raw: dict[str, tuple[float, int]] = {}
        self._indices: set[int] = set()
        self._count: int | None = None
        self._bytewise: bool | None = None
        self._heard_s = 0.0
        self._news = asyncio.Event()
        self._awaited: dict[str, asyncio.Future[bool]] = {}
        self._setting: defaultdict[str, asyncio.Lock] = defaultdict(asyncio.Lock)

    def receive(self, frame: Frame) -> None:
        """Read parameter values and capability bits from a received frame."""
        if frame.component_id != DRONE_COMPONENT:
            return
        match frame.message():
            case dialect.ParamValue() as value:
                self._raw[value.param_id] = (value.param_value, value.param_type)
                self._indices.add(value.param_index)
                self._count = value.param_count
                if (answer := self._awaited.pop(value.param_id, None)) and not answer.done():
                    answer.set_result(True)
            case dialect.AutopilotVersion() as version:
                flag = MavProtocolCapability.PARAM_ENCODE_BYTEWISE
                self._bytewise = bool(version.capabilities & flag)
            case _:
                return
        self._heard_s = monotonic_s()
        self._news.set()

    async def list_all(self) -> dict[str, float]:
        """Return the values of all parameters by name; raises `LinkError`."""
        drone = self._drone()
        await self._learn_encoding(drone)
        self._raw.clear()
        self._indices.clear()
        self._count = None
        for _ in range(TRIES):
            with suppress(LinkError):  # its session comes within a second
                for message in self._missing(drone):
                    self._send(message)
            await self._quiet()
            if self._count is not None and len(self._indices) >= self._count:
                return {name: self._value(name) for name in self._raw}
        raise LinkError("the drone's parameters did not arrive", remedy="Try again")

    async def set(self, name: str, value: float) -> float:
        """Set a parameter; return its value. Raises `CommandRefused` if it did not change."""
        drone = self._drone()
        await self._learn_encoding(drone)
        async with self._setting[name]:
            return await self._set(name, value, drone)

    async def _set(self, name: str, value: float, drone: Peer) -> float:
        for _ in range(TRIES):
            answer = self._awaited[name] = asyncio.get_running_loop().create_future()
            # Sealed for each try: a drone takes no seal twice.
            with suppress(LinkError):  # its session comes within a second
                self._send(self._set_parameter(name, value, drone))
            if await within(self._wait_s, answer):
                now = self._value(name)
                if abs(now - value) > 1e-6 * abs(value):
                    raise CommandRefused(
                        f"{name} is still {now:g}; the drone's status text gives the reason"
                    )
                return now
        raise LinkError(f"the drone did not confirm the parameter {name}", remedy="Try again")

    def _set_parameter(self, name: str, value: float, drone: Peer) -> Message:
        return self._protocol.sealed_parameter(name, value) or dialect.ParamSet(
            **drone.address,
            param_id=name,
            param_value=value,
            # Whole numbers, too: of this type they need no encoding.
            param_type=MavParamType.REAL32,
        )

    def _drone(self) -> Peer:
        if self._protocol.drone is None:
            raise LinkError(
                "no contact with the drone yet", remedy="Check the drone's power and radio"
            )
        return self._protocol.drone

    def _missing(self, drone: Peer) -> list[Message]:
        """Requests for the parameters that have not arrived; authenticated if a key is set."""
        sealed = self._protocol.sealed_parameter
        if self._count is None:
            return [sealed("", math.nan) or dialect.ParamRequestList(**drone.address)]
        return [
            sealed("", index)
            or dialect.ParamRequestRead(**drone.address, param_id="", param_index=index)
            for index in range(self._count)
            if index not in self._indices
        ]

    async def _learn_encoding(self, drone: Peer) -> None:
        """Request the autopilot's capability bits once; they show how integers are encoded."""
        for _ in range(TRIES):
            if self._bytewise is not None:
                return
            self._send(request_message(drone, dialect.AutopilotVersion.ID))
            await self._wait_for_news(self._wait_s)
        raise LinkError(
            "the drone's autopilot has not reported its capabilities", remedy="Try again"
        )

    async def _quiet(self) -> None:
        """Wait until the drone's parameter values stop arriving after the first one."""
        await self._wait_for_news(self._wait_s)
        heard_s = 0.0
        while heard_s != self._heard_s:
            heard_s = self._heard_s
            await self._wait_for_news(QUIET_S)

    async def _wait_for_news(self, timeout_s: float) -> None:
        self._news.clear()
        await within(timeout_s, self._news.wait())

    def _value(self, name: str) -> float:
        field, kind = self._raw[name]
        value = decode_value(field, kind, bool(self._bytewise))
        return float("nan") if value is None else value
