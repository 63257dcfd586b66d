"""A QGroundControl without plug-in, as pymavlink stands in for it."""

import asyncio
import contextlib
import struct
from collections.abc import AsyncIterator, Callable
from typing import Any

from until import until_async as until


class StockStation(asyncio.DatagramProtocol):
    """System 255, component 190, of type GCS: MAVLink's common dialect and nothing of ours."""

    def __init__(self) -> None:
        from pymavlink.dialects.v20 import common

        self.common = common
        self.mav = common.MAVLink(None, srcSystem=255, srcComponent=190)
        self.mav.robust_parsing = True
        self.heard: list[Any] = []
        """Messages of component 191."""
        self.vehicle: Any = None
        self._transport: Any = None

    def connection_made(self, transport: Any) -> None:
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self.vehicle = addr
        self.heard += [
            message
            for message in self.mav.parse_buffer(data) or []
            if message.get_srcComponent() == 191
        ]

    async def live(self) -> None:
        while True:
            if self.vehicle is not None:
                self.say(self.common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
            await asyncio.sleep(0.2)

    def say(self, message: Any) -> None:
        self._transport.sendto(message.pack(self.mav), self.vehicle)

    def of(self, kind: str) -> list[Any]:
        return [message for message in self.heard if message.get_type() == kind]

    def values(self, since: int = 0) -> list[tuple[str, float]]:
        """Parameters told, as PX4 encodes them: the bytes of whole numbers in a float."""
        return [
            (
                message.param_id,
                struct.unpack(
                    "<i" if message.param_type == 6 else "<f",
                    struct.pack("<f", message.param_value),
                )[0],
            )
            for message in self.heard[since:]
            if message.get_type() == "PARAM_VALUE"
        ]

    @property
    def texts(self) -> list[str]:
        return [message.text for message in self.of("STATUSTEXT")]


def bytewise(value: int) -> float:
    """Write a whole number as PX4 has it: its bytes in a float."""
    number: float = struct.unpack("<f", struct.pack("<i", value))[0]
    return number


@contextlib.asynccontextmanager
async def stock_station(
    port: int, is_known: Callable[[], object]
) -> AsyncIterator[StockStation]:
    """Listen on a port until the drone sends to it, and until the drone knows of it."""
    station = StockStation()
    transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
        lambda: station, local_addr=("127.0.0.1", port)
    )
    living = asyncio.create_task(station.live())
    try:
        await until(lambda: station.of("HEARTBEAT"))
        await until(is_known)
        yield station
    finally:
        living.cancel()
        await asyncio.gather(living, return_exceptions=True)
        transport.close()
