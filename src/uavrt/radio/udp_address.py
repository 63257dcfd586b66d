"""Parse UDP addresses that the user enters, and open sockets with large buffers."""

import errno
import socket
from typing import Any, Final

from uavrt.core.errors import ConfigError, RadioError, os_errors_as

BUFFER_BYTES: Final = 4 * 1024 * 1024
"""Size of the buffer that is requested for each socket [bytes]: 1.4 s of a band of 375 kS/s, or
minutes of one channel. The system limits it to /proc/sys/net/core/rmem_max."""

_OTHER_PORT: Final = "End the other program that listens there, or choose another port"
_REMEDIES: Final = {
    errno.EADDRNOTAVAIL: "Give an address of this computer: 127.0.0.1, or 0.0.0.0 for all",
    errno.EACCES: "Choose a port from 1024 on",
}
_PREFIX: Final = "udp://"


def is_udp_address(text: str) -> bool:
    """True if a text has the form ``udp://HOST:PORT``."""
    return text.startswith(_PREFIX)


def parse_udp_address(text: str) -> tuple[str, int]:
    """Split ``udp://HOST:PORT`` or ``HOST:PORT`` into host and port.

    An IPv6 address is written in brackets. Raises `ConfigError` for an invalid address.
    """
    host, colon, port = text.removeprefix(_PREFIX).rstrip("/").rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not (colon and host and port.isascii() and port.isdigit() and 0 < int(port) < 65_536):
        raise ConfigError(
            f"{text!r} is not a UDP address", remedy="Write the address as 127.0.0.1:20000"
        )
    return host, int(port)


def listen(host: str, port: int) -> list[socket.socket]:
    """Open a receiving socket for each address of a host name.

    ``localhost`` has two addresses: the sender (netcat) may use ``::1`` and this program
    127.0.0.1. Datagrams to an address without a socket would be lost.
    """
    places = set(_host_addresses(host, port))
    if host == "localhost":
        places |= {
            (socket.AF_INET, ("127.0.0.1", port)),
            (socket.AF_INET6, ("::1", port, 0, 0)),
        }
    sockets: list[socket.socket] = []
    fault: OSError | None = None
    for family, address in sorted(places, key=str):
        try:
            sock = socket.socket(family, socket.SOCK_DGRAM)
        except OSError:
            continue  # a kernel without IPv6
        try:
            if family == socket.AF_INET6:
                sock.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
            sock.setblocking(False)
            sock.bind(address)
        except OSError as error:
            sock.close()
            if family == socket.AF_INET or fault is None:
                fault = error
            continue
        sockets.append(sock)
    # With "localhost" the other family may be off; an IPv4 port in use is still a fault.
    in_use = fault is not None and fault.errno == errno.EADDRINUSE
    if not sockets or in_use:
        for sock in sockets:
            sock.close()
        raise RadioError(
            f"cannot listen to UDP {host}:{port}: "
            f"{fault.strerror if fault is not None else 'no such address'}",
            remedy=_REMEDIES.get(
                0 if fault is None or fault.errno is None else fault.errno, _OTHER_PORT
            ),
        )
    return sockets


def send_socket(host: str) -> socket.socket:
    """Open a non-blocking socket for sending; raises `RadioError` if the host is unknown."""
    sock = socket.socket(_host_addresses(host, 0)[0][0], socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
    sock.setblocking(False)
    return sock


def _host_addresses(host: str, port: int) -> list[tuple[socket.AddressFamily, Any]]:
    with os_errors_as(
        RadioError, f"no address {host}", "Check the name, or give the IP address"
    ):
        found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
    return [(family, address) for family, _, _, _, address in found]
