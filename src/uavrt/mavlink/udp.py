"""Links over UDP."""

import asyncio
from typing import Any

from uavrt.clock import monotonic_s
from uavrt.errors import LinkError
from uavrt.log import get_logger
from uavrt.mavlink.address import Address
from uavrt.mavlink.link import MAX_PENDING, RETRY_S, FrameHandler, Link

log = get_logger()

PEER_SILENCE_S = 30.0
"""A peer that is silent this long is not sent to any more."""
MAX_PEERS = 8


class UdpLink(Link, asyncio.DatagramProtocol):
    """UDP: ``udpin`` listens and answers whoever speaks, ``udpout`` speaks to one address."""

    def __init__(self, address: Address, on_frame: FrameHandler) -> None:
        super().__init__(address, on_frame)
        self._transport: Any = None  # a selector transport; its class is no DatagramTransport
        self._peers: dict[tuple[str, int], float] = {}
        self._closed = False

    async def open(self) -> None:
        """Bind or connect the socket."""
        place = (self.address.host, self.address.port)
        listen = self.address.kind == "udpin"
        loop = asyncio.get_running_loop()
        try:
            await loop.create_datagram_endpoint(
                lambda: self,
                local_addr=place if listen else None,
                remote_addr=None if listen else place,
            )
        except OSError as error:
            raise LinkError(
                f"{self.address}: {error.strerror or error}",
                remedy=f"Port {self.address.port} may be held by another program "
                "(`ss -ulpn` shows which), or the address is not of this computer",
            ) from error

    @property
    def local_port(self) -> int:
        """Port the socket is bound to, also where the system chose it."""
        assert self._transport is not None
        port: int = self._transport.get_extra_info("sockname")[1]
        return port

    async def close(self) -> None:
        """Close the socket."""
        self._closed = True
        if self._transport is not None:
            self._transport.close()
            await asyncio.sleep(0)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Asyncio's: the socket is there."""
        self._transport = transport

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Asyncio's: take a datagram; a frame never spans two."""
        if self.address.kind == "udpin":
            self._remember(addr[:2])
        self._parser.reset()
        self._take(data)

    def error_received(self, exc: Exception) -> None:
        """Asyncio's: the peer's port is closed, most likely not started yet."""
        log.debug("datagram refused", address=str(self.address), reason=str(exc))

    def connection_lost(self, exc: Exception | None) -> None:
        """Asyncio's: closed by us, or the network went away: open again."""
        self._transport = None
        if not self._closed:
            asyncio.get_running_loop().call_later(RETRY_S, self._reopen)

    def _reopen(self) -> None:
        if not self._closed:
            self._reconnects += 1
            self._reopening = asyncio.get_running_loop().create_task(self._try_open())

    async def _try_open(self) -> None:
        try:
            await self.open()
        except LinkError as error:
            log.warning("link still down", reason=str(error))
            asyncio.get_running_loop().call_later(RETRY_S, self._reopen)

    def _remember(self, peer: tuple[str, int]) -> None:
        now = monotonic_s()
        self._peers[peer] = now
        if len(self._peers) > 1:
            silent = [p for p, heard in self._peers.items() if now - heard > PEER_SILENCE_S]
            for old in silent:
                del self._peers[old]
        if len(self._peers) > MAX_PEERS:
            del self._peers[min(self._peers, key=self._peers.__getitem__)]

    def _write(self, frame: bytes) -> bool:
        transport = self._transport
        if transport is None or transport.get_write_buffer_size() > MAX_PENDING:
            return False
        if self.address.kind == "udpout":
            transport.sendto(frame)
            return True
        for peer in self._peers:
            transport.sendto(frame, peer)
        return bool(self._peers)
