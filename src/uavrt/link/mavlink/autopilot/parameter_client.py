"""Read and set an autopilot's parameters over a link of its own, for set-up on the ground."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Iterable

from uavrt.core.errors import LinkError
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.waiting import within
from uavrt.link.mavlink.dialect import (
    MavAutopilot,
    MavComponent,
    MavModeFlag,
    MavParamType,
    MavType,
)
from uavrt.link.mavlink.discovery import Peer, own_heartbeat
from uavrt.link.mavlink.frame import Frame, FrameWriter
from uavrt.link.mavlink.links.address import Address
from uavrt.link.mavlink.links.mavlink_link import Link
from uavrt.link.mavlink.links.transport import open_link
from uavrt.link.mavlink.message import Message
from uavrt.link.mavlink.services.parameter_service import decode_value, encode_value

HEARTBEAT_S = 1.0
ANSWER_S = 0.7
"""Longest wait for the autopilot's answer [s]; a full send queue at 57 600 baud empties within
this time."""
TRIES = 4
REQUEST_GAP_S = 0.03
OWN_COMPONENT = 191


class ParameterClient:
    """Client of the autopilot's parameters; open it with `connected`."""

    def __init__(self) -> None:
        self.autopilot: Peer | None = None
        self.kind = int(MavAutopilot.GENERIC)
        self.armed = False
        self._link: Link | None = None
        self._writer = FrameWriter(1, OWN_COMPONENT)
        self._there = asyncio.Event()
        self._types: dict[str, int] = {}
        self._values: dict[str, float] = {}
        self._waiting: tuple[str, asyncio.Future[float]] | None = None

    @classmethod
    @contextlib.asynccontextmanager
    async def connected(
        cls, address: str | Address, timeout_s: float
    ) -> AsyncIterator["ParameterClient"]:
        """Open the link and wait for the autopilot; raises `LinkError` if that fails."""
        client = cls()
        client._link = await open_link(address, client._receive)
        beating = asyncio.create_task(client._send_heartbeat())
        try:
            if not await within(timeout_s, client._there.wait()):
                raise LinkError(
                    f"no message from an autopilot arrived at {address} in {timeout_s:.0f} s",
                    remedy="Check wiring and baud rate; USB always works: "
                    "--mavlink serial:///dev/ttyACM0:57600",
                )
            yield client
        finally:
            beating.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await beating
            await client._link.close()

    @property
    def bytewise(self) -> bool:
        """True if parameter messages hold the bytes of integers (PX4), not float values."""
        return self.kind != MavAutopilot.ARDUPILOTMEGA

    async def read(self, names: Iterable[str]) -> dict[str, float | None]:
        """Read parameters by name; None for those without an answer, such as unknown names."""
        assert self.autopilot is not None
        values: dict[str, float | None] = dict.fromkeys(names)
        for _ in range(TRIES):
            missing = [name for name, value in values.items() if value is None]
            for name in missing:
                address = self.autopilot.address
                self._send(dialect.ParamRequestRead(**address, param_id=name, param_index=-1))
                await asyncio.sleep(REQUEST_GAP_S)
            if missing:
                await asyncio.sleep(ANSWER_S)
            values.update({name: self._values.get(name) for name in missing})
        return values

    async def write(self, name: str, value: float) -> float | None:
        """Set a parameter that was read before, and return its new value; None if the autopilot
        does not answer.
        """
        assert self.autopilot is not None
        kind = self._types.get(name, MavParamType.REAL32)
        request = dialect.ParamSet(
            **self.autopilot.address,
            param_id=name,
            param_value=encode_value(value, kind, self.bytewise),
            param_type=kind,
        )
        for _ in range(TRIES):
            answer: asyncio.Future[float] = asyncio.get_running_loop().create_future()
            self._waiting = (name, answer)
            self._send(request)
            if (value_now := await within(ANSWER_S, answer)) is not None:
                return value_now
        return None

    async def _send_heartbeat(self) -> None:
        """Send a heartbeat, so that the autopilot learns this side's address."""
        while True:
            self._send(own_heartbeat(MavType.ONBOARD_CONTROLLER))
            await asyncio.sleep(HEARTBEAT_S)

    def _receive(self, frame: Frame) -> None:
        if frame.component_id != MavComponent.COMP_ID_AUTOPILOT1:
            return
        peer = Peer(frame.system_id, frame.component_id)
        message = frame.message()
        if isinstance(message, dialect.Heartbeat) and self.autopilot in (None, peer):
            self.autopilot, self.kind = peer, message.autopilot
            self.armed = bool(message.base_mode & MavModeFlag.SAFETY_ARMED)
            self._writer.system_id = peer.system_id
            self._there.set()
        elif isinstance(message, dialect.ParamValue) and peer == self.autopilot:
            self._take(message)

    def _take(self, message: dialect.ParamValue) -> None:
        self._types[message.param_id] = message.param_type
        value = decode_value(message.param_value, message.param_type, self.bytewise)
        if value is None:
            return
        self._values[message.param_id] = value
        if self._waiting is not None:
            name, future = self._waiting
            if name == message.param_id and not future.done():
                future.set_result(value)

    def _send(self, message: Message) -> None:
        if self._link is not None:
            self._link.send(self._writer.encode(message))
