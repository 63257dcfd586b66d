"""The serial ports of this computer."""

from typing import Any


def serial_ports() -> list[dict[str, Any]]:
    """List the serial ports (COM on Windows, tty elsewhere) with their descriptions."""
    from serial.tools import list_ports

    found = []
    for port in sorted(list_ports.comports()):
        words = [port.description] if port.description not in (None, "n/a") else []
        found.append(
            {
                "device": port.device,
                "description": " ".join(words),
                "address": f"serial://{port.device}:57600",
            }
        )
    return found
