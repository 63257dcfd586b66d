"""Addresses of MAVLink links, as written in ``uavrt.toml``."""

import re
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Literal
from urllib.parse import SplitResult, urlsplit

from uavrt.core.errors import ConfigError

LinkKind = Literal["udpin", "udpout", "tcp", "serial"]

NETWORK_KINDS: dict[str, LinkKind] = {"udpin": "udpin", "udpout": "udpout", "tcp": "tcp"}

DEFAULT_BAUD = 57_600
"""Default rate of PX4's and ArduPilot's telemetry ports [baud]."""

FORMS = (
    "Write the address as serial:///dev/ttyUSB0:57600, udpin://127.0.0.1:14540, "
    "udpout://HOST:PORT or tcp://HOST:PORT"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Address:
    """Address of one end of a MAVLink link: kind, and host with port or serial device."""

    kind: LinkKind
    host: str = ""
    port: int = 0
    device: str = ""
    baud: int = DEFAULT_BAUD

    def __str__(self) -> str:
        if self.kind == "serial":
            return f"serial://{self.device}:{self.baud}"
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.kind}://{host}:{self.port}"

    @property
    def is_loopback(self) -> bool:
        """True if only programs on this computer can be at the other end.

        >>> parse_address("udpin://127.0.0.1:14540").is_loopback
        True
        >>> parse_address("udpin://0.0.0.0:14540").is_loopback
        False
        """
        if self.kind == "serial":
            return False
        with suppress(ValueError):
            return ip_address(self.host).is_loopback
        return self.host == "localhost"


def parse_address(text: str, *, baud: int = DEFAULT_BAUD) -> Address:
    """Read an address: ``udpin://``, ``udpout://``, ``tcp://`` or ``serial://``.

    `baud`: rate of a serial port whose address has none. Raises `ConfigError` for other texts.

    >>> parse_address("udpin://127.0.0.1:14540").port
    14540
    >>> parse_address("serial:///dev/ttyAMA0:921600").baud
    921600
    >>> parse_address("serial://COM3").device
    'COM3'
    """
    try:
        parts = urlsplit(text)
        if parts.scheme == "serial":
            return _serial(parts, baud)
        kind = NETWORK_KINDS.get(parts.scheme)
        if kind is not None and parts.hostname and not parts.path:
            port = parts.port
            if port is not None and (port > 0 or kind == "udpin"):
                return Address(kind=kind, host=parts.hostname, port=port)
    except ValueError as error:
        raise ConfigError(f"{text!r} is not a link address: {error}", remedy=FORMS) from error
    raise ConfigError(f"{text!r} is not a link address", remedy=FORMS)


def _serial(parts: SplitResult, default_baud: int) -> Address:
    """Read ``serial:///dev/NAME[:BAUD]``, or ``serial://COM3[:BAUD]`` on Windows."""
    place = parts.netloc or parts.path
    device, separator, baud = place.rpartition(":")
    if not separator:
        device, baud = place, str(default_baud)
    windows = re.fullmatch(r"COM\d{1,3}", device) is not None and not parts.path
    known = windows or (device.startswith("/") and not parts.netloc)
    if not known or int(baud) <= 0:
        raise ValueError("a serial address needs a device path and a positive baud rate")
    return Address(kind="serial", device=device, baud=int(baud))
