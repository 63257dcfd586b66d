"""QR codes with the page's address and the Wi-Fi, for opening the page on another device."""

import socket
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import segno
from starlette.datastructures import URL

LOOPBACK = ("127.0.0.1", "::1", "localhost")
WILDCARD = ("0.0.0.0", "::")
UNROUTED = ("192.0.2.1", 9)
"""Address for documentation (RFC 5737). A socket connected to it sends no packet, but shows
which of our own addresses the system would use."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Served:
    """Addresses, port and Wi-Fi under which the page is served."""

    host: str
    """Address on which the server listens."""
    names: frozenset[str]
    """Host names of this computer, accepted in requests."""
    access_point: str | None
    """Text of the QR code by which a phone joins this computer's Wi-Fi; None without one."""


def access_list(served: Served, asked: URL) -> list[dict[str, Any]]:
    """List address and Wi-Fi for other devices: kind, text and QR code; empty if closed."""
    if served.host in LOOPBACK:
        return []
    found = [("page", address) for address in addresses(served, asked)]
    if served.access_point is not None:
        found.insert(0, ("access point", served.access_point))
    return [{"what": what, "text": text, "picture": picture(text)} for what, text in found]


def addresses(served: Served, asked: URL) -> list[str]:
    """Addresses by which other computers reach the page."""
    names = sorted(served.names)
    if not names and asked.hostname and asked.hostname not in LOOPBACK:
        names = [asked.hostname]
    if not names:
        names = [served.host] if served.host not in WILDCARD else own_address()
    port = f":{asked.port}" if asked.port else ""
    return [f"{asked.scheme}://{f'[{name}]' if ':' in name else name}{port}/" for name in names]


def own_address() -> list[str]:
    """Address of this computer in its network; empty without a network."""
    with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(UNROUTED)
        return [str(sock.getsockname()[0])]
    return []


def picture(text: str) -> str:
    """Draw a QR code (ISO/IEC 18004) as a data URI, dark on white in any theme."""
    code = segno.make(text, micro=False, error="m")
    return code.svg_data_uri(scale=4, border=4, light="#fff", dark="#000")
