"""Opening of links."""

from uavrt.mavlink.address import Address, parse_address
from uavrt.mavlink.link import FrameHandler, Link
from uavrt.mavlink.stream import SerialLink, TcpLink
from uavrt.mavlink.udp import UdpLink


async def open_link(address: str | Address, on_frame: FrameHandler) -> Link:
    """Open a link.

    Parameters
    ----------
    address : str or Address
        ``udpin://``, ``udpout://``, ``tcp://`` or ``serial://``, see `uavrt.mavlink.address`.
    on_frame : callable
        Called with each received frame, in the loop's thread.

    Raises
    ------
    ConfigError
        The address is none.
    LinkError
        It cannot be opened; the text says why and what to do.
    """
    where = parse_address(address) if isinstance(address, str) else address
    link: Link
    match where.kind:
        case "serial":
            link = SerialLink(where, on_frame)
        case "tcp":
            link = TcpLink(where, on_frame)
        case "udpin" | "udpout":
            link = UdpLink(where, on_frame)
    await link.open()
    return link
