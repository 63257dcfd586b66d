"""Addresses and access point by which another screen opens the page, as QR codes."""

import socket
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import segno
from starlette.datastructures import URL

LOOPBACK = ("127.0.0.1", "::1", "localhost")
WILDCARD = ("0.0.0.0", "::")
UNROUTED = ("192.0.2.1", 9)
"""Address for documentation (RFC 5737): no packet is sent, but the system then reports which of
our addresses it would use."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Served:
    """How the page is served."""

    host: str
    """Address that the server listens on."""
    names: frozenset[str]
    """Host names of this computer."""
    access_point: str | None
    """Text of its own Wi-Fi's QR code."""


def doors(served: Served, asked: URL) -> list[dict[str, Any]]:
    """List how others can open the page: kind, text, and a QR code for a phone's camera.

    None if the page is served to this computer only.
    """
    if served.host in LOOPBACK:
        return []
    found = [("page", address) for address in addresses(served, asked)]
    if served.access_point is not None:
        found.insert(0, ("access point", served.access_point))
    return [{"what": what, "text": text, "picture": picture(text)} for what, text in found]


def addresses(served: Served, asked: URL) -> list[str]:
    """Get the addresses at which other computers reach the page."""
    names = sorted(served.names)
    if not names and asked.hostname and asked.hostname not in LOOPBACK:
        names = [asked.hostname]
    if not names:
        names = [served.host] if served.host not in WILDCARD else own_address()
    port = f":{asked.port}" if asked.port else ""
    return [f"{asked.scheme}://{f'[{name}]' if ':' in name else name}{port}/" for name in names]


def own_address() -> list[str]:
    """Get this computer's address in its network; None without one."""
    with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(UNROUTED)
        return [str(sock.getsockname()[0])]
    return []


def picture(text: str) -> str:
    """Draw a QR code (ISO/IEC 18004) as a data URI; dark on white in any theme."""
    code = segno.make(text, micro=False, error="m")
    return code.svg_data_uri(scale=4, border=4, light="#fff", dark="#000")
