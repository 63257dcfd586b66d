"""Open links from their addresses, and keep them open."""

import asyncio
from collections.abc import Callable
from typing import Any, NoReturn

from uavrt.core.errors import UavrtError
from uavrt.link.mavlink.links.address import Address, parse_address
from uavrt.link.mavlink.links.mavlink_link import Link, Parser
from uavrt.link.mavlink.links.stream_links import SerialLink, TcpLink
from uavrt.link.mavlink.links.udp import UdpLink

OPEN_AGAIN_S = 3.0


async def open_link(
    address: str | Address, on_frame: Callable[[Any], None], parser: Parser | None = None
) -> Link:
    """Open the link of an address; raises `ConfigError` for a wrong one, else `LinkError`."""
    where = parse_address(address) if isinstance(address, str) else address
    link: Link
    match where.kind:
        case "serial":
            link = SerialLink(where, on_frame, parser)
        case "tcp":
            link = TcpLink(where, on_frame, parser)
        case "udpin" | "udpout":
            link = UdpLink(where, on_frame, parser)
    await link.open()
    return link


async def keep_open(
    address: Address,
    take: Callable[[Any], None],
    parser: Parser,
    *,
    opened: Callable[[Link | None], None],
    failed: Callable[[UavrtError], None],
) -> NoReturn:
    """Open a link, retrying until it opens, and pass its frames to `take` until cancelled."""
    link = None
    try:
        while link is None:
            try:
                link = await open_link(address, take, parser)
            except UavrtError as error:
                failed(error)
                await asyncio.sleep(OPEN_AGAIN_S)
        opened(link)
        await asyncio.get_running_loop().create_future()
        raise AssertionError
    finally:
        opened(None)
        if link is not None:
            await link.close()
