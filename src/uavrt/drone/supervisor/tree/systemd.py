"""Report to systemd that the system is ready and alive (sd_notify(3))."""

import contextlib
import os
import socket


class SystemdNotifier:
    """Sends state messages to the socket in the environment variable that systemd has set."""

    def __init__(self) -> None:
        address = os.environ.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._sock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) if address else None
        self.watchdog_s = _watchdog_s()
        """Longest allowed time between calls of `alive` [s]; None without a watchdog."""

    def ready(self) -> None:
        """Report that the start is complete."""
        self._send("READY=1")

    def alive(self, status: str) -> None:
        """Report the system's state, which also shows that the main loop runs."""
        self._send(f"WATCHDOG=1\nSTATUS={status}")

    def stopping(self) -> None:
        """Report that the system is stopping."""
        self._send("STOPPING=1")

    def close(self) -> None:
        """Close the socket to systemd."""
        if self._sock is not None:
            self._sock.close()

    def _send(self, state: str) -> None:
        if self._sock is not None:
            with contextlib.suppress(OSError):
                self._sock.sendto(state.encode(), socket.MSG_DONTWAIT, self._address)


def _watchdog_s() -> float | None:
    """Return half of systemd's watchdog time [s]; None if no watchdog is set."""
    microseconds = os.environ.get("WATCHDOG_USEC", "")
    pid = os.environ.get("WATCHDOG_PID", str(os.getpid()))
    if not microseconds.isdigit() or pid != str(os.getpid()):
        return None
    return int(microseconds) / 2e6
