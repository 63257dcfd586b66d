"""Decide which station may command: the first one, until it is silent for a minute.

Telemetry radios are open to everybody. The first commanding station is in command from its tag
upload to the flight's end. Others take over only with a sealed command, which proves the
drone's key, or after `SILENCE_S`. Senders choose their own names, so this prevents mistakes,
not an attack (docs/how-to/lock-the-link.md).
"""

from collections.abc import Callable

from uavrt.core.clock import monotonic_s
from uavrt.core.commands import COMMANDS, PermittedSender
from uavrt.core.messages import Command

SILENCE_S = 60.0
"""Silence of the commanding station after which another station may command [s]; longer than a
restart takes."""
OWN_SOURCES = ("capture", "command line")
"""Command sources on the drone itself: the supervisor and the program that started it."""


class CommandingStation:
    """Stores which station commands the drone; unless `pinned`, every station may command."""

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
        """Record that a station was last received `silent_s` ago [s]."""
        if source == self.name:
            self._heard_s = max(self._heard_s, self._clock_s() - silent_s)

    def refusal(self, command: Command) -> str | None:
        """Text that explains why a command is refused; None if it is allowed."""
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
            f"{self.name} is in command. Send a sealed command, or wait until it "
            f"has been silent for {SILENCE_S:.0f} s"
        )

    def flight_ended(self) -> None:
        """Allow any station to take command with its next upload of tags."""
        self._flight_over = True

    def accepted(self, command: Command) -> bool:
        """Register an accepted command; True if its sender is now in command."""
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
