"""Decide which ground station may command: the first one, until it is silent for a minute.

Anyone can send to a telemetry radio. The first station that sends a command stays in command
from its tag upload to the flight's end. Another station takes over only by a sealed
(authenticated) command, which proves that it has the drone's key, or after `SILENCE_S`. Senders
choose their own names, so this prevents mistakes, not an attack (docs/how-to/lock-the-link.md).
"""

from collections.abc import Callable

from uavrt.core.clock import monotonic_s
from uavrt.core.commands import COMMANDS, PermittedSender
from uavrt.core.messages import Command

SILENCE_S = 60.0
"""Silence of the station in command after which another station may take over [s]; a restart
takes less."""
OWN_SOURCES = ("capture", "command line")
"""Command sources on the drone itself: the supervisor and the program that started it."""


class CommandingStation:
    """Decides who may command and remembers the station in command.

    Unless `pinned`, every station may command.
    """

    def __init__(
        self,
        *,
        pinned: bool = True,
        clock_s: Callable[[], float] = monotonic_s,
    ) -> None:
        self._pinned = pinned
        self._clock_s = clock_s
        self._heard_s = clock_s()
        self.name: str | None = None
        """Source name of the station in command; None before the first command."""
        self.refused = 0
        self._flight_over = False

    def heard(self, source: str, silent_s: float) -> None:
        """Note that the station `source` was last received `silent_s` ago [s]."""
        if source == self.name:
            self._heard_s = max(self._heard_s, self._clock_s() - silent_s)

    def refusal(self, command: Command) -> str | None:
        """Return the reason why a command must be refused; None if it is allowed."""
        permitted_sender = COMMANDS[command.name].permitted_sender
        if (
            not self._pinned
            or permitted_sender is PermittedSender.ANYBODY
            or _is_own(command.source)
        ):
            return None
        self.heard(command.source, 0.0)
        if self.name in (None, command.source) or command.sealed:
            return None
        if self._flight_over and permitted_sender is PermittedSender.COMMANDER:
            return None
        left_s = SILENCE_S - (self._clock_s() - self._heard_s)
        if left_s <= 0.0:
            return None
        self.refused += 1
        return (
            f"{self.name} is in command. Send an authenticated command, or wait "
            f"until it has been silent for {SILENCE_S:.0f} s"
        )

    def flight_ended(self) -> None:
        """After a flight, allow any station to take command by uploading tags."""
        self._flight_over = True

    def accepted(self, command: Command) -> bool:
        """Note an accepted command; True if its sender has now taken command."""
        if COMMANDS[command.name].permitted_sender is PermittedSender.ANYBODY or _is_own(
            command.source
        ):
            return False
        changed = self.name != command.source
        self._flight_over = self._flight_over and not changed and command.name != "start_tags"
        self.name, self._heard_s = command.source, self._clock_s()
        return changed


def _is_own(source: str) -> bool:
    """True for a command from the drone itself, such as ``command line 4711`` (process id)."""
    return source.startswith(OWN_SOURCES)
